#include "skin/write/write_flipbook.h"

#include <fmt/format.h>

#include <algorithm>
#include <limits>
#include <map>
#include <vector>

#include "geometry/base/check.h"
#include "geometry/base/error.h"
#include "geometry/base/files.h"
#include "geometry/base/zones.h"
#include "skin/write/glb_builder_internal.h"
#include "skin/write/mesh_arrays.h"

namespace effuse::skin {

using geometry::TriMesh;
using geometry::VertexAttribute;

struct Flipbook::Impl {
  struct Page {
    int node = -1;  // none: empty
    Real time = 0;
  };
  std::string name;
  GlbBuilder glb;
  Json nodes = Json::array(), meshes = Json::array();
  std::map<std::string, std::vector<Page>> pages;
  // Glow of all meshes, one after the other: it becomes one ramp in the end.
  VertexAttribute glow{3, {}};
  std::vector<std::size_t> glowing;  // meshes with it, and where theirs begins
  std::vector<std::size_t> glow_begin;

  int add(const std::string& title, const TriMesh& mesh) {
    require_well_formed(title, mesh);
    const VertexAttribute* shines = nullptr;
    Json attributes = add_vertices(glb, title, mesh, &shines);
    if (shines) {
      glowing.push_back(meshes.size());
      glow_begin.push_back(glow.values.size() / 3);
      glow.values.insert(glow.values.end(), shines->values.begin(), shines->values.end());
    }
    const int material = shines ? 2 : find_color(mesh) ? 1 : 0;
    meshes.push_back({{"name", title}, {"primitives", Json::array({{{"attributes", std::move(attributes)}, {"indices", add_triangles(glb, mesh)}, {"material", material}}})}});
    nodes.push_back({{"name", title}, {"mesh", meshes.size() - 1}});
    return static_cast<int>(nodes.size()) - 1;
  }

  /// TEXCOORD_0 of all that glows, and its material.
  Json glowing_material() {
    Json material{{"name", name}, {"pbrMetallicRoughness", {{"metallicFactor", 0}, {"roughnessFactor", 0.85}}}};
    const EmissionRamp ramp = make_emission_ramp(glow);
    if (!(ramp.strength > 0)) return material;
    for (std::size_t k = 0; k < glowing.size(); ++k) {
      const std::size_t end = k + 1 < glowing.size() ? glow_begin[k + 1] : ramp.coordinate.size();
      const std::vector<float> part(ramp.coordinate.begin() + static_cast<std::ptrdiff_t>(glow_begin[k]), ramp.coordinate.begin() + static_cast<std::ptrdiff_t>(end));
      meshes[glowing[k]]["primitives"][0]["attributes"]["TEXCOORD_0"] = add_ramp_coordinates(glb, part);
    }
    add_ramp(glb, ramp, material);
    return material;
  }

  /// Node by node: 0 before its page, 1 while it is shown, 0 after.
  Json animation(Real end) {
    Json channels = Json::array(), samplers = Json::array();
    for (const auto& [title, book] : pages) {
      for (std::size_t k = 0; k < book.size(); ++k) {
        if (book[k].node < 0) continue;
        std::vector<float> times, scales;
        const auto key = [&](Real time, float scale) {
          times.push_back(static_cast<float>(time));
          scales.insert(scales.end(), 3, scale);
        };
        if (book[k].time > 0) key(0, 0);
        key(book[k].time, 1);
        const bool last = k + 1 == book.size();
        if (!last) key(book[k + 1].time, 0);
        else if (end > book[k].time) key(end, 1);  // so that the film lasts as long as its last frame
        const auto input = glb.add_accessor(bytes_of(times), 0, kFloat, times.size(), "SCALAR", {{"min", {times.front()}}, {"max", {times.back()}}});
        channels.push_back({{"sampler", samplers.size()}, {"target", {{"node", book[k].node}, {"path", "scale"}}}});
        samplers.push_back({{"input", input}, {"output", glb.add_accessor(bytes_of(scales), 0, kFloat, times.size(), "VEC3")}, {"interpolation", "STEP"}});
        if (!last) nodes[static_cast<std::size_t>(book[k].node)]["scale"] = {0, 0, 0};
      }
    }
    return {{"name", "film"}, {"channels", channels}, {"samplers", samplers}};
  }
};

Flipbook::Flipbook(std::string name) : impl_(std::make_unique<Impl>()) { impl_->name = std::move(name); }
Flipbook::~Flipbook() = default;

std::uint64_t Flipbook::bytes() const { return impl_->glb.bytes(); }

void Flipbook::add_still(const std::string& name, const TriMesh& mesh) {
  if (!mesh.triangles.empty()) impl_->add(name, mesh);
}

void Flipbook::add_frame(const std::string& name, Real time, const TriMesh& mesh) {
  ZONE("write.flipbook");
  std::vector<Impl::Page>& book = impl_->pages[name];
  CHECK_GE(time, 0);
  if (!book.empty()) CHECK_GT(time, book.back().time);
  const std::string title = fmt::format("{}.{:04}", name, book.size() + 1);
  book.push_back({mesh.triangles.empty() ? -1 : impl_->add(title, mesh), time});
  // Glow's coordinates are still to come.
  if (bytes() + 8 * impl_->glow.values.size() / 3 > std::numeric_limits<std::uint32_t>::max() - (1u << 24))
    throw InputError({title}, "does not fit: with it the file would be longer than the 4 GB of a GLB; fewer frames (--frames A-B), or larger edges of the skin would do");
}

void Flipbook::finish(const std::filesystem::path& file, Real end, const Metadata& metadata) {
  ZONE("write.flipbook");
  Impl& all = *impl_;
  GlbBuilder& glb = all.glb;
  glb.json["asset"] = {{"version", "2.0"}, {"generator", "effuse"}};
  for (const auto& [key, value] : metadata) glb.json["asset"]["extras"][key] = value;
  glb.json["scene"] = 0;
  glb.json["scenes"] = Json::array({{{"name", all.name}}});
  if (!all.nodes.empty()) {
    Json material = all.glowing_material(), film = all.animation(end);
    Json roots = Json::array();
    for (std::size_t k = 0; k < all.nodes.size(); ++k) roots.push_back(k);
    glb.json["scenes"][0]["nodes"] = roots;
    glb.json["nodes"] = std::move(all.nodes);
    glb.json["meshes"] = std::move(all.meshes);
    glb.json["materials"] = Json::array({{{"name", "ground"}, {"pbrMetallicRoughness", {{"baseColorFactor", {0.3, 0.28, 0.26, 1}}, {"metallicFactor", 0}, {"roughnessFactor", 0.85}}}},
                                          {{"name", "coloured"}, {"pbrMetallicRoughness", {{"metallicFactor", 0}, {"roughnessFactor", 0.85}}}}, material});
    if (!film["channels"].empty()) glb.json["animations"] = Json::array({film});
  }
  write_file(file, glb.file(file));
}

}  // namespace effuse::skin
