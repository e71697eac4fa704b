#pragma once

#include <memory>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "flow/bodies/brittle_bodies.h"
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
/// A thing with a material of its own takes up heat as a half-space where lava touches it (sph::Heat), beginning from the temperature that
/// the whole has by then: that rises by what it was given over its heat capacity, so that it never grows hotter than the lava. Of an
/// obstacle that is no solid, or has no temperature of its own, it stays.
/// Solids that deform give way to lava in the same way, each point of theirs an unknown of both solves (sph::Pressed), and take their own
/// step, as long, before the bodies'. They and bodies do not know one another here; they meet bodies as any effect does (MetThings).
/// Surfaces are numbered from 1: obstacles, then bodies, in their order, then solids that deform, then pieces of those that break as they come.
/// Numbers of bodies that are gone are not given again. Not to be moved while a lava refers to it.
///
/// What lava does to a body that may break is spread over the places where particles lie on it (wet()) as one smooth field a + b x r whose
/// force and moment are those of the solves, so that a wall bends under lava that stands against it.
class SolidWorld {
 public:
  /// births: bodies may come later (add_block), though there be none yet.
  SolidWorld(const std::vector<PlacedObstacle>& obstacles, const std::vector<PlacedBody>& bodies, const geometry::Terrain* terrain, const bodies::BodyOptions& options = {},
             const std::vector<PlacedJoint>& joints = {}, bool births = false);

  /// A plate of that mass [kg] that came into the world: the convex hull of corners, about the origin of the frame that pose places.
  /// velocity of its centre of mass.
  void add_block(std::span<const Vec3> corners, Real mass, const geometry::RigidPose& pose, const Vec3& velocity, const Vec3& spin, Real temperature);
  std::size_t blocks() const { return blocks_.size(); }
  /// Of those that are there: centres of mass [m]; their mass [kg].
  std::vector<Vec3> block_centres() const;
  Real block_mass() const;
  /// Takes out blocks whose centre is where `beyond` says; their mass [kg].
  Real drop_blocks(const std::function<bool(const Vec3&)>& beyond);

  /// Solids that deform, before the first step: those of an effect with such (Effect::soft), called by its name. Lava's options say all.
  void add_soft(const std::string& name, const SoftSolid& soft);
  std::size_t softs() const { return soft_.size(); }

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
  /// From the solid that was added last [m]; 0 inside, infinite beyond reach.
  Real distance_to_last(const Vec3& point, Real reach) const;
  bool any() const { return !obstacles_.empty(); }
  /// Bodies there are now, pieces and blocks among them.
  std::size_t count() const;
  bool has_bodies() const { return bodies_ != nullptr; }
  const bodies::RigidBodies& bodies() const { return *bodies_; }
  /// Where particles lie on bodies that may break, for the next step. Without such bodies: nothing.
  void wet(std::span<const Vec3> x, Real spacing);
  /// Bodies that may break, as they are now, in pieces or whole.
  std::vector<SolidPiece> pieces() const;
  /// Poses of the bodies' frames, in their order; of one that broke, where it did.
  std::vector<geometry::RigidPose> poses() const;
  Vec3 velocity(std::size_t body) const;
  /// What its steps came to, for a run's report; none without bodies.
  std::vector<std::pair<std::string, double>> figures() const;
  const bodies::BodyReport& last() const { return last_; }

  /// What lava has done to a thing's heat.
  ///   given    [J] in all
  ///   hottest  [K] that its surface has been where lava touched it; 0: never touched
  ///   mean     [K] of the whole: where it began and what it was given; 0: it has no temperature, or no heat capacity, of its own
  struct Warmth {
    Real given = 0, hottest = 0, mean = 0;
  };
  /// Obstacles, then the scene's bodies; and what they are called.
  const std::vector<Warmth>& warmth() const { return warmth_; }
  const std::vector<std::string>& names() const { return heated_names_; }

  void add_to(StateHash& hash) const;
  void save(StateWriter& out) const;
  void load(StateReader& in);

