#pragma once

#include <filesystem>
#include <memory>
#include <string>
#include <utility>
#include <vector>

#include "geometry/mesh/points.h"
#include "geometry/mesh/tri_mesh.h"
#include "geometry/terrain/terrain.h"

namespace effuse::skin {

struct LevelSetOptions {
  Real spacing = 0;       ///< particle spacing [m], > 0
  Real voxel = 0;         ///< [m]; 0: spacing / 2
  Real influence = 2;     ///< a particle is felt within influence * spacing
  Real radius = 0.6;      ///< of the sphere round a lone particle, in spacings (about (3/4pi)^(1/3) = 0.62 for equal volume)
  int smoothing = 2;      ///< passes of mean-curvature flow
  Real drop_volume = 0;   ///< closed pieces smaller than this many particles' volume are dropped
  bool match_volume = true;  ///< shift the surface so that it encloses the particles' volume above ground
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
  std::size_t active_voxels() const;

 private:
  std::unique_ptr<Impl> impl_;
};

/// Level set round the points (Zhu & Bridson 2005): phi(x) = |x - xbar| - rbar, xbar and rbar averages of the
/// particles' positions and radii with weights (1 - (|x - x_i|/R)^2)^3, R = influence * spacing; smoothed,
/// then cut at the ground: below it the surface follows the ground's footprint straight along the normal and
/// ends `sink` under the ground, so that no gap shows and nothing flickers. Without terrain nothing is cut.
///
/// Temperature, velocity and crust are carried by the same weights. Deterministic: the same bits on any
/// number of threads. Empty points: an empty level set.
///   volume  particles' total volume [m^3], used when options.match_volume
LevelSet build_level_set(const geometry::Points& points, Real volume, const geometry::Terrain* terrain, const LevelSetOptions& options);

/// Watertight triangles of the zero level (OpenVDB volumeToMesh, winding put right), closed, oriented and
/// manifold; attributes "temperature", "velocity", "crust" sampled at the vertices; normals from the gradient.
geometry::TriMesh mesh_level_set(const LevelSet& surface);

/// Volume between the surface and the ground above it [m^3] (below-ground part left out).
Real volume_above_ground(const LevelSet& surface, const geometry::Terrain* terrain);

/// VDB with "surface" (GRID_LEVEL_SET), "density" (fog), "temperature", "velocity", metadata as strings; whole or
/// absent. A full disk is noticed (OpenVDB does not) and thrown as ResourceError.
void write_vdb(const std::filesystem::path& file, const LevelSet& surface, const std::vector<std::pair<std::string, std::string>>& metadata);

/// Names, classes, active voxels and bounds of the grids of a VDB file, one line each. Throws InputError.
std::vector<std::string> describe_vdb(const std::filesystem::path& file);

}  // namespace effuse::skin
