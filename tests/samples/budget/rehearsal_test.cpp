#include "samples/budget/rehearsal.h"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>

#include "flow/effects/registry.h"
#include "flow/scene/scene.h"
#include "geometry/base/error.h"
#include "geometry/base/parallel.h"
#include "geometry/terrain/plane.h"
#include "importers/scene/scene_file.h"
#include "samples/budget/forecast.h"

namespace effuse::budget {
namespace {

geometry::Points at(const std::vector<Vec3>& x) {
  geometry::Points points;
  points.position = x;
  return points;
}

TEST(MeanNeighbors, CountsThoseWithinReachOnALattice) {
  std::vector<Vec3> x;
  for (int i = 0; i < 12; ++i)
    for (int j = 0; j < 12; ++j) x.push_back(Vec3(i, j, 0));
  // Within 1.2: four inside, three on an edge, two in a corner.
  EXPECT_NEAR(mean_neighbors(at(x), 1.2, x.size()), (100 * 4 + 40 * 3 + 4 * 2) / 144.0, 1e-12);
  EXPECT_EQ(mean_neighbors(at({}), 1), 0);
}

TEST(DifferenceOfFronts, IsRelativeToTheFiner) {
  Rehearsal one, other;
  for (int k = 1; k <= 4; ++k) {
    one.moments.push_back({});
    other.moments.push_back({});
    one.moments.back().time = other.moments.back().time = k;
    one.moments.back().front = 11 * k;
    other.moments.back().front = 10 * k;
  }
  EXPECT_NEAR(difference_of_fronts(one, other), 0.1, 1e-12);
  one.moments.pop_back();
  one.moments.back().time = 2.5;  // cut off in the midst of a frame
  one.moments.back().front = 1e9;
  EXPECT_NEAR(difference_of_fronts(one, other), 0.1, 1e-12);
  for (Moment& m : other.moments) m.front = 0;
  EXPECT_TRUE(std::isinf(difference_of_fronts(one, other)));
}

TEST(FrontDifferences, AreSignedAndOfTheFinestsFront) {
  Rehearsal coarser, own, finer;
  for (Rehearsal* r : {&coarser, &own, &finer}) r->moments.resize(3), r->whole = true;
  for (std::size_t k = 0; k < 3; ++k) {
    const Real front = 10 * static_cast<Real>(k + 1);
    finer.moments[k].front = front;
    own.moments[k].front = 0.95 * front;
    coarser.moments[k].front = 1.15 * front;
  }
  const FrontDifferences d = front_differences(coarser, own, finer);
  EXPECT_NEAR(d.coarser, 0.2, 1e-12);
  EXPECT_NEAR(d.finer, -0.05, 1e-12);
  EXPECT_NEAR(d.finer_rms, 0.05, 1e-12);
  // One that is ahead at first and behind later: the sum cancels, the mean square does not.
  own.moments[0].front = 10 + 9;
  own.moments[2].front = 30 - 3;
  own.moments[1].front = 20;
  EXPECT_NEAR(front_differences(coarser, own, finer).finer, 0, 1e-12);
  EXPECT_NEAR(front_differences(coarser, own, finer).finer_rms, std::sqrt(90.0 / 1400), 1e-12);
}

flow::Node scene(const std::string& lava) {
  return importers::read_scene_text("format = 1\n[film]\nframes = 6\nfps = 1\ntime_scale = 2\n[terrain.plane]\nsize = [\"120 m\", \"120 m\"]\nslope = \"8 deg\"\n[lava]\npreset = \"etna\"\n" + lava +
                                        "\n[[lava.vent]]\nat = [-20, 0]\nwidth = \"8 m\"\nrate = \"20 m3/s\"\n",
                                    "scene");
}

const geometry::Terrain& ground() {
  static const geometry::Terrain terrain = geometry::Terrain::from_height_field(geometry::make_plane(Vec2(120, 120), 8 * kPi / 180, 0), {}, 288.15);
  return terrain;
}

flow::AccuracyWish within(Real front) {
  flow::AccuracyWish wish;
  wish.front = front;
  return wish;
}

TEST(Rehearse, IsTheSameOnAnyNumberOfThreads) {
  const flow::World world{&ground()};
  const Rehearsal one = rehearse(scene(""), world, 1.6, 1e9);
  const ThreadLimit two(2);
  const Rehearsal other = rehearse(scene(""), world, 1.6, 1e9);
  ASSERT_EQ(one.moments.size(), 6u);
  ASSERT_EQ(other.moments.size(), 6u);
  EXPECT_TRUE(one.whole);
  Real last = 0;
  for (std::size_t k = 0; k < 6; ++k) {
    EXPECT_EQ(one.moments[k].front, other.moments[k].front);
    EXPECT_EQ(one.moments[k].counts.pressure_pairs, other.moments[k].counts.pressure_pairs);
    EXPECT_GT(one.moments[k].counts.particle_steps, last);
    last = one.moments[k].counts.particle_steps;
  }
  EXPECT_NEAR(one.moments.back().particles, 20 * 12 / std::pow(1.6, 3), 25) << "what the vent let out";
}

TEST(Rehearse, StopsWhenItHasDoneEnough) {
  const Rehearsal cut = rehearse(scene(""), flow::World{&ground()}, 1.6, 300);
  EXPECT_FALSE(cut.whole);
  ASSERT_FALSE(cut.moments.empty());
  EXPECT_LT(cut.moments.size(), 6u);
  EXPECT_LE(cut.moments.back().counts.particle_steps, 400);
}

TEST(Forecast, KeepsWhatTheSceneSaysAndChoosesTheRest) {
  flow::Node node = scene("spacing = \"1.4 m\"\ncourant = 0.3");
  const Forecast f = forecast(node, within(0.1), flow::World{&ground()});
  EXPECT_EQ(f.spacing, 1.4);
  int kept = 0;
  for (const Setting& s : f.settings) {
    kept += s.of_the_scene;
    EXPECT_EQ(s.of_the_scene, s.key == "lava.spacing" || s.key == "lava.courant") << s.key;
  }
  EXPECT_EQ(kept, 2);
  EXPECT_EQ(node.find("lava")->find("courant")->real, 0.3);
  ASSERT_TRUE(node.find("lava")->find("viscosity_tolerance"));
  EXPECT_EQ(node.find("lava")->find("viscosity_tolerance")->real, 1e-3);
  ASSERT_TRUE(node.find("skin"));
  EXPECT_NEAR(f.particles, 20 * 12 / std::pow(1.4, 3), 20);
  EXPECT_GT(f.error, 0);
  EXPECT_GT(f.front, 5);
}

TEST(ForecastSlow, TellsTheErrorByFinerParticlesWhereTheyCanBePaidForAndElseByTheDepth) {
  flow::Node near = scene("spacing = \"1.4 m\""), fine = scene("spacing = \"0.2 m\"");
  const Forecast told = forecast(near, within(0.1), flow::World{&ground()}), guessed = forecast(fine, within(0.1), flow::World{&ground()});
  EXPECT_EQ(told.told_by, ErrorBy::kRehearsals);
  ASSERT_EQ(told.rehearsed.size(), 3u);
  EXPECT_NEAR(told.rehearsed[0], 1.4 * std::sqrt(2.0), 1e-12);
  EXPECT_EQ(told.rehearsed[1], 1.4);
  EXPECT_NEAR(told.rehearsed[2], 1.4 / std::sqrt(2.0), 1e-12);
  // The film itself was rehearsed: what is told of it is what comes.
  const Rehearsal film = rehearse(near, flow::World{&ground()}, 1.4, 1e9);
  EXPECT_EQ(told.front, film.moments.back().front);
  EXPECT_EQ(told.counts.pair_steps, film.moments.back().counts.pair_steps);
  EXPECT_EQ(guessed.told_by, ErrorBy::kDepth);
  EXPECT_EQ(guessed.error, guessed.law.error(0.2, kUsualCourant));
}

TEST(Forecast, TakesSpacingsThatOnlyLargerOnesWouldBeRefusedFor) {
  // 2.4 m from a vent of 0.5 m is legal, 3.4 m is not.
  flow::Node node = scene("spacing = \"2.4 m\"");
  importers::apply_override(node, "lava.vent[0].width=0.5 m");
  importers::apply_override(node, "lava.vent[0].rate=30 m3/s");
  const Forecast f = forecast(node, within(0.1), flow::World{&ground()});
  EXPECT_EQ(f.spacing, 2.4);
  EXPECT_EQ(f.told_by, ErrorBy::kDepth);
}

TEST(Forecast, IsTheSameEveryTime) {
  flow::Node one = scene("spacing = \"1.4 m\""), other = scene("spacing = \"1.4 m\"");
  const Forecast a = forecast(one, within(0.05), flow::World{&ground()});
  const ThreadLimit two(2);
  const Forecast b = forecast(other, within(0.05), flow::World{&ground()});
  EXPECT_EQ(a.error, b.error);
  EXPECT_EQ(a.front, b.front);
  EXPECT_EQ(a.counts.pair_steps, b.counts.pair_steps);
  EXPECT_EQ(importers::to_toml(one), importers::to_toml(other));
}

TEST(Forecast, SaysWhereNothingComesOut) {
  flow::Node node = scene("");
  importers::apply_override(node, "lava.vent[0].start=500 s");
  EXPECT_THROW(forecast(node, within(0.1), flow::World{&ground()}), InputError);
}

}  // namespace
}  // namespace effuse::budget
