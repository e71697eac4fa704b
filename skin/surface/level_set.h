#pragma once

#include <array>
#include <filesystem>
#include <memory>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "geometry/mesh/points.h"
#include "geometry/mesh/tri_mesh.h"
#include "geometry/terrain/terrain.h"

namespace effuse::skin {

/// What the particles are averaged with: spheres (Zhu & Bridson 2005), or ellipsoids that follow the lava's surface (Yu & Turk 2013;
/// anisotropy.h): flatter faces, sharper edges and fronts, drops that keep their volume, for about half as much time again; asks for no smoothing.
enum class SurfaceKernel { kRound, kAnisotropic };
inline constexpr std::array<std::string_view, 2> kSurfaceKernelNames = {"round", "anisotropic"};

struct LevelSetOptions {
  Real spacing = 0;          ///< particle spacing [m], > 0
  Real voxel = 0;            ///< [m]; 0: spacing / 2
  Real influence = 2;        ///< a particle is felt within influence * spacing
  SurfaceKernel kernel = SurfaceKernel::kRound;  ///< kAnisotropic: with smoothing 0, or edges are lost again
  Real radius = 0.6;         ///< of the sphere round a lone particle, in spacings (about (3/4pi)^(1/3) = 0.62 for equal volume)
  Real cover = 0.44;         ///< of the ball round a particle that stands out, in units of twice its radius; 0: none. At most `radius`
  int smoothing = 2;         ///< passes of mean-curvature flow, each as far as one at voxel = spacing / 2 whatever the voxel
  Real sink = 0;             ///< [m] how far under the ground the surface ends; 0: one and a half voxels
  Real drop_volume = 0;      ///< closed pieces and closed bubbles smaller than this many particles' volume are dropped, filled
  bool match_volume = true;  ///< shift the surface so that it encloses the particles' volume above ground
};

/// What building a level set did. The volume is matched in steps of 1/128 voxel of shift, to 5e-4 where a step is less than that.
struct LevelSetReport {
  std::size_t particles = 0;
  Real volume = 0;               ///< [m^3] enclosed, above ground
  Real target = 0;               ///< [m^3] what it was to be; 0: nothing asked for
  Real shift = 0;                ///< [m] by which the surface was moved out, within +-0.5 spacing
  Real residual = 0;             ///< volume / target - 1; 0 without target. Not small: the bound of the shift stood in the way
  std::size_t blocks = 0, renewed = 0;  ///< blocks of 8^3 voxels, and how many of them were computed, not taken from the last frame
  std::size_t dropped_webs = 0;  ///< pieces of the field that held no particle
  std::size_t dropped_pieces = 0, filled_bubbles = 0;  ///< by drop_volume
};

/// The lava's surface as a narrow-band level set, with fields beside it. Opaque: OpenVDB stays inside.
class LevelSet {
 public:
  LevelSet();
  ~LevelSet();
  LevelSet(LevelSet&&) noexcept;
  LevelSet& operator=(LevelSet&&) noexcept;

  struct Impl;
  Impl& impl() { return *impl_; }
  const Impl& impl() const { return *impl_; }
  bool empty() const;
  Real voxel() const;
  /// Voxels within two voxels of the surface.
  std::size_t active_voxels() const;
  const LevelSetReport& report() const;

 private:
  std::unique_ptr<Impl> impl_;
};

/// What a frame's surface leaves for the next frame's. Opaque. A film goes through one, frame by frame. It keeps a second field, and that of a
/// level set made with it once that is gone: the next frame's is made in its place, sooner than where the level set is still held.
class SurfaceCache {
 public:
  SurfaceCache();
  ~SurfaceCache();
  SurfaceCache(SurfaceCache&&) noexcept;
  SurfaceCache& operator=(SurfaceCache&&) noexcept;

  struct Impl;
  Impl& impl() { return *impl_; }

