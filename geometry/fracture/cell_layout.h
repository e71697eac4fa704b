#pragma once

#include <span>
#include <vector>

#include "geometry/mesh/tri_mesh.h"

/// How a body is to be cut into cells before it breaks: convex regions that fill space.
namespace effuse::geometry {

/// One region: what lies within all its sides. Behind each side are the regions named in `beyond`.
struct CellRegion {
  struct Side {
    Vec3 normal = Vec3::UnitZ();  ///< unit, out of the region
    Real offset = 0;              ///< normal . x <= offset inside [m]
    std::vector<Index> beyond;
  };
  std::vector<Side> sides;
};

/// How seeds lie in a body.
///   kUniform  the same number in any two parts of one volume
///   kNear     denser about `centre`: the chance falls as 1 / (1 + (d / reach)^2)^2 with the distance d from it
///   kSlabs    uniform, and cells are flattened across `axis`: their thickness is 1 / flatness of their width
///   kBricks   no seeds: courses square to `axis`, in running bond
enum class CellLayout { kUniform, kNear, kSlabs, kBricks };
inline constexpr std::string_view kCellLayoutNames[] = {"uniform", "near", "slabs", "bricks"};

struct CellOptions {
  CellLayout layout = CellLayout::kUniform;
  std::size_t cells = 40;       ///< wanted: bricks come as near to it as whole courses do
  std::uint64_t seed = 1;
  int relax = 1;                ///< each seed goes to the middle of its cell in the body's box so often: cells of like size
  Vec3 centre = Vec3::Zero();   ///< [m], kNear
  Real reach = 0;               ///< [m], kNear; 0: a quarter of the body's diagonal
  int axis = 2;                 ///< 0 x, 1 y, 2 z: kSlabs, kBricks
  Real flatness = 3;            ///< >= 1: kSlabs; of bricks: length over height
};

/// Voronoi regions of the seeds in a space stretched by `scale` along the axes (1, 1, 1: as it is): |scale (x - s_i)| is least. Each
/// has a side for every seed whose region may touch its own within `box`. Seeds must differ (checked). O(n^2 log n).
std::vector<CellRegion> voronoi_regions(std::span<const Vec3> seeds, const Box3& box, const Vec3& scale = Vec3::Ones());

/// Regions for a closed mesh. Seeds lie inside it. Deterministic: a function of mesh and options. Throws InputError when no place for
/// the seeds is found.
std::vector<CellRegion> cell_regions(const TriMesh& body, const CellOptions& options);

}  // namespace effuse::geometry
