#pragma once

#include <memory>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "flow/bodies/rigid_bodies.h"
#include "flow/scene/effect.h"
#include "flow/scene/joints.h"
#include "flow/scene/obstacles.h"
#include "flow/scene/rigid_bodies.h"
#include "flow/sph/solids.h"

namespace effuse::flow {

/// A scene's settings as the solver takes them.
bodies::BodyOptions body_options(const BodySettings& settings);

/// All that is solid beside the terrain, as one lava meets it: obstacles on their tracks and rigid bodies, which meet one another and
/// the terrain, too. Lava and bodies move each other: both solves of a lava step hold the bodies' velocities as unknowns beside the
/// particles' (sph::Movable), what these say is given to the bodies as an impulse, then the bodies take their own step,
/// as long, with gravity and their contacts. Momentum is kept, to the tolerance of the viscosity's solve.
///
/// What a body rests on is known to the lava by how it held the body up in the step before (Movable::acceleration).
/// Surfaces are numbered from 1: obstacles, then bodies, in their order. Not to be moved while a lava refers to it.
class SolidWorld {
 public:
  SolidWorld(const std::vector<PlacedObstacle>& obstacles, const std::vector<PlacedBody>& bodies, const geometry::Terrain* terrain, const bodies::BodyOptions& options = {},
             const std::vector<PlacedJoint>& joints = {});

  /// For ModernLava; refers to this object. No obstacles of any kind: empty.
  sph::SolidOptions solids();
  void stand(Real time, Real dt);
  /// Obstacles' ways from one moment to another [s]; bodies', that of their last step.
  void move(Real from, Real to);

  /// Without lava: obstacles and bodies go on from `time` by dt [s].
  void step(Real time, Real dt);

  /// The nearest thing within reach [m] of a point where all stand now (stand, move), and what its table calls it.
  struct Near {
    std::string name;
    Real distance = 0, speed = 0;  ///< [m], negative inside; of the surface there [m/s]
  };
  std::optional<Near> nearest(const Vec3& point, Real reach) const;
  bool any() const { return !obstacles_.empty(); }
  bool has_bodies() const { return bodies_ != nullptr; }
  const bodies::RigidBodies& bodies() const { return *bodies_; }
  /// Poses of the bodies' frames, in their order.
  std::vector<geometry::RigidPose> poses() const;
  Vec3 velocity(std::size_t body) const;
  /// What its steps came to, for a run's report; none without bodies.
  std::vector<std::pair<std::string, double>> figures() const;
  const bodies::BodyReport& last() const { return last_; }

  void add_to(StateHash& hash) const;
  void save(StateWriter& out) const;
  void load(StateReader& in);

 private:
  void go(std::size_t obstacle, const geometry::RigidMotion& motion);
  void tell(std::vector<sph::Movable>& movable) const;
  void take(std::span<const sph::Movable> movable, Real dt);
  void step_bodies(Real dt);
  template <class Self, class Archive>
  static void archive(Self& self, Archive& io);

  std::vector<std::string> names_;       // obstacles', then bodies'
  std::vector<geometry::PoseTrack> tracks_;
  std::vector<bodies::BodyId> driven_;   // of each obstacle; only where there are bodies
  std::vector<bodies::BodyId> ids_;      // of bodies
  std::vector<Real> friction_;
  std::vector<Vec3> acceleration_;       // of bodies, by all but lava, in the last step [m/s^2]
  std::vector<geometry::RigidPose> before_;  // body axes at the last step's begin
  Real last_dt_ = 0, time_ = 0;
  bodies::BodyReport last_;
  struct Totals {
    Real steps = 0, retries = 0, stopped = 0, penetration = 0, joint_error = 0;  // the last two: the largest of any step
  } totals_;
  geometry::Obstacles obstacles_;
  std::unique_ptr<bodies::RigidBodies> bodies_;
};

/// Of the obstacles, bodies and joints of a world, with its settings.
std::unique_ptr<SolidWorld> make_solid_world(const World& world);

}  // namespace effuse::flow
