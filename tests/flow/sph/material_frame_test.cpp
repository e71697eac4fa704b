#include "flow/sph/material_frame.h"

#include <gtest/gtest.h>

#include "geometry/base/state_io.h"

namespace effuse::flow::sph {
namespace {

TEST(MaterialFrames, EachSetIsRenewedWhenTheOtherHasAllTheWeight) {
  const Real period = 10;
  MaterialFrames frames(period);
  frames.born(Vec3::Zero(), Vec3::Zero());
  int renewed = 0;
  // One particle that moves at 1 m/s in x: its material coordinates are the times of the sets' births.
  for (Real t = 0; t < 100; t += 0.37) {
    const Vec3 x(t, 0, 0);
    const Real rest = frames.rest()[0].x(), rest2 = frames.rest2()[0].x();
    frames.renew(t, std::span(&x, 1));
    if (frames.rest()[0].x() != rest) {
      EXPECT_GT(frames.ratio(t), 1 - 2 * 0.37 / period) << "the first set jumps while the second is seen, at " << t;
      ++renewed;
    }
    if (frames.rest2()[0].x() != rest2) {
      EXPECT_LT(frames.ratio(t), 2 * 0.37 / period) << "the second set jumps while the first is seen, at " << t;
      ++renewed;
    }
    EXPECT_GE(frames.ratio(t), 0);
    EXPECT_LE(frames.ratio(t), 1);
    EXPECT_LE(t - frames.rest_born(), period) << "births keep their beat, no drift by the steps";
    EXPECT_EQ(std::fmod(frames.rest_born(), period), 0);
    EXPECT_EQ(std::fmod(frames.rest2_born() + period / 2, period), 0);
    EXPECT_LE(x.x() - frames.rest()[0].x(), period + 0.37) << "no set stretches further than a period's way";
  }
  EXPECT_EQ(renewed, 9 + 10);
}

TEST(MaterialFrames, WithoutAPeriodTheFirstSetStays) {
  MaterialFrames frames(0);
  frames.born(Vec3(1, 2, 3), Vec3(4, 5, 6));
  const Vec3 x = Vec3::Zero();
  frames.renew(1e9, std::span(&x, 1));
  EXPECT_EQ(frames.rest()[0], Vec3(1, 2, 3));
  EXPECT_EQ(frames.ratio(1e9), 0) << "all weight is the first set's";
}

TEST(MaterialFrames, KeepAndLoadTakeBothSetsAlong) {
  MaterialFrames frames(10);
  for (int i = 0; i < 4; ++i) frames.born(Vec3(i, 0, 0), Vec3(0, i, 0));
  const std::vector<Vec3> x(4, Vec3(7, 7, 7));
  frames.renew(5, x);  // the second set
  frames.keep(std::vector<Index>{3, 1});
  EXPECT_EQ(frames.rest()[0], Vec3(3, 0, 0));
  EXPECT_EQ(frames.rest()[1], Vec3(1, 0, 0));
  EXPECT_EQ(frames.rest2()[1], Vec3(7, 7, 7));
  StateWriter out;
  MaterialFrames::arrays(static_cast<const MaterialFrames&>(frames), out);
  MaterialFrames::values(static_cast<const MaterialFrames&>(frames), out);
  MaterialFrames other(10);
  StateReader in(out.bytes(), "memory");
  MaterialFrames::arrays(other, in);
  MaterialFrames::values(other, in);
  other.check_loaded(2);
  EXPECT_THROW(other.check_loaded(3), InputError);
  EXPECT_EQ(other.rest()[0], Vec3(3, 0, 0));
  EXPECT_EQ(other.rest2_born(), 5);
}

TEST(Census, IdsAreNeverUsedAgainAndTheCountsAddUp) {
  Census census;
  for (int i = 0; i < 5; ++i) census.born(0.5 * i);
  census.keep(std::vector<Index>{4, 2});
  census.count_left(3);
  census.born(9);
  EXPECT_EQ((std::vector<std::uint64_t>(census.ids().begin(), census.ids().end())), (std::vector<std::uint64_t>{4, 2, 5}));
  EXPECT_EQ((std::vector<Real>(census.births().begin(), census.births().end())), (std::vector<Real>{2, 1, 9}));
  EXPECT_EQ(census.emitted(), census.left() + census.size());
  StateWriter out;
  Census::arrays(static_cast<const Census&>(census), out);
  Census::values(static_cast<const Census&>(census), out);
  Census other;
  StateReader in(out.bytes(), "memory");
  Census::arrays(other, in);
  Census::values(other, in);
  other.check_loaded(3);
  EXPECT_THROW(other.check_loaded(2), InputError);
  other.born(10);
  EXPECT_EQ(other.ids().back(), 6u);
}

}  // namespace
}  // namespace effuse::flow::sph
