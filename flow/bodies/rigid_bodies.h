#pragma once

#include <cstdint>
#include <functional>
#include <memory>
#include <optional>
#include <span>
#include <vector>

#include "flow/bodies/joint.h"
#include "flow/bodies/rotor.h"
#include "flow/bodies/shape.h"
#include "geometry/base/hash.h"
#include "geometry/base/state_io.h"
#include "geometry/terrain/terrain.h"

/// Rigid bodies with contacts, friction and joints on terrain. Stands on its own: no scene.
namespace effuse::flow::bodies {

/// How bodies are kept out of each other.
///   kConstraint  impulses that solve for the velocities: stiff, any step
///   kPenalty     a spring and a damper at each place of contact, as the jello lecture has it: soft, and the substep
///                must resolve the spring (penalty_step_limit): more are made where there are too few
enum class ContactModel { kConstraint, kPenalty };
inline constexpr std::string_view kContactModelNames[] = {"constraint", "penalty"};

struct BodyOptions {
  Vec3 gravity = Vec3(0, 0, -kGravity);  ///< [m/s^2]
  Real step = 1.0 / 120;       ///< [s]: contacts are looked for at least this often
  int substeps = 4;            ///< of one step between two such looks
  int iterations = 1;          ///< over the contacts, in a substep; where masses differ by 10^n, n more (at most 4)
  RotorScheme rotor = RotorScheme::kSplitting;
  ContactModel contact = ContactModel::kConstraint;
  Real penalty_frequency = 60; ///< f [1/s] of the penalty spring: k = m (2 pi f)^2 with the reduced mass at the place
  Real penalty_damping = 0.5;  ///< zeta, of critical: d = 2 zeta m 2 pi f
  Real penalty_springs = 4;    ///< so many of them may push a body the same way, as far as the substep goes
  Real restitution_speed = 0.5;  ///< [m/s]: slower impacts do not rebound
  Real push_speed = 3;         ///< [m/s]: overlap is taken away no faster
  Real margin = 0.02;          ///< contacts are made this far ahead, in bounding radii (and as far as the speed asks)
  Real terrain_friction = 0.6, terrain_restitution = 0;
  Real sleep_speed = 0.03;     ///< [m/s] of any point of a body: slower for sleep_delay, islands fall asleep. 0: never
  Real sleep_delay = 0.5;      ///< [s]
  int max_looks = 32;          ///< at most so many looks for contacts a step of fast bodies (see RigidBodies)
};

/// The longest stable substep h [s] of a body on n penalty springs that push the same way:
///   (omega h)^2 + 4 zeta omega h = 4 / n,   omega = 2 pi f.
/// Symplectic Euler with the damper taken explicitly,
///   v' = v - h n (omega^2 x + 2 zeta omega v),   x' = x + h v',
/// has the characteristic polynomial  l^2 - (2 - n (2 zeta omega h + omega^2 h^2)) l + (1 - 2 n zeta omega h),  whose roots stay
/// inside the unit circle below that. One box on the ground counts 1.5 (it rocks), a stack of them 3. At rest a spring
/// holds mass m at the depth m g / k = g / omega^2.
Real penalty_step_limit(const BodyOptions& options, Real springs);

/// Of a body's surface. Two in contact: the geometric mean of friction, the larger restitution and rolling.
struct Surface {
  Real friction = 0.5;     ///< mu of Coulomb's cone, >= 0
  Real restitution = 0;    ///< 0..1
  Real rolling = 0;        ///< lever arm of rolling (and spinning) resistance [m], >= 0
};

struct BodyReport {
  Real dt = 0;                ///< [s]
  int looks = 0, substeps = 0;
  int retries = 0;            ///< times that the step was undone and tried with twice as many looks
  std::size_t contacts = 0;   ///< places, at the last look
  std::size_t awake = 0;      ///< dynamic bodies
  std::size_t islands = 0;    ///< of awake bodies
  std::size_t stopped = 0;    ///< bodies set back along their path so as not to pass through something
  Real penetration = 0;       ///< deepest overlap at a place of contact [m]
  Real joint_error = 0;       ///< largest distance [m] (or angle [rad]) any joint is off by
  Real kinetic = 0, potential = 0;  ///< [J] of dynamic bodies; potential against gravity, 0 at the origin
};

/// What a contact gave to a body whose loads are recorded (RigidBodies::record_loads), in one substep. In body axes, about its centre of mass.
struct ContactLoad {
  BodyId body = 0;
  int substep = 0;             ///< counted through the whole step
  Vec3 at = Vec3::Zero();      ///< [m]
  Vec3 impulse = Vec3::Zero(); ///< [N s]
};

/// State, as Baraff's lectures have it: position x of the centre of mass, orientation q, linear momentum p, angular
/// momentum L about the centre, one array each. A step:
///
///   look      broad phase (FCL's tree of boxes), manifolds with last look's impulses, islands
///   substeps  p += h f, L += h t; impulses of last time; joints exactly (a sparse LDL^T a linkage, Baraff 1996), contacts in turn
///             by soft constraints that push overlap out; x, q on; the same again without the push, so that it leaves
///             no speed (soft step: Catto 2024, Solver2D; small steps: Macklin et al. 2019)
///   rebound   restitution, by the speeds before the look
///
/// Momentum: each impulse is given to one body and taken from the other at the same point, so both momenta of what no
/// static body touches are kept to rounding. Free bodies keep energy as their RotorScheme does.
///
/// Fast bodies: a look is made at least every half bounding radius of path (at most max_looks a step), contacts are
/// made as far ahead as a body goes until the next, and the largest sphere inside each body that goes further than half its
/// radius is swept from look to look against terrain, static and driven bodies (conservative advancement); at the first touch
/// the body waits there for the next look. So no centre passes through a surface at any speed; a corner may pass a
/// thin plate for a moment, and is pushed back to the centre's side.
///
/// Sleep: islands (bodies joined by contacts and joints) all of whose points have been slower than sleep_speed for
/// sleep_delay rest until something that moves touches them or one of them is pushed.
///
/// How good, at the defaults (tests hold it): a stack of ten boxes of 10 cm stands 0.4 % deep, of 1 m 0.04 %; a box 1,000 times as
/// heavy as the one it lies on presses it in by 2 to 4 %, by 1 % with eight substeps; friction holds and lets go within 0.05 deg of
/// arctan mu; a pendulum's period is right to 1e-5. Two fast dynamic bodies may pass through each other.
///
/// Deterministic: the same bits on any number of threads. Not thread-safe itself.
class RigidBodies {
 public:
  /// Checks the options.
  explicit RigidBodies(const BodyOptions& options = {}, std::optional<geometry::Terrain> terrain = {});
  ~RigidBodies();
  RigidBodies(RigidBodies&&) noexcept;
  RigidBodies& operator=(RigidBodies&&) noexcept;

