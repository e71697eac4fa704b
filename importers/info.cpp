#include "importers/info.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <nlohmann/json.hpp>
#include <optional>

#include "geometry/base/error.h"
#include "geometry/mesh/measure.h"
#include "geometry/mesh/self_intersections.h"
#include "geometry/mesh/validate.h"
#include "geometry/motion/walk.h"
#include "importers/clips/read_bvh.h"
#include "importers/clips/read_points.h"
#include "importers/input_file.h"
#include "importers/mesh/import_mesh.h"
#include "importers/scene/scene_file.h"
#include "importers/terrain/depressions.h"
#include "importers/terrain/ground_place.h"
#include "importers/terrain/import_dem.h"
#include "importers/terrain/import_terrain.h"
#include "importers/terrain/spatial_reference.h"

namespace effuse::importers {

namespace fs = std::filesystem;

namespace {

using Lines = std::vector<std::string>;

void add_notes(Lines& lines, const Lines& notes) {
  for (const std::string& note : notes) lines.push_back("note: " + note);
}

/// "x 751420, y 1157910 (-84.703, 10.4635 in degrees)"
std::string where(const GroundPlace& place) {
  std::string text = fmt::format("x {:.10g}, y {:.10g}", std::round(place.map.x() * 10) / 10, std::round(place.map.y() * 10) / 10);
  if (place.degrees.allFinite()) text += fmt::format(" ({:.7g}, {:.7g} in degrees)", place.degrees.x(), place.degrees.y());
  return text;
}

nlohmann::ordered_json values_of(const GroundPlace& place) {
  using json = nlohmann::ordered_json;
  return {{"map", {place.map.x(), place.map.y()}},
          {"degrees", place.degrees.allFinite() ? json({place.degrees.x(), place.degrees.y()}) : json()},
          {"height_m", place.height},
          {"slope_deg", place.slope * 180 / kPi},
          {"downhill_deg", place.downhill * 180 / kPi}};
}

FileFacts describe_grid(const fs::path& file, const ReadLimits& limits, const std::optional<Vec2>& at) {
  using json = nlohmann::ordered_json;
  DemOptions options;
  options.limits = limits;
  DemGrid grid = import_dem({file}, options);
  const std::string format = grid.format;
  const TerrainImport import = terrain_from_grid(std::move(grid), file.string());
  const geometry::HeightField& field = *import.terrain.height_field();
  const geometry::Georeference& georeference = import.terrain.georeference();
  const Vec2 size(field.spacing().x() * (field.nx() - 1), field.spacing().y() * (field.ny() - 1)), corner = georeference.origin.head<2>() + field.corner();
  Real low = INFINITY, high = -INFINITY;
  std::size_t holes = 0;
  for (Real z : field.posts()) {
    holes += std::isnan(z);
    low = std::fmin(low, z);
    high = std::fmax(high, z);
  }
  const Crs crs = read_crs(georeference.crs, file.string());
  const Real share = static_cast<Real>(holes) / static_cast<Real>(field.posts().size());

  FileFacts facts;
  Lines& lines = facts.lines;
  lines.push_back(fmt::format("terrain grid: {} x {} posts, {:.6g} x {:.6g} m apart: {:.6g} x {:.6g} m", field.nx(), field.ny(),
                              field.spacing().x(), field.spacing().y(), size.x(), size.y()));
  lines.push_back("format: " + format);
  lines.push_back(fmt::format("covers: x {:.10g} to {:.10g}, y {:.10g} to {:.10g}", corner.x(), corner.x() + size.x(), corner.y(), corner.y() + size.y()));
  const GroundPlace top = highest_place(field, georeference);
  lines.push_back(fmt::format("heights: {:.6g} to {:.6g} m, highest at {}", low, high, where(top)));
  lines.push_back(holes == 0 ? std::string("holes: none") : fmt::format("holes: {} posts without data ({:.1f} %)", holes, 100 * share));
  lines.push_back("coordinate system: " + to_string(crs));
  lines.push_back(
      fmt::format("local origin: {:.0f}, {:.0f}, {:.0f}", georeference.origin.x(), georeference.origin.y(), georeference.origin.z()));

  std::optional<GroundPlace> place;
  if (at) {
    try {
      place = ground_place(field, georeference, *at);
    } catch (const InputError& error) {
      throw InputError(Place{file.string()}, error.faults().front().message);
    }
    lines.push_back(fmt::format("at {}: height {:.6g} m, slope {:.0f} deg, downhill is {:.0f} deg counter-clockwise from east", where(*place), place->height, place->slope * 180 / kPi, place->downhill * 180 / kPi));
  }

  json deepest = json::array();
  const std::vector<Depression> depressions = closed_depressions(field);
  if (depressions.empty()) {
    lines.push_back("closed depressions: none");
  } else {
    Real volume = 0;
    for (const Depression& d : depressions) volume += d.volume;
    lines.push_back(fmt::format("closed depressions: {}, {:.4g} m3", depressions.size(), volume));
    for (std::size_t d = 0; d < std::min<std::size_t>(3, depressions.size()); ++d) {
      const Depression& found = depressions[d];
      const Vec2 lowest = georeference.origin.head<2>() + found.lowest;
      lines.push_back(fmt::format("  {:.6g} m deep, floor {:.6g} m, spills at {:.6g} m, lowest at x {:.10g}, y {:.10g}; {} posts, {:.3g} m3", found.depth(), found.floor, found.spill, lowest.x(), lowest.y(), found.posts,
                                  found.volume));
      deepest.push_back({{"depth_m", found.depth()}, {"floor_m", found.floor}, {"spill_m", found.spill}, {"lowest_local", {found.lowest.x(), found.lowest.y()}}, {"lowest_map", {lowest.x(), lowest.y()}}, {"posts", found.posts}, {"volume_m3", found.volume}});
    }
  }
  add_notes(lines, import.notes);
  json values;
  values["kind"] = "terrain grid";
  values["format"] = format;
  values["posts"] = {field.nx(), field.ny()};
  values["spacing_m"] = {field.spacing().x(), field.spacing().y()};
  values["covers"] = {{"west", corner.x()}, {"south", corner.y()}, {"east", corner.x() + size.x()}, {"north", corner.y() + size.y()}};
  values["heights_m"] = {low, high};
  values["highest"] = values_of(top);
  if (place) values["at"] = values_of(*place);
  values["holes"] = holes;
  values["hole_share"] = share;
  values["crs"] = {{"title", to_string(crs)}, {"epsg", crs.epsg > 0 ? json(crs.epsg) : json()}, {"wkt", crs.wkt}};
  values["origin"] = {georeference.origin.x(), georeference.origin.y(), georeference.origin.z()};
  values["closed_depressions"] = depressions.size();
  values["deepest"] = deepest;
  values["notes"] = import.notes;
  facts.values = values.dump(-1, ' ', false, json::error_handler_t::replace);
  return facts;
}

FileFacts describe_mesh(const fs::path& file, const ReadLimits& limits) {
  using json = nlohmann::ordered_json;
  MeshOptions options;
  options.limits = limits;
  const MeshImport import = import_mesh(file, options);
  const geometry::TriMesh& mesh = import.mesh;
  const geometry::MeshReport report = geometry::validate(mesh);
  const Box3 box = geometry::bounds(mesh);
  const MeshFrame& frame = import.frame;
  FileFacts facts;
  Lines& lines = facts.lines;
  lines.push_back("mesh: " + to_string(report));
  lines.push_back("format: " + lower_extension(file).substr(1));
  std::optional<std::size_t> crossings;
  if (report.triangles <= kMostTested) crossings = geometry::self_intersections(mesh, kMostCrossings).size();
  const bool more = crossings == kMostCrossings;
  lines.push_back(!crossings ? fmt::format("self-intersections: not looked for, in more than {} triangles", kMostTested)
                             : *crossings == 0 ? std::string("self-intersections: none") : fmt::format("self-intersections: {}{} pairs of triangles", *crossings, more ? " or more" : ""));
  lines.push_back(fmt::format("box: {:.10g} .. {:.10g}, {:.10g} .. {:.10g}, {:.10g} .. {:.10g} m", box.min().x(), box.max().x(), box.min().y(),
                              box.max().y(), box.min().z(), box.max().z()));
  const Real area = geometry::surface_area(mesh);
  lines.push_back(fmt::format("size: {:.6g} x {:.6g} x {:.6g} m, area {:.6g} m2{}", box.sizes().x(), box.sizes().y(), box.sizes().z(), area,
                              report.solid() ? fmt::format(", volume {:.6g} m3", geometry::signed_volume(mesh)) : ""));
  // Up and unit: what the file says, or what its shape suggests.
  const UpAxis guess = guess_up(mesh);
  const bool says_up = frame.up != UpAxis::kUnknown, says_unit = frame.metres_per_unit > 0;
  std::string up = says_up ? fmt::format("{}, by {}", name_of(frame.up), frame.source) : guess == UpAxis::kUnknown ? std::string("the file does not say; z is assumed") : fmt::format("the file does not say; it looks along {}{}", name_of(guess), guess == UpAxis::kZ ? "" : ", though z is assumed (--up)");
  lines.push_back("up axis: " + up);
  lines.push_back(says_unit ? fmt::format("unit: {:g} m, by {}", frame.metres_per_unit, frame.source) : std::string("unit: the file does not say; metres are assumed"));
  if (frame.origin != Vec3::Zero() || !frame.crs.empty()) lines.push_back(fmt::format("origin on the map: {:.10g}, {:.10g}, {:.10g}", frame.origin.x(), frame.origin.y(), frame.origin.z()));
  std::string attributes = mesh.normals.empty() ? "" : "normals";
  json names = json::array();
  for (const auto& [name, attribute] : mesh.attributes) {
    names.push_back(printable(name, 40));
    attributes += fmt::format("{}{}{}", attributes.empty() ? "" : ", ", printable(name, 40), attribute.width > 1 ? fmt::format(" ({})", attribute.width) : "");
  }
  lines.push_back("attributes: " + (attributes.empty() ? std::string("none") : attributes));
  add_notes(lines, import.notes);

  const auto list = [](const Vec3& v) { return json::array({v.x(), v.y(), v.z()}); };
  json values;
  values["kind"] = "mesh";
  values["format"] = lower_extension(file).substr(1);
  values["vertices"] = report.vertices;
  values["triangles"] = report.triangles;
  values["components"] = report.components;
  values["closed"] = report.closed();
  values["manifold"] = report.manifold();
  values["oriented"] = report.oriented();
  values["border_edges"] = report.boundary_edges;
  values["non_manifold_edges"] = report.non_manifold_edges;
  values["non_manifold_vertices"] = report.non_manifold_vertices;
  values["misoriented_edges"] = report.misoriented_edges;
  values["degenerate_triangles"] = report.zero_area + report.repeated_indices;
  values["self_intersections"] = crossings ? json(*crossings) : json();
  values["self_intersections_or_more"] = more;
  values["low"] = list(box.min());
  values["high"] = list(box.max());
  values["area_m2"] = area;
  values["volume_m3"] = report.solid() ? json(geometry::signed_volume(mesh)) : json();
  values["up"] = says_up ? json(name_of(frame.up)) : json();
  values["up_guess"] = guess == UpAxis::kUnknown ? json() : json(name_of(guess));
  values["metres_per_unit"] = says_unit ? json(frame.metres_per_unit) : json();
  values["origin"] = list(frame.origin);
  values["crs"] = frame.crs;
  values["normals"] = !mesh.normals.empty();
  values["attributes"] = names;
  values["notes"] = import.notes;
  facts.values = values.dump(-1, ' ', false, json::error_handler_t::replace);
  return facts;
}

Lines describe_scene(const fs::path& file) {
  const flow::Node scene = read_scene_file(file);
  Lines lines;
  std::string name, effects, tables;
  for (const char* key : {"name", "title"})
    if (const flow::Node* node = scene.find(key); node && node->kind == flow::Node::Kind::kText && name.empty()) name = node->text;
  if (const flow::Node* node = scene.find("effects"))
    for (const flow::Node& item : node->items)
      if (item.kind == flow::Node::Kind::kText) effects += (effects.empty() ? "" : ", ") + item.text;
  for (const auto& [key, node] : scene.entries)
    if (node.kind == flow::Node::Kind::kTable ||
        (node.kind == flow::Node::Kind::kArray && !node.items.empty() && node.items.front().kind == flow::Node::Kind::kTable))
      tables += (tables.empty() ? "" : ", ") + key;
  // Tables that stand for several things say so by copies.
  std::string things;
  for (const auto& [key, one, many] : {std::array{"obstacle", "obstacle", "obstacles"}, {"body", "body", "bodies"}, {"joint", "joint", "joints"}}) {
    const flow::Node* list = scene.find(key);
    if (!list || list->kind != flow::Node::Kind::kArray) continue;
    std::int64_t count = 0;
    for (const flow::Node& item : list->items) {
      const flow::Node* copies = item.find("copies");
      count += copies && copies->kind == flow::Node::Kind::kInteger && copies->integer > 0 ? std::min<std::int64_t>(copies->integer, 1000000) : 1;
    }
    if (count > 0) things += fmt::format("{}{} {}", things.empty() ? "" : ", ", count, count == 1 ? one : many);
  }
  lines.push_back("scene: " + (name.empty() ? file.stem().string() : name));
  if (!effects.empty()) lines.push_back("effects: " + effects);
  if (!things.empty()) lines.push_back("solid: " + things);
  lines.push_back("tables: " + (tables.empty() ? std::string("none") : tables));
  return lines;
}

Lines describe_skeleton(const fs::path& file) {
  const geometry::SkeletonClip clip = read_bvh(file, 1);
  Real travelled = 0;
  for (std::size_t f = 1; f < clip.frames.size(); ++f) travelled += (clip.frames[f].root - clip.frames[f - 1].root).head<2>().norm();
  Box3 box;
  for (const geometry::RigidPose& joint : geometry::forward_kinematics(clip.joints, clip.frames.front())) box.extend(joint.position);
  std::string names;
  for (const geometry::ClipJoint& joint : clip.joints) names += (names.empty() ? "" : ", ") + printable(joint.name, 40);
  return {fmt::format("motion capture: {} joints, {} frames of {:.6g} s, {:.6g} s", clip.joints.size(), clip.frames.size(), clip.frame_time, clip.length()),
          fmt::format("in the file's own unit: {:.4g} tall in its first frame, goes {:.4g} along the ground", box.sizes().z(), travelled),
          fmt::format("legs: {}", geometry::find_legs(clip.joints).size()), "joints: " + names};
}

Lines describe_points(const fs::path& file) {
  const geometry::PointClip clip = read_points(file);
  std::size_t missing = 0;
  std::string names;
  for (const auto& frame : clip.frames) missing += static_cast<std::size_t>(std::count_if(frame.begin(), frame.end(), [](const Vec3& p) { return !p.allFinite(); }));
  for (const std::string& name : clip.names) names += (names.empty() ? "" : ", ") + printable(name, 40);
  return {fmt::format("markers: {} points, {} frames of {:.6g} s, {:.6g} s", clip.names.size(), clip.frames.size(), clip.frame_time, clip.length()),
          fmt::format("not seen: {} of {} places", missing, clip.names.size() * clip.frames.size()), "points: " + names};
}

}  // namespace

FileFacts file_facts(const fs::path& file, const ReadLimits& limits, const std::optional<Vec2>& at) {
  const std::string extension = lower_extension(file);
  const bool other = extension == ".toml" || extension == ".bvh" || extension == ".trc" || extension == ".tsv";
  if (!other && is_dem(file)) return describe_grid(file, limits, at);
  if (at) throw InputError(Place{file.string()}, "is no terrain grid: of those alone a place can be asked (effuse import makes one of a mesh: --cell 5m)");
  if (extension == ".toml") return {describe_scene(file), ""};
  if (extension == ".bvh") return {describe_skeleton(file), ""};
  if (extension == ".trc" || extension == ".tsv") return {describe_points(file), ""};
  return describe_mesh(file, limits);
}

std::vector<std::string> describe_file(const fs::path& file) { return file_facts(file).lines; }

}  // namespace effuse::importers
