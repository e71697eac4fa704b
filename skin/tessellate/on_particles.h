#pragma once

#include <span>

#include "skin/surface/particle_surface.h"
#include "skin/tessellate/surface_walk.h"

/// For the .cpp files of this folder: vertices where the particles say, not the voxels of the mesh that was walked on.
namespace effuse::skin {

/// A line that a vertex lies on: of the points as far from three particles, say. along: a unit vector; zero: there is no line.
struct Line {
  Vec3 at = Vec3::Zero(), along = Vec3::Zero();
};

/// The points as far from a as from b and c, outward: along up, if that says. None where the three are nearly in a row.
Line line_between(const Vec3& a, const Vec3& b, const Vec3& c, const Vec3& up);
/// The points as far from a as from b, and as far from p as from q.
Line line_between(const Vec3& a, const Vec3& b, const Vec3& p, const Vec3& q, const Vec3& up);

/// Takes spots to where their lines meet the surface of the particles, with the unit normals there. From those without a line, or with one
/// that runs along the mesh, along the normal. Their triangles and weights become those of the nearest points of the mesh.
///   share  out, if given: how much of the way each went (ParticleSurface)
void take_onto(const ParticleSurface& particles, const SurfaceWalk& walk, std::span<Spot> spots, std::span<Vec3> up, std::span<const Line> lines,
               std::span<Real> share = {});
/// The same for those from `first` on of a mesh, and no triangle gets thinner than eight degrees by it, or folded: corners of one that would stay where they
/// were (share 0).
///   spots, up, lines, share  of all vertices
void take_onto(const ParticleSurface& particles, const SurfaceWalk& walk, std::span<const geometry::Triangle> triangles, std::size_t first, std::span<Spot> spots,
               std::span<Vec3> up, std::span<const Line> lines, std::span<Real> share);

}  // namespace effuse::skin
