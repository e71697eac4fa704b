#include "flow/waves/wave_grid.h"

#include <gtest/gtest.h>

#include <cmath>
#include <vector>

#include "geometry/base/error.h"
#include "geometry/base/parallel.h"
#include "geometry/base/random.h"

namespace effuse::flow::waves {
namespace {

WaveGrid grid(int nx, int ny, Real cell, Border border, WaveScheme scheme = WaveScheme::kExplicit, Real c2 = 1) {
  WaveOptions o;
  o.nx = nx;
  o.ny = ny;
  o.cell = cell;
  o.border = border;
  o.scheme = scheme;
  return WaveGrid(o, {c2});
}

/// cos(pi m x / L) along x between mirrors: h = cos(pi m c t / L) of it.
void set_mode(WaveGrid& w, int m) {
  const auto n = static_cast<std::size_t>(w.options().nx);
  for (std::size_t k = 0; k < w.size(); ++k) w.height()[k] = std::cos(kPi * m * (static_cast<Real>(k % n) + 0.5) / static_cast<Real>(n));
}

class WaveBothSchemes : public testing::TestWithParam<WaveScheme> {};

TEST_P(WaveBothSchemes, AStandingWaveHasThePeriodOfTheory) {
  WaveGrid w = grid(100, 3, 0.1, Border::kMirror, GetParam(), 4);
  set_mode(w, 2);  // length 10 m, c = 2 m/s: period 10 / 2 = 5 s
  const Real dt = 0.9 * w.longest_step();
  Real t = 0, before = 1, crossing = 0;
  int crossings = 0;
  while (crossings < 20) {
    ASSERT_TRUE(w.step(dt));
    t += dt;
    const Real now = w.height()[0];
    if (before * now < 0 || now == 0) {
      ++crossings;
      crossing = t - dt * now / (now - before);
    }
    before = now;
  }
  EXPECT_NEAR(crossing / 9.75, 5, 0.005 * 5);  // the 20th zero lies at 9.75 periods
}

TEST_P(WaveBothSchemes, MirrorsReflectAsTwiceTheRoomWouldCarryOn) {
  // A mirror at x = L is a symmetric state on a periodic room of 2 L.
  WaveGrid half = grid(20, 5, 0.1, Border::kMirror, GetParam()), whole = grid(40, 10, 0.1, Border::kPeriodic, GetParam());
  for (std::size_t j = 0; j < 10; ++j)
    for (std::size_t i = 0; i < 40; ++i) {
      const std::size_t x = std::min(i, 39 - i), y = std::min(j, 9 - j);
      const auto h = random_normal(3, 1, y * 20 + x);
      whole.height()[j * 40 + i] = h;
      half.height()[y * 20 + x] = h;
    }
  for (int k = 0; k < 50; ++k) {
    half.step(0.05);
    whole.step(0.05);
  }
  const Real slack = GetParam() == WaveScheme::kExplicit ? 1e-5 : 1e-4;  // rounding; the solver's tolerance
  for (std::size_t j = 0; j < 5; ++j)
    for (std::size_t i = 0; i < 20; ++i) EXPECT_NEAR(half.height()[j * 20 + i], whole.height()[j * 40 + i], slack);
}

TEST_P(WaveBothSchemes, KeepsItsVolume) {
  WaveGrid w = grid(50, 40, 0.2, Border::kMirror, GetParam());
  EXPECT_DOUBLE_EQ(w.add_volume(Vec2(3, 2), 0.5, 7), 7);
  EXPECT_NEAR(w.volume(), 7, 1e-5);
  for (int k = 0; k < 200; ++k) w.step(0.1);
  EXPECT_NEAR(w.volume(), 7, 1e-3);
}

TEST_P(WaveBothSchemes, AbsorbingBordersSwallowNineteenTwentieths) {
  WaveGrid w = grid(80, 80, 0.1, Border::kAbsorbing, GetParam());
  w.add_volume(Vec2(3, 4.4), 0.4, 1);
  const Real before = w.energy();
  for (int k = 0; k < 250; ++k) w.step(0.06);  // 15 m: twice across, mirrors would have it all back
  EXPECT_LT(w.energy(), 0.05 * before) << "left: " << w.energy() / before;
}

TEST_P(WaveBothSchemes, TheSameBitsOnOneThreadAndOnTwo) {
  const auto run = [&](int threads) {
    ThreadLimit limit(threads);
    WaveGrid w = grid(70, 150, 0.1, Border::kPeriodic, GetParam());
    w.add_volume(Vec2(0.3, 14), 0.4, 1);
    for (int k = 0; k < 20; ++k) w.step(0.05);
    StateHash hash;
    w.add_to(hash);
    return hash.hex();
  };
  EXPECT_EQ(run(1), run(2));
}
INSTANTIATE_TEST_SUITE_P(Waves, WaveBothSchemes, testing::Values(WaveScheme::kExplicit, WaveScheme::kImplicit),
                         [](const auto& each) { return each.param == WaveScheme::kExplicit ? "explicit" : "implicit"; });

TEST(WaveGrid, PeriodicBordersDoNotKnowWhereTheStateLies) {
  WaveGrid a = grid(37, 41, 0.1, Border::kPeriodic), b = a;
  for (std::size_t j = 0; j < 41; ++j)
    for (std::size_t i = 0; i < 37; ++i) {
      a.height()[j * 37 + i] = random_normal(8, 1, j * 37 + i);
      b.height()[(j + 17) % 41 * 37 + (i + 30) % 37] = a.height()[j * 37 + i];
    }
  for (int k = 0; k < 100; ++k) {
    a.step(0.06);
    b.step(0.06);
  }
  for (std::size_t j = 0; j < 41; ++j)
    for (std::size_t i = 0; i < 37; ++i) ASSERT_NEAR(a.height()[j * 37 + i], b.height()[(j + 17) % 41 * 37 + (i + 30) % 37], 1e-5);
}

TEST(WaveGrid, HalvingCellAndStepQuartersTheError) {
  const auto error = [](int n) {
    WaveGrid w = grid(n, 2, 1.0 / n, Border::kMirror);
    set_mode(w, 1);
    // The scheme holds rates half a step behind: the first kick is half.
    const int steps = 3 * n / 2;
    const Real time = 0.75, dt = time / steps;
    for (std::size_t k = 0; k < w.size(); ++k) {
      const Real kx = kPi;
      w.rate()[k] = kx * std::sin(kx * -dt / 2) * -w.height()[k];
    }
    for (int k = 0; k < steps; ++k) w.step(dt);
    Real worst = 0;
    for (std::size_t i = 0; i < static_cast<std::size_t>(n); ++i)
      worst = std::max(worst, std::abs(w.height()[i] - std::cos(kPi * time) * std::cos(kPi * (static_cast<Real>(i) + 0.5) / n)));
    return worst;
  };
  const Real coarse = error(8), fine = error(16);
  EXPECT_NEAR(std::log2(coarse / fine), 2, 0.2) << coarse << " -> " << fine;
}

TEST(WaveGridSlow, StaysBoundedForAMillionStepsJustBelowTheLimit) {
  WaveGrid w = grid(24, 24, 0.1, Border::kMirror);
  w.add_volume(Vec2(1, 1.3), 0.2, 0.05);
  const Real before = w.energy(), dt = 0.99 * w.longest_step(), volume = w.volume();
  Real most = 0;
  for (int k = 0; k < 1000000; ++k) {
    w.step(dt);
    if (k % 1000 == 0) most = std::max(most, w.energy());
  }
  EXPECT_LT(most, 2 * before);  // what the scheme keeps is energy and a share of the fastest waves' rates
  EXPECT_GT(most, 0.5 * before);
  EXPECT_NEAR(w.volume(), volume, 1e-6 * volume);
}

TEST(WaveGrid, RefusesExplicitStepsBeyondTheLimitAndBlowsUpThere) {
  WaveGrid w = grid(24, 24, 0.1, Border::kMirror);
  w.add_volume(Vec2(1, 1.3), 0.2, 1);
  const std::vector<Real> before(w.height().begin(), w.height().end());
  EXPECT_THROW(w.step(1.01 * w.longest_step()), UnstableError);
  EXPECT_TRUE(std::equal(before.begin(), before.end(), w.height().begin()));
  EXPECT_NO_THROW(w.step(w.longest_step()));
}

TEST(WaveGrid, ImplicitStepsStandAnyLengthAndKeepTheEnergy) {
  WaveGrid w = grid(40, 30, 0.1, Border::kMirror, WaveScheme::kImplicit);
  w.add_volume(Vec2(1, 1.3), 0.3, 1);
  const Real before = w.energy();
  for (int k = 0; k < 100; ++k) ASSERT_TRUE(w.step(50 * w.longest_step()));
  EXPECT_NEAR(w.energy() / before, 1, 1e-3);
}

TEST(WaveGrid, BothSchemesAgreeAtSmallSteps) {
  WaveGrid a = grid(40, 30, 0.1, Border::kMirror), b = grid(40, 30, 0.1, Border::kMirror, WaveScheme::kImplicit);
  a.add_volume(Vec2(1, 1.3), 0.4, 1);
  b.add_volume(Vec2(1, 1.3), 0.4, 1);
  for (int k = 0; k < 400; ++k) {
    a.step(0.005);
    b.step(0.005);
  }
  Real apart = 0, highest = 0;
  for (std::size_t k = 0; k < a.size(); ++k) {
    apart = std::max(apart, std::abs(a.height()[k] - b.height()[k]));
    highest = std::max(highest, std::abs(a.height()[k]));
  }
  EXPECT_LT(apart, 0.02 * highest);
}

TEST(WaveGrid, WavesTurnBackAtTheShoreAndRunSlowerInTheShallows) {
  // Water 4 m/s fast on the left, 1 m/s in the middle, land on the right, 60 m in all.
  WaveOptions o;
  o.nx = 600;
  o.ny = 2;
  o.cell = 0.1;
  std::vector<Real> c2(1200);
  for (std::size_t k = 0; k < 1200; ++k) c2[k] = k % 600 < 200 ? 16.0 : k % 600 < 400 ? 1.0 : 0.0;
  WaveGrid w(o, c2);
  // A step of height at the left, let go: its front runs at c.
  for (std::size_t k = 0; k < 1200; ++k)
    if (k % 600 < 50) w.height()[k] = 1;
  const Real before = w.volume(), dt = 0.5 * w.longest_step();
  const auto front = [&] {
    std::size_t last = 0;
    for (std::size_t i = 0; i < 600; ++i)
      if (std::abs(w.height()[i]) > 0.2) last = i;
    return 0.1 * static_cast<Real>(last);
  };
  Real t = 0;
  for (; t < 3.75; t += dt) w.step(dt);
  EXPECT_NEAR(front(), 5 + 4 * 3.75, 0.5);
  for (; t < 3.75 + 10; t += dt) w.step(dt);
  EXPECT_NEAR(front(), 20 + 10, 0.7);
  for (; t < 40; t += dt) w.step(dt);
  for (std::size_t i = 400; i < 600; ++i) EXPECT_EQ(w.height()[i], 0);
  EXPECT_NEAR(w.volume(), before, 1e-4 * before);
}

TEST(WaveGrid, DampingTakesTheEnergyAtItsRate) {
  WaveOptions o;
  o.nx = 64;
  o.ny = 2;
  o.cell = 0.1;
  o.damping = 0.3;
  WaveGrid w(o, {1});
  set_mode(w, 8);
  const Real before = w.energy();
  for (int k = 0; k < 400; ++k) w.step(0.02);
  EXPECT_NEAR(std::log(before / w.energy()), 0.3 * 8, 0.1);  // amplitude exp(-k t / 2)
}

TEST(WaveGrid, BumpsKeepTheirVolumeOnWaterOnly) {
  WaveOptions o;
  o.nx = o.ny = 20;
  std::vector<Real> c2(400, 1);
  for (std::size_t k = 0; k < 400; ++k)
    if (k % 20 < 10) c2[k] = 0;
  WaveGrid w(o, c2);
  EXPECT_EQ(w.add_volume(Vec2(2, 10), 1, 5), 0);
  EXPECT_EQ(w.add_volume(Vec2(100, 10), 1, 5), 0);
  EXPECT_EQ(w.add_volume(Vec2(10, 10), 2, 5), 5);
  EXPECT_NEAR(w.volume(), 5, 1e-5);
  for (std::size_t k = 0; k < 400; ++k)
    if (k % 20 < 10) {
      EXPECT_EQ(w.height()[k], 0);
    }
}

TEST(WaveGrid, SavesAndLoadsToTheBit) {
  WaveGrid a = grid(20, 30, 0.1, Border::kAbsorbing), b = a;
  a.add_volume(Vec2(1, 1), 0.3, 1);
  for (int k = 0; k < 10; ++k) a.step(0.05);
  StateWriter out;
  a.save(out);
  StateReader in(out.bytes(), "test");
  b.load(in);
  StateHash ha, hb;
  a.step(0.05);
  b.step(0.05);
  a.add_to(ha);
  b.add_to(hb);
  EXPECT_EQ(ha.hex(), hb.hex());
}

}  // namespace
}  // namespace effuse::flow::waves
