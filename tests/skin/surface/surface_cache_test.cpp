#include "skin/surface/surface_cache.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <deque>
#include <numeric>
#include <set>

#include "geometry/base/parallel.h"
#include "geometry/base/random.h"
#include "tests/skin/surface/shapes.h"

/// The parts of a frame made from the last. That it is the frame made alone, to the bit: SurfaceCached, level_set_test.cpp.
namespace effuse::skin {
namespace {

using testing_shapes::Cloud;
using testing_shapes::cube;
using testing_shapes::fill;

/// Some of the blocks of a cube of 6^3, the share `kept` of them.
Blocks some_blocks(std::uint64_t seed, Real kept) {
  std::vector<BlockCoord> coords;
  for (int n = 215; n >= 0; --n)
    if (random_uniform(seed, 0, static_cast<std::uint64_t>(n)) < kept) coords.push_back({n / 36 - 3, n / 6 % 6 - 3, n % 6 - 3});
  return Blocks(coords);
}

TEST(Blocks, AreSortedAndKnowThoseAroundThem) {
  for (const Real kept : {0.0, 0.1, 0.5, 1.0}) {
    const Blocks blocks = some_blocks(1, kept);
    EXPECT_TRUE(std::is_sorted(blocks.coords().begin(), blocks.coords().end()));
    for (std::size_t b = 0; b < blocks.size(); ++b) {
      const BlockCoord& c = blocks.coords()[b];
      for (int slot = 0; slot < 27; ++slot) {
        const BlockCoord wanted = {c[0] + slot / 9 - 1, c[1] + slot / 3 % 3 - 1, c[2] + slot % 3 - 1};
        const auto at = std::find(blocks.coords().begin(), blocks.coords().end(), wanted);
        const Index there = at == blocks.coords().end() ? kNone : static_cast<Index>(at - blocks.coords().begin());
        ASSERT_EQ(blocks.around(b)[static_cast<std::size_t>(slot)], there);
        ASSERT_EQ(blocks.block_at(Vec3(8 * wanted[0] + 7.5, 8 * wanted[1], 8 * wanted[2] + 3)), there);
      }
    }
  }
}

TEST(Blocks, FarFromTheOriginAreNeighborsToo) {
  const int far = (1 << 17) - 1;
  const Blocks blocks({{-far, -far, -far}, {-far, -far, 1 - far}, {far, far, far}, {far - 1, far - 1, far - 1}, {0, 0, -1}, {0, 0, 0}});
  EXPECT_EQ(blocks.coords().front(), (BlockCoord{-far, -far, -far}));
  EXPECT_EQ(blocks.around(0)[14], 1u);
  EXPECT_EQ(blocks.around(2)[14], 3u);
  EXPECT_EQ(blocks.around(4)[26], 5u);
}

TEST(Blocks, SamePlacesAreSame) {
  const Blocks one = some_blocks(1, 0.5), other = some_blocks(2, 0.5);
  const std::vector<Index> same = same_places(one, other);
  std::size_t found = 0;
  for (std::size_t b = 0; b < one.size(); ++b) {
    const BlockCoord& c = one.coords()[b];
    ASSERT_EQ(same[b], other.block_at(Vec3(8 * c[0], 8 * c[1], 8 * c[2])));
    found += same[b] != kNone;
  }
  EXPECT_GT(found, 20u);
  EXPECT_LT(found, one.size());
}

TEST(SurfaceCacheParts, RearrangedValuesAreWhereTheirBlocksAre) {
  for (std::uint64_t seed = 1; seed <= 20; ++seed) {
    // Blocks come, go, or both: values move up, down, and over one another.
    const Blocks before = some_blocks(seed, seed % 3 == 0 ? 0.9 : 0.5), after = some_blocks(seed + 100, seed % 3 == 1 ? 0.9 : 0.5);
    Field field(before.size() * kVoxels);
    std::iota(field.begin(), field.end(), 0.0f);
    const std::vector<Index> same = same_places(after, before);
    rearrange(field, same);
    ASSERT_EQ(field.size(), after.size() * kVoxels);
    for (std::size_t b = 0; b < after.size(); ++b)
      for (std::size_t v = 0; v < kVoxels; v += 73)
        if (same[b] != kNone) {
          ASSERT_EQ(field[b * kVoxels + v], static_cast<float>(same[b] * kVoxels + v)) << "seed " << seed;
        }
  }
}

TEST(SurfaceCacheParts, BlocksBesideGoneOnesAreMarked) {
  const Blocks before = some_blocks(1, 0.8), after = some_blocks(2, 0.8);
  std::vector<std::uint8_t> marks(after.size(), 0);
  mark_beside_gone(before, same_places(before, after), marks);
  const std::vector<Index> was = same_places(after, before);
  for (std::size_t b = 0; b < after.size(); ++b) {
    bool gone = false;
    if (was[b] != kNone)
      for (std::size_t slot = 0; slot < 27; ++slot) gone = gone || (before.around(was[b])[slot] != kNone && after.around(b)[slot] == kNone);
    ASSERT_EQ(marks[b] != 0, gone);
  }
}

TEST(SurfaceCacheParts, ParticlesOfOneFrameAloneAreFoundWhateverTheirOrder) {
  // Moved, grown, gone, come, doubled; some at one height, some at one place.
  Cloud one = fill(cube(4), 1, [](const Vec3&) { return true; }, 0.3);
  for (int k = 0; k < 3; ++k) one.add(Vec3(0.25, 0.25, 0.25), 1);
  Cloud other;
  for (std::size_t i = one.x.size(); i-- > 0;)
    if (i % 17 != 3) other.add(one.x[i] + (i % 5 == 1 ? Vec3(0.01, 0, i % 2 == 0 ? 0.3 : 0) : Vec3::Zero()), i % 11 == 2 ? 1.5 : 1);
  for (int k = 0; k < 5; ++k) other.add(Vec3(0.25, 0.25, 0.25), 1);
  const ParticleGrid a(one.bare(), 0.25, 2), b(other.bare(), 0.25, 2);
  ASSERT_EQ(a.origin(), b.origin());
  const auto alone = [](const ParticleGrid& some, const ParticleGrid& others) {
    std::multiset<std::array<Real, 4>> left, found;
    const auto key = [](const ParticleGrid& grid, std::size_t i) { return std::array<Real, 4>{grid.x()[i].x(), grid.x()[i].y(), grid.x()[i].z(), static_cast<Real>(grid.radius()[i])}; };
    for (std::size_t i = 0; i < some.size(); ++i) left.insert(key(some, i));
    for (std::size_t i = 0; i < others.size(); ++i)
      if (const auto at = left.find(key(others, i)); at != left.end()) left.erase(at);
    each_not_among(some, others, [&](Index i) { found.insert(key(some, i)); });
    EXPECT_EQ(found, left);
    return found.size();
  };
  EXPECT_GT(alone(a, b), 100u);
  EXPECT_GT(alone(b, a), 100u);
  EXPECT_EQ(alone(a, a), 0u);
  EXPECT_EQ(alone(a, ParticleGrid()), a.size());
}

TEST(SurfaceCacheParts, RowsThatAParticleOfOneFrameAloneIsFeltInAreMadeAnewAndTheFieldIsTheSameToTheBit) {
  for (const float d : {2.0f, 4.0f, 5.0f}) {
    const auto moved = [](const Cloud& cloud, int frame) {
      Cloud next = cloud;
      for (Vec3& x : next.x)
        if (x.x() > 5 && x.y() > 4) x += Vec3(0.07, 0.2 * frame, -0.03);
      return next;
    };
    const Cloud first = fill(Box3(Vec3(-9, -9, -3), Vec3(9, 9, 3)), 1, [](const Vec3&) { return true; }, 0.2);
    const RasterOptions o{.reach = 2 * d, .spacing = d, .outside = 1.4f * d};
    SurfaceCache::Impl last;
    RasterField& raster = last.raster;
    for (int frame = 0; frame < 3; ++frame) {
      const ParticleGrid grid(moved(first, frame).bare(), 1 / static_cast<Real>(d), static_cast<Real>(d));
      const Blocks blocks = blocks_around(grid, static_cast<Real>(o.reach));
      std::size_t set = 0;
      if (frame == 0) {
        rasterize(grid, blocks, o, {}, raster);
      } else {
        const Renewal renewal = find_stale(last, grid, blocks, static_cast<Real>(o.reach), static_cast<Real>(o.reach));
        for (const RowSet rows : renewal.rows) set += static_cast<std::size_t>(std::popcount(rows));
        EXPECT_GT(set, 0u);
        EXPECT_LT(set, 32 * blocks.size()) << "half of the rows";
        for (auto* field : {&raster.phi, &raster.weight}) rearrange(*field, renewal.before);
        if (!raster.nodes.empty()) {
          rearrange(raster.nodes, renewal.before, 1);
          rearrange(raster.covered, renewal.before, 1);
        }
        rasterize(grid, blocks, o, renewal.rows, raster);
      }
      Field phi, weight;
      rasterize(grid, blocks, o, phi, weight);
      ASSERT_EQ(raster.phi, phi) << "frame " << frame << ", " << d << " voxels a spacing";
      ASSERT_EQ(raster.weight, weight);
      last.blocks = blocks;
      last.particles = grid;
    }
  }
}

TEST(SurfaceCacheParts, SmoothingOfWantedBlocksIsThatOfAll) {
  const Blocks blocks = some_blocks(1, 0.9);
  Field rough(blocks.size() * kVoxels), weight(rough.size(), 20);
  for (std::size_t i = 0; i < rough.size(); ++i) rough[i] = static_cast<float>(4 * random_uniform(5, 1, i) - 2);
  std::vector<std::uint8_t> wanted(blocks.size());
  for (std::size_t b = 0; b < wanted.size(); ++b) wanted[b] = random_uniform(5, 2, b) < 0.1;
  for (const float time : {0.0f, 0.2f, 0.4f, 1.3f, 1.7f, 2.3f}) {
    FieldRule rule;
    rule.smoothing = time;
    rule.lone = 0.1f;
    rule.sheet = 1;
    Field all = rough, some = rough;
    smooth(blocks, 2.5f, rule, weight, all);
    smooth(blocks, 2.5f, rule, weight, some, wanted);
    for (std::size_t b = 0; b < wanted.size(); ++b)
      if (wanted[b]) {
        ASSERT_TRUE(std::equal(&all[b * kVoxels], &all[b * kVoxels] + kVoxels, &some[b * kVoxels])) << "block " << b << ", " << smoothing_steps(time) << " steps";
      }
    if (time > 0) {
      EXPECT_NE(all, rough);
    }
  }
}

TEST(SurfaceCacheParts, AFieldGivenBackIsTakenOnceAndAnOlderOneDoesNotReplaceIt) {
  ReturnedField returned;
  EXPECT_EQ(returned.take().first, 0u);
  returned.give_back(7, Field(8, 1));
  returned.give_back(3, Field(4, 2));
  const auto [frame, field] = returned.take();
  EXPECT_EQ(frame, 7u);
  EXPECT_EQ(field, Field(8, 1));
  EXPECT_EQ(returned.take().first, 0u);
}

TEST(MatchingShift, IsTheSameWhereverOneBeginsToLook) {
  // Three drops and a ball of noise: a field with jumps.
  const Blocks blocks = some_blocks(1, 1);
  Field phi(blocks.size() * kVoxels);
  for (std::size_t b = 0; b < blocks.size(); ++b)
    for (std::size_t v = 0; v < kVoxels; ++v) {
      const BlockCoord& c = blocks.coords()[b];
      const Vec3 p(8 * c[0] + static_cast<int>(v >> 6), 8 * c[1] + static_cast<int>((v >> 3) & 7), 8 * c[2] + static_cast<int>(v & 7));
      const Real noise = 1.5 * (random_uniform(3, b, v) - 0.5);
      phi[b * kVoxels + v] = static_cast<float>(std::min({p.norm() - 9 + noise, (p - Vec3(14, 0, 0)).norm() - 3, (p - Vec3(0, 14, 3)).norm() - 2.5, 3.0}));
    }
  for (const Real target : {100.0, 2500.0, 3100.0, 3107.3, 9000.0, 1e6}) {
    KnownVolumes plain;
    const Shift shift = matching_shift(blocks, 3, phi, {}, target, 2, plain);
    EXPECT_LE(std::abs(shift.steps), 2 * kShiftSteps);
    // It is near the target, or no step beside it is nearer.
    const auto miss = [&](int steps) { return std::abs(enclosed(blocks, 3, phi, {}, static_cast<float>(steps) / kShiftSteps) - target); };
    for (const int beside : {-1, 1})
      if (std::abs(shift.steps + beside) <= 2 * kShiftSteps && miss(shift.steps) > 5e-4 * target) {
        EXPECT_LE(miss(shift.steps), miss(shift.steps + beside) * (1 + 1e-12)) << target;
      }
    for (const int guess : {-1000, -256, -31, 0, shift.steps - 1, shift.steps, shift.steps + 1, 77, 256}) {
      KnownVolumes other;
      other.guess = guess;
      const Shift again = matching_shift(blocks, 3, phi, {}, target, 2, other);
      EXPECT_EQ(again.steps, shift.steps) << "from " << guess << " to " << target;
      EXPECT_EQ(again.volume, shift.volume);
    }
  }
}

/// A slab of which a corner creeps on, so that its shift changes now and then.
struct Creeping {
  Cloud cloud = fill(Box3(Vec3(-12, -12, 0), Vec3(12, 12, 4)), 1, [](const Vec3&) { return true; }, 0.15);
  LevelSetOptions options;
  Creeping() { options.spacing = 1; }
  void advance() {
    for (Vec3& x : cloud.x)
      if (x.x() > 4 && x.y() > 4) x += Vec3(0.05, 0.03, 0.04);
  }
  LevelSet surface(SurfaceCache* last) const { return build_level_set(cloud.bare(), cloud.volume(), nullptr, options, last); }
};

TEST(SurfaceCache, FramesThatAreKeptAndFramesThatAreGivenBackLateAreTheSame) {
  // Every third level set is held on to for some frames: its field cannot be used, and comes back when it is old.
  Creeping lava;
  SurfaceCache cache;
  std::deque<LevelSet> held;
  std::set<Real> shifts;
  std::size_t renewed = 0, blocks = 0;
  for (int frame = 0; frame < 16; ++frame) {
    lava.advance();
    LevelSet kept = lava.surface(&cache);
    const LevelSet fresh = lava.surface(nullptr);
    ASSERT_EQ(kept.impl().phi, fresh.impl().phi) << "frame " << frame;
    ASSERT_EQ(kept.report().volume, fresh.report().volume);
    ASSERT_EQ(kept.report().shift, fresh.report().shift);
    const geometry::TriMesh a = mesh_level_set(kept, &cache), b = mesh_level_set(fresh);
    ASSERT_EQ(a.positions, b.positions);
    ASSERT_EQ(a.triangles, b.triangles);
    ASSERT_EQ(a.normals, b.normals);
    shifts.insert(kept.report().shift);
    renewed += kept.report().renewed;
    blocks += kept.report().blocks;
    if (frame % 3 == 0) held.push_back(std::move(kept));
    if (held.size() > 2) held.pop_front();
  }
  EXPECT_GT(shifts.size(), 2u);
  EXPECT_LT(renewed, blocks / 2);
}

TEST(SurfaceCache, GoesOnWhenVoxelsBecomeCoarserOrFiner) {
  // Fine voxels have sums at nodes, of a few blocks; coarse ones have none, and more blocks. What is read too far is not used: without a
  // sanitizer this passes also where the sums are left behind.
  Creeping few, many;
  few.cloud = fill(Box3(Vec3(0, 0, 0), Vec3(1, 1, 1)), 1, [](const Vec3&) { return true; }, 0.15);
  few.options.voxel = 0.125;
  many.options.voxel = 0.35;
  SurfaceCache cache;
  for (Creeping* each : {&few, &many, &many, &few, &few, &many, &many}) {
    each->advance();
    EXPECT_EQ(each->surface(&cache).impl().phi, each->surface(nullptr).impl().phi);
  }
}

TEST(SurfaceCache, ASurfaceOutlivesTheCacheItWasMadeWith) {
  Creeping lava;
  LevelSet surface;
  {
    SurfaceCache cache;
    surface = lava.surface(&cache);
  }
  EXPECT_EQ(surface.impl().phi, lava.surface(nullptr).impl().phi);
  SurfaceCache other;
  surface = lava.surface(&other);
  other = SurfaceCache();
  EXPECT_EQ(lava.surface(&other).report().renewed, surface.report().blocks);
}

}  // namespace
}  // namespace effuse::skin
