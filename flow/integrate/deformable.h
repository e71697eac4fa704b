#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "flow/integrate/block_matrix.h"
#include "geometry/mesh/tri_mesh.h"

namespace effuse::flow {

/// A surface that hangs on points, closed or open: vertex q is at
///   sum over k in [first[q], first[q + 1]) of weight[k] x[point[k]],
/// the weights of a vertex add up to 1. No two vertices began at one place, each is used.
struct HungSurface {
  std::vector<geometry::Triangle> triangles;  ///< of vertices; outward
  std::vector<Index> first = {0}, point;
  std::vector<Real> weight;

  std::size_t size() const { return first.size() - 1; }
  /// Of points' places, velocities, ... those of the vertices; out: overwritten, size() of them.
  void gather(std::span<const Vec3> of_points, std::vector<Vec3>& out) const;
  /// Adds what is on the vertices to the points: the transpose. Sums are kept.
  void scatter(std::span<const Vec3> of_vertices, std::span<Vec3> to_points) const;
};

/// The surface of triangles on vertices at `places`, each on the points [first[q], first[q + 1]) of `point` by `weight`, which are divided by
/// their sum. Vertices at the very place of another are that one, those of no triangle are left out.
HungSurface hang(std::span<const Vec3> places, std::span<const geometry::Triangle> triangles, std::span<const Index> first, std::span<const Index> point, std::span<const Real> weight);

/// Impulses [N s] that wait for a solid's next step, by point; empty: none do.
class OwedImpulses {
 public:
  void add(Index point, const Vec3& impulse, std::size_t points) {
    impulses_.resize(points, Vec3::Zero());
    impulses_[point] += impulse;
  }
  /// Forces [N] of a step of dt [s], with those that come otherwise (none: empty); none of either: empty.
  std::vector<Vec3> as_forces(Real dt, std::span<const Vec3> others = {}) const;
  void clear() { impulses_.clear(); }
  const std::vector<Vec3>& impulses() const { return impulses_; }
  std::vector<Vec3>& impulses() { return impulses_; }

 private:
  std::vector<Vec3> impulses_;
};

/// A solid that deforms, as a flow sees it that presses on it: a surface on points, how these answer to impulses in a step, and the step. The
/// flow holds what the points do in both of its solves, linearised about where they are, as unknowns beside its own; what these say is then
/// given to the solid as forces through a step of its own, as long, with all that it knows of itself.
class Deformable {
 public:
  virtual ~Deformable() = default;

  /// Of n points: places [m], velocities [m/s], masses [kg]; held: 1 goes with its own velocity, whatever presses.
  virtual std::span<const Vec3> places() const = 0;
  virtual std::span<const Vec3> velocities() const = 0;
  virtual std::span<const Real> masses() const = 0;
  virtual std::span<const std::uint8_t> held() const = 0;
  /// Changes with surface_version() only.
  virtual const HungSurface& surface() const = 0;
  virtual std::uint64_t surface_version() const = 0;

  /// The step of dt [s] that would follow without the flow, linearised where the points are.
  ///   velocity  out: of each point, how far it goes over dt [m/s]; of held ones their own
  ///   answer    out: A [kg], factored: impulses J [N s] of forces that act evenly through the step change those by A^-1 J; rows of held points
  ///             mean nothing, and stand alone. A is nowhere less than the masses
  virtual void predict(Real dt, std::vector<Vec3>& velocity, BlockMatrix& answer) = 0;
  /// Steps on to a time [s], with forces on the points [N]; none: empty.
  virtual void go(Real to, std::span<const Vec3> forces) = 0;
  /// An impulse [N s] on a point, as a force that acts evenly through its next step; predict() knows of it. On a held one it is lost. At once it
  /// would throw a point that is lighter than what hit it.
  virtual void push(Index point, const Vec3& impulse) = 0;
};

}  // namespace effuse::flow
