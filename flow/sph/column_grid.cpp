#include "flow/sph/column_grid.h"

#include <algorithm>
#include <cmath>
#include <stdexcept>

#include "geometry/base/check.h"
#include "geometry/base/parallel.h"
#include "geometry/base/zones.h"

namespace effuse::flow::sph {

namespace {
constexpr std::size_t kChunk = 1024;  // particles one thread searches for at a time

std::uint64_t hash_column(std::uint64_t column) {
  column *= 0x9e3779b97f4a7c15ULL;
  return column ^ (column >> 29);
}

/// Stable counting sort of keys by the digit (11 bits) that digit(key) returns.
template <class Key, class Digit>
void counting_pass(const std::vector<Key>& in, std::vector<Key>& out, Digit digit) {
  std::vector<Index> start(2049, 0);
  for (const Key& key : in) ++start[digit(key) + 1];
  for (std::size_t d = 0; d < 2048; ++d) start[d + 1] += start[d];
  for (const Key& key : in) out[start[digit(key)]++] = key;
}
}  // namespace

void ColumnGrid::build(std::span<const Vec3> x, Real cell) {
  ZONE("sph.grid");
  CHECK_GT(cell, 0.0);
  cell_ = cell;
  const std::size_t n = x.size();
  keys_.resize(n);
  scratch_.resize(n);
  order_.resize(n);
  level_.resize(n);
  sorted_.resize(n);
  columns_.clear();
  if (n == 0) {
    table_.clear();
    return;
  }

  Vec3 low = x[0], high = x[0];
  for (const Vec3& p : x) {
    CHECK(p.allFinite());
    low = low.cwiseMin(p);
    high = high.cwiseMax(p);
  }
  const Vec3 extent = (high - low) / cell;
  CHECK_LT(extent.maxCoeff(), 2147483647.0);

  // A cell is a hair wider than asked, so that rounding never puts two points closer than the search
  // radius two cells apart.
  const Real per_cell = (1 - 1e-9) / cell;
  parallel_for(n, [&](std::size_t i) {
    const Vec3 c = (x[i] - low) * per_cell;
    keys_[i] = {static_cast<std::uint64_t>(c.y()) << 32 | static_cast<std::uint64_t>(c.x()), static_cast<std::int32_t>(c.z()), static_cast<Index>(i)};
  }, 4096);

  // Radix sort by (iy, ix, iz), lowest digit first, over the digits that differ at all.
  const auto passes = [&](auto word, Real largest) {
    for (int shift = 0; shift == 0 || (shift < 32 && static_cast<std::uint64_t>(largest) >> shift); shift += 11) {
      counting_pass(keys_, scratch_, [&](const Key& key) { return (word(key) >> shift) & 2047u; });
      keys_.swap(scratch_);
    }
  };
  passes([](const Key& k) { return static_cast<std::uint32_t>(k.iz); }, extent.z());
  passes([](const Key& k) { return static_cast<std::uint32_t>(k.column); }, extent.x());
  passes([](const Key& k) { return static_cast<std::uint32_t>(k.column >> 32); }, extent.y());

  for (std::size_t k = 0; k < n;) {
    std::size_t end = k + 1;
    while (end < n && keys_[end].column == keys_[k].column) ++end;
    columns_.push_back({static_cast<std::int32_t>(keys_[k].column), static_cast<std::int32_t>(keys_[k].column >> 32), static_cast<Index>(k),
                        static_cast<Index>(end)});
    k = end;
  }

  // Hash table of columns, at most half full, open addressing.
  std::size_t capacity = 16;
  while (capacity < 2 * columns_.size()) capacity *= 2;
  table_.assign(capacity, kNone);
  for (std::size_t c = 0; c < columns_.size(); ++c) {
    const std::uint64_t key = static_cast<std::uint64_t>(static_cast<std::uint32_t>(columns_[c].iy)) << 32 | static_cast<std::uint32_t>(columns_[c].ix);
    std::size_t slot = hash_column(key) & (capacity - 1);
    while (table_[slot] != kNone) slot = (slot + 1) & (capacity - 1);
    table_[slot] = static_cast<Index>(c);
  }

  parallel_for(n, [&](std::size_t k) {
    order_[k] = keys_[k].particle;
    level_[k] = keys_[k].iz;
    sorted_[k] = x[keys_[k].particle];
  }, 4096);
}

Index ColumnGrid::find_column(std::int32_t ix, std::int32_t iy) const {
  if (ix < 0 || iy < 0) return kNone;
  const std::uint64_t key = static_cast<std::uint64_t>(static_cast<std::uint32_t>(iy)) << 32 | static_cast<std::uint32_t>(ix);
  std::size_t slot = hash_column(key) & (table_.size() - 1);
  while (table_[slot] != kNone) {
    const Column& column = columns_[table_[slot]];
    if (column.ix == ix && column.iy == iy) return table_[slot];
    slot = (slot + 1) & (table_.size() - 1);
  }
  return kNone;
}

int ColumnGrid::runs_around(Index c, std::int32_t iz, Run out[9]) const {
  const Column& center = columns_[c];
  int runs = 0;
  for (std::int32_t dy = -1; dy <= 1; ++dy) {
    for (std::int32_t dx = -1; dx <= 1; ++dx) {
      const Index other = dx == 0 && dy == 0 ? c : find_column(center.ix + dx, center.iy + dy);
      if (other == kNone) continue;
      const Column& column = columns_[other];
      const auto first = level_.begin() + column.begin, last = level_.begin() + column.end;
      const auto low = std::lower_bound(first, last, iz - 1), high = std::lower_bound(low, last, iz + 2);
      if (low < high) out[runs++] = {static_cast<Index>(low - level_.begin()), static_cast<Index>(high - level_.begin())};
    }
  }
  return runs;
}

std::size_t ColumnGrid::memory() const {
  return keys_.capacity() * sizeof(Key) + scratch_.capacity() * sizeof(Key) + (order_.capacity() + level_.capacity() + table_.capacity()) * sizeof(Index) +
         columns_.capacity() * sizeof(Column) + sorted_.capacity() * sizeof(Vec3);
}

void Neighbors::find(const ColumnGrid& grid, Real radius) {
  ZONE("sph.neighbors");
  CHECK_GT(radius, 0.0);
  CHECK_LE(radius, grid.cell());
  const std::size_t n = grid.size();
  const Real r2 = radius * radius;
  const auto order = grid.order();
  const auto x = grid.sorted_positions();
  const auto columns = grid.columns();
  const auto levels = grid.levels();
  chunk_.resize(n);
  first_.resize(n);
  count_.resize(n);
  const std::size_t chunks = (n + kChunk - 1) / kChunk;
  if (chunks_.size() < chunks) chunks_.resize(chunks);

  parallel_ranges(n, kChunk, [&](std::size_t begin, std::size_t end) {
    const Index chunk = static_cast<Index>(begin / kChunk);
    std::vector<Index>& list = chunks_[chunk];
    auto column = std::upper_bound(columns.begin(), columns.end(), begin, [](std::size_t k, const ColumnGrid::Column& c) { return k < c.begin; }) - 1;
    std::size_t used = 0;
    ColumnGrid::Run runs[9];
    for (std::size_t k = begin; k < end;) {
      if (column->end <= k) ++column;
      std::size_t cell_end = k + 1;
      while (cell_end < std::min<std::size_t>(end, column->end) && levels[cell_end] == levels[k]) ++cell_end;
      const int run_count = grid.runs_around(static_cast<Index>(column - columns.begin()), levels[k], runs);
      std::size_t candidates = 0;
      for (int r = 0; r < run_count; ++r) candidates += runs[r].end - runs[r].begin;
      for (; k < cell_end; ++k) {
        if (list.size() < used + candidates) list.resize(std::max(used + candidates, list.size() + list.size() / 2));
        Index* out = list.data() + used;
        const Vec3 p = x[k];
        for (int r = 0; r < run_count; ++r) {
          for (Index q = runs[r].begin; q < runs[r].end; ++q) {
            *out = order[q];  // written always, kept when near: no branch to mispredict
            out += ((p - x[q]).squaredNorm() < r2) & (q != k);
          }
        }
        const Index i = order[k];
        chunk_[i] = chunk;
        first_[i] = static_cast<Index>(used);
        count_[i] = static_cast<Index>(out - (list.data() + used));
        used += count_[i];
      }
    }
  });
}

std::size_t Neighbors::pairs() const {
  std::size_t sum = 0;
  for (const Index c : count_) sum += c;
  return sum;
}

std::size_t Neighbors::memory() const {
  std::size_t bytes = (chunk_.capacity() + first_.capacity() + count_.capacity()) * sizeof(Index);
  for (const auto& chunk : chunks_) bytes += chunk.capacity() * sizeof(Index);
  return bytes;
}

}  // namespace effuse::flow::sph
