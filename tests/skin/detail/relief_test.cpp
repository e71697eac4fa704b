#include "skin/detail/relief.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <set>
#include <string>
#include <utility>
#include <vector>

#include "geometry/base/error.h"
#include "geometry/base/parallel.h"
#include "geometry/base/random.h"
#include "geometry/mesh/measure.h"
#include "geometry/mesh/validate.h"
#include "geometry/procedural/noise.h"
#include "skin/detail/clinker.h"
#include "skin/detail/folds.h"
#include "skin/detail/plates.h"
#include "skin/surface/level_set.h"

namespace effuse::skin {
namespace {

using geometry::Points;
using geometry::TriMesh;

/// Lava as the skin's tests move it about: spacing 1.
struct Lava {
  std::vector<Vec3> x, velocity, rest, rest2;
  std::vector<Real> radius, temperature, crust;
  std::vector<std::uint64_t> id;
  Real rest_ratio = 0;

  void add(const Vec3& p, Real T, Real solid) {
    id.push_back(1000 + x.size());
    x.push_back(p);
    velocity.emplace_back(0.1 - 0.02 * p.x(), 0.01 * p.y(), 0);
    rest.push_back(p + Vec3(100, 20, 3));
    rest2.push_back(p + Vec3(-40, 55, 0.4));
    radius.push_back(0.5);
    temperature.push_back(T);
    crust.push_back(solid);
  }
  Points points() const {
    Points p;
    p.position = x;
    p.velocity = velocity;
    p.rest = rest;
    p.rest2 = rest2;
    p.radius = radius;
    p.temperature = temperature;
    p.crust = crust;
    p.id = id;
    p.rest_ratio = rest_ratio;
    return p;
  }
};

/// A slab of three layers, its top about z = 3, as a liquid's particles lie: rows, and everything moved by up to 0.2.
Lava slab(int across, Real T = 900, Real crust = 1) {
  Lava lava;
  std::uint64_t n = 0;
  for (int i = 0; i < across; ++i)
    for (int j = 0; j < across; ++j)
      for (int k = 0; k < 3; ++k, ++n) {
        const auto off = [&](std::uint64_t axis) { return 0.4 * random_uniform(2, axis, n) - 0.2; };
        lava.add(Vec3(i + 0.5 + 0.25 * (j % 2) + off(0), j + 0.5 + off(1), k + 0.5 + 0.5 * off(2)), T, crust);
      }
  return lava;
}

/// Points of its top, away from its sides.
std::vector<Vec3> top(int across, std::size_t n, Real margin = 3) {
  std::vector<Vec3> at;
  for (std::uint64_t i = 0; i < n; ++i)
    at.emplace_back(margin + (across - 2 * margin) * random_uniform(5, 0, i), margin + (across - 2 * margin) * random_uniform(5, 1, i), 3);
  return at;
}

DisplaceOptions options_of(SkinKind kind, Real rest_ratio = 0) {
  DisplaceOptions o;
  o.spacing = 1;
  o.kind = kind;
  o.rest_ratio = rest_ratio;
  return o;
}

constexpr Real kEdge = 0.05;  // fine enough for every octave

std::vector<Real> heights(const Relief& relief, const std::vector<Vec3>& at) {
  std::vector<Real> h;
  for (const Vec3& x : at) h.push_back(relief.at(x, kEdge).height);
  return h;
}

/// From valleys to crests: what "clinker height" means here.
Real range(const std::vector<Real>& h) {
  const auto [low, high] = std::minmax_element(h.begin(), h.end());
  return *high - *low;
}

Real largest_difference(const std::vector<Real>& a, const std::vector<Real>& b) {
  Real most = 0;
  for (std::size_t i = 0; i < a.size(); ++i) most = std::max(most, std::abs(a[i] - b[i]));
  return most;
}

class Kinds : public testing::TestWithParam<SkinKind> {};
INSTANTIATE_TEST_SUITE_P(All, Kinds, testing::Values(SkinKind::kAa, SkinKind::kPahoehoe, SkinKind::kBlock, SkinKind::kObsidian),
                         [](const auto& each) { return std::string(kSkinKindNames[static_cast<std::size_t>(each.param)]); });

struct Move {
  Quat turn{Eigen::AngleAxisd(0.8, Vec3::UnitZ())};
  Vec3 shift{313.7, -94.1, 12.2};
  Vec3 operator()(const Vec3& x) const { return turn * x + shift; }
};

TEST_P(Kinds, ParticlesMovedRigidlyTakeTheReliefWithThem) {
  Lava lava = slab(12);
  const std::vector<Vec3> at = top(12, 300);
  const std::vector<Real> before = heights(Relief(lava.points(), options_of(GetParam(), 0.3)), at);
  const Move move;
  std::vector<Vec3> moved_at;
  for (const Vec3& x : at) moved_at.push_back(move(x));
  for (Vec3& x : lava.x) x = move(x);
  for (Vec3& v : lava.velocity) v = move.turn * v;
  const std::vector<Real> after = heights(Relief(lava.points(), options_of(GetParam(), 0.3)), moved_at);
  EXPECT_GT(range(before), 0.1);
  // One per cent is asked for; nothing but rounding is left.
  EXPECT_LT(largest_difference(before, after), 1e-6 * range(before));

  // Noise that stands in the world fails the same measure by far.
  std::vector<Real> naive, naive_moved;
  for (std::size_t i = 0; i < at.size(); ++i) {
    naive.push_back(geometry::gradient_noise(at[i] / 3, 1));
    naive_moved.push_back(geometry::gradient_noise(moved_at[i] / 3, 1));
  }
  EXPECT_GT(largest_difference(naive, naive_moved), 0.3 * range(naive));
}

TEST(Relief, WithoutMaterialCoordinatesItSwims) {
  Lava lava = slab(12);
  lava.rest.clear();
  lava.rest2.clear();
  const std::vector<Vec3> at = top(12, 300);
  const std::vector<Real> before = heights(Relief(lava.points(), options_of(SkinKind::kObsidian)), at);
  std::vector<Vec3> moved_at;
  for (const Vec3& x : at) moved_at.push_back(x + Vec3(1.3, 0, 0));
  for (Vec3& x : lava.x) x += Vec3(1.3, 0, 0);
  EXPECT_GT(largest_difference(before, heights(Relief(lava.points(), options_of(SkinKind::kObsidian)), moved_at)), 0.1 * range(before));
}

/// Two hundred frames of slow shear: a velocity gradient of 1 % a frame, so that neighbours pass at 1 % of the spacing a frame, most of it
/// sideways over the slab's width, some over its depth. Material frames are renewed in turn every 160 frames; one
/// particle in three of the second layer rises to the surface at half a per cent, and as many of the top sink.
TEST_P(Kinds, ShearWithChangingNeighborsNeverJumps) {
  constexpr int kAcross = 14, kFrames = 200, kPeriod = 160;
  constexpr Real kStep = 0.01;
  Lava lava = slab(kAcross);
  std::vector<Vec3> at = top(kAcross, 150, 4.5);
  const Vec3 middle(kAcross / 2.0, kAcross / 2.0, 0);
  const auto velocity = [&](const Vec3& x) { return Vec3(kStep * (0.8 * (x.y() - middle.y()) + 0.57 * (x.z() - 1.5) - 0.2 * (x.x() - middle.x())), 0, 0); };
  int rest_born = -kPeriod / 4, rest2_born = -3 * kPeriod / 4;
  std::vector<Real> before;
  Real most = 0, amplitude = 0;
  int changed = 0;
  std::vector<Index> owner(at.size());
  for (int frame = 0; frame <= kFrames; ++frame) {
    if (frame - rest_born >= kPeriod) {
      lava.rest = lava.x;
      rest_born = frame;
    }
    if (frame - rest2_born >= kPeriod) {
      lava.rest2 = lava.x;
      rest2_born = frame;
    }
    for (std::size_t i = 0; i < lava.x.size(); ++i) lava.velocity[i] = 25 * velocity(lava.x[i]);
    const Real ratio = std::abs(2.0 * (frame - rest_born) / kPeriod - 1);
    const std::vector<Real> now = heights(Relief(lava.points(), options_of(GetParam(), ratio)), at);
    if (frame > 0) most = std::max(most, largest_difference(before, now));
    amplitude = std::max(amplitude, range(now));
    before = now;
    const Regions regions(lava.points(), 1);
    for (std::size_t i = 0; i < at.size(); ++i) {
      const Index p = regions.nearest(at[i]);
      changed += frame > 0 && p != owner[i];
      owner[i] = p;
    }

    for (std::size_t i = 0; i < lava.x.size(); ++i) {
      lava.x[i] += velocity(lava.x[i]);
      if (i % 9 == 1 && lava.x[i].z() < 2.6) lava.x[i].z() += kStep / 2;
      if (i % 9 == 5 && lava.x[i].z() > 1.4) lava.x[i].z() -= kStep / 2;
    }
    for (Vec3& x : at) x += velocity(x);
  }
  RecordProperty("per_cent_a_frame", std::to_string(100 * most / amplitude));
  EXPECT_GT(changed, 100) << "regions came, went and changed";
  EXPECT_LT(most, 0.05 * amplitude) << "of " << amplitude;
}

TEST_P(Kinds, TheBlendOfFramesBeginsAndEndsWithoutAStep) {
  Lava lava = slab(12);
  const std::vector<Vec3> at = top(12, 100);
  const std::vector<Real> first = heights(Relief(lava.points(), options_of(GetParam(), 0)), at),
                          nearly = heights(Relief(lava.points(), options_of(GetParam(), 1e-4)), at);
  EXPECT_LT(largest_difference(first, nearly), 1e-3);
  // At ratio 0 the second frame weighs nothing: born anew there, nobody sees.
  for (Vec3& r : lava.rest2) r = 3 * r + Vec3(7, 8, 9);
  EXPECT_EQ(heights(Relief(lava.points(), options_of(GetParam(), 0)), at), first);
}

TEST_P(Kinds, ReliefGrowsAsLavaCoolsAndCrustThickens) {
  const std::vector<Vec3> at = top(14, 400);
  const auto deviation = [&](Real T, Real crust) {
    const Lava lava = slab(14, T, crust);
    Real sum = 0, squares = 0;
    for (const Real h : heights(Relief(lava.points(), options_of(GetParam())), at)) {
      sum += h;
      squares += h * h;
    }
    const Real n = static_cast<Real>(at.size());
    return std::sqrt(squares / n - sum * sum / n / n);
  };
  Real before = 0;
  for (const Real T : {1500.0, 1400.0, 1350.0, 1300.0, 1250.0, 1200.0, 1100.0}) {
    const Real now = deviation(T, 0);
    EXPECT_GE(now, before) << T;
    before = now;
  }
  EXPECT_GT(before, 1.8 * deviation(1500, 0));
  before = 0;
  for (const Real crust : {0.0, 0.2, 0.4, 0.6, 0.8, 1.0}) {
    const Real now = deviation(1500, crust);
    EXPECT_GT(now, before) << crust;
    before = now;
  }
}

TEST_P(Kinds, MeansAreSmallSoThatVolumeStays) {
  for (const Real T : {1500.0, 1300.0, 900.0}) {
    const Lava lava = slab(24, T, 0);
    const std::vector<Vec3> at = top(24, 3000);
    Real sum = 0;
    for (const Real h : heights(Relief(lava.points(), options_of(GetParam())), at)) sum += h;
    // A tenth of the amplitude, 0.25: of a flow three spacings deep 0.8 %.
    EXPECT_NEAR(sum / static_cast<Real>(at.size()), 0, 0.025) << T;
  }
}

TEST(Relief, IsSmoothAlongTheSurfaceAcrossRegionsAndPlates) {
  // C1: steps of a line through many regions; second differences shrink with the square of the step, a kink's would by the first power.
  const Lava lava = slab(14);
  for (const SkinKind kind : {SkinKind::kAa, SkinKind::kPahoehoe, SkinKind::kBlock, SkinKind::kObsidian}) {
    const Relief relief(lava.points(), options_of(kind));
    const auto bend = [&](Real step) {
      Real most = 0;
      for (Real s = 3; s < 11; s += 0.004) {
        const auto h = [&](Real t) { return relief.at(Vec3(t, 0.3 * t + 4, 3), kEdge).height; };
        most = std::max(most, std::abs(h(s + step) - 2 * h(s) + h(s - step)) / step);
      }
      return most;  // jump of the slope
    };
    const Real coarse = bend(2e-3), fine = bend(2.5e-4);
    EXPECT_LT(fine, 0.25 * coarse) << kSkinKindNames[static_cast<std::size_t>(kind)];
  }
}

TEST(Clinker, VanishesWithItsSlopeOnEveryBorder) {
  const Lava lava = slab(12);
  const Points points = lava.points();
  const Regions regions(points, 1);
  const auto z = [&](const Vec3& x) {
    const Regions::Place p = regions.at(x);
    const Vec3 d = x - points.position[p.particle];
    return clinker(p, points.id[p.particle], d.head<2>(), clinker_growth(1), 1);
  };
  int crossed = 0;
  for (const Vec3& x : top(12, 400)) {
    // Walk until the region changes, bisect the border.
    Vec3 a = x, b = x + Vec3(0.9, 0.2, 0);
    if (regions.nearest(a) == regions.nearest(b)) continue;
    for (int k = 0; k < 45; ++k) {
      const Vec3 c = (a + b) / 2;
      (regions.nearest(c) == regions.nearest(a) ? a : b) = c;
    }
    ++crossed;
    ASSERT_NEAR(z(a), 0, 1e-6);
    ASSERT_NEAR(z(a - Vec3(1e-5, 0, 0)), 0, 1e-6) << "no slope";
  }
  EXPECT_GT(crossed, 100);
}

TEST(Clinker, HeightSizeAndRoughnessGrowWithCold) {
  ClinkerGrowth before = clinker_growth(0);
  EXPECT_EQ(before.height, 0);
  EXPECT_EQ(before.roughness, 0);
  for (Real cold = 0.05; cold <= 1; cold += 0.05) {
    const ClinkerGrowth now = clinker_growth(cold);
    EXPECT_GT(now.height, before.height);
    EXPECT_GT(now.size, before.size);
    EXPECT_GT(now.roughness, before.roughness);
    before = now;
  }
}

TEST(Clinker, ItsMeanIsWhatItSays) {
  const Lava lava = slab(24);
  const Points points = lava.points();
  const Regions regions(points, 1);
  for (const Real cold : {0.0, 0.5, 1.0}) {
    Real sum = 0;
    const std::vector<Vec3> at = top(24, 20000);
    for (const Vec3& x : at) {
      const Regions::Place p = regions.at(x);
      sum += clinker(p, points.id[p.particle], (x - points.position[p.particle]).head<2>(), clinker_growth(cold), 1);
    }
    const Real mean = sum / static_cast<Real>(at.size());
    EXPECT_NEAR(mean, mean_clinker(clinker_growth(cold).size), 0.03) << cold;
  }
}

/// Skin of a slab on flat ground.
struct Skin {
  Lava lava = slab(12, 950, 0.8);
  geometry::Terrain ground = geometry::Terrain::from_height_field(geometry::HeightField(Vec2(-20, -20), Vec2(10, 10), 6, 6, std::vector<Real>(36, 0.0)));
  Real particles = static_cast<Real>(lava.x.size());  // [m^3]
  TriMesh mesh;
  Skin() {
    for (std::size_t i = 0; i < lava.x.size(); ++i) lava.temperature[i] = 1450 - 50 * lava.x[i].x();
    LevelSetOptions options;
    options.spacing = 1;
    mesh = mesh_level_set(build_level_set(lava.points(), particles, &ground, options));
  }
};

Real volume_above(TriMesh mesh, Real z) {
  for (Vec3& p : mesh.positions) p.z() = std::max(p.z(), z);
  return geometry::signed_volume(mesh);
}

TEST_P(Kinds, TheSkinStaysSolidOnTheGroundAndEnclosesTheParticlesVolume) {
  const Skin skin;
  TriMesh mesh = skin.mesh;
  DisplaceOptions options = options_of(GetParam());
  options.edge = 0.25;
  const DisplaceReport report = displace(mesh, skin.lava.points(), &skin.ground, options);
  EXPECT_GT(report.refined, 0);
  EXPECT_GT(report.largest, 0.08);
  EXPECT_LE(report.largest, 0.35);
  EXPECT_LT(static_cast<double>(report.held_back), 0.01 * static_cast<double>(mesh.positions.size()));
  const geometry::MeshReport valid = geometry::validate(mesh);
  EXPECT_TRUE(valid.solid()) << geometry::to_string(valid);
  EXPECT_NEAR(volume_above(mesh, 0) / skin.particles, 1, 0.03);
  const auto& detail = mesh.attributes.at("detail").values;
  ASSERT_EQ(detail.size(), mesh.positions.size());
  const auto [low, high] = std::minmax_element(detail.begin(), detail.end());
  EXPECT_GE(*low, -1);
  EXPECT_LE(*high, 1);
  EXPECT_GT(*high - *low, 0.5);
}

TEST_P(Kinds, TheDisplacedSkinMovesRigidlyWithItsParticles) {
  Skin skin;
  const Move move;
  TriMesh here = skin.mesh, there = skin.mesh;
  const DisplaceOptions options = options_of(GetParam(), 0.6);
  displace(here, skin.lava.points(), nullptr, options);
  for (Vec3& x : skin.lava.x) x = move(x);
  for (Vec3& v : skin.lava.velocity) v = move.turn * v;
  for (Vec3& p : there.positions) p = move(p);
  for (Vec3& n : there.normals) n = move.turn * n;
  displace(there, skin.lava.points(), nullptr, options);
  ASSERT_EQ(here.positions.size(), there.positions.size());
  Real most = 0;
  for (std::size_t i = 0; i < here.positions.size(); ++i) most = std::max(most, (move(here.positions[i]) - there.positions[i]).norm());
  EXPECT_LT(most, 0.01 * 2 * options.amplitude) << "one per cent of the clinkers' height";
}

TEST(Relief, TwoMeshesOfOneSurfaceAreMovedAlike) {
  const Skin skin;
  const Relief relief(skin.lava.points(), options_of(SkinKind::kAa));
  TriMesh coarse = skin.mesh, fine = skin.mesh;
  DisplaceOptions options = options_of(SkinKind::kAa);
  options.octaves = 1;
  options.edge = 0.3;
  displace(coarse, skin.lava.points(), nullptr, options);
  options.edge = 0.15;
  displace(fine, skin.lava.points(), nullptr, options);
  // The first vertices are in both; the finer mesh's octaves were left out of neither.
  std::size_t differ = 0;
  Real sum = 0;
  for (std::size_t i = 0; i < skin.mesh.positions.size(); ++i) {
    const Real apart = (coarse.positions[i] - fine.positions[i]).norm();
    differ += apart > 0.02;
    sum += apart;
  }
  // Where a triangle of one of them would have turned over, its corners are held back.
  EXPECT_LE(differ, skin.mesh.positions.size() / 1000);
  EXPECT_LT(sum / static_cast<Real>(skin.mesh.positions.size()), 0.002);
}

TEST(Relief, WithAViewTheMeshIsFineWhereItIsSeen) {
  const Skin skin;
  TriMesh mesh = skin.mesh;
  DisplaceOptions options = options_of(SkinKind::kAa);
  options.edge = 0.05;
  options.view = View{};
  options.view->eye = Vec3(0, 0, 5);
  options.view->pixels = 40;
  displace(mesh, skin.lava.points(), &skin.ground, options);
  std::size_t near = 0, far = 0;
  for (const Vec3& p : mesh.positions) {
    near += p.z() > 2 && p.head<2>().norm() < 5;
    far += p.z() > 2 && (p.head<2>() - Vec2(12, 12)).norm() < 5;
  }
  EXPECT_GT(near, 2 * far);
  EXPECT_TRUE(geometry::validate(mesh).solid());
}

TEST(Relief, SameBitsOnAnyThreadsAndOrderOfTheParticlesDoesNotMatter) {
  const Skin skin;
  const auto skin_of = [&](const Lava& lava, int threads) {
    const ThreadLimit limit(threads);
    TriMesh mesh = skin.mesh;
    displace(mesh, lava.points(), &skin.ground, options_of(SkinKind::kAa, 0.4));
    return mesh;
  };
  const TriMesh one = skin_of(skin.lava, 1), four = skin_of(skin.lava, 4);
  EXPECT_EQ(one.positions, four.positions);
  Lava turned = skin.lava;
  const auto turn = [](auto& v) { std::reverse(v.begin(), v.end()); };
  turn(turned.x), turn(turned.velocity), turn(turned.rest), turn(turned.rest2), turn(turned.temperature), turn(turned.crust), turn(turned.id);
  const TriMesh other = skin_of(turned, 2);
  for (std::size_t i = 0; i < one.positions.size(); ++i) ASSERT_LT((one.positions[i] - other.positions[i]).norm(), 1e-9);
}

TEST(Relief, ALoneParticleAndNoneAtAll) {
  Lava lava;
  TriMesh mesh;
  for (const SkinKind kind : {SkinKind::kAa, SkinKind::kPahoehoe, SkinKind::kBlock, SkinKind::kObsidian}) {
    EXPECT_EQ(displace(mesh, lava.points(), nullptr, options_of(kind)).largest, 0);
    EXPECT_EQ(Relief(lava.points(), options_of(kind)).at(Vec3(1, 2, 3), 0.1).height, 0);
  }
  lava.add(Vec3(1, 2, 3), 900, 1);
  for (const SkinKind kind : {SkinKind::kAa, SkinKind::kPahoehoe, SkinKind::kBlock, SkinKind::kObsidian}) {
    const Relief relief(lava.points(), options_of(kind));
    for (const Vec3& d : {Vec3(0.6, 0, 0), Vec3(0, 0, -0.6), Vec3(0, 0, 0)}) {
      const Relief::Sample s = relief.at(lava.x[0] + d, 0.1);
      EXPECT_TRUE(std::isfinite(s.height) && std::isfinite(s.detail)) << kSkinKindNames[static_cast<std::size_t>(kind)];
      EXPECT_LE(std::abs(s.height), 0.35);
    }
  }
}

TEST(Relief, OnADropIsNoHigherThanAFifthOfItsRadius) {
  Lava lava;
  lava.add(Vec3(1, 2, 3), 900, 1);
  for (const SkinKind kind : {SkinKind::kAa, SkinKind::kBlock}) {
    const Relief relief(lava.points(), options_of(kind));
    Real most = 0;
    for (std::uint64_t i = 0; i < 200; ++i) {
      const Vec3 way(random_normal(8, 0, i), random_normal(8, 1, i), random_normal(8, 2, i));
      most = std::max(most, std::abs(relief.at(lava.x[0] + 0.62 * way.normalized(), 0.1).height));
    }
    EXPECT_LT(most, 0.2 * 0.62);
    EXPECT_GT(most, 0.01);
  }
}

/// A velocity that squeezes along x: folds must run across it.
TEST(Folds, RunAcrossTheSqueezeAndFadeWithoutOne) {
  Lava lava = slab(14);
  const auto bends = [&](const Mat3& gradient) {
    for (std::size_t i = 0; i < lava.x.size(); ++i) lava.velocity[i] = gradient * lava.x[i];
    DisplaceOptions still = options_of(SkinKind::kObsidian), folded = still;
    still.fold_time = 0;
    const Relief without(lava.points(), still), with(lava.points(), folded);
    Real along = 0, across = 0;
    for (const Vec3& x : top(14, 500)) {
      const auto fold = [&](const Vec3& p) { return with.at(p, kEdge).height - without.at(p, kEdge).height; };
      along += std::pow(fold(x + Vec3(0.05, 0, 0)) - fold(x), 2);
      across += std::pow(fold(x + Vec3(0, 0.05, 0)) - fold(x), 2);
    }
    return std::pair{std::sqrt(along), std::sqrt(across)};
  };
  Mat3 squeeze = Mat3::Zero();
  squeeze(0, 0) = -0.05;
  squeeze(2, 2) = 0.05;
  const auto [along, across] = bends(squeeze);
  EXPECT_GT(along, 2 * across) << "heights change along the squeeze, folds run across it";
  std::swap(squeeze(0, 0), squeeze(1, 1));
  const auto [turned_along, turned_across] = bends(squeeze);
  EXPECT_GT(turned_across, 2 * turned_along);
  Mat3 spin = Mat3::Zero();
  spin(0, 1) = 0.05;
  spin(1, 0) = -0.05;
  EXPECT_LT(bends(spin).first, 0.02 * along) << "turning as a whole folds nothing";
}

TEST(Folds, ProfileIsEvenPeriodicAndOfMeanZero) {
  Real sum = 0;
  for (int k = 0; k < 1000; ++k) {
    const Real phase = 2 * kPi * k / 1000;
    sum += rope_profile(phase);
    ASSERT_NEAR(rope_profile(phase), rope_profile(-phase), 1e-12);
    ASSERT_NEAR(rope_profile(phase), rope_profile(phase + 2 * kPi), 1e-12);
  }
  EXPECT_NEAR(sum / 1000, 0, 1e-3);
  EXPECT_GT(rope_profile(0), 0.8);
  EXPECT_LT(rope_profile(kPi), -1);
}

TEST(Plates, InsideIsC1AndPlatesAreOnePerCell) {
  std::set<std::uint64_t> ids;
  Real most = 0;
  for (std::uint64_t i = 0; i < 20000; ++i) {
    const Vec3 p = 6 * Vec3(random_uniform(8, 0, i), random_uniform(8, 1, i), random_uniform(8, 2, i));
    const PlatePlace at = plate_at(p, kWidestPlateSlope, 3);
    ids.insert(at.id);
    ASSERT_GE(at.inside, 0);
    ASSERT_LE(at.inside, 1);
    ASSERT_GE(at.border, 0);
    const Real step = 1e-6;
    const Real bend = plate_at(p + Vec3(step, 0, 0), kWidestPlateSlope, 3).inside - 2 * at.inside + plate_at(p - Vec3(step, 0, 0), kWidestPlateSlope, 3).inside;
    most = std::max(most, std::abs(bend) / step);
    if (plate_at(p, kWidestPlateSlope, 3).border < 1e-3) {
      EXPECT_LT(at.inside, 1e-3);
    }
  }
  EXPECT_LT(most, 0.01) << "a kink would jump by its slope, ten";
  // A site a cell: those of the cube, and some of the cells about it.
  EXPECT_GE(ids.size(), 6u * 6 * 6);
  EXPECT_LE(ids.size(), 8u * 8 * 8);
}

TEST(Material, FollowsShearAndStretchExactlyAndTurnsWithTheParticles) {
  Lava lava = slab(12);
  Mat3 F;
  F << 1.2, 0.4, 0.1, 0, 0.9, -0.2, 0.05, 0, 1;
  for (std::size_t i = 0; i < lava.x.size(); ++i) {
    lava.rest[i] = F * lava.x[i] + Vec3(7, 8, 9);
    lava.velocity[i] = F * lava.x[i];
  }
  const Material material(lava.points(), 1);
  for (const Vec3& x : top(12, 100)) {
    const Material::Sample s = material.at(x);
    ASSERT_TRUE(s.any);
    // Lambda against a spread of 0.1 or more: 0.05^2 / 0.1 of a slope of 1.8, at a point 0.8 from the mean.
    ASSERT_LT((s.rest[0] - (F * x + Vec3(7, 8, 9))).norm(), 0.036);
    ASSERT_LT((s.slope[0] - F).norm(), 0.045);
    ASSERT_LT((s.strain_rate - 0.5 * (F + F.transpose())).norm(), 0.045);
    ASSERT_GT(s.outward.z(), 0.3) << "out of the top";
    ASSERT_NEAR(s.temperature, 900, 1e-9);
  }
  EXPECT_FALSE(material.at(Vec3(100, 0, 0)).any);
  lava.x[3].x() = std::nan("");
  EXPECT_THROW(Material(lava.points(), 1), InputError);
}

}  // namespace
}  // namespace effuse::skin
