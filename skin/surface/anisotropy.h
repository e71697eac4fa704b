#pragma once

#include <array>
#include <vector>

#include "skin/surface/rasterize.h"

namespace effuse::skin {

/// The kernels of the field, in units of RasterOptions::reach: as large as round ones whatever their shape.
inline constexpr float kKernelReach = 0.85f;

/// Anisotropic kernels of sorted particles, one of each a particle. Lengths in voxels.
struct Kernels {
  std::vector<Vec3> centre;                  ///< xbar: moved along the surface's normal towards the particle's layer
  std::vector<std::array<float, 6>> metric;  ///< M = G G: xx xy xz yy yz zz; symmetric, det 1; the unit matrix for lone particles
  std::vector<float> amplitude;              ///< a: 1 inside, up to 6 where neighbours are missing
  std::vector<float> crowd;                  ///< sum of (1 - |x_i - x_j|^2 / R^2)^3, the particle itself included: 1 if alone
};

/// Kernels that follow the lava's surface: flat along sheets and faces, long along edges, round inside and where particles are few.
///
///   C_i = covariance of the neighbours' positions within 2.5 spacings, weights 1 - r^2, blended into a round one where these
///         weights sum to less than 4; eigenvalues l1 >= l2 >= l3
///   M_i = the inverse of C_i, no eigenvalue of it less than l1 / 1.6^2, scaled to det 1: semi-axes differ by 1.6 at most
///   a_i = min(6, (a full neighbourhood's crowd / crowd_i)^2)
///
/// Centres move along the normal n alone (the eigenvector of l3), with neighbours of the same layer, twice:
///
///   x_i += f n sum w_ij n.(x_j - x_i) / sum w_ij,   w_ij = (1 - r^2 / (2.5 spacings)^2)^2 (1 - (n.(x_j - x_i) / 0.7 spacings)^2)^2
///   f    = rises from 0 to 1 as 1 - (max(l3, l1/2.45) / max(l2, l1/2.45))^4 goes from 0.3 to 0.8, less for small layers
///
/// so that faces turn flat while edges (l2 = l3), fronts, drops and filaments stay where they are: a plain mean over the
/// neighbours with lambda = 0.9, as in the paper, rounds a box's edges by 1.4 spacings instead of 0.8 and has to be shifted out by
/// 0.3 to keep its volume, faces no flatter. A curved surface is still pulled in a little, a sphere of 8 spacings by 0.15 spacings.
/// All is continuous in the particles' positions, to repeated eigenvalues and to neighbours that come and go.
///
///   spacing  of the particles [voxels], > 0 (checked)
///   reach    RasterOptions::reach [voxels], >= spacing (checked)
///   wanted   nullptr, or blocks: only kernels that are felt in these are made, the others mean nothing
/// Same bits on any number of threads and any order of the points; and whatever lies farther away.
/// 0.9 us a particle and thread.
/// Source: Yu & Turk 2013, ACM Trans. Graph. 32, 5:1-5:12; the smoothing along the normal and the exponents are ours.
Kernels anisotropic_kernels(const ParticleGrid& particles, float spacing, float reach, const Blocks* wanted = nullptr);

/// No value of rasterize_anisotropic depends on particles farther away than this along an axis [voxels], but by a block deep
/// inside being one: that depends on the blocks around it.
Real kernel_influence(float spacing, float reach);

/// Zhu & Bridson's field with these kernels, and the bound between separate particles that rasterize() has:
///
///   q_i = (x - xbar_i)^T M_i (x - xbar_i) / (0.85 R)^2    w_i = a_i max(0, 1 - q_i)^5    W = sum w_i
///   phi = max(|x - sum w_i xbar_i / W| - sum w_i r_i / W,  3 (min |x - x_i| - 1.15 spacing)),   at most `outside`
///
/// and where W vanishes the distance of the nearest particle less a radius. The bound counts from the particles, not the centres.
///
///   phi     out: the field [voxels], conventions of rasterize()
///   weight  out: what W of rasterize() would be at the surface, for smooth(): crowd averaged with w_i, times that of a lone
///           particle; 0 far from particles
///   wanted  blocks whose values are asked for, all around them being there: those of the others are 0; empty: all
/// Each voxel is summed for itself, in float, within 1e-3 voxels of double. Blocks that lie a block and more from any voxel without
/// a particle within one spacing are filled with one value. Same bits on any number of threads and any order of the points.
///
/// Against rasterize(), both before smooth(), voxels of a half (a quarter) spacing, in spacings: faces of a jittered lattice, 0.1
/// each way, rough by 0.008 (0.008) instead of 0.031 (0.035), at 0.25 by 0.027 (0.028) instead of 0.075 (0.088), of random points
/// 0.8 apart by 0.061 (0.070) instead of 0.073 (0.085); edges of a box of lattice rounded by 0.83 (0.59) instead of 1.06 (0.90);
/// mean distance to the box 0.037 (0.024) instead of 0.054 (0.051), to a sphere of 8 spacings 0.065 (0.067) instead of 0.091 (0.095).
/// Drops of two, eight and 27 particles keep 0.95 to 1 of their volume instead of 0.73, 0.58 and 0.92. Random points are hardly
/// flatter, or not at all when relaxed (0.026 instead of 0.024): their layers have gaps. One pass of smooth() takes the crumbs
/// off edges that voxels of a quarter show. 1.3 to 1.8 times the time of rasterize(), kernels included, at 100,000 particles.
/// Source: Zhu & Bridson 2005, ACM Trans. Graph. 24, 965-972; Yu & Turk 2013.
void rasterize_anisotropic(const ParticleGrid& particles, const Kernels& kernels, const Blocks& blocks, const RasterOptions& options,
                           Field& phi, Field& weight, std::span<const std::uint8_t> wanted = {});

/// The same at one point, in double, over all particles: the twin that tests compare with.
Real anisotropic_distance(const ParticleGrid& particles, const Kernels& kernels, const RasterOptions& options, const Vec3& p);

}  // namespace effuse::skin