 private:
  std::unique_ptr<Impl> impl_;
};

/// Level set round the points (Zhu & Bridson 2005): phi(x) = |x - xbar| - rbar, xbar and rbar averages of the
/// particles' positions and radii with weights (1 - (|x - x_i|/R)^2)^3, R = influence * spacing. Three repairs: between
/// particles that do not touch the average lies in empty space, so phi >= 3 (d - 1.15 spacing), d the distance of the
/// nearest particle (no floating blobs, no webs; a sheet one particle thick stays whole up to 1.6 spacings between its
/// particles); pieces that hold no particle are dropped; and smoothing acts only where a
/// particle has neighbours, so that drops do not shrink away.
///
/// Averages over two spacings round edges and corners off: the particle in the corner of a box lies 0.05 spacings under them, the corner
/// 0.8 away. So a ball of 2 cover times its radius round each particle that has few others near is joined to it (cover_particles): in corners, on
/// edges, at thin fronts, not on faces; its rim is rounded widely, so that the surface passes half a spacing from it. Particles that fill a solid as a liquid does then show it to within half a spacing everywhere,
/// at any voxel up to half a spacing (`effuse study skin`).
///
/// Then cut at the ground: at a height g over it, in spacings, the field is the least of those at max(g, 1/2), max(g, 3/4) and
/// max(g, 1) along the ground's normal, so that lava stands straight on the ground, also on ground so rough that its lowest
/// particles float a spacing over it; and it ends `sink` under the ground, so that no gap
/// shows and nothing flickers. Without terrain nothing is cut. Ground distance is sampled every second voxel.
///
/// All particles are needed, the inner ones too: where there are none it is hollow. Deterministic: the same bits on any
/// number of threads, whatever the order of the points. Empty points: an empty level set.
///   volume  particles' total volume [m^3], used when options.match_volume
/// Throws InputError for positions or radii that are not finite, a radius <= 0, or particles so far apart that the voxels
/// cannot be numbered (a million in a row); ResourceError, before any field is made, where the voxels would not fit into the memory that is free.
/// Source: Zhu & Bridson 2005, ACM Trans. Graph. 24, 965-972.
///   last  values are taken from it where no particle has moved, come or gone nearby, and it is left for the next frame. The result is
///         the same, to the bit. The terrain must be the one of the frames before, at the same address and unchanged
LevelSet build_level_set(const geometry::Points& points, Real volume, const geometry::Terrain* terrain, const LevelSetOptions& options,
                         SurfaceCache* last = nullptr);

/// Watertight triangles of the zero level (iso_mesh.h): closed, oriented and manifold. Attributes "temperature",
/// "velocity", "crust" and, when the points had them, "age", "rest", "rest2" (width 3), by the surface's weights
/// at the vertices; normals from the gradient.
///   last  as for build_level_set, whose cache of the same frame it is
geometry::TriMesh mesh_level_set(const LevelSet& surface, SurfaceCache* last = nullptr);

/// Volume between the surface and the ground above it [m^3] (below-ground part left out).
Real volume_above_ground(const LevelSet& surface, const geometry::Terrain* terrain);

/// VDB with "surface" (GRID_LEVEL_SET, distances [m], band of three voxels), "density" (fog: 1 inside, 0 outside, one voxel
/// between), and when the points had them "temperature" and "velocity" inside and up to two voxels outside; metadata as
/// strings of the file. Half floats, blosc. Whole or absent: the file's table of contents is walked before it gets its name, so that a
/// full disk is noticed (OpenVDB does not) and thrown as ResourceError. Empty level set: the grids, empty.
void write_vdb(const std::filesystem::path& file, const LevelSet& surface,
               const std::vector<std::pair<std::string, std::string>>& metadata);

/// Names, classes, active voxels and bounds of the grids of a VDB file, one line each, from
/// the headers: fast whatever the size. A truncated file is noticed. Throws InputError.
std::vector<std::string> describe_vdb(const std::filesystem::path& file);

}  // namespace effuse::skin
