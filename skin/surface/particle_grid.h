#pragma once

#include <cmath>
#include <memory>
#include <span>
#include <vector>

#include "geometry/mesh/points.h"
#include "skin/surface/key_table.h"

namespace effuse::skin {

/// The particles, sorted into upright columns and by height inside each: all within a box are a few
/// runs of neighbouring elements. Coordinates in voxels from origin (blocks.h). Never changes once made: copies are the same object, and
/// cost nothing.
class ParticleGrid {
 public:
  ParticleGrid() : data_(std::make_shared<const Data>()) {}
  /// voxel: [m]; side: of a column [voxels]. Throws InputError for positions that are not finite, radii that
  /// are not finite or <= 0, and extents beyond 2^20 voxels.
  ///   last  columns in which nothing has changed are taken from it, where it has the same voxel, side and origin. The result is the same, to the bit
  ParticleGrid(const geometry::Points& points, Real voxel, Real side, const ParticleGrid* last = nullptr);

  ParticleGrid(const ParticleGrid&) = default;  // and no moves: a ParticleGrid without data is none
  ParticleGrid& operator=(const ParticleGrid&) = default;

  std::size_t size() const { return data_->x.size(); }
  /// A multiple of 512 voxels [m], near the particles' middle: frames share one lattice, and most of them one origin.
  const Vec3& origin() const { return data_->origin; }
  const std::vector<Vec3>& x() const { return data_->x; }             ///< sorted [voxels]
  const std::vector<float>& radius() const { return data_->radius; }  ///< sorted [voxels]

  struct Column {
    int x, y;          // which square of side
    Index begin, end;  // its particles, by rising z
  };
  const std::vector<Column>& columns() const { return data_->columns; }
  /// The column at (x, y); nullptr: nothing is there.
  const Column* column(int x, int y) const {
    const Index c = data_->table.find(pack(x, y, 0));
    return c == kNone ? nullptr : &data_->columns[c];
  }
  Real side() const { return data_->side; }  ///< of a column [voxels]

  /// f(begin, end) for runs that together hold every particle in the box (and others of the same columns), west to east,
  /// south to north: an order that does not depend on the points' own.
  template <class F>
  void runs(const Vec3& low, const Vec3& high, F&& f) const {
    const int x0 = column_of(low.x()), x1 = column_of(high.x()), y0 = column_of(low.y()), y1 = column_of(high.y());
    for (int cx = x0; cx <= x1; ++cx)
      for (int cy = y0; cy <= y1; ++cy) {
        const Column* c = column(cx, cy);
        if (!c) continue;
        const Index begin = first_above(*c, low.z()), end = first_above(*c, high.z());
        if (begin < end) f(begin, end);
      }
  }

  /// Numbers carried beside the positions, `width` a particle, in the order temperature 1, velocity 3, crust 1, age 1,
  /// rest 3, rest2 3, each only if the points had it. offset -1: they had not.
  struct Carried {
    int width = 0;
    int temperature = -1, velocity = -1, crust = -1, age = -1, rest = -1, rest2 = -1;
  };
  const Carried& carried() const { return data_->carried; }
  /// The carried numbers of sorted particle i.
  const float* values(std::size_t i) const { return &data_->values[i * static_cast<std::size_t>(data_->carried.width)]; }

  /// Averages of the carried numbers with weights (1 - |x - x_i|^2 / reach^2)^3 at each of the points [voxels]. Where
  /// none is within reach, with the reach doubled until one is. out: carried().width numbers a point.
  void average(std::span<const Vec3> points, Real reach, std::span<float> out) const;

 private:
  int column_of(Real v) const;
  Index first_above(const Column& column, Real z) const;

  struct Data {
    Vec3 origin = Vec3::Zero();
    Real voxel = 0, side = 1;
    std::vector<Vec3> x;
    std::vector<float> radius, values;
    std::vector<Index> point;  // of each sorted particle, its number among the points
    std::vector<Column> columns;
    KeyTable table;
    Carried carried;
  };
  static void take_carried(const geometry::Points& points, Data& data);
  std::shared_ptr<const Data> data_;
};

}  // namespace effuse::skin
