#pragma once

#include <cstddef>
#include <optional>
#include <span>
#include <vector>

#include "importers/terrain/dem_options.h"
#include "importers/terrain/raster.h"
#include "importers/terrain/spatial_reference.h"

namespace effuse::importers {

/// Posts to fill with heights: (i, j) at corner + (i spacing, j spacing), i fastest, south row first.
struct PostLattice {
  Vec2 corner = Vec2::Zero();
  Vec2 spacing = Vec2::Ones();
  int nx = 0, ny = 0;
  Vec2 at(int i, int j) const { return corner + Vec2(i * spacing.x(), j * spacing.y()); }
  std::size_t posts() const { return static_cast<std::size_t>(nx) * static_cast<std::size_t>(ny); }
};

/// Where the posts of a lattice lie among the cells of a raster. The transform is asked at posts about 200 m apart and
/// interpolated between them: within 1 mm for projections as curved as UTM.
class CellMap {
 public:
  /// raster_from_posts: null when both are in the same system.
  CellMap(const PostLattice& posts, const RasterFrame& frame, const CrsTransform* raster_from_posts);

  /// Column and row, NaN where the transform knows none.
  Vec2 operator()(int i, int j) const;
  /// The cells that the posts and margin cells around them touch; nullopt when none does.
  std::optional<CellWindow> window(int margin) const;
  const PostLattice& posts() const { return posts_; }
  const RasterFrame& frame() const { return frame_; }

 private:
  PostLattice posts_;
  RasterFrame frame_;
  int step_x_ = 1, step_y_ = 1, knots_x_ = 0;
  std::vector<Vec2> knots_;
};

struct Resampled {
  std::vector<Real> z;        ///< of the lattice's posts; NaN: none
  std::vector<char> beside;   ///< 1: a post beside the raster
  std::size_t outside = 0;    ///< how many those are
};

/// Heights at the posts from cells, which holds map.window(margin) of the raster: margin 2, and half of
/// cells_per_post more for kAverage and kAuto. cells_per_post: how many cells wide the new spacing is. A post whose four cells around (kNearest: whose nearest) lack a height has none; cubic falls
/// back to bilinear where one of its sixteen does. The same bits on any number of threads.
Resampled resample(const CellMap& map, const RasterCells& cells, Resampling method, Real cells_per_post);

}  // namespace effuse::importers
