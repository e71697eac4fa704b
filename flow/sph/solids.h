#pragma once

#include <cstdint>
#include <functional>
#include <memory>
#include <span>
#include <vector>

#include "flow/sph/boundary.h"
#include "flow/sph/column_grid.h"
#include "flow/sph/movable.h"
#include "flow/sph/pressed.h"
#include "geometry/collide/obstacles.h"
#include "geometry/collide/slide.h"

namespace effuse::flow::sph {

/// Obstacles as lava meets them: any meshes, standing or moving, beside the ground.
///
///   obstacles  not owned; must outlive the lava and stand still while it steps. Surfaces' numbers are from 1 on
///   move       sets the obstacles' motions to their way from one moment to another and calls update(); empty: nothing moves
///   stand      sets motions that end where obstacles are at a moment, at the speed they have in the step of dt [s] that follows, and calls
///              update(); empty: what move() says for that step is turned back
///   friction   by surface number: factor of the drag along it, 1 no slip, 0 free slip; shorter lists: 1
///   friction_by  the same by a function, for surfaces that come later; empty: the list says
///   movable    the bodies among them that lava moves, as they are now, in any order; called at a step's begin; empty: there are none
///   moved      those bodies with the velocities that lava has given them in a step of dt [s], acceleration * dt included. What lava has
///              done is the difference less that. Called before move() for the step
///   effusivity by surface number: sqrt(k rho c) [J/(m^2 K s^0.5)] of what takes up heat there as a half-space; 0, and shorter lists: the
///              ground's
///   heated     what each surface has been given in a step [J], and the hottest it was where lava touched it [K], 0 where none did; by
///              surface number, the ground's (0) and those without an effusivity of their own among them
///   push       an impulse [N s] that particles stopped by a body's surface have given it, at a place [m], after the step
///   deforming  those among them that lava deforms, which it moves and steps itself: not owned, as above
struct SolidOptions {
  /// Its place among the obstacles; what it hangs on. Its surface there has the vertices of solid->surface().
  struct Deforming {
    std::size_t obstacle = 0;
    Deformable* solid = nullptr;
    std::string name = {};  ///< for messages; may be empty
  };

  geometry::Obstacles* obstacles = nullptr;
  std::function<void(Real from, Real to)> move;
  std::vector<Real> friction;
  std::function<void(Real time, Real dt)> stand = {};
  std::function<void(std::vector<Movable>&)> movable = {};
  std::function<void(std::span<const Movable>, Real dt)> moved = {};
  std::function<void(Index surface, const Vec3& impulse, const Vec3& at)> push = {};
  std::function<Real(Index surface)> friction_by = {};
  std::vector<Real> effusivity = {};
  std::function<void(std::span<const Real> heat, std::span<const Real> hottest)> heated = {};
  std::vector<Deforming> deforming = {};
};

/// The lava's side of its obstacles: walls for the sums, and moves that go through nothing.
///
/// Unlike the ground it keeps no bounds from step to step: what is near is asked each step, first for the box around all particles, then
/// for that around 64 at a time: obstacles that are far cost less than a hundredth of a step, were it 10,000 of them. The same bits on any
/// number of threads.
///
/// Projection and boundary terms are all there is for lava; springs (a penalty), which bodies and jello may choose, are not offered. Lava's
/// pressure is whatever keeps its density, found in one solve of which the wall is a part: it carries a column of any height and lets nothing
/// in. A spring carries p dx^2 by giving way, p dx^2 / k deep; to keep that below a hundredth of a spacing under a column of H it takes
/// k = 100 rho g H dx, and an explicit step below 2 sqrt(m / k) = 0.2 dx / sqrt(g H): 6 ms at dx = 0.1 m and H = 1 m, against the
/// 100 ms and more that thick lava can be stepped with; and its push would be known to neither solve, so that lava would bounce where it
/// lies. What the projection does is only to take back, without a speed, the rounding and advection errors that are left.
///
/// A wall's drag is that of a half-space; beside the obstacle's convex edges (the end of a wall, the corners of a gap) it counts by the
/// share of that half-space which the obstacles hide from the particle. In full it would hold back a tenth of what a gap six spacings
/// wide lets through.
///
/// Known limits: at the inner edges of a vessel the sums still miss a little; lava at rest in it creeps round by 0.03 g spacing^2 / nu, a
/// hundredth on the mean. A duct 3 by 5 particles wide lets through 8 % too much, one 3 by 10 wide 2 %. Things whose size is a kernel's are
/// felt too strongly where lava is deep: a ball 3 spacings in radius sinks within 10 % of what Stokes and Haberman say down to 5 radii below the
/// surface, a quarter too slowly at 7 (why: even_out.h). Held still it is lifted by 0.82 of what it displaces (0.87 at 5 spacings, 0.89 at 6).
///
/// A body lighter than a particle answers lava as if it were as heavy as one: its walls take it for as large, and their push on a
/// thousandth of that mass would be more than the solves' single precision can undo. Momentum is kept with heavier bodies only.
class Solids {
 public:
  /// radius: particles' centres stay so far off surfaces where there is room [m]. mass: of a particle [kg]. widest: of walls face to
  /// face that are looked for [m].
  Solids(const SolidOptions& options, Real radius, Real mass, Real widest);

