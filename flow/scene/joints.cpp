#include "flow/scene/joints.h"

#include <fmt/format.h>

#include <algorithm>
#include <charconv>
#include <cmath>
#include <map>

#include "flow/scene/placing.h"
#include "geometry/base/error.h"

namespace effuse::flow {

namespace {

using Kind = JointKind;

constexpr std::int64_t kMostCopies = 100000;

/// What a joint can name.
struct Names {
  std::map<std::string, std::vector<JointEnd>> ends;
  std::vector<std::string> all;
};

Names names_of(const std::vector<PlannedObstacle>& obstacles, const std::vector<PlannedBody>& bodies) {
  Names names;
  const auto add = [&](const std::string& name, JointEnd end) {
    std::vector<JointEnd>& ends = names.ends[name];
    if (ends.empty()) names.all.push_back(name);
    ends.push_back(end);
  };
  add("world", {});
  for (std::size_t i = 0; i < bodies.size(); ++i) add(bodies[i].name, {JointEnd::Kind::kBody, i});
  for (std::size_t i = 0; i < obstacles.size(); ++i) add(obstacles[i].name, {JointEnd::Kind::kObstacle, i});
  return names;
}

/// What `name` stands for; a fault at `key` and the world when it is nobody's or several's.
JointEnd find(Parameters& p, const std::string& key, const std::string& name, const Names& names) {
  const auto found = names.ends.find(name);
  if (found == names.ends.end()) {
    constexpr std::size_t kShown = 8;
    std::string advice = nearest_name(name, names.all);
    if (!advice.empty()) {
      advice = fmt::format("did you mean '{}'?", advice);
    } else {
      advice = "there are: ";
      for (std::size_t k = 0; k < std::min(kShown, names.all.size()); ++k) advice += (k == 0 ? "" : ", ") + names.all[k];
      if (names.all.size() > kShown) advice += fmt::format(" and {} more", names.all.size() - kShown);
    }
    p.fault(key, fmt::format("no body or obstacle is called '{}'; {}", name, advice));
    return {};
  }
  if (found->second.size() > 1) p.fault(key, fmt::format("{} things are called '{}': give each a name of its own", found->second.size(), name));
  return found->second.front();
}

/// "link.3" k further: "link.7"; a name without a number stays.
std::string counted_on(const std::string& name, std::int64_t k) {
  const std::size_t dot = name.rfind('.');
  std::int64_t number = 0;
  if (dot == std::string::npos || dot + 1 == name.size()) return name;
  const char* end = name.data() + name.size();
  const auto [stopped, error] = std::from_chars(name.data() + dot + 1, end, number);
  if (error != std::errc{} || stopped != end || number < 0) return name;
  return fmt::format("{}.{}", name.substr(0, dot), number + k);
}

Vec3 vector(Parameters& p, const char* key, const char* unit, bool required, const Vec3& fallback, const char* what) {
  const std::vector<Real> v = p.numbers(key, unit, 3, required, what);
  return v.size() == 3 ? Vec3(v[0], v[1], v[2]) : fallback;
}

void read_limits(Parameters& p, Kind kind, JointLaw& law) {
  if (kind == Kind::kBall) {
    if (p.has("cone")) law.high = p.number("cone", "rad", std::nullopt, {0, kPi, true}, "half angle of the cone about the axis that the second stays in");
    if (p.has("limits")) p.numbers("limits", "rad", 2, false, ""), p.fault("limits", "of a ball joint are a cone about its axis: cone = \"40 deg\"");
    return;
  }
  if (kind == Kind::kFixed) {
    if (p.has("limits")) p.numbers("limits", "", 2, false, ""), p.fault("limits", "has none: nothing moves in a fixed joint");
    return;
  }
  const std::vector<Real> limits = p.numbers("limits", kind == Kind::kHinge ? "rad" : "m", 2, false, kind == Kind::kDistance ? "shortest and longest: a rope, not a rod" : "lowest and highest, from where it stands at the start");
  if (limits.size() != 2) return;
  law.low = limits[0];
  law.high = limits[1];
  const bool turns = kind == Kind::kHinge;
  const auto shown = [&](Real x) { return turns ? fmt::format("{:.6g} deg", x * 180 / kPi) : fmt::format("{:.6g} m", x); };
  if (law.low > law.high) {
    p.fault("limits", fmt::format("the lower, {}, is above the upper, {}: the other way round would do", shown(law.low), shown(law.high)));
  } else if (kind == Kind::kDistance) {
    if (law.low < 0 || !(law.high > 0)) p.fault("limits", fmt::format("are lengths of {} to {}, must be 0 or more and not both 0", shown(law.low), shown(law.high)));
  } else if (law.low > 0 || law.high < 0) {
    p.fault("limits", fmt::format("from {} to {} leave out 0, where it stands at the start", shown(law.low), shown(law.high)));
  } else if (turns && (law.low <= -kPi || law.high >= kPi)) {
    p.fault("limits", fmt::format("from {} to {}, must lie between -180 and 180 deg; none at all turns freely", shown(law.low), shown(law.high)));
  }
}

void read_drive(Parameters& p, Kind kind, JointLaw& law) {
  const bool turns = kind == Kind::kHinge, drives = turns || kind == Kind::kSlider, springs = drives || kind == Kind::kDistance;
  Parameters motor = p.table("motor", "drives the second along the axis"), spring = p.table("spring", "pulls back to where it stands at the start");
  if (p.has("motor")) {
    law.motor_speed = motor.number("speed", turns || !drives ? "rad/s" : "m/s", std::nullopt, {}, "it would reach");
    law.motor_strength = turns || !drives ? motor.number("torque", "N m", std::nullopt, Parameters::positive(), "it has at most") : motor.number("force", "N", std::nullopt, Parameters::positive(), "it has at most");
    if (!drives) p.fault("motor", fmt::format("a {} joint has none: hinges and sliders have", kJointKindNames[static_cast<std::size_t>(kind)]));
  }
  if (p.has("spring")) {
    law.stiffness = spring.number("stiffness", turns ? "N m/rad" : "N/m", kind == Kind::kDistance ? std::nullopt : std::optional<Real>(0), Parameters::not_negative(), "");
    law.damping = spring.number("damping", turns ? "N m s/rad" : "N s/m", 0, Parameters::not_negative(), "");
    if (!springs) p.fault("spring", fmt::format("a {} joint has none: hinges, sliders and distance joints have", kJointKindNames[static_cast<std::size_t>(kind)]));
    else if (kind == Kind::kDistance && law.stiffness == 0) p.fault("spring", "of a distance joint needs a stiffness above 0");
    if (drives && p.has("motor")) p.fault("spring", "found with motor, wanted one or the other");
  }
}

std::string called(const PlannedJoint& plan) { return fmt::format("{} of '{}' and '{}'", kJointKindNames[static_cast<std::size_t>(plan.kind)], plan.names[0], plan.names[1]); }

}  // namespace

std::vector<PlannedJoint> read_joints(Parameters& root, const std::vector<PlannedObstacle>& obstacles, const std::vector<PlannedBody>& bodies) {
  std::vector<PlannedJoint> plans;
  const std::vector<Parameters> tables = root.tables("joint", "holds two bodies together, or one to an obstacle or the world");
  if (tables.empty()) return plans;
  const Names names = names_of(obstacles, bodies);
  for (Parameters p : tables) {
    PlannedJoint plan;
    plan.place = p.place("");
    plan.kind = static_cast<Kind>(p.choice("kind", {kJointKindNames.begin(), kJointKindNames.end()}, 0, "ball: a point in common; hinge: and an axis; slider: moves along an axis; fixed; distance: rod, rope or spring"));
    const bool distance = plan.kind == Kind::kDistance, has_axis = plan.kind == Kind::kHinge || plan.kind == Kind::kSlider;
    const std::vector<std::string> written = p.texts("bodies", 2, "two of the scene's bodies and obstacles, or one and \"world\"");
    const std::int64_t copies = p.integer("copies", 1, 1, kMostCopies, "so many of it: names that end in .number count on");
    const std::string of = p.text("of", "", "body or obstacle whose own coordinates point and axis are in, scaled and upright; \"\": the terrain file's");
    const std::string of_b = distance ? p.text("of_b", "", "the same of point_b") : "";
    plan.point = vector(p, "point", "m", true, Vec3::Zero(), distance ? "x, y, z where it holds the first" : "x, y, z of the joint");
    if (distance) plan.point_b = vector(p, "point_b", "m", true, Vec3::Zero(), "x, y, z where it holds the second");
    if (has_axis || (plan.kind == Kind::kBall && p.has("cone"))) {
      plan.axis = vector(p, "axis", "", true, Vec3::UnitZ(), "along which it moves or about which it turns, counter-clockwise; of any length");
      if (p.has("axis") && !(plan.axis.norm() > 0)) p.fault("axis", "is 0, 0, 0: it needs a direction");
    }
    plan.on_ground = p.flag("on_ground", true, "heights of points in the terrain file's coordinates count from the ground there");
    read_limits(p, plan.kind, plan.law);
    read_drive(p, plan.kind, plan.law);
    plan.law.collide = p.flag("collide", false, "whether the two touch each other");
    if (written.size() != 2) continue;

    const bool counts = counted_on(written[0], 1) != written[0] || counted_on(written[1], 1) != written[1];
    if (copies > 1 && !counts) p.fault("copies", fmt::format("would all hold '{}' and '{}': of the names at least one must end in .number, as bodies with copies have it", written[0], written[1]));
    if (copies > 1 && (of.empty() || (distance && of_b.empty()))) p.fault("copies", fmt::format("need {}: a body whose own coordinates the point is in", of.empty() ? "of" : "of_b"));
    const std::size_t before = p.faults().size();
    for (std::int64_t k = 0; k < copies && p.faults().size() == before; ++k) {
      for (std::size_t e = 0; e < 2; ++e) {
        plan.names[e] = counted_on(written[e], k);
        plan.ends[e] = find(p, "bodies", plan.names[e], names);
      }
      if (!of.empty()) plan.of = find(p, "of", counted_on(of, k), names);
      if (!of_b.empty()) plan.of_b = find(p, "of_b", counted_on(of_b, k), names);
      if (p.faults().size() > before) break;
      const auto movable = [](const JointEnd& end) { return end.kind == JointEnd::Kind::kBody; };
      if (plan.names[0] == plan.names[1]) p.fault("bodies", fmt::format("joins '{}' to itself", plan.names[0]));
      else if (!movable(plan.ends[0]) && !movable(plan.ends[1])) p.fault("bodies", fmt::format("joins '{}' and '{}', neither of which a joint can move: one must be a [[body]]", plan.names[0], plan.names[1]));
      plans.push_back(plan);
    }
  }
  return plans;
}

void place_joint(const PlannedJoint& plan, const std::vector<PlacedObstacle>& obstacles, const std::vector<PlacedBody>& bodies, const geometry::Terrain& terrain,
                 std::vector<PlacedJoint>& placed, std::vector<Fault>& faults) {
  const auto pose_of = [&](const JointEnd& end) -> geometry::RigidPose {
    if (end.kind == JointEnd::Kind::kObstacle) return obstacles.at(end.index).track.at(0);
    if (end.kind == JointEnd::Kind::kBody) return bodies.at(end.index).pose;
    return {};
  };
  const auto place = [&](Vec3& point, const std::optional<JointEnd>& of) {
    geometry::RigidPose pose{point, Quat::Identity()};
    if (of && of->kind != JointEnd::Kind::kWorld) pose.position = pose_of(*of).world(point);
    else if (!put_on_terrain(pose, plan.on_ground, terrain, "joint " + called(plan), plan.place, faults)) return false;
    point = pose.position;
    return true;
  };
  PlacedJoint joint{plan.kind, plan.ends, plan.names, plan.point, plan.point_b, plan.axis, plan.law};
  if (!place(joint.point, plan.of)) return;
  if (plan.of) joint.axis = pose_of(*plan.of).orientation * joint.axis;
  if (plan.kind == Kind::kDistance) {
    if (!place(joint.point_b, plan.of_b)) return;
    const Real length = (joint.point_b - joint.point).norm();
    const bool rope = plan.law.high < JointLaw::kFree;
    if (!rope && !(length > 0)) {
      faults.push_back({plan.place, fmt::format("joint {}: its ends are at one place, and a rod needs a length: kind = \"ball\" would do", called(plan))});
      return;
    }
    // Half a per cent is what rounding positions in a scene makes.
    if (rope && !(length <= plan.law.high * 1.005 && length >= plan.law.low * 0.995)) {
      faults.push_back({plan.place, fmt::format("joint {}: its ends are {:.4g} m apart, beyond its limits of {:.4g} to {:.4g} m", called(plan), length, plan.law.low, plan.law.high)});
      return;
    }
  }
  placed.push_back(std::move(joint));
}

}  // namespace effuse::flow