  /// A body of this density [kg/m^3] > 0; the pose is that of the frame its shape was given in. velocity [m/s] of the centre of
  /// mass, spin [rad/s]. Throws InputError when the shape encloses no volume.
  BodyId add(std::shared_ptr<const Shape> shape, Real density, const geometry::RigidPose& pose, const Surface& surface = {},
             const Vec3& velocity = Vec3::Zero(), const Vec3& spin = Vec3::Zero());
  /// One that stands, and one that goes where move_to says: nothing moves them.
  BodyId add_static(std::shared_ptr<const Shape> shape, const geometry::RigidPose& pose, const Surface& surface = {});
  BodyId add_driven(std::shared_ptr<const Shape> shape, const geometry::RigidPose& pose, const Surface& surface = {});
  /// A driven body arrives at pose at the end of the next step, on a straight line with a constant spin, and stands then.
  void move_to(BodyId id, const geometry::RigidPose& pose);
  /// Joins two bodies. Throws InputError when limits or axis make no sense.
  JointId join(const Joint& joint);
  void set_motor(JointId joint, Real speed, Real strength);
  /// Takes a joint away (it broke).
  void unjoin(JointId joint);

  /// f [N] at the point `at` of the world, until the end of the next step.
  void add_force(BodyId id, const Vec3& f, const Vec3& at);
  void add_torque(BodyId id, const Vec3& torque);
  /// Now. Of static and driven bodies nothing changes.
  void add_impulse(BodyId id, const Vec3& impulse, const Vec3& at);
  /// Velocity [m/s] of the body's point that is at `at` in the world.
  Vec3 velocity_at(BodyId id, const Vec3& at) const;
  /// K: velocity_at(id, at) changes by K * impulse for an impulse at the same point [1/kg]. Zero for static and driven ones.
  Mat3 inverse_mass_at(BodyId id, const Vec3& at) const;

