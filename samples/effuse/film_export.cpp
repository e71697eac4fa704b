#include "samples/effuse/film_export.h"

#include <fmt/format.h>

#include <algorithm>

#include "samples/effuse/film_folder.h"
#include "skin/write/write_points.h"
#include "skin/write/write_vtp.h"

namespace effuse {

namespace fs = std::filesystem;
using geometry::TriMesh;

namespace {
std::string numbered(const std::string& name, int frame, const char* extension) { return fmt::format("{}.{:04}.{}", name, frame, extension); }

void add_attribute(TriMesh& mesh, const char* name, std::span<const Vec3> values) {
  if (values.empty()) return;
  geometry::VertexAttribute& to = mesh.attributes[name];
  to.width = 3;
  for (const Vec3& v : values)
    for (const Real x : v) to.values.push_back(static_cast<float>(x));
}

template <class T>
void add_attribute(TriMesh& mesh, const char* name, std::span<const T> values) {
  if (values.empty()) return;
  std::vector<float>& to = mesh.attributes[name].values;
  for (const T value : values) to.push_back(static_cast<float>(value));
}
}  // namespace

void FilmExport::add_still(const std::string& name, const TriMesh& mesh, const skin::Metadata& about) {
  if (formats_.vtp) skin::write_vtp(folder_ / (name + ".vtp"), mesh, 0, about);
  if (!formats_.usda) return;
  skin::write_usda_still(folder_ / (name + ".usda"), mesh, name, about);
  stills_.push_back({name, name + ".usda"});
}

void FilmExport::add(const std::string& name, int frame, const TriMesh& mesh, const skin::Metadata& about) {
  if (formats_.vtp) skin::write_vtp(folder_ / "frames" / numbered(name, frame, "vtp"), mesh, film_.time_of(frame), about);
  if (formats_.usda) skin::write_usda_frame(folder_ / "frames" / numbered(name, frame, "usda"), mesh, name, {frame, film_.fps, film_.time_scale}, about);
  // What one frame has, all declare: before the lava comes there is nothing to go by.
  skin::UsdaSequence& thing = things_[name];
  thing.prim = name;
  thing.points |= is_particles(mesh);
  for (const skin::UsdaAttribute& attribute : skin::usda_attributes(mesh)) {
    const auto same = [&](const skin::UsdaAttribute& other) { return other.name == attribute.name; };
    if (std::none_of(thing.attributes.begin(), thing.attributes.end(), same)) thing.attributes.push_back(attribute);
  }
  // In an order that does not hang on which frame came first: a run resumed begins in the middle.
  std::sort(thing.attributes.begin(), thing.attributes.end(), [](const skin::UsdaAttribute& a, const skin::UsdaAttribute& b) { return a.name < b.name; });
}

std::vector<skin::UsdaSequence::File> FilmExport::files_of(const std::string& name, const char* extension, int frames) const {
  std::vector<skin::UsdaSequence::File> files;
  std::error_code ignored;
  for (int frame = 1; frame <= frames; ++frame)
    if (const std::string file = "frames/" + numbered(name, frame, extension); fs::exists(folder_ / file, ignored)) files.push_back({frame, file});
  return files;
}

void FilmExport::finish(int frames, const std::vector<skin::UsdaView>& views, Real aspect, const skin::Metadata& about) const {
  skin::UsdaStage stage;
  for (const auto& [name, thing] : things_) {
    if (formats_.vtp) {
      std::vector<skin::TimedFile> from_folder, from_frames;
      for (const auto& [frame, file] : files_of(name, "vtp", frames)) {
        from_folder.push_back({file, film_.time_of(frame)});
        from_frames.push_back({fs::path(file).filename().string(), film_.time_of(frame)});
      }
      skin::write_series(folder_ / "frames" / (name + ".vtp.series"), from_frames);
      skin::write_pvd(folder_ / (name + ".pvd"), from_folder);
    }
    if (!formats_.usda) continue;
    stage.sequences.push_back(thing);
    stage.sequences.back().files = files_of(name, "usda", frames);
    if (stage.sequences.back().files.empty()) stage.sequences.pop_back();
  }
  if (!formats_.usda) return;
  stage.fps = film_.fps;
  stage.last_frame = std::max(1, frames);
  stage.stills = stills_;
  stage.views = views;
  stage.aspect = aspect;
  skin::write_usda_stage(folder_ / "film.usda", stage, about);
}

TriMesh mesh_of_points(const geometry::Points& points) {
  TriMesh mesh;
  mesh.positions.assign(points.position.begin(), points.position.end());
  add_attribute(mesh, "radius", points.radius);
  add_attribute(mesh, "velocity", points.velocity);
  add_attribute(mesh, "temperature", points.temperature);
  add_attribute(mesh, "crust", points.crust);
  add_attribute(mesh, "age", points.age);
  add_attribute(mesh, "opacity", points.opacity);
  add_attribute(mesh, "id", points.id);
  add_attribute(mesh, "rest", points.rest);
  add_attribute(mesh, "rest2", points.rest2);
  return mesh;
}

void write_film_bgeo(const fs::path& file, const geometry::Points& points, Real scale) {
  std::vector<Vec3> velocity(points.velocity.begin(), points.velocity.end());
  for (Vec3& v : velocity) v *= scale;
  geometry::Points film = points;
  film.velocity = velocity;
  skin::write_points_bgeo(file, film);
}

}  // namespace effuse
