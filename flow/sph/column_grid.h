#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "flow/sph/simd.h"
#include "geometry/base/check.h"
#include "geometry/base/parallel.h"
#include "geometry/base/types.h"

namespace effuse::flow::sph {

/// Particles binned in a grid of columns (Stora et al. 1999): columns as wide as the search radius in x
/// and y, cut into levels a quarter as high, and each column covers only the flow's own vertical range.
/// Memory is proportional to the number of particles: empty land costs nothing, nor does the air between
/// two layers of a column.
///
/// A column (ix, iy) is found through a hash table; its particles stand in memory by rising level, so
/// the levels iz-4..iz+4 of one column are one contiguous run, and a search visits nine runs.
class ColumnGrid {
 public:
  static constexpr std::int32_t kLevelsPerCell = 4;
  /// Fixed-point units of a cell's width.
  static constexpr std::int32_t kUnitsPerCell = 1 << 22;
  /// Elements that may be read, though they mean nothing, behind the last of order() and fixed().
  static constexpr std::size_t kPadding = 16;

  /// Bins positions x [m] into cells of `cell` [m] > 0. Positions must be finite (checked). Extents up
  /// to 2^29 cells in each direction from the lowest corner (checked). Particles in one level keep the
  /// order they had. Parallel; the same order on any number of threads. O(n).
  void build(std::span<const Vec3> x, Real cell);

  std::size_t size() const { return sorted_.size(); }
  Real cell() const { return cell_; }
  /// Particle numbers in memory order: column by column (by rising iy, then ix), level by level.
  std::span<const Index> order() const { return {order_.data(), size()}; }
  /// Positions and levels in memory order.
  std::span<const Vec3> sorted_positions() const { return sorted_; }
  std::span<const std::int32_t> levels() const { return level_; }
  /// Bytes held, capacity included.
  std::size_t memory() const;

  struct Column {
    std::int32_t ix, iy;  // from the lowest corner
    Index begin, end;     // places of its particles in memory order
  };
  std::span<const Column> columns() const { return columns_; }
  /// The column and those of the eight around it that hold particles, in memory order. Every particle
  /// within `cell` of one in the column at level iz is in them, at levels iz - kLevelsPerCell to
  /// iz + kLevelsPerCell. Returns how many.
  int columns_around(Index column, Index out[9]) const;

  /// Positions in memory order as whole numbers of about cell / kUnitsPerCell from the lowest corner,
  /// modulo 2^32: the difference of two particles of neighbouring cells is right wherever they are, has
  /// at most 24 bits (so a float holds it), and x_ij = -x_ji to the last bit. One array an axis.
  struct Fixed {
    const std::int32_t *x, *y, *z;
  };
  Fixed fixed() const { return {fixed_[0].data(), fixed_[1].data(), fixed_[2].data()}; }
  /// Fixed-point units a metre. Two positions' fixed-point distance and their true one, times this,
  /// differ by less than kFixedError.
  Real units_per_metre() const { return units_per_metre_; }
  static constexpr Real kFixedError = 12;

 private:
  static constexpr Index kNone = ~Index{0};
  Index find_column(std::int32_t ix, std::int32_t iy) const;
  void sort_by_keys(int bits);

  Real cell_ = 0, units_per_metre_ = 0;
  std::vector<std::uint64_t> keys_, other_keys_;
  std::vector<Index> order_, other_order_, table_, counts_;
  std::vector<std::int32_t> level_, fixed_[3];
  std::vector<Column> columns_;
  std::vector<Vec3> sorted_;
};

/// For each particle, the others within a radius.
class Neighbors {
 public:
  /// Fills the list for all particles of grid: j is a neighbour of i when |x_i - x_j|^2 < radius^2 in
  /// double precision, j != i; so i is then one of j. radius <= grid.cell() (checked). Neighbours stand
  /// in the grid's memory order. Parallel; the same lists on any number of threads and with any simd,
  /// which must be one that the processor has.
  ///
  /// The wide paths compare in float on ColumnGrid::fixed(), and once more in double when the distance is
  /// so close to the radius (3e-6 of it) that float could err.
  void find(const ColumnGrid& grid, Real radius, Simd simd = best_simd());

  /// Behind the last of a list stands i itself, as often as fills the list up to whole groups of this many: loops
  /// over groups need no tail.
  static constexpr std::size_t kGroup = 8;

  /// Keeps the lists of the first n; a neighbour j >= n is an image of image_of[j - n] < n, which takes its place.
  void fold(std::size_t n, std::span<const Index> image_of);

  /// Takes out of the list of each which[k] those j for which hidden(k, j). In parallel; lists must stay mutual: what i loses must lose i.
  template <class F>
  void drop(std::span<const Index> which, F&& hidden) {
    parallel_for(which.size(), [&](std::size_t k) {
      const Index i = which[k];
      Index* list = chunks_[chunk_[i]].data() + first_[i];
      const Index count = count_[i];
      Index kept = 0;
      for (Index n = 0; n < count; ++n)
        if (!hidden(k, list[n])) list[kept++] = list[n];
      count_[i] = kept;
      // The rest of the last group is i itself, as before.
      for (Index n = kept; n < count; ++n) list[n] = i;
    }, 64);
  }

  std::size_t size() const { return count_.size(); }
  std::span<const Index> operator[](std::size_t i) const {
    DCHECK(i < size());
    return {chunks_.data()[chunk_.data()[i]].data() + first_.data()[i], count_.data()[i]};
  }
  /// Sum of the lists' lengths.
  std::size_t pairs() const;
  std::size_t memory() const;

 private:
  std::vector<std::vector<Index>> chunks_;  // one a chunk of particles: filled by one thread, never moved
  std::vector<Index> chunk_, first_, count_;
};

}  // namespace effuse::flow::sph