  /// Takes a body out for good: nothing meets it, it has no momentum, its number is never given again. Wakes what it touches.
  void retire(BodyId id);
  bool is_gone(BodyId id) const;
  /// Joints of `from` hold the body to(anchor in the world) instead, where they held it: before it is retired.
  void hand_joints(BodyId from, const std::function<BodyId(const Vec3&)>& to);
  /// Whether the loads of contacts on this body are kept; by island, place and substep.
  void record_loads(BodyId id, bool on);
  std::span<const ContactLoad> contact_loads() const;  ///< of the last step
  /// What was added since the last step [N], [N m].
  Vec3 force(BodyId id) const;
  Vec3 torque(BodyId id) const;
  const Surface& surface(BodyId id) const;
  /// All that a step changes, to go back to while no body has come or gone.
  struct Moment;
  std::shared_ptr<const Moment> moment() const;
  void go_back(const Moment& moment);

  /// dt [s] > 0. A step whose result is not finite is undone and tried with twice as many looks, six times; then
  /// UnstableError, everything as it was before the step. So is one that pulls a joint apart by 1e-4 of the size of what it holds,
  /// four times; what comes then is kept.
  BodyReport step(Real dt);

  std::size_t size() const;
  Real time() const;
  const BodyOptions& options() const;
  bool is_dynamic(BodyId id) const;
  bool asleep(BodyId id) const;
  void wake(BodyId id);
  const Shape& shape(BodyId id) const;
  Real mass(BodyId id) const;                       ///< [kg]; infinity for static and driven bodies
  geometry::RigidPose pose(BodyId id) const;        ///< of the frame the shape was given in
  geometry::RigidPose body_pose(BodyId id) const;   ///< of body axes
  Vec3 spin(BodyId id) const;                       ///< angular velocity [rad/s]
  /// Views, valid until the next add.
  std::span<const Vec3> centres() const;            ///< of mass [m]
  std::span<const Quat> orientations() const;       ///< world_from_body
  std::span<const Vec3> momenta() const;            ///< [kg m/s]
  std::span<const Vec3> angular_momenta() const;    ///< about the centre of mass [kg m^2/s]
  Real kinetic_energy() const;                      ///< [J] of dynamic bodies
  Real potential_energy() const;                    ///< [J] against gravity
  /// Distance [m] or, for hinge, slider and fixed, angle [rad], whichever is larger, that a joint is off by.
  Real joint_error(JointId joint) const;
  /// Turn [rad] of a hinge, travel [m] of a slider, length [m] of a distance joint, tilt [rad] of a ball with a cone.
  Real joint_position(JointId joint) const;

  /// Where bodies touch, as of the last look.
  struct Touch {
    static constexpr Index kTerrain = ~Index{0};
    Index a = 0, b = 0;        ///< a < b; b may be kTerrain
    Vec3 point = Vec3::Zero(), normal = Vec3::UnitZ();  ///< normal from a to b
    Real separation = 0;       ///< [m], negative in overlap
    Real normal_impulse = 0;   ///< of the last substep [N s]
  };
  std::vector<Touch> touches() const;

  std::size_t memory() const;
  void add_to(StateHash& hash) const;
  void save(StateWriter& out) const;
  /// Into one with the same bodies and joints added in the same order. Throws InputError where what was saved does not fit;
  /// this is then unchanged.
  void load(StateReader& in);

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace effuse::flow::bodies
