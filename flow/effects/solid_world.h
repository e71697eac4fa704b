#pragma once

#include <memory>
#include <string>
#include <vector>

#include "flow/bodies/rigid_bodies.h"
#include "flow/scene/obstacles.h"
#include "flow/scene/rigid_bodies.h"
#include "flow/sph/solids.h"

namespace effuse::flow {

/// All that is solid beside the terrain, as one lava meets it: obstacles on their tracks and rigid bodies, which meet one another and
/// the terrain, too. Lava and bodies move each other: both solves of a lava step hold the bodies' velocities as unknowns beside the
/// particles' (sph::Movable), what these say is given to the bodies as an impulse, then the bodies take their own step,
/// as long, with gravity and their contacts. Momentum is kept, to the tolerance of the viscosity's solve.
///
/// What a body rests on is known to the lava by how it held the body up in the step before (Movable::acceleration).
/// A thing with a material of its own takes up heat as a half-space where lava touches it (sph::Heat), beginning from the temperature that
/// the whole has by then: that rises by what it was given over its heat capacity, so that it never grows hotter than the lava. Of an
/// obstacle that is no solid, or has no temperature of its own, it stays.
/// Surfaces are numbered from 1: obstacles, then bodies, in their order. Not to be moved while a lava refers to it.
class SolidWorld {
 public:
  SolidWorld(const std::vector<PlacedObstacle>& obstacles, const std::vector<PlacedBody>& bodies, const geometry::Terrain* terrain, const bodies::BodyOptions& options = {});

  /// For ModernLava; refers to this object. No obstacles of any kind: empty.
  sph::SolidOptions solids();
  void stand(Real time, Real dt);
  /// Obstacles' ways from one moment to another [s]; bodies', that of their last step.
  void move(Real from, Real to);

  bool has_bodies() const { return bodies_ != nullptr; }
  const bodies::RigidBodies& bodies() const { return *bodies_; }
  /// Poses of the bodies' frames, in their order.
  std::vector<geometry::RigidPose> poses() const;
  Vec3 velocity(std::size_t body) const;

  /// What lava has done to a thing's heat.
  ///   given    [J] in all
  ///   hottest  [K] that its surface has been where lava touched it; 0: never touched
  ///   mean     [K] of the whole: where it began and what it was given; 0: it has no temperature, or no heat capacity, of its own
  struct Warmth {
    Real given = 0, hottest = 0, mean = 0;
  };
  /// Obstacles, then bodies; and what they are called.
  const std::vector<Warmth>& warmth() const { return warmth_; }
  const std::vector<std::string>& names() const { return names_; }

  void add_to(StateHash& hash) const;
  void save(StateWriter& out) const;
  void load(StateReader& in);

 private:
  void go(std::size_t obstacle, const geometry::RigidMotion& motion);
  void tell(std::vector<sph::Movable>& movable) const;
  void take(std::span<const sph::Movable> movable, Real dt);
  void add_heat(std::string name, const Material& material, Real temperature, Real volume);
  void set_mean(std::size_t thing);
  void warm(std::span<const Real> heat, std::span<const Real> hottest);

  std::vector<geometry::PoseTrack> tracks_;
  std::vector<bodies::BodyId> driven_;   // of each obstacle; only where there are bodies
  std::vector<bodies::BodyId> ids_;      // of bodies
  std::vector<Real> friction_, effusivity_;  // by surface
  std::vector<std::string> names_;           // of obstacles, then bodies, and so on
  std::vector<Warmth> warmth_;
  std::vector<Real> capacity_;               // [J/K]; 0: stays as warm as it is
  std::vector<Real> first_temperature_;      // [K]
  std::vector<Vec3> acceleration_;       // of bodies, by all but lava, in the last step [m/s^2]
  std::vector<geometry::RigidPose> before_;  // body axes at the last step's begin
  Real last_dt_ = 0, time_ = 0;
  geometry::Obstacles obstacles_;
  std::unique_ptr<bodies::RigidBodies> bodies_;
};

}  // namespace effuse::flow
