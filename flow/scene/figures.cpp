#include "flow/scene/figures.h"

#include <fmt/format.h>

#include <filesystem>

#include "geometry/motion/walk.h"

namespace effuse::flow {

using geometry::RigidPose;

std::vector<PlannedFigure> read_figures(Parameters& root) {
  std::vector<PlannedFigure> plans;
  for (Parameters& p : root.tables("figure", "somebody who walks: a motion capture clip along a path, an obstacle that moves")) {
    PlannedFigure plan;
    plan.place = p.place("");
    plan.file = p.text("file", std::nullopt, "clip of somebody walking (.bvh), relative to the scene file");
    plan.file_place = p.place("file");
    plan.name = p.text("name", std::filesystem::path(plan.file).stem().string(), "for people and files");
    plan.scale = p.number("scale", "m", plan.scale, Parameters::positive(), "that one of the clip's numbers means: 0.01 if they are centimetres");
    for (const std::vector<Real>& at : p.number_lists("path", "m", 2, true, "[x, y] in the terrain's map coordinates: a smooth way goes through all; at its end it stands")) plan.path.push_back(Vec2(at[0], at[1]));
    if (plan.path.size() < 2 && p.has("path")) p.fault("path", fmt::format("has {} points, wanted at least two", plan.path.size()));
    plan.start = p.number("start", "s", plan.start, {}, "when it sets out; before, it stands in its first pose");
    plan.pace = p.number("pace", "", plan.pace, {0.05, 20}, "times the clip's own");
    if (const std::vector<Real> rgb = p.numbers("color", "", 3, false, "red, green and blue, 0 to 1 (sRGB)"); rgb.size() == 3) {
      plan.color = Vec3(rgb[0], rgb[1], rgb[2]);
      if (plan.color.minCoeff() < 0 || plan.color.maxCoeff() > 1) p.fault("color", "has a number that is not from 0 to 1");
    }
    plans.push_back(std::move(plan));
  }
  return plans;
}

void place_figure(const PlannedFigure& plan, const geometry::SkeletonClip& clip, const geometry::Terrain& terrain, Real duration, std::vector<PlacedObstacle>& placed,
                  std::vector<Fault>& faults, std::vector<std::string>& notes) {
  const Vec2 origin = terrain.georeference().origin.head<2>();
  geometry::WalkOptions options;
  options.start = plan.start;
  options.duration = duration;
  options.pace = plan.pace;
  for (const Vec2& at : plan.path) {
    options.path.push_back(at - origin);
    if (terrain.height(at.x() - origin.x(), at.y() - origin.y())) continue;
    faults.push_back({plan.place, fmt::format("figure '{}': there is no ground at {:.10g}, {:.10g}", plan.name, at.x(), at.y())});
    return;
  }
  try {
    bool off = false;
    const auto height = [&](const Vec2& p) {
      const std::optional<Real> z = terrain.height(p.x(), p.y());
      off |= !z;
      return z.value_or(0);
    };
    const geometry::Walk walk = geometry::walk_along(clip, height, options);
    if (off) throw InputError(Place{}, "walks over the terrain's edge or a hole; a path farther in would do");
    std::vector<std::size_t> samples;
    for (std::size_t i = 0; i < walk.poses.size(); ++i) samples.push_back(i);
    for (const geometry::Bone& bone : geometry::body_of(clip.joints, clip.frames.front())) {
      std::vector<geometry::PoseKey> keys;
      for (const std::size_t i : samples) keys.push_back({static_cast<Real>(i) * walk.step, walk.poses[i][bone.joint]});
      placed.push_back({fmt::format("{}.{}", plan.name, bone.name), geometry::CollisionMesh(bone.mesh), geometry::PoseTrack(std::move(keys), geometry::KeyMotion::kLinear), 0, 1, plan.color});
    }
    notes.push_back(fmt::format("figure '{}': walks {:.1f} m in {} steps, feet slide by {:.1g} m at most", plan.name, walk.travelled, walk.plants.size(), walk.slide));
  } catch (const InputError& error) {
    for (const Fault& fault : error.faults()) faults.push_back({plan.place, fmt::format("figure '{}': {}", plan.name, fault.message)});
  }
}

}  // namespace effuse::flow
