#pragma once

#include <span>
#include <vector>

#include "geometry/mesh/tri_mesh.h"
#include "skin/surface/level_set.h"

namespace effuse::skin {

/// A level set's surface as a function of the particles alone: no voxel has a part in where it lies. A mesh of the level set knows it at the
/// voxels' own places, half a spacing apart, and so lies a little differently on lava that has moved against the lattice (by 0.008
/// spacings in the mean, 0.1 on edges); taken onto this surface it goes with the particles.
///
///   phi   Zhu & Bridson's field with its bound (rasterize.h), at any point, from the particles
///   phi_s = phi + s (sum_q w_q phi(x + y_q) - phi), y_q in the tangent plane of phi_s at x: a centre and two rings of six and twelve points,
///         a Gaussian's moments; what mean-curvature flow for `smoothing` does to a surface that is not far from plane. s: 0 at lone particles .. 1
///   f     phi_s joined to the balls of particles that stand out (cover), less the shift that the level set had, as it is before it is rounded to steps
///
/// kRound only: for kAnisotropic points stay where they are.
class ParticleSurface {
 public:
  /// surface: must outlive this. Without particles: nothing moves.
  explicit ParticleSurface(const LevelSet& surface);

  /// Takes points near the surface onto it, f = 0, by Newton's method, with their normals: of unit length, near the surface's; out: f's.
  /// Points that would go farther than a quarter of a spacing go less far, or stay; so do those within a spacing of the ground, where the
  /// surface is cut and lifted, and those where f has a slope below 0.5 (creases, necks, thin sheets). Sizes must agree (checked).
  /// 2 us a point and thread. Same bits on any number of threads.
  void project(std::span<Vec3> x, std::span<Vec3> normals) const;
  /// The same along lines: to where the line through each point along its unit vector meets the surface, so that a place said in terms of
  /// the particles, on a line through them, is the same place however the particles lie on the voxels. Lines more than 60 degrees from the
  /// normal: their points stay.
  ///   share  out, if given: how much of the way each point went, 0 .. 1
  void project_along(std::span<Vec3> x, std::span<Vec3> normals, std::span<const Vec3> along, std::span<Real> share = {}) const;
  /// The same for a mesh's vertices and normals (which it must have: checked), but no triangle is turned over: vertices of one that would
  /// be go half the way, a quarter, or stay, and keep their normals.
  void project(geometry::TriMesh& mesh) const;
  /// Of the particles [m].
  Real spacing() const;

 private:
  template <class F>
  void move(std::span<Vec3> x, std::span<Vec3> normals, std::span<Real> share, F&& along) const;

  const LevelSet& surface_;
  std::vector<float> ball_;  // radii, of sorted particles
};

}  // namespace effuse::skin