 private:
  /// An obstacle whose track has several keys, and what the track said last: it is asked twice a step, and begins where it ended.
  struct Moving {
    Index obstacle;
    Real from = 0, to = 0;
    geometry::RigidPose end = {};
    geometry::RigidMotion way = {};
  };
  void go(std::size_t obstacle, const geometry::RigidMotion& motion);
  const geometry::RigidMotion& between(Moving& moving, Real from, Real to) const;
  void tell(std::vector<sph::Movable>& movable) const;
  void take(std::span<const sph::Movable> movable, Real dt);
  void step_bodies(Real dt);
  void spread(std::size_t body, const Vec3& force, const Vec3& torque);
  void admit_pieces();
  void admit(bodies::BodyId id, Index parent);
  struct Block {
    bodies::BodyId id;
    std::vector<Vec3> corners;
    Real mass, temperature;
  };
  bodies::BodyId add_block_body(const Block& block, const geometry::RigidPose& pose, const Vec3& velocity, const Vec3& spin);
  void admit_block(const Block& block);
  /// Of a body or piece among the obstacles; its surface has the number behind. And back: of a body's surface.
  std::size_t place(std::size_t body) const { return tracks_.size() + body + (body < of_scene_ ? 0 : soft_.size()); }
  std::size_t body_of(Index surface) const { return surface - tracks_.size() - 1 - (surface > tracks_.size() + of_scene_ ? soft_.size() : 0); }
  bool is_body(Index surface) const { return surface > tracks_.size() && !(surface > tracks_.size() + of_scene_ && surface <= tracks_.size() + of_scene_ + soft_.size()); }
  bool breaks(std::size_t body) const { return brittle_ && brittle_->knows(ids_[body]); }
  bool gone(std::size_t body) const { return bodies_->is_gone(ids_[body]); }
  template <class Self, class Archive>
  static void archive(Self& self, Archive& io);
  void add_heat(std::string name, const Material& material, Real temperature, Real volume);
  void set_mean(std::size_t thing);
  void warm(std::span<const Real> heat, std::span<const Real> hottest);

  std::vector<std::string> names_;       // by surface: obstacles', bodies', solids' that deform, pieces'
  std::vector<geometry::PoseTrack> tracks_;
  std::vector<Moving> moving_;
  std::vector<bodies::BodyId> driven_;   // of each obstacle; only where there are bodies
  std::vector<bodies::BodyId> ids_;      // of bodies, then pieces
  std::size_t of_scene_ = 0;             // bodies of the scene among them
  std::vector<Index> origin_;            // body of the scene that each is or broke off
  std::vector<Real> temperature_;
  std::vector<std::shared_ptr<const geometry::TriMesh>> look_;  // of those that may break
  std::vector<std::vector<Vec3>> wet_;   // places of lava on them, in their frames
  std::vector<Real> friction_, effusivity_;  // by surface
  std::vector<std::string> heated_names_;    // of obstacles, then bodies of the scene, and so on
  std::vector<Warmth> warmth_;
  std::vector<Real> capacity_;               // [J/K]; 0: stays as warm as it is
  std::vector<Real> first_temperature_;      // [K]
  std::vector<Vec3> acceleration_;       // of bodies, by all but lava, in the last step [m/s^2]
  std::vector<geometry::RigidPose> before_;  // body axes at the last step's begin
  Real last_dt_ = 0, time_ = 0;
  bodies::BodyReport last_;
  struct Totals {
    Real steps = 0, retries = 0, stopped = 0, penetration = 0, joint_error = 0;  // the last two: the largest of any step
    Real broken = 0, redone = 0;  // bodies that came apart; steps made anew for it
  } totals_;
  geometry::Obstacles obstacles_;
  std::unique_ptr<bodies::RigidBodies> bodies_;
  std::unique_ptr<bodies::BrittleBodies> brittle_;  // null: none may break
  std::vector<Block> blocks_;  // also those that are gone
  std::vector<sph::SolidOptions::Deforming> soft_;
};

/// Of the obstacles, bodies and joints of a world, with its settings.
std::unique_ptr<SolidWorld> make_solid_world(const World& world, bool births = false);

}  // namespace effuse::flow
