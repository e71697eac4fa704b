#pragma once

#include <array>
#include <span>

#include "geometry/collide/obstacles.h"

namespace effuse::geometry {

/// How a particle answers to the surfaces it meets.
///   friction     Coulomb's number: what is taken of the speed along the surface is at most this times what is taken of
///                the speed into it; 0 slips freely, infinity sticks
///   restitution  share of the approaching speed that is given back, 0 .. 1; the step's rest is then gone with it
///   rounds       surfaces met in one step, at most; then it stays where it is, relative to the one it touches
struct SlideOptions {
  Real friction = 0;
  Real restitution = 0;
  int rounds = 12;
};

/// What became of a particle.
///   x, v      at the step's end [m], [m/s]
///   impacts   surfaces met on the way
///   squeezed  there was not room for its radius: it overlaps, on its own side of everything
///   crushed   there was no room at all: surfaces came together or crossed where it was; it is on its side of those it
///             has been carried by, and may be on the wrong one of the last that came
///   stopped   the rounds were used up
struct Slid {
  Vec3 x = Vec3::Zero(), v = Vec3::Zero();
  int impacts = 0;
  bool squeezed = false, crushed = false, stopped = false;
  Index surface = 0;  ///< the last one met, or touched at the end; 0: none
};

/// A particle of radius r > 0 that would go from x to x + dx in the step of the obstacles' motions, with velocity v
/// [m/s], among all obstacles.
///
/// It goes until it touches (swept.h: nothing is jumped over), loses the approaching part of its motion relative to
/// the surface there, and of its velocity likewise, and goes on with the rest: along the surface; along the crease where
/// it touches two; carried by a surface that moves. At the end it is on the side it started from of every obstacle. It
/// keeps its radius clear of all it came to from outside, less 1/64 for each time one surface was met again (in
/// a hollow); where it started nearer, and where there is no room (see Slid), it keeps what it had or what there is. Then
/// it is moved out of what it overlaps as far as there is room, at most by its radius; starts inside a solid end
/// outside, by the shortest way, if nothing stands there.
///
/// Obstacles' update() must have been called (checked). x, dx, v finite (checked).
Slid slide(const Obstacles& obstacles, const Vec3& x, const Vec3& dx, const Vec3& v, Real r, const SlideOptions& options = {});

/// How many of the particles met something, and what became of them.
struct SlideReport {
  std::size_t near = 0, met = 0, squeezed = 0, crushed = 0, stopped = 0;
};

/// All particles of a step, in parallel: x and v in, x + dx and v out where nothing is near, else as slide() says.
/// Those whose swept box meets no obstacle's cost one box test.
///   x, v, dx  n each; x and v changed
///   r         n, or one for all; > 0
///   surfaces  out: for those whose velocity was changed the last surface that did, 0 for others; n, or empty: not asked for
SlideReport slide_all(const Obstacles& obstacles, std::span<Vec3> x, std::span<const Vec3> dx, std::span<Vec3> v, std::span<const Real> r,
                      const SlideOptions& options = {}, std::span<Index> surfaces = {});

}  // namespace effuse::geometry
