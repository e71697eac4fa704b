#include "skin/surface/rasterize.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <set>

#include "skin/surface/level_set_impl.h"
#include "tests/skin/surface/shapes.h"

namespace effuse::skin {
namespace {

using testing_shapes::Cloud;
using testing_shapes::cube;
using testing_shapes::fill;

Vec3 voxel_point(const Blocks& blocks, std::size_t b, std::size_t v) {
  const BlockCoord& c = blocks.coords()[b];
  return Vec3(kSide * c[0] + static_cast<int>(v >> 6), kSide * c[1] + static_cast<int>((v >> 3) & 7),
              kSide * c[2] + static_cast<int>(v & 7));
}

TEST(BlocksAround, AreThoseOfEveryParticlesColumnAndReachAndNoMore) {
  // Every block with a voxel within reach of a particle is there; none that no particle's cube of that half-side, widened by its column's, touches.
  for (const Real side : {2.0, 5.0}) {
    Cloud cloud;
    for (std::uint64_t i = 0; i < 300; ++i) cloud.add(Vec3(60 * random_uniform(5, 0, i) - 30, 60 * random_uniform(5, 1, i) - 30, (i < 200 ? 6 : 90) * random_uniform(5, 2, i) - 3), 1);
    for (std::uint64_t i = 0; i < 5; ++i) cloud.add(Vec3(4000 * random_uniform(6, 0, i), -9000, 0), 1);  // strays: rows by hash
    const ParticleGrid particles(cloud.bare(), 1, side);
    constexpr Real kReach = 3.7;
    const Blocks blocks = blocks_around(particles, kReach);
    const auto touches = [&](const BlockCoord& c, Real reach) {
      const Vec3 low(kSide * c[0], kSide * c[1], kSide * c[2]), high = low + Vec3::Constant(kSide);
      return std::any_of(particles.x().begin(), particles.x().end(), [&](const Vec3& x) { return ((low - x).array() <= reach).all() && ((x - high).array() <= reach).all(); });
    };
    for (const BlockCoord& c : blocks.coords()) EXPECT_TRUE(touches(c, kReach + side)) << c[0] << " " << c[1] << " " << c[2];
    for (const Vec3& x : particles.x())
      for (int corner = 0; corner < 27; ++corner)
        EXPECT_NE(blocks.block_at(x + 0.999 * kReach * Vec3(corner / 9 - 1, corner / 3 % 3 - 1, corner % 3 - 1)), kNone) << x.transpose();
    EXPECT_TRUE(blocks_around(particles, kReach, blocks.size()).has_value());
    EXPECT_FALSE(blocks_around(particles, kReach, blocks.size() - 1).has_value());
  }
}

TEST(Rasterize, AgreesWithTheSumOverAllParticlesInDouble) {
  for (std::uint64_t seed = 1; seed <= 3; ++seed) {
    Cloud cloud;
    for (std::uint64_t i = 0; i < 300; ++i) {
      cloud.add(9 * Vec3(random_uniform(seed, 0, i), random_uniform(seed, 1, i), random_uniform(seed, 2, i)) + Vec3(1000, -2000, 300), 1);
      cloud.radius.back() = 0.4 + 0.2 * random_uniform(seed, 3, i);
    }
    const ParticleGrid particles(cloud.bare(), 0.5, 2);
    const Blocks blocks = blocks_around(particles, 4);
    Field phi, weight;
    const RasterOptions options;
    rasterize(particles, blocks, options, phi, weight);
    for (std::size_t i = 0; i < phi.size(); i += 7)
      ASSERT_NEAR(phi[i], zhu_bridson(particles, options, voxel_point(blocks, i / kVoxels, i % kVoxels)), 1e-4) << "seed " << seed;
  }
}

// Four voxels a spacing: sums on every second voxel. A block of lava with a hole in it, a sheet of single particles that is torn, and
// two lone ones; near the surface both must agree, and on the side of it everywhere.
TEST(RasterizeSlow, InterpolatedSumsAgreeWithTheSumOverAllParticles) {
  Cloud cloud = fill(cube(5), 1, [](const Vec3& p) { return (p - Vec3(1, 1, 1)).norm() > 1.6; }, 0.15);
  for (int i = 0; i < 8; ++i)
    for (int j = 0; j < 8; ++j)
      cloud.add(Vec3(9 + 1.3 * i + 0.05 * i * i, -5 + 1.4 * j, 0.3 * std::sin(i + j)), 1);
  cloud.add(Vec3(0, 0, 9), 1);
  cloud.add(Vec3(2.2, 0, 9.4), 1);
  const ParticleGrid particles(cloud.bare(), 0.25, 4);
  const Blocks blocks = blocks_around(particles, 8);
  const RasterOptions options{.reach = 8, .spacing = 4, .outside = 5.6f};
  Field phi, weight;
  rasterize(particles, blocks, options, phi, weight);
  double largest = 0, sum = 0, n = 0;
  for (std::size_t i = 0; i < phi.size(); i += 7) {
    const double exact = zhu_bridson(particles, options, voxel_point(blocks, i / kVoxels, i % kVoxels));
    if (std::abs(exact) < 2) {
      largest = std::max(largest, std::abs(phi[i] - exact));
      sum += std::abs(phi[i] - exact);
      ++n;
    } else {
      ASSERT_EQ(phi[i] < 0, exact < 0) << i << ": " << phi[i] << " for " << exact;
    }
  }
  // Voxels: a twentieth of a spacing, and 0.004 of one.
  EXPECT_LT(largest, 0.2);
  EXPECT_LT(sum / n, 0.016);
  EXPECT_GT(n, 3000);
}

TEST(Rasterize, BlocksHoldEveryVoxelWithinReach) {
  Cloud cloud;
  for (std::uint64_t i = 0; i < 60; ++i) cloud.add(40 * Vec3(random_uniform(5, 0, i), random_uniform(5, 1, i), random_uniform(5, 2, i)), 1);
  const ParticleGrid particles(cloud.bare(), 0.5, 2);
  const Blocks blocks = blocks_around(particles, 4);
  for (const Vec3& p : particles.x())
    for (std::uint64_t i = 0; i < 200; ++i) {
      Vec3 q = p + 4 * Vec3(2 * random_uniform(6, 0, i) - 1, 2 * random_uniform(6, 1, i) - 1, 2 * random_uniform(6, 2, i) - 1);
      q = q.array().round();
      if ((q - p).norm() < 4) {
        ASSERT_NE(blocks.block_at(q), kNone);
      }
    }
}

TEST(Blocks, PaddedBlocksAndSamplesAgreeWithSingleVoxels) {
  const ParticleGrid particles(fill(cube(4), 1, [](const Vec3& p) { return p.norm() < 4; }).bare(), 0.5, 2);
  const Blocks blocks = blocks_around(particles, 4);
  Field field(blocks.size() * kVoxels);
  // A linear field: trilinear samples and differences are exact.
  const Vec3 slope(0.3, -0.7, 1.1);
  for (std::size_t i = 0; i < field.size(); ++i) field[i] = static_cast<float>(slope.dot(voxel_point(blocks, i / kVoxels, i % kVoxels)));
  for (std::size_t b = 0; b < blocks.size(); ++b) {
    float padded[1000];
    blocks.padded(field, 99, b, padded);
    const BlockCoord& c = blocks.coords()[b];
    for (int i = -1; i <= 8; i += 3)
      for (int j = -1; j <= 8; ++j)
        for (int k = -1; k <= 8; ++k)
          ASSERT_EQ(padded[(i + 1) * 100 + (j + 1) * 10 + k + 1],
                    blocks.at(field, 99, static_cast<Index>(b), 8 * c[0] + i, 8 * c[1] + j, 8 * c[2] + k));
  }
  for (std::uint64_t i = 0; i < 200; ++i) {
    const Vec3 p = 5 * Vec3(random_uniform(2, 0, i) - 0.5, random_uniform(2, 1, i) - 0.5, random_uniform(2, 2, i) - 0.5);
    ASSERT_NEAR(blocks.sample(field, 99, blocks.block_at(p), p), slope.dot(p), 1e-4);
    ASSERT_LT((blocks.gradient(field, 99, blocks.block_at(p), p) - slope).norm(), 1e-4);
  }
}

TEST(ParticleGrid, AveragesAreThoseOfTheFormula) {
  const Cloud cloud = fill(
      cube(3), 1, [](const Vec3&) { return true; }, 0.3);
  const ParticleGrid particles(cloud.points(), 0.5, 2);
  const int width = particles.carried().width;
  ASSERT_EQ(width, 12);
  std::vector<Vec3> points;
  for (std::uint64_t i = 0; i < 100; ++i)
    points.push_back(14 * Vec3(random_uniform(8, 0, i) - 0.5, random_uniform(8, 1, i) - 0.5, random_uniform(8, 2, i) - 0.5));
  points.emplace_back(40, 0, 0);  // nothing within reach: a wider mean, of the near side mostly
  std::vector<float> out(points.size() * 12);
  particles.average(points, 4, out);
  for (std::size_t p = 0; p + 1 < points.size(); ++p) {
    double weight = 0, temperature = 0;
    for (std::size_t i = 0; i < cloud.x.size(); ++i) {
      const double w = std::pow(std::max(0.0, 1 - (cloud.x[i] / 0.5 - particles.origin() / 0.5 - points[p]).squaredNorm() / 16), 3);
      weight += w;
      temperature += w * cloud.temperature[i];
    }
    if (weight > 1e-6) {
      ASSERT_NEAR(out[p * 12], temperature / weight, 1e-2);
    }
  }
  EXPECT_GT(out[(points.size() - 1) * 12], 1201);
  EXPECT_LT(out[(points.size() - 1) * 12], 1230);
}

TEST(Smooth, FlattensBumpsAndLeavesPlanesAndLoneParticlesAlone) {
  const Box3 box(Vec3(0, 0, 0), Vec3(16, 16, 5));
  const Cloud cloud = fill(
      box, 1, [](const Vec3&) { return true; }, 0.25);
  const auto roughness = [&](int passes) {
    LevelSetOptions options;
    options.spacing = 1;
    options.smoothing = passes;
    const geometry::TriMesh mesh = mesh_level_set(build_level_set(cloud.bare(), cloud.volume(), nullptr, options));
    double sum = 0, squares = 0, n = 0;
    for (const Vec3& p : mesh.positions)
      if (p.z() > 4 && p.x() > 3 && p.x() < 13 && p.y() > 3 && p.y() < 13) {
        sum += p.z();
        squares += p.z() * p.z();
        ++n;
      }
    return std::sqrt(squares / n - sum / n * sum / n);
  };
  const double raw = roughness(0), smooth = roughness(4);
  EXPECT_LT(smooth, 0.8 * raw) << raw << " -> " << smooth;

  Cloud lone;
  lone.add(Vec3(0.1, 0.2, 0.3), 1);
  LevelSetOptions options;
  options.spacing = 1;
  options.match_volume = false;
  options.smoothing = 0;
  const Real before = volume_above_ground(build_level_set(lone.bare(), 1, nullptr, options), nullptr);
  options.smoothing = 8;
  EXPECT_NEAR(volume_above_ground(build_level_set(lone.bare(), 1, nullptr, options), nullptr), before, 0.01 * before);
}

TEST(Distances, AreThoseOfTheSphere) {
  const ParticleGrid particles(fill(cube(6), 1, [](const Vec3& p) { return p.norm() < 6; }).bare(), 0.5, 2);
  const Blocks blocks = blocks_around(particles, 4);
  Field phi(blocks.size() * kVoxels);
  // Twice the distance: only the zero level is to be trusted.
  for (std::size_t i = 0; i < phi.size(); ++i) phi[i] = static_cast<float>(2 * (voxel_point(blocks, i / kVoxels, i % kVoxels).norm() - 10));
  const Field distance = distances(blocks, 6, phi, 3);
  for (std::size_t i = 0; i < phi.size(); ++i) {
    const float wanted = std::clamp(phi[i] / 2, -3.0f, 3.0f);
    ASSERT_NEAR(distance[i], wanted, std::abs(wanted) < 1 ? 0.05 : 0.2);
  }
}

}  // namespace
}  // namespace effuse::skin
