#include "skin/tessellate/regions.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <numeric>

#include "geometry/base/error.h"
#include "geometry/base/random.h"

namespace effuse::skin {
namespace {

constexpr Real kSpacing = 0.5;

struct Sites {
  std::vector<Vec3> x;
  std::vector<Real> radius;
  std::vector<std::uint64_t> id;

  void add(const Vec3& p) {
    x.push_back(p);
    radius.push_back(kSpacing / 2);
    id.push_back(1000 + 7 * x.size());
  }
  geometry::Points points() const {
    geometry::Points p;
    p.position = x;
    p.radius = radius;
    p.id = id;
    return p;
  }
};

Vec3 random_point(std::uint64_t seed, std::uint64_t n) {
  return {random_uniform(seed, 0, n), random_uniform(seed, 1, n), random_uniform(seed, 2, n)};
}

/// A jittered lattice of n^3 particles from the origin.
Sites cloud(int n, std::uint64_t seed) {
  Sites sites;
  for (int i = 0; i < n; ++i)
    for (int j = 0; j < n; ++j)
      for (int k = 0; k < n; ++k) sites.add(kSpacing * (Vec3(i, j, k) + 0.6 * random_point(seed, sites.x.size())));
  return sites;
}

/// The docstring's formulas over all particles.
Regions::Place brute_force(const Sites& sites, const Vec3& x, Real width) {
  Regions::Place place;
  Real least = 9 * kSpacing * kSpacing;
  for (std::size_t i = 0; i < sites.x.size(); ++i) {
    const Real d = (x - sites.x[i]).squaredNorm();
    if (d < least || (d == least && place.particle != Regions::kNone && sites.id[i] < sites.id[place.particle])) {
      least = d;
      place.particle = static_cast<Index>(i);
    }
  }
  if (place.particle == Regions::kNone) return place;
  const Vec3 xi = sites.x[place.particle];
  place.inside = 1;
  place.border = width * kSpacing;
  for (std::size_t j = 0; j < sites.x.size(); ++j) {
    const Real apart = (sites.x[j] - xi).norm();
    if (apart == 0) continue;
    const Real b = ((x - sites.x[j]).squaredNorm() - least) / (2 * apart), t = std::min(1.0, b / (width * kSpacing));
    place.inside *= t * t * (3 - 2 * t);
    if (b < place.border) {
      place.border = b;
      place.neighbor = static_cast<Index>(j);
    }
  }
  return place;
}

TEST(Regions, AgreeWithTheFormulaOverAllParticles) {
  for (std::uint64_t seed = 1; seed <= 3; ++seed) {
    const Sites sites = cloud(7, seed);
    const Regions regions(sites.points(), kSpacing);
    int none = 0, cut = 0;
    for (std::uint64_t n = 0; n < 3000; ++n) {
      // Over the cloud's border too, up to where nobody reaches.
      const Vec3 x = kSpacing * (14 * random_point(100 + seed, n) - Vec3::Constant(4));
      const Real width = n % 3 == 0 ? 0.5 : 0.2 + random_uniform(seed, 9, n);
      const Regions::Place place = regions.at(x, width), expected = brute_force(sites, x, width);
      ASSERT_EQ(place.particle, expected.particle) << "seed " << seed << ", point " << n;
      ASSERT_EQ(regions.nearest(x), expected.particle);
      ASSERT_EQ(place.neighbor, expected.neighbor);
      ASSERT_NEAR(place.inside, expected.inside, 1e-13);
      ASSERT_NEAR(place.border, expected.border, 1e-13);
      none += place.particle == Regions::kNone;
      cut += place.neighbor != Regions::kNone;
    }
    EXPECT_GT(none, 100);
    EXPECT_GT(cut, 1000);
  }
}

TEST(Regions, InsideHasNoStepAndNoKinkAlongALine) {
  // Along lines through the cloud, across borders and where the set of neighbours changes: first differences vanish with the
  // step, and so do the differences of slopes. A kink would leave a jump of slope however small the step.
  const Sites sites = cloud(6, 5);
  const Regions regions(sites.points(), kSpacing);
  int crossings = 0;
  for (std::uint64_t line = 0; line < 8; ++line) {
    const Vec3 from = kSpacing * (Vec3::Constant(1) + 4 * random_point(40, line)),
               to = kSpacing * (Vec3::Constant(1) + 4 * random_point(41, line));
    const int steps = 20000;
    const Real h = (to - from).norm() / steps;
    Real before = 0, slope_before = 0;
    Index last = Regions::kNone;
    for (int s = 0; s <= steps; ++s) {
      const Regions::Place place = regions.at(from + (to - from) * (static_cast<Real>(s) / steps));
      ASSERT_GE(place.inside, 0);
      ASSERT_LE(place.inside, 1);
      const Real slope = (place.inside - before) / h;
      // |inside'| <= 1.5 / w a factor, |inside''| <= 6 / w^2 a factor and products of two slopes: with up to six factors at
      // once below 60 / w^2, w = kSpacing / 2.
      const Real w = kSpacing / 2;
      if (s > 0) {
        ASSERT_LT(std::abs(slope), 6 / w);
      }
      if (s > 1) {
        ASSERT_LT(std::abs(slope - slope_before), 60 / (w * w) * h) << "line " << line << ", step " << s;
      }
      crossings += s > 0 && place.particle != last;
      if (s > 0 && place.particle != last) {
        EXPECT_LT(place.inside, 1e-5);
      }
      last = place.particle;
      before = place.inside;
      slope_before = slope;
    }
  }
  EXPECT_GT(crossings, 20);
}

TEST(Regions, InsideHasNoStepAndNoKinkAsParticlesMove) {
  // One particle wanders through all the others past a fixed point: its region comes, takes the point, and goes.
  Sites sites = cloud(5, 6);
  const Vec3 x = kSpacing * Vec3(2.3, 2.4, 2.2);
  const Vec3 from = kSpacing * Vec3(0.2, 2.0, 1.9), to = kSpacing * Vec3(4.6, 2.7, 2.6);
  const int steps = 4000;
  const Real h = (to - from).norm() / steps;
  Real before = 0, slope_before = 0;
  bool taken = false;
  for (int s = 0; s <= steps; ++s) {
    sites.x.back() = from + (to - from) * (static_cast<Real>(s) / steps);
    const Regions::Place place = Regions(sites.points(), kSpacing).at(x);
    taken |= place.particle + 1 == sites.x.size();
    const Real slope = (place.inside - before) / h, w = kSpacing / 2;
    // A particle's own motion turns its planes as well: they move by at most the ratio of the distances, here below 4.
    if (s > 1) {
      ASSERT_LT(std::abs(slope - slope_before), 16 * 60 / (w * w) * h) << "step " << s;
    }
    before = place.inside;
    slope_before = slope;
  }
  EXPECT_TRUE(taken);
}

TEST(Regions, AreTheSameInAnyOrderOfThePoints) {
  // A lattice without jitter: ties everywhere.
  Sites sites;
  for (int i = 0; i < 5; ++i)
    for (int j = 0; j < 5; ++j)
      for (int k = 0; k < 5; ++k) sites.add(kSpacing * Vec3(i, j, k));
  std::vector<std::size_t> order(sites.x.size());
  std::iota(order.begin(), order.end(), 0u);
  std::sort(order.begin(), order.end(), [](std::size_t a, std::size_t b) { return random_bits(3, 0, a) < random_bits(3, 0, b); });
  Sites shuffled = sites;
  for (std::size_t i = 0; i < order.size(); ++i) {
    shuffled.x[i] = sites.x[order[i]];
    shuffled.id[i] = sites.id[order[i]];
  }
  const Regions one(sites.points(), kSpacing), other(shuffled.points(), kSpacing);
  for (std::uint64_t n = 0; n < 2000; ++n) {
    // Half of them on the lattice of quarter spacings, where several particles are equally near.
    Vec3 x = kSpacing * (5 * random_point(8, n) - Vec3::Constant(0.5));
    if (n % 2) x = (kSpacing / 4) * (x / (kSpacing / 4)).array().round().matrix();
    const Regions::Place a = one.at(x), b = other.at(x);
    ASSERT_EQ(sites.id[a.particle], shuffled.id[b.particle]);
    ASSERT_EQ(a.neighbor == Regions::kNone, b.neighbor == Regions::kNone);
    if (a.neighbor != Regions::kNone) {
      ASSERT_EQ(sites.id[a.neighbor], shuffled.id[b.neighbor]);
    }
    ASSERT_EQ(a.inside, b.inside);
    ASSERT_EQ(a.border, b.border);
  }
}

TEST(Regions, MoveRigidlyWithTheParticles) {
  const Sites sites = cloud(6, 7);
  const Mat3 turn = Eigen::AngleAxisd(1.1, Vec3(1, 2, 3).normalized()).toRotationMatrix();
  const Vec3 shift(340000, 5.9e6, 120);  // metres of a map
  Sites moved = sites;
  for (Vec3& x : moved.x) x = turn * x + shift;
  const Regions before(sites.points(), kSpacing), after(moved.points(), kSpacing);
  for (std::uint64_t n = 0; n < 2000; ++n) {
    const Vec3 x = kSpacing * 6 * random_point(9, n);
    const Regions::Place a = before.at(x), b = after.at(turn * x + shift);
    // Positions of 6e6 m are good to 1e-9 m.
    ASSERT_NEAR(a.inside, b.inside, 1e-7);
    ASSERT_NEAR(a.border, b.border, 1e-8);
    if (a.border > 1e-8) {
      ASSERT_EQ(a.particle, b.particle);
    }
  }
}

TEST(Regions, OfParticlesAtOnePlaceTheSmallerIdHasTheRegion) {
  Sites sites;
  sites.add(Vec3::Zero());
  sites.add(Vec3::Zero());
  sites.add(Vec3(kSpacing, 0, 0));
  sites.id = {9, 4, 5};
  const Regions regions(sites.points(), kSpacing);
  const Regions::Place place = regions.at(Vec3(0.1 * kSpacing, 0.2 * kSpacing, 0));
  EXPECT_EQ(place.particle, 1u);
  EXPECT_EQ(place.neighbor, 2u);
  EXPECT_NEAR(place.border, 0.4 * kSpacing, 1e-15);
  // Half way between two: the smaller id.
  EXPECT_EQ(regions.nearest(Vec3(kSpacing / 2, 0, 0)), 1u);
}

TEST(Regions, ALoneParticleHasNoBorder) {
  Sites sites;
  sites.add(Vec3(1, 2, 3));
  const Regions regions(sites.points(), kSpacing);
  const Regions::Place place = regions.at(Vec3(1, 2, 3.3));
  EXPECT_EQ(place.particle, 0u);
  EXPECT_EQ(place.neighbor, Regions::kNone);
  EXPECT_EQ(place.inside, 1);
  EXPECT_EQ(place.border, kSpacing / 2);
  EXPECT_EQ(regions.nearest(Vec3(1, 2, 3 + 3.01 * kSpacing)), Regions::kNone);
  EXPECT_EQ(regions.at(Vec3(1e300, 2, 3)).particle, Regions::kNone);
  EXPECT_EQ(regions.nearest(Vec3(std::nan(""), 0, 0)), Regions::kNone);
}

TEST(Regions, OfNoParticlesAreNone) {
  const Regions regions(geometry::Points{}, kSpacing);
  EXPECT_EQ(regions.size(), 0u);
  EXPECT_EQ(regions.at(Vec3::Zero()).particle, Regions::kNone);
}

TEST(Regions, RefuseWhatIsNotFiniteOrAstray) {
  Sites sites;
  sites.add(Vec3::Zero());
  sites.add(Vec3(1, std::numeric_limits<Real>::infinity(), 0));
  EXPECT_THROW(Regions(sites.points(), kSpacing), InputError);
  sites.x[1] = Vec3(1, 2e6 * kSpacing, 0);
  EXPECT_THROW(Regions(sites.points(), kSpacing), InputError);
}

}  // namespace
}  // namespace effuse::skin
