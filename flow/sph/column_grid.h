#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "geometry/base/types.h"

namespace effuse::flow::sph {

/// Particles binned in a grid of columns (Stora et al. 1999): cells as wide as the search radius in x
/// and y, and each column covers only the flow's own vertical range. Memory is proportional to the
/// number of particles: empty land costs nothing, nor does the air between two layers of a column.
///
/// A column (ix, iy) is found through a hash table; its particles stand in memory by rising level iz,
/// so the levels iz-1..iz+1 of one column are one contiguous run, and a search visits nine runs.
class ColumnGrid {
 public:
  /// Bins positions x [m] into cells of `cell` [m] > 0. Positions must be finite (checked). Extents up
  /// to 2^31 cells in each direction from the lowest corner. Deterministic; particles in one cell keep
  /// the order they had. O(n).
  void build(std::span<const Vec3> x, Real cell);

  std::size_t size() const { return order_.size(); }
  Real cell() const { return cell_; }
  /// Particle numbers in memory order: column by column, level by level.
  std::span<const Index> order() const { return order_; }
  /// Positions and levels in memory order.
  std::span<const Vec3> sorted_positions() const { return sorted_; }
  std::span<const std::int32_t> levels() const { return level_; }
  /// Bytes held, capacity included.
  std::size_t memory() const;

  /// Places in memory order, [begin, end).
  struct Run {
    Index begin, end;
  };
  struct Column {
    std::int32_t ix, iy;  // from the lowest corner
    Index begin, end;     // places of its particles
  };
  std::span<const Column> columns() const { return columns_; }
  /// The runs (nine at most) of particles around the cell (column c, level iz): every particle within
  /// `cell` of any point of that cell is in them. Returns how many.
  int runs_around(Index column, std::int32_t iz, Run out[9]) const;

 private:
  static constexpr Index kNone = ~Index{0};
  Index find_column(std::int32_t ix, std::int32_t iy) const;

  struct Key {
    std::uint64_t column;  // iy << 32 | ix
    std::int32_t iz;
    Index particle;
  };
  Real cell_ = 0;
  std::vector<Key> keys_, scratch_;
  std::vector<Index> order_, table_;
  std::vector<std::int32_t> level_;
  std::vector<Column> columns_;
  std::vector<Vec3> sorted_;
};

/// For each particle, the others within a radius.
class Neighbors {
 public:
  /// Fills the list for all particles of grid: j is a neighbour of i when |x_i - x_j|^2 < radius^2,
  /// j != i. radius <= grid.cell() (checked). Neighbours stand in the grid's memory order. Parallel;
  /// the same lists on any number of threads.
  void find(const ColumnGrid& grid, Real radius);

  std::size_t size() const { return count_.size(); }
  std::span<const Index> operator[](std::size_t i) const {
    const Index* data = chunks_[chunk_[i]].data();
    return {data + first_[i], count_[i]};
  }
  /// Sum of the lists' lengths.
  std::size_t pairs() const;
  std::size_t memory() const;

 private:
  std::vector<std::vector<Index>> chunks_;  // one a chunk of particles: filled by one thread, never moved
  std::vector<Index> chunk_, first_, count_;
};

}  // namespace effuse::flow::sph
