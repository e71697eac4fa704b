#pragma once

#include <array>
#include <limits>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "flow/scene/obstacles.h"
#include "flow/scene/rigid_bodies.h"

namespace effuse::flow {

/// What a joint holds: one of the scene's bodies or obstacles, by its number among them, or the world.
struct JointEnd {
  enum class Kind { kWorld, kObstacle, kBody };
  Kind kind = Kind::kWorld;
  std::size_t index = 0;
  friend bool operator==(const JointEnd&, const JointEnd&) = default;
};

/// In the order of bodies::Joint::Kind.
enum class JointKind { kBall, kHinge, kSlider, kFixed, kDistance };
inline constexpr std::array<std::string_view, 5> kJointKindNames = {"ball", "hinge", "slider", "fixed", "distance"};

/// What a joint lets its ends do, as a table and the solver both have it: see bodies::Joint for the meaning of the numbers.
struct JointLaw {
  static constexpr Real kFree = std::numeric_limits<Real>::infinity();
  Real low = -kFree, high = kFree;  ///< [rad] of a hinge and a ball's cone, [m] of a slider and a distance
  Real motor_speed = 0, motor_strength = 0;
  Real stiffness = 0, damping = 0;
  bool collide = false;
};

/// A joint as its table [[joint]] describes it.
struct PlannedJoint {
  Place place;
  JointKind kind = JointKind::kBall;
  std::array<JointEnd, 2> ends;
  std::array<std::string, 2> names;       ///< of the ends, for people
  /// Whose own coordinates point and axis, and point_b, are in; none: the terrain file's.
  std::optional<JointEnd> of, of_b;
  Vec3 point = Vec3::Zero(), point_b = Vec3::Zero(), axis = Vec3::UnitZ();
  bool on_ground = true;                  ///< heights of points in the terrain file's coordinates count from the ground there
  JointLaw law;
};

/// The tables [[joint]]; one with copies = n stands for n joints, the numbers that its names end in counting on. Faults stay in root.
std::vector<PlannedJoint> read_joints(Parameters& root, const std::vector<PlannedObstacle>& obstacles, const std::vector<PlannedBody>& bodies);

/// A joint in the world, where its ends are at the start.
struct PlacedJoint {
  JointKind kind = JointKind::kBall;
  std::array<JointEnd, 2> ends;
  std::array<std::string, 2> names;
  Vec3 point = Vec3::Zero(), point_b = Vec3::Zero(), axis = Vec3::UnitZ();
  JointLaw law;
};

/// Obstacles and bodies: all of the scene's, none left out. What does not fit is a fault at the plan's place, and the joint is left out.
void place_joint(const PlannedJoint& plan, const std::vector<PlacedObstacle>& obstacles, const std::vector<PlacedBody>& bodies, const geometry::Terrain& terrain,
                 std::vector<PlacedJoint>& placed, std::vector<Fault>& faults);

}  // namespace effuse::flow
