#include "flow/scene/placing.h"

#include <fmt/format.h>

#include <filesystem>

#include "geometry/procedural/primitives.h"

namespace effuse::flow {

using geometry::RigidPose;

namespace {

/// Turned about x, then y, then z, as Blender's XYZ angles.
Quat turned(const std::vector<Real>& angles) {
  if (angles.size() != 3) return Quat::Identity();
  return Quat(Eigen::AngleAxisd(angles[2], Vec3::UnitZ()) * Eigen::AngleAxisd(angles[1], Vec3::UnitY()) * Eigen::AngleAxisd(angles[0], Vec3::UnitX()));
}

}  // namespace

void read_form(Parameters& p, std::string_view file_what, PlannedForm& form) {
  form.place = p.place("");
  form.file = p.text("file", "", file_what);
  const std::vector<Real> edges = p.numbers("box", "m", 3, false, "instead of a file: edges of a box about its own origin");
  form.ball = p.number("ball", "m", 0, Parameters::not_negative(), "instead of a file: radius of a ball about its own origin");
  form.scale = p.number("scale", "", form.scale, Parameters::positive(), "of the mesh's numbers: 0.01 if they are centimetres");
  form.y_up = p.choice("up", {"z", "y"}, 0, "the mesh's axis that points up") == 1;
  const bool file = !form.file.empty(), box = edges.size() == 3, ball = form.ball > 0;
  form.file_place = p.place(file ? "file" : p.has("box") ? "box" : "ball");
  if (form.file.find('\0') != std::string::npos || (p.has("file") && !file && !box && !ball)) p.fault("file", "is not the name of a file");
  else if (!file && !p.has("box") && !p.has("ball")) p.fault("file", fmt::format("is missing ({}), wanted the name of a file in quotes, or box or ball instead", file_what));
  else if (p.has("ball") && !ball && !file && !p.has("box")) p.fault("ball", "needs a radius above 0");
  if (file + box + ball > 1) p.fault(box ? "box" : "ball", fmt::format("found with {}, wanted one of file, box and ball", file ? "file" : "ball"));
  if (box) {
    form.box = Vec3(edges[0], edges[1], edges[2]);
    if (!(form.box.minCoeff() > 0)) p.fault("box", fmt::format("edges {:g}, {:g}, {:g} m, must all be longer than 0", edges[0], edges[1], edges[2]));
  }
  if (!file && (form.scale != 1 || form.y_up) && (box || ball)) p.fault(form.scale != 1 ? "scale" : "up", "is of a file's mesh; a box and a ball are in metres");
  form.name = p.text("name", box ? "box" : ball ? "ball" : std::filesystem::path(form.file).stem().string(), "for people, files and joints");
  if (p.has("name") && (form.name.empty() || form.name == "world")) p.fault("name", fmt::format("'{}' is no name for a thing: {}", form.name, form.name.empty() ? "it is empty" : "it is that of what stands still"));
  if (const std::vector<Real> rgb = p.numbers("color", "", 3, false, "red, green and blue, 0 to 1 (sRGB), in pictures and files"); rgb.size() == 3) {
    form.color = Vec3(rgb[0], rgb[1], rgb[2]);
    if (form.color.minCoeff() < 0 || form.color.maxCoeff() > 1) p.fault("color", "has a number that is not from 0 to 1");
  }
}

bool has_shape(const PlannedForm& form) { return !form.file.empty() || form.ball > 0 || form.box.minCoeff() > 0; }

geometry::TriMesh mesh_of(const PlannedForm& form) {
  constexpr int kSubdivisions = 3;
  return form.ball > 0 ? geometry::make_sphere(Vec3::Zero(), form.ball, kSubdivisions) : geometry::make_box(-form.box / 2, form.box / 2);
}

RigidPose read_pose(Parameters& p, bool required, const RigidPose& fallback) {
  RigidPose pose = fallback;
  const std::vector<Real> at = p.numbers("position", "m", 3, required, "x, y in the terrain's map coordinates, and z, of the mesh's own origin");
  if (at.size() == 3) pose.position = Vec3(at[0], at[1], at[2]);
  const std::vector<Real> angles = p.numbers("rotation", "rad", 3, false, "about x, then y, then z, counter-clockwise");
  if (angles.size() == 3) pose.orientation = turned(angles);
  return pose;
}

geometry::TriMesh upright(geometry::TriMesh mesh, Real scale, bool y_up) {
  for (Vec3& p : mesh.positions) {
    if (y_up) p = Vec3(p.x(), -p.z(), p.y());
    p *= scale;
  }
  return mesh;
}

bool too_large(const geometry::TriMesh& mesh, const std::string& what, const Place& place, std::vector<Fault>& faults) {
  constexpr Real kLargest = 1e5;  // [m]
  Box3 box;
  for (const Vec3& p : mesh.positions) box.extend(p);
  if (box.isEmpty() || box.min().cwiseAbs().cwiseMax(box.max().cwiseAbs()).maxCoeff() < kLargest) return false;
  faults.push_back({place, fmt::format("{}: its mesh reaches {:.3g} m from its origin, wanted less than {:g} m: is its scale right?", what, box.min().cwiseAbs().cwiseMax(box.max().cwiseAbs()).maxCoeff(), kLargest)});
  return true;
}

bool put_on_terrain(RigidPose& pose, bool on_ground, const geometry::Terrain& terrain, const std::string& what, const Place& place, std::vector<Fault>& faults) {
  constexpr Real kFarthest = 1e6;  // [m]
  const Vec3 origin = terrain.georeference().origin;
  Vec3& p = pose.position;
  if (!((p - origin).cwiseAbs().maxCoeff() < kFarthest)) {
    faults.push_back({place, fmt::format("{}: {:g}, {:g}, {:g} is more than {:g} m from the terrain's origin", what, p.x(), p.y(), p.z(), kFarthest)});
    return false;
  }
  const Vec2 map = p.head<2>();
  p.head<2>() -= origin.head<2>();
  if (!on_ground) {
    p.z() -= origin.z();
    return true;
  }
  const std::optional<Real> ground = terrain.height(p.x(), p.y());
  if (ground) {
    p.z() += *ground;
    return true;
  }
  const Vec2 low = terrain.bounds().min().head<2>() + origin.head<2>(), high = terrain.bounds().max().head<2>() + origin.head<2>();
  faults.push_back({place, fmt::format("{}: {:.12g}, {:.12g} is not on the terrain, which runs from {:.12g}, {:.12g} to {:.12g}, {:.12g}; on_ground = false counts heights as the terrain's file does", what,
                                       map.x(), map.y(), low.x(), low.y(), high.x(), high.y())});
  return false;
}

}  // namespace effuse::flow
