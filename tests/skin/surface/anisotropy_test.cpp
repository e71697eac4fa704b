#include "skin/surface/anisotropy.h"

#include <gtest/gtest.h>

#include <Eigen/Eigenvalues>
#include <algorithm>
#include <cmath>

#include "geometry/base/hash.h"
#include "geometry/base/parallel.h"
#include "geometry/mesh/measure.h"
#include "skin/surface/iso_mesh.h"
#include "tests/skin/surface/shapes.h"

namespace effuse::skin {
namespace {

using geometry::TriMesh;
using testing_shapes::Cloud;
using testing_shapes::cube;
using testing_shapes::fill;

const auto everywhere = [](const Vec3&) { return true; };

/// Spacing 1 and d voxels a spacing.
RasterOptions at_fineness(float d) { return {.reach = 2 * d, .spacing = d, .radius_factor = 1.2f, .outside = 1.4f * d}; }

struct Rasterized {
  ParticleGrid particles;
  Blocks blocks;
  RasterOptions options;
  Field phi, weight;
  Real voxel;

  /// The zero level moved out by `shift` voxels, in spacings.
  TriMesh mesh(float shift = 0) const {
    Field moved = phi;
    for (float& v : moved) v -= shift;
    TriMesh mesh = iso_mesh(blocks, options.outside - shift, moved);
    for (Vec3& p : mesh.positions) p = particles.origin() + voxel * p;
    return mesh;
  }
  /// With the shift at which it encloses `volume`.
  TriMesh mesh_of_volume(Real volume) const {
    float low = -0.5f * options.spacing, high = -low;
    for (int step = 0; step < 9; ++step) {
      const float middle = (low + high) / 2;
      (geometry::signed_volume(mesh(middle)) < volume ? low : high) = middle;
    }
    return mesh((low + high) / 2);
  }
};

enum class Kind { kRound, kAnisotropic };

Rasterized rasterized(const Cloud& cloud, float d, Kind kind) {
  Rasterized r{.particles = ParticleGrid(cloud.bare(), 1 / static_cast<Real>(d), static_cast<Real>(d)),
               .blocks = {},
               .options = at_fineness(d),
               .phi = {},
               .weight = {},
               .voxel = 1 / static_cast<Real>(d)};
  r.blocks = blocks_around(r.particles, static_cast<Real>(r.options.reach));
  if (kind == Kind::kRound)
    rasterize(r.particles, r.blocks, r.options, r.phi, r.weight);
  else
    rasterize_anisotropic(r.particles, anisotropic_kernels(r.particles, d, r.options.reach), r.blocks, r.options, r.phi, r.weight);
  return r;
}

Vec3 voxel_point(const Blocks& blocks, std::size_t i) {
  const BlockCoord& c = blocks.coords()[i / kVoxels];
  const int v = static_cast<int>(i % kVoxels);
  return Vec3(kSide * c[0] + (v >> 6), kSide * c[1] + ((v >> 3) & 7), kSide * c[2] + (v & 7));
}

Mat3 matrix(const std::array<float, 6>& m) {
  Mat3 M;
  M << m[0], m[1], m[2], m[1], m[3], m[4], m[2], m[4], m[5];
  return M;
}

/// A block of lava with a bubble, a torn sheet of single particles and two lone ones.
Cloud all_sorts(Real half) {
  Cloud cloud = fill(
      cube(half), 1, [](const Vec3& p) { return (p - Vec3(1, 1, 1)).norm() > 1.6; }, 0.15);
  for (int i = 0; i < 8; ++i)
    for (int j = 0; j < 8; ++j) cloud.add(Vec3(half + 4 + 1.3 * i + 0.05 * i * i, -5 + 1.4 * j, 0.3 * std::sin(i + j)), 1);
  cloud.add(Vec3(0, 0, half + 4), 1);
  cloud.add(Vec3(2.2, 0, half + 4.4), 1);
  for (std::size_t i = 0; i < cloud.radius.size(); i += 3) cloud.radius[i] = 0.45;
  return cloud;
}

// The docstring's formulas, in double over all particles.
TEST(AnisotropicKernels, AgreeWithTheFormulasOverAllParticles) {
  const Cloud cloud = all_sorts(3);
  const double d = 2, support = 2.5 * d, R = 2 * d;
  const ParticleGrid particles(cloud.bare(), 1 / d, d);
  const Kernels kernels = anisotropic_kernels(particles, 2, 4);
  const std::vector<Vec3>& x = particles.x();
  const auto ramp = [](double v, double from, double to) {
    const double t = std::clamp((v - from) / (to - from), 0.0, 1.0);
    return t * t * (3 - 2 * t);
  };
  std::vector<Vec3> normal;
  std::vector<double> freedom;
  for (std::size_t i = 0; i < x.size(); ++i) {
    double W = 0, crowd = 0;
    Vec3 mean = Vec3::Zero();
    Mat3 C = Mat3::Zero();
    for (const Vec3& y : x) {
      const Vec3 v = y - x[i];
      const double w = std::max(0.0, 1 - v.squaredNorm() / (support * support));
      crowd += std::pow(std::max(0.0, 1 - v.squaredNorm() / (R * R)), 3);
      W += w;
      mean += w * v;
      C += w * v * v.transpose();
    }
    mean /= W;
    C = C / W - mean * mean.transpose();
    const double trust = ramp(W - 1, 2, 4);
    C = trust * C + (1.0001 - trust) * support * support / 7 * Mat3::Identity();
    const Eigen::SelfAdjointEigenSolver<Mat3> solver(C);
    Vec3 l = solver.eigenvalues();
    const double layer = std::max(l[0], l[2] / std::sqrt(6.0)) / std::max(l[1], l[2] / std::sqrt(6.0));
    normal.push_back(solver.eigenvectors().col(0));
    freedom.push_back(ramp(1 - std::pow(layer, 4), 0.3, 0.8));
    l = l.cwiseMax(l[2] / 2.56);
    const Mat3 M = std::cbrt(l.prod()) * solver.eigenvectors() * l.cwiseInverse().asDiagonal() * solver.eigenvectors().transpose();
    ASSERT_LT((matrix(kernels.metric[i]) - M).norm(), 2e-3) << i;
    ASSERT_NEAR(kernels.crowd[i], crowd, 1e-4);
    ASSERT_NEAR(kernels.amplitude[i], std::min(6.0, std::pow(64 * kPi / 315 * 8 / crowd, 2)), 1e-3);
  }
  std::vector<Vec3> centre = x;
  for (int pass = 0; pass < 2; ++pass) {
    const std::vector<Vec3> from = centre;
    for (std::size_t i = 0; i < x.size(); ++i) {
      double W = 0, height = 0;
      for (std::size_t j = 0; j < x.size(); ++j) {
        const double up = normal[i].dot(from[j] - from[i]);
        const double t = std::max(0.0, 1 - (x[j] - x[i]).squaredNorm() / (support * support)), u = std::max(0.0, 1 - up * up / (1.4 * 1.4));
        W += t * t * u * u;
        height += t * t * u * u * up;
      }
      centre[i] += freedom[i] * ramp(W / (kPi / 3 * 6.25), 0.1, 0.4) * height / W * normal[i];
    }
  }
  double moved = 0;
  for (std::size_t i = 0; i < x.size(); ++i) {
    // Where the normal is all but free (f near 0) its error counts little.
    ASSERT_LT((kernels.centre[i] - centre[i]).norm(), 5e-3) << i << ", freedom " << freedom[i];
    moved = std::max(moved, (centre[i] - x[i]).norm());
  }
  EXPECT_GT(moved, 0.1 * d);
}

TEST(AnisotropicKernels, AreRoundForLoneParticlesAndFlatOnSheetsAndLongOnEdges) {
  const auto axes_of = [](const Kernels& kernels, std::size_t i) {
    const Eigen::SelfAdjointEigenSolver<Mat3> solver(matrix(kernels.metric[i]));
    return std::pair<Vec3, Mat3>(solver.eigenvalues().cwiseInverse().cwiseSqrt(), solver.eigenvectors());
  };
  const auto nearest = [](const ParticleGrid& particles, const Vec3& p) {
    std::size_t best = 0;
    for (std::size_t i = 0; i < particles.size(); ++i)
      if ((particles.x()[i] - p).norm() < (particles.x()[best] - p).norm()) best = i;
    return best;
  };
  Cloud few;
  few.add(Vec3(0, 0, 0), 1);
  few.add(Vec3(10, 0, 0), 1);
  few.add(Vec3(11, 0, 0), 1);
  const ParticleGrid lone(few.bare(), 0.5, 2);
  const Kernels round = anisotropic_kernels(lone, 2, 4);
  for (std::size_t i = 0; i < lone.size(); ++i) {
    EXPECT_LT((matrix(round.metric[i]) - Mat3::Identity()).norm(), 1e-6);
    EXPECT_EQ(round.centre[i], lone.x()[i]);
  }

  const Cloud box = fill(Box3(Vec3(0, 0, 0), Vec3(9, 9, 9)), 1, everywhere, 0.05);
  const ParticleGrid particles(box.bare(), 0.5, 2);
  const Kernels kernels = anisotropic_kernels(particles, 2, 4);
  for (std::size_t i = 0; i < particles.size(); ++i) {
    const auto [semi, axes] = axes_of(kernels, i);
    ASSERT_NEAR(semi.prod(), 1, 1e-4);
    ASSERT_LT(semi.maxCoeff(), 1.6001 * semi.minCoeff());
  }
  const auto at = [&](const Vec3& p) { return axes_of(kernels, nearest(particles, 2 * p - particles.origin() / 0.5)); };
  const auto [inside, any] = at(Vec3(4.5, 4.5, 4.5));
  EXPECT_LT(inside[0], 1.1 * inside[2]);
  const auto [face, across] = at(Vec3(4.5, 4.5, 8.5));  // semi-axes falling
  EXPECT_GT(face[1], 1.4 * face[2]);
  EXPECT_GT(std::abs(across(2, 2)), 0.98);
  const auto [edge, along] = at(Vec3(4.5, 8.5, 8.5));
  EXPECT_GT(edge[0], 1.3 * edge[1]);
  EXPECT_GT(std::abs(along(0, 0)), 0.98);
}

TEST(AnisotropicKernels, FollowSmallMovementsOfTheParticlesWithoutAJump) {
  // A crystal of three layers, where every direction is as good as the next, opens until its layers are sheets, and a stranger
  // walks by: wherever they are, a little step changes everything a little.
  const auto kernels_at = [](double gap, double stranger) {
    Cloud cloud;
    for (int i = -3; i <= 3; ++i)
      for (int j = -3; j <= 3; ++j)
        for (int k = -1; k <= 1; ++k) cloud.add(Vec3(i, j, k == 0 ? 0 : k * (1 + gap)), 1);
    cloud.add(Vec3(0.3, 0.2, 1 + gap + stranger), 1);
    const ParticleGrid particles(cloud.bare(), 0.5, 2);
    const Kernels kernels = anisotropic_kernels(particles, 2, 4);
    // Those of the layer z = 0, which stay in their order.
    std::vector<double> all;
    for (std::size_t p = 0; p < particles.size(); ++p)
      if (std::abs(particles.x()[p].z() + particles.origin().z() / 0.5) < 0.5) {
        for (const float v : kernels.metric[p]) all.push_back(v);
        all.push_back(kernels.centre[p].z() + particles.origin().z() / 0.5);
        all.push_back(kernels.amplitude[p]);
      }
    return all;
  };
  double furthest = 0;
  const std::vector<double> first = kernels_at(0, 0.4);
  for (int step = 0; step < 90; ++step) {
    constexpr double kLittle = 1e-4;  // [spacings]
    const double gap = 0.02 * step, stranger = 0.4 + 0.01 * step;
    const std::vector<double> from = kernels_at(gap, stranger), to = kernels_at(gap + kLittle, stranger + kLittle);
    ASSERT_EQ(from.size(), first.size());
    ASSERT_EQ(to.size(), first.size());
    for (std::size_t i = 0; i < from.size(); ++i) {
      // The steepest of them, the amplitude of a corner, goes from 6 to 1 within less than a spacing.
      ASSERT_LT(std::abs(to[i] - from[i]), 10 * kLittle + 2e-4) << "at a gap of " << gap;
      furthest = std::max(furthest, std::abs(from[i] - first[i]));
    }
  }
  EXPECT_GT(furthest, 0.5);
}

TEST(RasterizeAnisotropic, AgreesWithTheSumOverAllParticlesInDouble) {
  for (const float d : {2.0f, 4.0f}) {
    const Rasterized r = rasterized(all_sorts(d > 2 ? 3.5 : 5), d, Kind::kAnisotropic);
    const Kernels kernels = anisotropic_kernels(r.particles, d, r.options.reach);
    std::size_t compared = 0;
    for (std::size_t i = 0; i<r.phi.size(); i += d> 2 ? 101 : 31) {
      const Real exact = anisotropic_distance(r.particles, kernels, r.options, voxel_point(r.blocks, i));
      if (exact < -0.5 * static_cast<Real>(d)) {
        ASSERT_LT(r.phi[i], 0);  // may be deep inside
        continue;
      }
      ++compared;
      ASSERT_NEAR(r.phi[i], exact, 1e-3) << i;
    }
    EXPECT_GT(compared, 1000u);
  }
}

TEST(RasterizeAnisotropic, FillsDeepBlocksAndLeavesBubblesOpen) {
  // Blocks are two spacings wide; eight of them share the bubble and are more than half full.
  const Vec3 hole(4, 0, 0);
  const Rasterized r = rasterized(fill(
                                      cube(8), 1, [&](const Vec3& p) { return (p - hole).norm() > 1.5; }, 0.1),
                                  4, Kind::kAnisotropic);
  const Kernels kernels = anisotropic_kernels(r.particles, 4, 8);
  std::size_t filled = 0;
  for (std::size_t b = 0; b < r.blocks.size(); ++b)
    filled += std::all_of(&r.phi[b * kVoxels], &r.phi[b * kVoxels] + kVoxels, [&](float v) { return v == -2.4f; });
  EXPECT_GT(filled, 20u);
  for (std::size_t i = 0; i < r.phi.size(); i += 1501) {
    ASSERT_EQ(r.phi[i] < 0, anisotropic_distance(r.particles, kernels, r.options, voxel_point(r.blocks, i)) < 0);
  }
  const Vec3 bubble = (hole - r.particles.origin()) / r.voxel;
  EXPECT_GT(r.blocks.sample(r.phi, r.options.outside, r.blocks.block_at(bubble), bubble), 0.3f * 4);
}

TEST(RasterizeAnisotropic, KeepsTheBoundBetweenSeparateParticles) {
  Cloud cloud = all_sorts(3);
  for (std::uint64_t i = 0; i < 60; ++i)
    cloud.add(Vec3(-20, 0, 0) + 10 * Vec3(random_uniform(4, 0, i), random_uniform(4, 1, i), random_uniform(4, 2, i)), 1);
  for (const Real gap : {2.6, 2.8, 3.2, 3.6})
    for (const Real side : {0.0, gap}) cloud.add(Vec3(side, 10 * gap, -10), 1);
  const Rasterized r = rasterized(cloud, 2, Kind::kAnisotropic);
  for (std::size_t i = 0; i < r.phi.size(); i += 3) {
    const Vec3 p = voxel_point(r.blocks, i);
    Real nearest = 1e9;
    for (const Vec3& x : r.particles.x()) nearest = std::min(nearest, (x - p).norm());
    ASSERT_GT(r.phi[i], std::min<Real>(r.options.outside, 3 * (nearest - 2.3)) - 1e-4);
    ASSERT_LE(r.phi[i], r.options.outside);
  }
}

/// Root mean square of the surface's height over its mean, at the middle of a slab's upper face.
Real roughness(const TriMesh& mesh, Real above, Real from, Real to) {
  Real sum = 0, squares = 0, n = 0;
  for (const Vec3& p : mesh.positions)
    if (p.z() > above && p.x() > from && p.x() < to && p.y() > from && p.y() < to) {
      sum += p.z();
      squares += p.z() * p.z();
      ++n;
    }
  EXPECT_GT(n, 100);
  return std::sqrt(std::max(0.0, squares / n - sum / n * (sum / n)));
}

class AnisotropicFace : public testing::TestWithParam<Real> {};
TEST_P(AnisotropicFace, IsTwiceAsFlatAsWithRoundKernels) {
  const Cloud slab = fill(Box3(Vec3(0, 0, 0), Vec3(14, 14, 4)), 1, everywhere, GetParam());
  const Real round = roughness(rasterized(slab, 2, Kind::kRound).mesh(), 3, 3, 11);
  const Real flat = roughness(rasterized(slab, 2, Kind::kAnisotropic).mesh(), 3, 3, 11);
  EXPECT_LT(flat, round / 2) << round << " -> " << flat;
}
INSTANTIATE_TEST_SUITE_P(Jitter, AnisotropicFace, testing::Values(0.05, 0.1, 0.2, 0.25),
                         [](const auto& instance) { return "of_" + std::to_string(static_cast<int>(100 * instance.param)) + "_percent"; });

TEST(RasterizeAnisotropic, SheetsOfOneParticleAreTwiceAsFlatAndWhole) {
  const Cloud sheet = fill(Box3(Vec3(0, 0, 0), Vec3(14, 14, 1)), 1, everywhere, 0.15);
  const Real round = roughness(rasterized(sheet, 2, Kind::kRound).mesh(), 0.5, 3, 11);
  const Real flat = roughness(rasterized(sheet, 2, Kind::kAnisotropic).mesh(), 0.5, 3, 11);
  EXPECT_LT(flat, round / 2) << round << " -> " << flat;
  for (const Real stretch : {1.0, 1.3, 1.5}) {
    Cloud torn;
    std::uint64_t n = 0;
    for (int i = 0; i < 14; ++i)
      for (int j = 0; j < 14; ++j, ++n)
        torn.add(
            Vec3(stretch * i + 0.08 * random_uniform(3, 0, n), stretch * j + 0.08 * random_uniform(3, 1, n), 0.1 * random_uniform(3, 2, n)),
            1);
    const TriMesh mesh = rasterized(torn, 2, Kind::kAnisotropic).mesh();
    EXPECT_EQ(mesh.positions.size(), mesh.triangles.size() / 2 + 2) << "stretch " << stretch << ": a hole through it, or pieces";
  }
}

/// How far a box's edges, seen along them, stay behind the meeting of its faces [spacings]: 0.41 of the radius that rounds them.
Real edge_gap(const TriMesh& mesh, Real x, Real z, Real y0, Real y1) {
  const auto mean = [&](int axis, auto&& counts) {
    Real sum = 0, n = 0;
    for (const Vec3& p : mesh.positions)
      if (p.y() > y0 && p.y() < y1 && counts(p)) sum += p[axis], ++n;
    return sum / n;
  };
  const Real face_x = mean(0, [&](const Vec3& p) { return p.x() > x - 1 && p.z() > z - 3 && p.z() < z - 2; });
  const Real face_z = mean(2, [&](const Vec3& p) { return p.z() > z - 1 && p.x() > x - 6 && p.x() < x - 2; });
  Real gap = 0, n = 0;
  for (Real y = y0; y < y1; y += 0.5, ++n) {
    Real best = -1e9;
    for (const Vec3& p : mesh.positions)
      if (std::abs(p.y() - y) < 0.3) best = std::max(best, p.x() + p.z());
    gap += (face_x + face_z - best) / std::sqrt(2.0);
  }
  return gap / n;
}

TEST(RasterizeAnisotropic, EdgesAreSharperAndTheSurfaceIsNearer) {
  const Cloud box = fill(Box3(Vec3(0, 0, 0), Vec3(12, 12, 5)), 1, everywhere, 0.05);
  const auto to_box = [](const Vec3& p) {
    const Vec3 q = (p - Vec3(6, 6, 2.5)).cwiseAbs() - Vec3(6, 6, 2.5);
    return q.cwiseMax(0).norm() + std::min(0.0, q.maxCoeff());
  };
  const Cloud ball = fill(
      cube(9), 1, [](const Vec3& p) { return p.norm() < 7.75; }, 0.1);
  const auto mean_distance = [](const TriMesh& mesh, auto&& distance) {
    Real sum = 0;
    for (const Vec3& p : mesh.positions) sum += std::abs(distance(p));
    return sum / static_cast<Real>(mesh.positions.size());
  };
  struct Figures {
    Real gap, box, ball, farthest;
  };
  const auto figures = [&](Kind kind) {
    const TriMesh m = rasterized(box, 4, kind).mesh_of_volume(720), b = rasterized(ball, 2, kind).mesh_of_volume(4.0 / 3 * kPi * 512);
    EXPECT_NEAR(geometry::signed_volume(m) / 720, 1, 0.005);
    EXPECT_NEAR(geometry::signed_volume(b) / (4.0 / 3 * kPi * 512), 1, 0.005);
    Figures f{.gap = edge_gap(m, 12, 5, 3, 9), .box = mean_distance(m, to_box), .ball = 0, .farthest = 0};
    f.ball = mean_distance(b, [](const Vec3& p) { return p.norm() - 8; });
    for (const Vec3& p : b.positions) f.farthest = std::max(f.farthest, std::abs(p.norm() - 8));
    return f;
  };
  const Figures round = figures(Kind::kRound), flat = figures(Kind::kAnisotropic);
  EXPECT_LT(flat.gap, 0.8 * round.gap) << round.gap << " -> " << flat.gap;
  EXPECT_LT(flat.box, 0.8 * round.box) << round.box << " -> " << flat.box;
  EXPECT_LT(flat.ball, 0.9 * round.ball) << round.ball << " -> " << flat.ball;
  EXPECT_LT(flat.farthest, round.farthest);
}

TEST(RasterizeAnisotropic, ThinFrontsReachFurther) {
  // Thickness falls from 5 to nothing over 24.
  const auto tip_of = [](const Cloud& wedge, Kind kind) {
    const TriMesh mesh = rasterized(wedge, 2, kind).mesh_of_volume(wedge.volume());
    EXPECT_NEAR(geometry::signed_volume(mesh) / wedge.volume(), 1, 0.005);
    Real sum = 0, n = 0;
    for (Real y = 2; y < 10; y += 0.5, ++n) {
      Real tip = 0;
      for (const Vec3& p : mesh.positions)
        if (std::abs(p.y() - y) < 0.3) tip = std::max(tip, p.x());
      sum += tip;
    }
    return sum / n;
  };
  Real round = 0, flat = 0;
  for (std::uint64_t seed = 1; seed <= 4; ++seed) {
    const Cloud wedge = fill(
        Box3(Vec3(0, 0, 0), Vec3(24, 12, 5)), 1, [](const Vec3& p) { return p.z() + 0.15 < 5 * (1 - p.x() / 24); }, 0.1, seed);
    round += tip_of(wedge, Kind::kRound) / 4;
    flat += tip_of(wedge, Kind::kAnisotropic) / 4;
  }
  EXPECT_GT(flat, round + 0.05);
}

TEST(RasterizeAnisotropic, DropsAndThreadsDoNotShrink) {
  const auto volume = [](const Cloud& cloud) {
    return geometry::signed_volume(rasterized(cloud, 4, Kind::kAnisotropic).mesh()) / cloud.volume();
  };
  Cloud lone;
  lone.add(Vec3(0.1, 0.2, 0.3), 1);
  // A sphere of 0.6 spacings, as far as its field reaches.
  const Rasterized sphere = rasterized(lone, 4, Kind::kAnisotropic);
  for (std::size_t i = 0; i < sphere.phi.size(); ++i) {
    const Real wanted = (voxel_point(sphere.blocks, i) - sphere.particles.x()[0]).norm() - 2.4;
    if (wanted < 3) {
      ASSERT_NEAR(sphere.phi[i], wanted, 1e-3);
    }
  }
  // Round kernels without smoothing leave 0.77, 0.61 and 0.93 of two, eight and 27.
  EXPECT_NEAR(volume(fill(Box3(Vec3(0, 0, 0), Vec3(2, 1, 1)), 1, everywhere, 0)), 1, 0.1);
  EXPECT_NEAR(volume(fill(cube(1), 1, everywhere, 0.1)), 1, 0.1);
  EXPECT_NEAR(volume(fill(cube(1.5), 1, everywhere, 0.1)), 1, 0.1);
  EXPECT_NEAR(volume(fill(Box3(Vec3(0, 0, 0), Vec3(12, 1, 1)), 1, everywhere, 0.05)), 1, 0.15);
}

TEST(RasterizeAnisotropic, WeightTellsLoneParticlesFromSheets) {
  Cloud cloud = fill(Box3(Vec3(0, 0, 0), Vec3(14, 14, 1)), 1, everywhere, 0.05);
  cloud.add(Vec3(7, 7, 8), 1);
  const Rasterized r = rasterized(cloud, 2, Kind::kAnisotropic);
  const float lone = std::pow(1 - 0.09f, 3.0f), sheet = static_cast<float>(kPi) * lone * (1 - 0.09f);
  std::size_t of_lone = 0, of_sheet = 0;
  for (std::size_t i = 0; i < r.phi.size(); ++i) {
    if (std::abs(r.phi[i]) > 0.5f) continue;
    const Vec3 p = r.particles.origin() + r.voxel * voxel_point(r.blocks, i);
    if (p.z() > 4) {
      ++of_lone;
      ASSERT_NEAR(r.weight[i], lone, 1e-3);
    } else if ((p - Vec3(7, 7, 0.5)).cwiseAbs().cwiseMax(Vec3(0, 0, 9)).maxCoeff() < 4 ||
               (std::abs(p.x() - 7) < 4 && std::abs(p.y() - 7) < 4)) {
      ++of_sheet;
      ASSERT_GT(r.weight[i], 0.9f * sheet);
    }
  }
  EXPECT_GT(of_lone, 10u);
  EXPECT_GT(of_sheet, 200u);
}

TEST(RasterizeAnisotropic, IsTheSameBitsOnAnyThreadsInAnyOrderAndOnSomeOfTheBlocks) {
  const Cloud cloud = all_sorts(4);
  const auto hash_of = [](const Rasterized& r) {
    StateHash hash;
    hash.add(std::span<const float>(r.phi));
    hash.add(std::span<const float>(r.weight));
    return hash.value();
  };
  std::uint64_t first = 0;
  for (const int threads : {1, 3}) {
    const ThreadLimit limit(threads);
    const std::uint64_t hash = hash_of(rasterized(cloud, 2, Kind::kAnisotropic));
    if (threads == 1) first = hash;
    EXPECT_EQ(hash, first) << threads << " threads";
  }
  Cloud turned;
  for (std::size_t i = cloud.x.size(); i-- > 0;) {
    turned.add(cloud.x[i], 1);
    turned.radius.back() = cloud.radius[i];
  }
  const Rasterized all = rasterized(turned, 2, Kind::kAnisotropic);
  EXPECT_EQ(hash_of(all), first);

  // The easternmost blocks, with the kernels made for them alone.
  std::vector<BlockCoord> some;
  for (const BlockCoord& c : all.blocks.coords())
    if (c[0] >= all.blocks.coords().back()[0] - 1) some.push_back(c);
  ASSERT_GT(some.size(), 10u);
  ASSERT_LT(some.size(), all.blocks.size());
  const Blocks part(some);
  Field phi, weight;
  rasterize_anisotropic(all.particles, anisotropic_kernels(all.particles, 2, 4, &part), part, all.options, phi, weight);
  for (std::size_t b = 0; b < part.size(); ++b) {
    const BlockCoord& c = part.coords()[b];
    const Index same = all.blocks.block_at(Vec3(kSide * c[0], kSide * c[1], kSide * c[2]));
    ASSERT_TRUE(std::equal(&phi[b * kVoxels], &phi[b * kVoxels] + kVoxels, &all.phi[same * kVoxels])) << b;
    ASSERT_TRUE(std::equal(&weight[b * kVoxels], &weight[b * kVoxels] + kVoxels, &all.weight[same * kVoxels])) << b;
  }
}

TEST(AnisotropicKernels, DependOnNothingBeyondTheirInfluence) {
  // Particles are put beyond it, into others: not a bit may change.
  const Cloud cloud = fill(Box3(Vec3(0, 0, 0), Vec3(14, 6, 4)), 1, everywhere, 0.2);
  const Real away = kernel_influence(2, 4) / 2;
  EXPECT_LT(away, 10);
  const auto first_block = [&](bool more) {
    Cloud all = cloud;
    // Far ones keep the origin where it is.
    all.add(Vec3(-64, -64, -64), 1);
    all.add(Vec3(64, 64, 64), 1);
    for (std::uint64_t i = 0; more && i < 300; ++i)
      all.add(Vec3(1 + away + 4 * random_uniform(1, 0, i), 8 * random_uniform(1, 1, i), 6 * random_uniform(1, 2, i)), 1);
    const Rasterized r = rasterized(all, 2, Kind::kAnisotropic);
    std::vector<float> values;
    for (int i = -2; i <= 1; ++i)
      for (int j = -2; j <= 8; ++j)
        for (int k = -2; k <= 6; ++k) {
          const Vec3 p = (Vec3(i, j, k) - r.particles.origin()) / r.voxel;
          values.push_back(r.blocks.sample(r.phi, r.options.outside, r.blocks.block_at(p), p));
        }
    return values;
  };
  EXPECT_EQ(first_block(false), first_block(true));
}

TEST(RasterizeAnisotropic, TakesNoParticlesAndParticlesOfOnePlace) {
  const ParticleGrid none;
  Field phi, weight;
  rasterize_anisotropic(none, anisotropic_kernels(none, 2, 4), Blocks(), RasterOptions(), phi, weight);
  EXPECT_TRUE(phi.empty());
  Cloud one, many;
  for (int i = 0; i < 20; ++i) many.add(Vec3(0.1, 0.2, 0.3), 1);
  one.add(Vec3(0.1, 0.2, 0.3), 1);
  const Rasterized a = rasterized(one, 2, Kind::kAnisotropic), b = rasterized(many, 2, Kind::kAnisotropic);
  ASSERT_EQ(a.phi.size(), b.phi.size());
  for (const Vec3& c : anisotropic_kernels(b.particles, 2, 4).centre) ASSERT_EQ(c, b.particles.x()[0]);
  for (std::size_t i = 0; i < a.phi.size(); ++i) ASSERT_NEAR(a.phi[i], b.phi[i], 1e-2);
}

}  // namespace
}  // namespace effuse::skin