  bool any() const { return options_.obstacles != nullptr && (!options_.obstacles->empty() || !pressed_.empty()); }

  /// Obstacles stand where they are at `time` and have the velocities of their way to time + dt.
  void stand(Real time, Real dt);
  /// Bodies: as the solves have them; back to the step's begin; and that, with what else moves them in a time dt.
  std::span<Movable> movable() { return movable_; }
  void begin_try() { movable_ = before_; }
  void restart(Real dt);
  /// Solids that deform: as the solves have them, from restart() on; before it, as they are.
  std::span<Pressed> pressed() { return pressed_; }

  /// Obstacles go from time to time + dt; bodies with the velocities they have been given.
  void go(Real time, Real dt);

  /// Obstacles stand where their way has ended.
  void rest();
  /// No point of any obstacle goes faster in the step of stand() [m/s].
  Real fastest() const { return fastest_; }

  /// Appends to each particle's walls those of obstacles within reach [m]. x: the particles', as walls has them.
  void add_walls(std::span<const Vec3> x, Real reach, Walls& walls);
  /// Takes pairs of particles that obstacles stand between out of the lists: lava on the two sides of a thin plate knows nothing of each
  /// other. For the walls last added to, of the same x; not where the flow is periodic (images' walls are not known).
  void part(std::span<const Vec3> x, const Walls& walls, Neighbors& neighbors);
  /// The fastest surface among the walls last added [m/s].
  Real speed() const { return speed_; }
  /// Whether a surface that goes faster than `speed` [m/s] is within reach of x.
  bool disturbs(const Vec3& x, Real reach, Real speed) const;

  /// Particles `which` that would go from `before` to `x` (by particle, all of them), velocities v: stopped, carried, led along by the
  /// obstacles on their way; x and v changed. Obstacles must be going (go()). wanted: x as it came, if any are near an obstacle.
  geometry::SlideReport slide(std::span<const Index> which, std::span<const Vec3> before, std::span<Vec3> x, std::span<Vec3> v, std::vector<Vec3>* wanted = nullptr);
  /// Tells what surfaces have been given: by particle, the surface it touches, heat [J] and temperature [K] there.
  void warm(std::span<const Index> touches, std::span<const Real> given, std::span<const Real> temperature);
  std::size_t memory() const;

 private:
  static constexpr int kMost = 4;  // surfaces that a particle feels at a time

  Real friction_of(Index surface) const {
    if (options_.friction_by) return options_.friction_by(surface);
    return surface < options_.friction.size() ? options_.friction[surface] : 1;
  }
  Real effusivity_of(Index surface) const { return surface < options_.effusivity.size() ? options_.effusivity[surface] : 0; }
  Index number_of(Index surface) const { return surface < number_.size() ? number_[surface] : kNotMovable; }
  void look_behind(std::span<const Vec3> x, Real reach, const Walls& ground);
  void stand_pressed(std::size_t k, Real dt);
  void go_pressed(std::size_t k, Real time, Real dt);
  bool leave_gone(std::size_t k);
  Index pressed_of(Index surface) const;  // kNotMovable: none
  Index triangle_of(std::size_t k, const Vec3& at, Vec3& weights) const;
  void know(std::size_t k);
  void push(Index surface, const Vec3& impulse, const Vec3& at);

  SolidOptions options_;
  Real radius_, mass_, widest_;
  Real speed_ = 0, fastest_ = 0;
  std::vector<Movable> movable_, before_;
  std::vector<Real> heavier_;  // these bodies' masses are so many times their own
  std::vector<Index> number_;  // of the body among them with a surface
  std::vector<Pressed> pressed_;  // as options_.deforming
  struct Drawn {                  // of each, as it stands among the obstacles
    std::uint64_t version = 0;
    std::vector<Vec3> vertices;
  };
  std::vector<Drawn> drawn_;
  Real predicted_ = 0;  // the step that pressed_ answers for [s]; 0: none yet
  std::vector<Index> near_, met_;
  std::vector<Vec3> at_, way_, speed_at_;
  std::vector<geometry::Contact> contacts_;
  std::vector<Real> backing_, across_;  // of each contact
  std::vector<Index> count_;
  std::vector<std::uint8_t> flags_;
  Walls merged_;
};

}  // namespace effuse::flow::sph
