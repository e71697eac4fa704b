#pragma once

#include <cstdint>
#include <limits>
#include <memory>
#include <optional>
#include <span>
#include <utility>
#include <vector>

#include "flow/bodies/contact_solver.h"
#include "flow/bodies/contacts.h"
#include "flow/bodies/islands.h"
#include "flow/bodies/joint_solver.h"
#include "flow/bodies/rigid_bodies.h"
#include "geometry/collide/broad_phase.h"
#include "geometry/collide/rigid_pose.h"

/// Inside RigidBodies: the state (rigid_bodies.cpp: bodies come, are asked about, saved) and its step (rigid_bodies_step.cpp).
namespace effuse::flow::bodies {

enum class Role : std::uint8_t { kDynamic, kStatic, kDriven, kGone };

/// Thrown inside a step whose numbers went bad: it is tried anew, smaller.
struct NotFinite {};

struct RigidBodies::Impl {
  Impl(const BodyOptions& o, std::optional<geometry::Terrain> t) : options(o) {
    if (t) ground.emplace(std::move(*t));
  }

  BodyOptions options;
  std::optional<GroundShape> ground;

  // Bodies, one array a quantity. What does not change:
  std::vector<std::shared_ptr<const Shape>> shape;
  std::vector<Role> role;
  std::vector<Real> mass;      // infinity: static and driven
  std::vector<Vec3> moments;
  std::vector<Surface> surface;
  // The state:
  Real time = 0;
  std::vector<Vec3> x, p, L;
  std::vector<Quat> q;
  std::vector<Real> rested;             // [s] slower than sleep_speed
  std::vector<std::uint64_t> group;     // 0: awake; else those that fell asleep together
  std::uint64_t groups = 0;
  std::vector<ContactPoint> points;     // of the last look, by pair
  std::vector<JointState> joints;
  // For the next step only:
  std::vector<Vec3> force, torque;
  std::vector<geometry::RigidPose> target;
  std::vector<std::uint8_t> driven_now;  // has a target

  std::vector<std::uint8_t> recorded;    // loads are kept
  std::vector<ContactLoad> loads;        // of the last step

  // Work of a look, kept for its memory.
  std::vector<PlacedShape> placed;
  std::vector<std::uint8_t> placed_well;  // bodies that do not move need not be placed again
  std::vector<SolverBody> solver;
  std::optional<geometry::BroadPhase> broad;
  std::vector<std::array<Index, 2>> pairs;
  std::vector<unsigned char> active;
  std::vector<geometry::RigidMotion> motion;        // of driven bodies in this step
  std::vector<std::vector<geometry::RigidPose>> path;

  std::size_t size() const { return x.size(); }
  bool dynamic(Index i) const { return role[i] == Role::kDynamic; }
  bool awake(Index i) const { return dynamic(i) && group[i] == 0; }
  Vec3 velocity(Index i) const { return dynamic(i) ? Vec3(p[i] / mass[i]) : Vec3::Zero(); }
  Vec3 spin(Index i) const { return dynamic(i) ? angular_velocity(q[i], L[i], moments[i]) : Vec3::Zero(); }

  BodyId add(std::shared_ptr<const Shape> s, Role r, Real density, const geometry::RigidPose& pose, const Surface& material, const Vec3& v, const Vec3& w);
  void wake_group(Index i);
  SolverBody solver_body(Index i) const;

  BodyReport run(Real dt, int looks);
  void look(Real dt, int number, int looks, BodyReport& report);
  int substeps_of(Real look) const;
  void place_bodies(Real dt);
  void find_contacts();
  bool wake_touched(Real dt);
  PairSurface pair_surface(const ContactPoint& c) const;
  void solve(Real dt, int number, std::vector<Island>& islands, BodyReport& report);
  Real solve_island(const Island& island, Real h, int substeps, int first_substep, std::vector<ContactLoad>& loads_out);
  int more_iterations(std::span<const ContactPoint> places) const;
  void go_on(const Island& island, JointSolver& linkage, int k, Real h);
  void stop_fast(const std::vector<Vec3>& before, Real s0, Real s1, BodyReport& report);
  void let_sleep(const std::vector<Island>& islands, Real dt);
  int looks_for(Real dt) const;
  bool may_meet(Index i, Real reach) const;
  bool finite() const;
  Real joint_strain() const;

  /// What a step changes: to be taken back when it went wrong.
  struct Saved {
    Real time;
    std::vector<Vec3> x, p, L;
    std::vector<Quat> q;
    std::vector<Real> rested;
    std::vector<std::uint64_t> group;
    std::uint64_t groups;
    std::vector<ContactPoint> points;
    std::vector<JointState> joints;
  };
  Saved saved() const { return {time, x, p, L, q, rested, group, groups, points, joints}; }
  void restore(const Saved& s) {
    time = s.time;
    x = s.x, p = s.p, L = s.L, q = s.q;
    rested = s.rested, group = s.group, groups = s.groups;
    points = s.points, joints = s.joints;
    std::fill(placed_well.begin(), placed_well.end(), std::uint8_t{0});
  }

  template <class Self, class Archive>
  static void archive(Self& self, Archive& io);
};

}  // namespace effuse::flow::bodies
