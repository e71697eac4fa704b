#pragma once

#include <span>
#include <vector>

#include "flow/bodies/contacts.h"
#include "flow/bodies/solver_body.h"

namespace effuse::flow::bodies {

struct ContactLoad;

/// What two surfaces are to each other.
struct PairSurface {
  Real friction = 0, restitution = 0, rolling = 0;
};

/// Impulses at places of contact. Between two looks, substep after substep:
///
///   prepare     separations, arms and effective masses where the bodies are now
///   warm_start  the impulses of the last substep once more
///   solve       one round over all places, in order: friction within the cone, then the normal. `push`: take overlap away, too, by a
///               soft constraint of frequency 1 / (4 h) and ten times critical damping
///   penalty     instead of these: spring and damper, by the speeds of the last substep's end
///   rub_all     with penalty: one round of friction, after all other forces, so that what rests does not creep
///   rebound     at the look's end
class ContactSolver {
 public:
  struct Options {
    Real h = 0;                 ///< substep [s]
    Real push_speed = 3;        ///< [m/s]
    Real restitution_speed = 0.5;
    Real penalty_frequency = 60, penalty_damping = 0.5;
  };
  /// points keep their impulses in the end. bodies: by body number, the terrain last.
  ContactSolver(const Options& options, std::span<ContactPoint> points, std::span<const PairSurface> surfaces, std::span<SolverBody> bodies);

  void prepare(int k);
  void warm_start();
  void solve(bool push);
  void penalty();
  void rub_all();
  void rebound();
  /// What each place has given in this substep to bodies whose flag is set.
  void book(std::span<const std::uint8_t> wanted, int substep, std::vector<ContactLoad>& out) const;
  /// Impulses back into the points; the deepest overlap where the bodies were at the last prepare().
  Real finish();

 private:
  struct Place {
    Index a, b;
    Vec3 on_a, on_b, n, t1, t2;
    Vec3 ra, rb;             // arms to the common point both impulses act at
    Real separation = 0, of_a = 0.5;
    Real mass = 0;           // 1 / (n K n)
    Real t11 = 0, t12 = 0, t22 = 0;  // inverse of the tangents' part of K
    Real slide = 0;          // 1 / its larger eigenvalue
    Real n1 = 0, n2 = 0;     // what friction along t1 and t2 adds to the normal velocity: n K t
    Mat3 twist_mass;         // rolling only
    Real friction, restitution, rolling;
    Real push = 0, most = 0, drag1 = 0, drag2 = 0;
    Vec3 twist = Vec3::Zero();
    Real approach = 0;       // normal velocity at the look's begin
    bool fresh = true;
  };
  Vec3 relative_velocity(const Place& c) const {
    const SolverBody &A = bodies_[c.a], &B = bodies_[c.b];
    return B.v + B.w.cross(c.rb) - A.v - A.w.cross(c.ra);
  }
  void apply(const Place& c, const Vec3& P) {
    bodies_[c.a].push(-P, c.ra);
    bodies_[c.b].push(P, c.rb);
  }
  Vec2 friction(const Place& c, Real v1, Real v2) const;
  void rub(Place& c);
  void roll(Place& c);

  Options options_;
  std::span<ContactPoint> points_;
  std::span<SolverBody> bodies_;
  std::vector<Place> places_;
  Real bias_rate_ = 0, mass_scale_ = 1, impulse_scale_ = 0;
};

}  // namespace effuse::flow::bodies
