#include "flow/sph/column_grid.h"

#if defined(__x86_64__)
#include <immintrin.h>
#endif

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <utility>

#include "geometry/base/check.h"
#include "geometry/base/parallel.h"
#include "geometry/base/zones.h"

namespace effuse::flow::sph {

namespace {
constexpr std::size_t kChunk = 1024;       // particles one thread searches for at a time
constexpr std::size_t kSortChunk = 32768;  // keys one thread counts at a time
constexpr int kDigitBits = 11;
constexpr int kUnitBits = std::countr_zero(static_cast<unsigned>(ColumnGrid::kUnitsPerCell));
constexpr int kLevelBits = kUnitBits - std::countr_zero(static_cast<unsigned>(ColumnGrid::kLevelsPerCell));

std::uint64_t hash_column(std::uint64_t column) {
  column *= 0x9e3779b97f4a7c15ULL;
  return column ^ (column >> 29);
}

std::uint64_t column_key(std::uint64_t ix, std::uint64_t iy) { return iy << 32 | ix; }

/// A position in fixed point, not yet cut to 32 bits.
struct Units {
  std::int64_t x, y, z;
  std::uint64_t ix() const { return static_cast<std::uint64_t>(x >> kUnitBits); }
  std::uint64_t iy() const { return static_cast<std::uint64_t>(y >> kUnitBits); }
  std::uint64_t iz() const { return static_cast<std::uint64_t>(z >> kLevelBits); }
};
}  // namespace

void ColumnGrid::build(std::span<const Vec3> x, Real cell) {
  ZONE("sph.grid");
  CHECK_GT(cell, 0.0);
  cell_ = cell;
  const std::size_t n = x.size();
  keys_.resize(n);
  other_keys_.resize(n);
  order_.resize(n + kPadding);
  other_order_.resize(n + kPadding);
  level_.resize(n);
  for (auto& axis : fixed_) axis.resize(n + kPadding);
  sorted_.resize(n);
  columns_.clear();
  if (n == 0) {
    table_.clear();
    return;
  }

  struct Bounds {
    Vec3 low, high;
  };
  const Bounds bounds = parallel_reduce(
      n, Bounds{x[0], x[0]},
      [&](std::size_t i) {
        CHECK(x[i].allFinite());
        return Bounds{x[i], x[i]};
      },
      [](const Bounds& a, const Bounds& b) { return Bounds{a.low.cwiseMin(b.low), a.high.cwiseMax(b.high)}; }, 4096);
  const Vec3 low = bounds.low;
  CHECK_LT((bounds.high - low).maxCoeff() / cell, 536870912.0);

  // A cell is a hair wider than asked, so that rounding never puts two points closer than the search
  // radius two cells apart: by 1e-6 of it, where rounding is 2^29 cells times 2^-52 at most.
  units_per_metre_ = (1 - 1e-6) * kUnitsPerCell / cell;
  const auto units = [&](const Vec3& p) {
    const Vec3 u = (p - low) * units_per_metre_;
    return Units{static_cast<std::int64_t>(u.x()), static_cast<std::int64_t>(u.y()), static_cast<std::int64_t>(u.z())};
  };

  // Sort by (iy, ix, iz) in one go, or by iz first and (iy, ix) then where the three are too long for one word.
  const Units top = units(bounds.high);
  const auto width = [](std::uint64_t largest) { return static_cast<int>(std::bit_width(largest)); };
  const int bits_x = width(top.ix()), bits_y = width(top.iy()), bits_z = width(top.iz());
  const auto key_of = [&](const Units& u) { return (u.iy() << bits_x | u.ix()) << bits_z | u.iz(); };
  const bool fits = bits_x + bits_y + bits_z <= 64;
  parallel_for(n, [&](std::size_t i) {
    const Units u = units(x[i]);
    keys_[i] = fits ? key_of(u) : u.iz();
    order_[i] = static_cast<Index>(i);
  }, 4096);
  sort_by_keys(fits ? bits_x + bits_y + bits_z : bits_z);
  if (!fits) {
    parallel_for(n, [&](std::size_t k) {
      const Units u = units(x[order_[k]]);
      keys_[k] = u.iy() << bits_x | u.ix();
    }, 4096);
    sort_by_keys(bits_x + bits_y);
  }

  parallel_for(n, [&](std::size_t k) {
    const Vec3& p = x[order_[k]];
    const Units u = units(p);
    sorted_[k] = p;
    level_[k] = static_cast<std::int32_t>(u.iz());
    fixed_[0][k] = static_cast<std::int32_t>(u.x);
    fixed_[1][k] = static_cast<std::int32_t>(u.y);
    fixed_[2][k] = static_cast<std::int32_t>(u.z);
    keys_[k] = column_key(u.ix(), u.iy());
  }, 4096);

  for (std::size_t k = 0; k < n;) {
    std::size_t end = k + 1;
    while (end < n && keys_[end] == keys_[k]) ++end;
    columns_.push_back({static_cast<std::int32_t>(keys_[k]), static_cast<std::int32_t>(keys_[k] >> 32), static_cast<Index>(k), static_cast<Index>(end)});
    k = end;
  }

  // Hash table of columns, at most half full, open addressing.
  const std::size_t capacity = std::bit_ceil(std::max<std::size_t>(16, 2 * columns_.size()));
  table_.assign(capacity, kNone);
  for (std::size_t c = 0; c < columns_.size(); ++c) {
    std::size_t slot = hash_column(keys_[columns_[c].begin]) & (capacity - 1);
    while (table_[slot] != kNone) slot = (slot + 1) & (capacity - 1);
    table_[slot] = static_cast<Index>(c);
  }
}

// Stable radix sort of order_ by keys_, lowest digit first. Each chunk counts its keys by digit and knows
// from the counts before it where its own go: a stable sort has one result, on any number of threads.
void ColumnGrid::sort_by_keys(int bits) {
  const std::size_t n = keys_.size(), chunks = (n + kSortChunk - 1) / kSortChunk;
  const int passes = (bits + kDigitBits - 1) / kDigitBits;
  if (passes == 0) return;
  const int width = (bits + passes - 1) / passes;
  const std::size_t digits = std::size_t{1} << width;
  for (int pass = 0; pass < passes; ++pass) {
    const auto digit = [&, shift = pass * width](std::uint64_t key) { return (key >> shift) & (digits - 1); };
    counts_.assign(chunks * digits, 0);
    parallel_ranges(n, kSortChunk, [&](std::size_t begin, std::size_t end) {
      Index* count = counts_.data() + begin / kSortChunk * digits;
      for (std::size_t k = begin; k < end; ++k) ++count[digit(keys_[k])];
    });
    Index sum = 0;
    for (std::size_t d = 0; d < digits; ++d)
      for (std::size_t c = 0; c < chunks; ++c) sum += std::exchange(counts_[c * digits + d], sum);
    parallel_ranges(n, kSortChunk, [&](std::size_t begin, std::size_t end) {
      Index* next = counts_.data() + begin / kSortChunk * digits;
      for (std::size_t k = begin; k < end; ++k) {
        const std::size_t to = next[digit(keys_[k])]++;
        other_keys_[to] = keys_[k];
        other_order_[to] = order_[k];
      }
    });
    keys_.swap(other_keys_);
    order_.swap(other_order_);
  }
}

Index ColumnGrid::find_column(std::int32_t ix, std::int32_t iy) const {
  if (ix < 0 || iy < 0) return kNone;
  std::size_t slot = hash_column(column_key(static_cast<std::uint32_t>(ix), static_cast<std::uint32_t>(iy))) & (table_.size() - 1);
  while (table_[slot] != kNone) {
    const Column& column = columns_[table_[slot]];
    if (column.ix == ix && column.iy == iy) return table_[slot];
    slot = (slot + 1) & (table_.size() - 1);
  }
  return kNone;
}

int ColumnGrid::columns_around(Index c, Index out[9]) const {
  const Column& center = columns_[c];
  int count = 0;
  for (std::int32_t dy = -1; dy <= 1; ++dy) {
    for (std::int32_t dx = -1; dx <= 1; ++dx) {
      const Index other = dx == 0 && dy == 0 ? c : find_column(center.ix + dx, center.iy + dy);
      if (other != kNone) out[count++] = other;
    }
  }
  return count;
}

std::size_t ColumnGrid::memory() const {
  std::size_t words = order_.capacity() + other_order_.capacity() + table_.capacity() + counts_.capacity() + level_.capacity();
  for (const auto& axis : fixed_) words += axis.capacity();
  return words * sizeof(Index) + (keys_.capacity() + other_keys_.capacity()) * sizeof(std::uint64_t) + columns_.capacity() * sizeof(Column) +
         sorted_.capacity() * sizeof(Vec3);
}

namespace {

/// Places in memory order, [begin, end).
struct Run {
  Index begin, end;
};

struct Search {
  ColumnGrid::Fixed fixed;
  const Vec3* x;
  const Index* order;
  Real r2;                  // [m^2]
  float r2_sure, r2_maybe;  // fixed-point units squared: below the one near for certain, from the other on far
};

bool near(const Search& s, Index k, Index q) { return (s.x[k] - s.x[q]).squaredNorm() < s.r2; }

/// Writes the numbers of the particles in runs, without that in place k, that are near it. Writes beyond the
/// last, by kPadding at most. Returns the end of what counts.
Index* gather_scalar(const Search& s, Index k, const Run* runs, int run_count, Index* out) {
  for (const Run* run = runs; run != runs + run_count; ++run) {
    for (Index q = run->begin; q < run->end; ++q) {
      *out = s.order[q];  // written always, kept when near: no branch to mispredict
      out += near(s, k, q) & (q != k);
    }
  }
  return out;
}

#if defined(__x86_64__)

/// Of the candidates q, q + 1, ... whose bits stand in `maybe`, those that double precision finds near.
unsigned decide(const Search& s, Index k, Index q, unsigned maybe) {
  unsigned kept = 0;
  for (; maybe; maybe &= maybe - 1) {
    const int lane = std::countr_zero(maybe);
    kept |= static_cast<unsigned>(near(s, k, q + static_cast<Index>(lane))) << lane;
  }
  return kept;
}

/// Lanes to take, in order, for each set of eight: one byte a lane.
constexpr auto kCompress = [] {
  std::array<std::uint64_t, 256> table{};
  for (unsigned set = 0; set < 256; ++set)
    for (unsigned lane = 0, place = 0; lane < 8; ++lane)
      if (set >> lane & 1) table[set] |= std::uint64_t{lane} << 8 * place++;
  return table;
}();

__attribute__((target("avx2,fma,bmi,bmi2,popcnt"))) Index* gather_avx2(const Search& s, Index k, const Run* runs, int run_count, Index* out) {
  const __m256i x = _mm256_set1_epi32(s.fixed.x[k]), y = _mm256_set1_epi32(s.fixed.y[k]), z = _mm256_set1_epi32(s.fixed.z[k]);
  const __m256 r2_sure = _mm256_set1_ps(s.r2_sure), r2_maybe = _mm256_set1_ps(s.r2_maybe);
  const auto load = [](const auto* p) __attribute__((target("avx2,fma,bmi,bmi2,popcnt"))) { return _mm256_loadu_si256(reinterpret_cast<const __m256i*>(p)); };
  for (const Run* run = runs; run != runs + run_count; ++run) {
    for (Index q = run->begin; q < run->end; q += 8) {
      const __m256 dx = _mm256_cvtepi32_ps(_mm256_sub_epi32(x, load(s.fixed.x + q)));
      const __m256 dy = _mm256_cvtepi32_ps(_mm256_sub_epi32(y, load(s.fixed.y + q)));
      const __m256 dz = _mm256_cvtepi32_ps(_mm256_sub_epi32(z, load(s.fixed.z + q)));
      const __m256 d2 = _mm256_fmadd_ps(dz, dz, _mm256_fmadd_ps(dy, dy, _mm256_mul_ps(dx, dx)));
      unsigned lanes = _bzhi_u32(0xff, std::min(run->end - q, 8u));  // those before the run's end, without k itself
      if (k - q < 8) lanes &= ~(1u << (k - q));
      unsigned set = static_cast<unsigned>(_mm256_movemask_ps(_mm256_cmp_ps(d2, r2_sure, _CMP_LT_OQ))) & lanes;
      const unsigned maybe = static_cast<unsigned>(_mm256_movemask_ps(_mm256_cmp_ps(d2, r2_maybe, _CMP_LT_OQ))) & lanes & ~set;
      if (maybe) [[unlikely]] set |= decide(s, k, q, maybe);
      const __m256i take = _mm256_cvtepu8_epi32(_mm_cvtsi64_si128(static_cast<long long>(kCompress[set])));
      _mm256_storeu_si256(reinterpret_cast<__m256i*>(out), _mm256_permutevar8x32_epi32(load(s.order + q), take));
      out += std::popcount(set);
    }
  }
  return out;
}

// g++ 12 takes the intrinsics' own "undefined" operand for a variable of ours (GCC bug 105593).
#pragma GCC diagnostic push
#pragma GCC diagnostic ignored "-Wmaybe-uninitialized"
__attribute__((target("avx512f,avx512dq,avx512bw,avx512vl,bmi,bmi2,popcnt"))) Index* gather_avx512(const Search& s, Index k, const Run* runs, int run_count,
                                                                                                   Index* out) {
  const __m512i x = _mm512_set1_epi32(s.fixed.x[k]), y = _mm512_set1_epi32(s.fixed.y[k]), z = _mm512_set1_epi32(s.fixed.z[k]);
  const __m512 r2_sure = _mm512_set1_ps(s.r2_sure), r2_maybe = _mm512_set1_ps(s.r2_maybe);
  for (const Run* run = runs; run != runs + run_count; ++run) {
    for (Index q = run->begin; q < run->end; q += 16) {
      const __m512 dx = _mm512_cvtepi32_ps(_mm512_sub_epi32(x, _mm512_loadu_si512(s.fixed.x + q)));
      const __m512 dy = _mm512_cvtepi32_ps(_mm512_sub_epi32(y, _mm512_loadu_si512(s.fixed.y + q)));
      const __m512 dz = _mm512_cvtepi32_ps(_mm512_sub_epi32(z, _mm512_loadu_si512(s.fixed.z + q)));
      const __m512 d2 = _mm512_fmadd_ps(dz, dz, _mm512_fmadd_ps(dy, dy, _mm512_mul_ps(dx, dx)));
      unsigned lanes = _bzhi_u32(0xffff, std::min(run->end - q, 16u));  // those before the run's end, without k itself
      if (k - q < 16) lanes &= ~(1u << (k - q));
      unsigned set = _mm512_cmp_ps_mask(d2, r2_sure, _CMP_LT_OQ) & lanes;
      const unsigned maybe = _mm512_cmp_ps_mask(d2, r2_maybe, _CMP_LT_OQ) & lanes & ~set;
      if (maybe) [[unlikely]] set |= decide(s, k, q, maybe);
      _mm512_storeu_si512(out, _mm512_maskz_compress_epi32(static_cast<__mmask16>(set), _mm512_loadu_si512(s.order + q)));
      out += std::popcount(set);
    }
  }
  return out;
}
#pragma GCC diagnostic pop

#endif

auto* gather_for(Simd simd) {
#if defined(__x86_64__)
  if (simd == Simd::kAvx512) return &gather_avx512;
  if (simd == Simd::kAvx2) return &gather_avx2;
#endif
  return &gather_scalar;
}

}  // namespace

void Neighbors::find(const ColumnGrid& grid, Real radius, Simd simd) {
  ZONE("sph.neighbors");
  CHECK_GT(radius, 0.0);
  CHECK_LE(radius, grid.cell());
  CHECK(simd <= best_simd());
  const std::size_t n = grid.size();
  const auto order = grid.order();
  const auto columns = grid.columns();
  const std::int32_t* levels = grid.levels().data();
  chunk_.resize(n);
  first_.resize(n);
  count_.resize(n);
  const std::size_t chunks = (n + kChunk - 1) / kChunk;
  if (chunks_.size() < chunks) chunks_.resize(chunks);

  // Three products' rounding in float is below 2^-21 of d2.
  const Real units = radius * grid.units_per_metre(), sure = std::max(units - ColumnGrid::kFixedError, 0.0), maybe = units + ColumnGrid::kFixedError;
  const Search search{grid.fixed(), grid.sorted_positions().data(), order.data(), radius * radius, static_cast<float>(sure * sure * (1 - 0x1p-21)),
                      static_cast<float>(maybe * maybe * (1 + 0x1p-21))};
  const auto gather = gather_for(simd);

  parallel_ranges(n, kChunk, [&](std::size_t begin, std::size_t end) {
    const Index chunk = static_cast<Index>(begin / kChunk);
    std::vector<Index>& list = chunks_[chunk];
    std::size_t used = 0;
    auto column = std::upper_bound(columns.begin(), columns.end(), begin, [](std::size_t k, const ColumnGrid::Column& c) { return k < c.begin; }) - 1;
    for (std::size_t k = begin; k < end; ++column) {
      // Up the column, level by level: in each column around, the run of levels in reach moves up along.
      Index around[9], tops[9];
      Run runs[9];
      const int run_count = grid.columns_around(static_cast<Index>(column - columns.begin()), around);
      const std::int32_t bottom = levels[k] - ColumnGrid::kLevelsPerCell;
      for (int r = 0; r < run_count; ++r) {
        const ColumnGrid::Column& other = columns[around[r]];
        const Index first = static_cast<Index>(std::lower_bound(levels + other.begin, levels + other.end, bottom) - levels);
        runs[r] = {first, first};
        tops[r] = other.end;
      }
      const std::size_t column_end = std::min<std::size_t>(end, column->end);
      while (k < column_end) {
        const std::int32_t level = levels[k];
        std::size_t candidates = 0;
        for (int r = 0; r < run_count; ++r) {
          Run& run = runs[r];
          while (run.end < tops[r] && levels[run.end] <= level + ColumnGrid::kLevelsPerCell) ++run.end;
          while (run.begin < run.end && levels[run.begin] < level - ColumnGrid::kLevelsPerCell) ++run.begin;
          candidates += run.end - run.begin;
        }
        for (; k < column_end && levels[k] == level; ++k) {
          const std::size_t needed = used + candidates + std::max(ColumnGrid::kPadding, kGroup);
          if (list.size() < needed) {
            const std::size_t grown = std::max(needed, list.size() + list.size() / 8);
            list.reserve(grown);  // resize alone would double
            list.resize(grown);
          }
          Index* out = list.data() + used;
          const Index i = order[k];
          chunk_[i] = chunk;
          first_[i] = static_cast<Index>(used);
          Index* out_end = gather(search, static_cast<Index>(k), runs, run_count, out);
          count_[i] = static_cast<Index>(out_end - out);
          std::fill_n(out_end, kGroup, i);
          used += (count_[i] + kGroup - 1) / kGroup * kGroup;
        }
      }
    }
  });
}

void Neighbors::fold(std::size_t n, std::span<const Index> image_of) {
  CHECK_EQ(n + image_of.size(), size());
  parallel_for(n, [&](std::size_t i) {
    Index* list = chunks_[chunk_[i]].data() + first_[i];
    for (Index k = 0; k < count_[i]; ++k)
      if (list[k] >= n) list[k] = image_of[list[k] - n];
  });
  chunk_.resize(n);
  first_.resize(n);
  count_.resize(n);
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
