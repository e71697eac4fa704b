#include "samples/effuse/frame_writer.h"

#include <fmt/format.h>

#include <algorithm>
#include <nlohmann/json.hpp>

#include "geometry/base/files.h"
#include "geometry/base/log.h"
#include "geometry/base/zones.h"
#include "geometry/procedural/primitives.h"
#include "skin/color/lava_color.h"
#include "skin/preview/preview.h"
#include "skin/surface/level_set.h"
#include "samples/effuse/air_look.h"
#include "samples/effuse/flipbook_export.h"
#include "samples/effuse/solid_things.h"
#include "samples/effuse/views.h"
#include "skin/tessellate/make_skin.h"
#include "skin/write/write_points.h"
#include "skin/write/write_volume.h"

namespace effuse {

namespace fs = std::filesystem;

namespace {
std::string numbered(const char* stem, int frame, const char* extension) { return fmt::format("{}.{:04}.{}", stem, frame, extension); }
}  // namespace

FrameWriter::FrameWriter(const flow::Scene& scene, const skin::SkinSettings& settings, const geometry::Terrain& terrain,
                         const SolidThings& solids, fs::path folder)
    : scene_(scene), settings_(settings), terrain_(terrain), solids_(solids), folder_(std::move(folder)), film_({scene.fps, scene.time_scale}, {settings.vtp, settings.usda}, folder_) {
  for (const flow::EffectPlan& plan : scene.effects) lava_ |= plan.name == "lava";
  if (settings.preview) preview_ = std::make_unique<skin::Preview>(terrain.mesh());
}
FrameWriter::~FrameWriter() = default;

skin::Metadata FrameWriter::metadata(int frame, Real time) const {
  const geometry::Georeference& geo = terrain_.georeference();
  return {{"generator", "effuse"},
          {"scene", scene_.name},
          {"frame", std::to_string(frame)},
          {"time_s", fmt::format("{}", time)},
          {"origin", fmt::format("{:.17g} {:.17g} {:.17g}", geo.origin.x(), geo.origin.y(), geo.origin.z())},
          {"crs", geo.crs},
          {"units", "metres, seconds, kelvin"}};
}

void FrameWriter::write_terrain() {
  ZONE("write.terrain");
  skin::write_ply(folder_ / "terrain.ply", terrain_.mesh(), metadata(0, 0));
  skin::write_glb(folder_ / "terrain.glb", terrain_.mesh(), metadata(0, 0));
  film_.add_still("terrain", terrain_.mesh(), metadata(0, 0));
  if (!solids_.any()) return;
  const geometry::TriMesh solids = solids_.at(scene_.frame_time(1));
  skin::write_ply(folder_ / "obstacles.ply", solids, metadata(0, 0));
  skin::write_glb(folder_ / "obstacles.glb", solids, metadata(0, 0));
  if (!solids_.any_moves()) film_.add_still("obstacles", solids, metadata(0, 0));
}

FrameWriter::Result FrameWriter::write_frame(const flow::Simulation& simulation) {
  const int frame = simulation.frame();
  const skin::Metadata about = metadata(frame, simulation.time());
  Result result;
  const bool exports = settings_.vtp || settings_.usda;
  if (!settings_.ply && !settings_.obj && !settings_.glb && !settings_.vdb && !settings_.bgeo && !exports && !preview_) return result;  // nobody asked for frames
  skin::Skin skin;
  for (const auto& effect : simulation.effects()) {
    if (effect->spacing() <= 0) continue;
    const geometry::Points points = effect->points();
    skin::SkinOptions options = skin::skin_at(settings_, terrain_, frame / scene_.fps, effect->spacing());
    options.detail->seed = scene_.seed;
    options.detail->rest_ratio = points.rest_ratio;
    skin = skin::make_skin(points, effect->volume(), &terrain_, options, &last_);
    skin::color_lava(skin.mesh, settings_.color);
    result.volume = skin.report.volume.after > 0 ? skin.report.volume.after : skin.report.level_set.volume;
    if (preview_) warn_of_lava_on(skin::picture_at(settings_, terrain_, frame / scene_.fps).camera.eye, points, effect->spacing(), frame);
    result.particle_volume = effect->volume();
    if (settings_.bgeo) write_film_bgeo(folder_ / "frames" / numbered("lava", frame, "bgeo"), points, scene_.time_scale);
  }
  const geometry::TriMesh& mesh = skin.mesh;
  result.regions = skin.regions.size();
  result.shapes = skin.report.shapes;
  result.held_back = skin.report.displace.held_back;
  result.triangles = mesh.triangles.size();
  COUNT("skin.triangles", mesh.triangles.size());

  const fs::path frames = folder_ / "frames";
  if (lava_ && settings_.ply) skin::write_skin_ply(frames / numbered("skin", frame, "ply"), mesh, skin.regions, about);
  if (lava_ && settings_.obj) skin::write_obj(frames / numbered("skin", frame, "obj"), mesh, about);
  if (lava_ && settings_.glb) skin::write_glb(frames / numbered("skin", frame, "glb"), mesh, about);
  if (lava_) film_.add("skin", frame, mesh, about);
  if (lava_ && settings_.vdb) skin::write_vdb(frames / numbered("lava", frame, "vdb"), skin.surface, about);
  std::vector<geometry::RigidPose> poses;
  for (const auto& effect : simulation.effects())
    if (poses.empty()) poses = effect->body_poses();
  std::vector<flow::SolidPiece> pieces;
  for (const auto& effect : simulation.effects()) {
    pieces_ |= effect->makes_pieces();
    for (flow::SolidPiece& piece : effect->pieces()) pieces.push_back(std::move(piece));
  }
  const bool moving = pieces_ || solids_.any_moves();
  const geometry::TriMesh solids = solids_.at(simulation.time(), poses, pieces);
  if (own_ply() && moving) skin::write_ply(frames / numbered("obstacles", frame, "ply"), solids, about);
  if (moving) film_.add("obstacles", frame, solids, about);
  geometry::TriMesh others = solids;
  for (const auto& effect : simulation.effects())
    for (flow::NamedMesh& own : effect->meshes()) {
      if (std::find(meshes_.begin(), meshes_.end(), own.name) == meshes_.end()) meshes_.push_back(own.name);
      if (own_ply()) write_own(own, frame);
      film_.add(own.name, frame, own.mesh, about);
      if (preview_) append_to_picture(others, own.mesh);
    }
  skin::Air air;
  const Real exposure = kShutter * scene_.time_scale / scene_.fps;
  for (const auto& effect : simulation.effects()) {
    for (const flow::NamedCloud& cloud : effect->clouds()) {
      if ((cloud.points || cloud.spheres) && std::find(meshes_.begin(), meshes_.end(), cloud.name) == meshes_.end()) meshes_.push_back(cloud.name);
      if (own_ply() && (cloud.points || cloud.spheres)) {
        const fs::path file = frames / numbered(cloud.name.c_str(), frame, "ply");
        if (cloud.spheres) skin::write_ply(file, spheres_of(cloud), about);
        else skin::write_points_ply(file, cloud.view(), with_look(about, cloud));
      }
      if (exports && cloud.points) film_.add(cloud.name, frame, mesh_of_points(cloud.view()), about);
      if (settings_.bgeo && cloud.points) write_film_bgeo(frames / numbered(cloud.name.c_str(), frame, "bgeo"), cloud.view(), scene_.time_scale);
      if (preview_) add_cloud(air, cloud, exposure);
    }
    const std::optional<Vec3> color = effect->draws_volumes();
    if (!settings_.vdb && !(preview_ && color)) continue;
    for (geometry::GridVolume& volume : effect->volumes()) {
      if (std::find(volumes_.begin(), volumes_.end(), volume.name) == volumes_.end()) volumes_.push_back(volume.name);
      if (settings_.vdb) skin::write_volume_vdb(frames / numbered(volume.name.c_str(), frame, "vdb"), volume, color ? with_color(about, *color) : about);
      if (preview_ && color) add_volume(air, std::move(volume), *color);
    }
  }
  if (preview_) {
    const skin::Image image = preview_->render(in_one_picture(mesh, others), skin::picture_at(settings_, terrain_, frame / scene_.fps), air);
    skin::write_png(folder_ / "preview" / numbered("preview", frame, "png"), image);
  }
  return result;
}

void FrameWriter::write_own(const flow::NamedMesh& own, int frame) const {
  const fs::path frames = folder_ / "frames";
  const auto file = [&](int n) { return frames / numbered(own.name.c_str(), n, "ply"); };
  // What has not changed is the file of the frame that showed it first, by another name: no bytes, no time.
  int first = frame;
  while (own.since >= 0 && first > 1 && scene_.frame_time(first - 1) >= own.since) --first;
  if (first < frame && fs::exists(file(first))) {
    std::error_code error;
    fs::remove(file(frame), error);
    fs::create_hard_link(file(first), file(frame), error);
    if (!error) return;
  }
  skin::write_exact_ply(file(frame), own.mesh, metadata(first, scene_.frame_time(first)));
}

void FrameWriter::warn_of_lava_on(const Vec3& eye, const geometry::Points& points, Real spacing, int frame) {
  if (told_of_camera_ || std::none_of(points.position.begin(), points.position.end(), [&](const Vec3& x) { return (x - eye).squaredNorm() < spacing * spacing; })) return;
  told_of_camera_ = true;
  log_warning(fmt::format("preview: in frame {} the camera stands in the lava; more elevation or distance, or another azimuth would do", frame));
}

void FrameWriter::write_contact_sheet(int frames) {
  if (!preview_ || frames < 1) return;
  ZONE("preview.contact_sheet");
  const int count = std::min(frames, 12);
  std::vector<fs::path> pictures;
  std::vector<std::string> labels;
  for (int k = 0; k < count; ++k) {
    const int frame = count == 1 ? 1 : 1 + static_cast<int>((frames - 1) * static_cast<Real>(k) / (count - 1) + 0.5);
    const fs::path picture = folder_ / "preview" / numbered("preview", frame, "png");
    if (!fs::exists(picture)) continue;  // a resumed run may have made its first frames without
    pictures.push_back(picture);
    // Short films want tenths.
    labels.push_back(fmt::format("frame {}   {:.{}f} s", frame, scene_.frame_time(frame), scene_.frame_time(frames) < 3 * count ? 1 : 0));
  }
  if (!pictures.empty()) skin::write_contact_sheet(folder_ / "preview" / "contact_sheet.png", pictures, labels, 3);
}

void FrameWriter::write_collections(int frames_done) const {
  if (settings_.vtp || settings_.usda)
    film_.finish(frames_done, film_views(settings_, terrain_, frames_done, scene_.fps), static_cast<Real>(settings_.picture.width) / settings_.picture.height, metadata(0, 0));
  if (settings_.flipbook && frames_done == scene_.frames) write_film_glb(folder_);
}

void FrameWriter::write_manifest(int frames_done, const std::vector<std::pair<std::string, std::string>>& flow) const {
  using nlohmann::ordered_json;
  const geometry::Georeference& geo = terrain_.georeference();
  ordered_json m;
  m["format"] = 1;
  m["name"] = scene_.name;
  m["frames"] = frames_done;
  m["first_frame"] = 1;
  m["fps"] = scene_.fps;
  m["time_scale"] = scene_.time_scale;
  m["units"] = {{"length", "m"}, {"time", "s"}, {"temperature", "K"}, {"velocity", "m/s"}};
  m["up_axis"] = {{"ply", "z"}, {"obj", "z"}, {"vdb", "z"}, {"vtp", "z"}, {"usda", "z"}, {"bgeo", "z"}, {"glb", "y"}};
  m["origin"] = {geo.origin.x(), geo.origin.y(), geo.origin.z()};
  m["crs"] = geo.crs;
  m["color_space"] = {{"ply", "srgb"}, {"obj", "srgb"}, {"glb", "linear"}, {"usda", "linear"}, {"vtp", "color: srgb, color_linear: linear"}};
  const Box3 box = terrain_.bounds();
  m["terrain"] = {{"files", {"terrain.ply", "terrain.glb"}},
                  {"min", {box.min().x(), box.min().y(), box.min().z()}},
                  {"max", {box.max().x(), box.max().y(), box.max().z()}}};
  if (solids_.any()) m["obstacles"] = {{"files", {"obstacles.ply", "obstacles.glb"}}};
  ordered_json files = ordered_json::object();
  if (own_ply() && (pieces_ || solids_.any_moves())) files["obstacles"] = "frames/obstacles.####.ply";
  if (lava_ && settings_.ply) files["ply"] = "frames/skin.####.ply";
  if (lava_ && settings_.obj) files["obj"] = "frames/skin.####.obj";
  if (lava_ && settings_.glb) files["glb"] = "frames/skin.####.glb";
  if (lava_ && settings_.vdb) files["vdb"] = "frames/lava.####.vdb";
  if (lava_ && settings_.vtp) files["vtp"] = "frames/skin.####.vtp";
  if (lava_ && settings_.usda) files["usda"] = "frames/skin.####.usda";
  if (lava_ && settings_.bgeo) files["bgeo"] = "frames/lava.####.bgeo";
  for (const std::string& name : meshes_) {
    if (own_ply()) files[name] = fmt::format("frames/{}.####.ply", name);
    if (settings_.vtp) files[name + "_vtp"] = fmt::format("frames/{}.####.vtp", name);
    if (settings_.usda) files[name + "_usda"] = fmt::format("frames/{}.####.usda", name);
  }
  for (const std::string& name : volumes_)
    if (settings_.vdb) files[name + "_vdb"] = fmt::format("frames/{}.####.vdb", name);
  if (settings_.preview) files["preview"] = "preview/preview.####.png";
  m["files"] = files;
  m["camera"] = {{"width", settings_.picture.width}, {"height", settings_.picture.height}, {"fov", "from bottom to top, radians"}, {"keys", ordered_json::parse(json_of(film_views(settings_, terrain_, scene_.frames, scene_.fps)))}};
  for (const auto& [name, path] : flow) m["flow"][name] = path;
  m["attributes"] = {{"temperature", "K"}, {"velocity", "m/s"}, {"crust", "0 molten .. 1 solid"}, {"region", "id of the particle whose Voronoi region it is, PLY only"}};
  if (pieces_ || solids_.any_breaks()) {
    m["attributes"]["piece"] = "number of a piece for life, from 1; 0: of what cannot break; obstacles only";
    m["attributes"]["inner"] = "1 on faces that breaking has made; obstacles only";
  }
  ordered_json times = ordered_json::array();
  for (int frame = 1; frame <= frames_done; ++frame) times.push_back(scene_.frame_time(frame));
  m["frame_times"] = times;
  write_file(folder_ / "manifest.json", m.dump(1, ' ', false, ordered_json::error_handler_t::replace) + "\n");
}

}  // namespace effuse
