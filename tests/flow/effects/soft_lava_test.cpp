#include <gtest/gtest.h>

#include <iostream>

#include "geometry/base/parallel.h"
#include "geometry/mesh/measure.h"
#include "tests/flow/effects/effect_scene.h"

/// Lava and soft solids as scenes name them.
namespace effuse::flow {
namespace {

const std::string kLava = "[lava]\nmodel = \"modern\"\nspacing = 0.25\nmax_step = 0.015\n[lava.rheology]\nviscosity = 200\n[lava.heat]\non = true\n[[lava.vent]]\nat = [0, 0]\nwidth = 1.5\nrate = 4\n";
const std::string kElastic = "[[elastic]]\nname = \"soft\"\nbox = [0.5, 2, 1]\nspacing = 0.25\nposition = [1.4, 0, 0.45]\nyoungs_modulus = \"0.2 MPa\"\ndensity = 1000\npins = [[1.4, -0.8, -0.1, 0.5], [1.4, 0, -0.1, 0.5], [1.4, 0.8, -0.1, 0.5]]\n";
const std::string kBrittle = "strength = \"30 kPa\"\n";
const std::string kWarm = "temperature = 300\nmaterial = \"concrete\"\n";

Box3 box_of(const EffectScene& scene) { return geometry::bounds(scene.effect("soft").meshes()[0].mesh); }

TEST(SoftLavaSlow, ASceneTellsWhetherTheyPushEachOther) {
  EffectScene both(kLava + kElastic + kWarm), neither(kLava + kElastic + kWarm + "meets_lava = false\n");
  for (EffectScene* each : {&both, &neither}) each->frames(36);
  EXPECT_GT(box_of(both).max().x(), box_of(neither).max().x() + 0.02) << "lava bends it";
  EXPECT_GT(both.figure("lava", "soft_given_J"), 0);
  EXPECT_GT(both.figure("lava", "soft_mean_K"), 300);
  // Nothing inside it of the one, something of the other.
  const auto inside = [](const EffectScene& scene) {
    const geometry::CollisionMesh mesh(scene.effect("soft").meshes()[0].mesh);
    int n = 0;
    for (const Vec3& x : scene.effect("lava").flow().x) n += mesh.inside(x);
    return n;
  };
  EXPECT_EQ(inside(both), 0);
  EXPECT_GT(inside(neither), 10);
}

/// What a scene fails with; "" when it does not.
std::string failure_of(EffectScene& scene, int frames) {
  try {
    scene.frames(frames);
  } catch (const UnstableError& error) {
    return error.what();
  }
  return "";
}

TEST(SoftLavaSlow, WhatCollapsesByItselfFarFromTheLavaDoesNotEndTheRun) {
  // Springs too weak for the cube's weight: it lies flat within a second.
  EffectScene scene(kLava + "[[springs]]\nname = \"jelly\"\npoints = 4\nsize = 0.8\nposition = [9, 9, 0.5]\ndensity = 100\nstiffness = 20\ndamping = 1\n");
  EXPECT_EQ(failure_of(scene, 36), "");
}

TEST(SoftLavaSlow, WhatBreaksDownBesideAnotherIsToldAndBothCanBeAsked) {
  EffectScene scene(kLava + kElastic + "[[springs]]\nname = \"wild\"\npoints = 3\nsize = 1\nposition = [6, 6, 3]\nmass = 1\nstiffness = 1e9\nscheme = \"euler\"\nstep = 0.02\nspin = [0, 5, 0]\n");
  const std::string told = failure_of(scene, 48);
  EXPECT_NE(told.find("'wild'"), std::string::npos) << told;
}

TEST(SoftLavaSlow, SolidsThatLavaCannotMeetAreRefusedByName) {
  const std::string over = "[[elastic]]\nname = \"lid\"\nbox = [3, 3, 1]\nspacing = 0.5\nposition = [0, 0, 0.5]\nyoungs_modulus = 1e5\ndensity = 1000\n";
  const auto told = [](const std::string& text) {
    try {
      EffectScene scene(text);
    } catch (const InputError& error) {
      return std::string(error.what());
    }
    return std::string();
  };
  EXPECT_NE(told(kLava + over).find("'lid' is over the vent when it opens"), std::string::npos) << told(kLava + over);
  EXPECT_NE(told(kLava + over).find("test.toml:"), std::string::npos) << "where";
  EXPECT_EQ(told(kLava + over + "meets_lava = false\n"), "");
  std::string folded = "[[springs]]\nshape = \"cloth\"\nfile = \"sheet.obj\"\ndensity = 1\nstiffness = 100\npositions = [";
  for (int k = 0; k < 81; ++k) folded += "[" + std::to_string(8 + 0.1 * (k % 2)) + ", " + std::to_string(0.1 * (k / 2 % 9)) + ", 2],";
  EXPECT_NE(told(kLava + folded + "]\n").find("two points begin at one place"), std::string::npos) << told(kLava + folded + "]\n");
}

TEST(SoftLavaSlow, WhichOfTheTwoComesFirstMattersNot) {
  EffectScene one(kLava + kElastic), other(kElastic + kLava);
  for (EffectScene* each : {&one, &other}) {
    each->frames(10);
    for (const auto& effect : each->simulation->effects()) EXPECT_EQ(effect->time(), each->simulation->time());
  }
  EXPECT_EQ(box_of(one).max(), box_of(other).max());
}

TEST(SoftLavaSlow, ResumesToTheSameBitsOnAnyNumberOfThreads) {
  for (const std::string& text : {kLava + kElastic + kWarm, kElastic + kBrittle + kLava}) {
    EffectScene whole(text), half(text), again(text);
    whole.frames(14);
    int steps = 0;
    half.frames(11);
    half.simulation->advance([&] { return ++steps < 2; });
    again.simulation->restore(half.simulation->checkpoint("key"), "key", "file");
    ASSERT_EQ(again.simulation->frame(), 11) << "within a frame";
    ASSERT_GT(again.simulation->effects()[0]->time(), again.simulation->time());
    {
      const ThreadLimit one(1);
      again.frames(3);
    }
    for (std::size_t k = 0; k < 2; ++k) {
      StateHash a, b;
      whole.simulation->effects()[k]->add_to(a);
      again.simulation->effects()[k]->add_to(b);
      EXPECT_EQ(a.hex(), b.hex()) << whole.simulation->effects()[k]->name() << " of\n" << text;
    }
    EXPECT_EQ(whole.simulation->state_hash(), again.simulation->state_hash());
  }
}

/// A curtain across the lava's way, held above and below; and a cube of springs in it.
const std::string kCurtain = "[[springs]]\nname = \"soft\"\nshape = \"cloth\"\nfile = \"sheet.obj\"\nposition = [1.5, 0, 0.9]\nrotation = [0, \"90 deg\", 0]\ndensity = 20\nstiffness = 20000\ndamping = 60\n"
                             "meets_ground = false\npins = [[1.5, -0.8, -0.1, 0.4], [1.5, -0.3, -0.1, 0.4], [1.5, 0.3, -0.1, 0.4], [1.5, 0.8, -0.1, 0.4], [1.5, -0.8, 1.9, 0.4], [1.5, 0, 1.9, 0.6], [1.5, 0.8, 1.9, 0.4]]\n";
const std::string kJello = "[[springs]]\nname = \"soft\"\npoints = 4\nsize = 0.8\nposition = [1.5, 0, 0.45]\ndensity = 600\nstiffness = 40000\ndamping = 200\ncontact_damping = 200\n";

TEST(SoftLavaSlow, ACurtainBulgesAndLetsNothingThrough) {
  EffectScene both(kLava + kCurtain), neither(kLava + kCurtain + "meets_lava = false\n");
  for (EffectScene* each : {&both, &neither}) each->frames(60);
  EXPECT_GT(box_of(both).max().x(), 1.53);
  EXPECT_LT(box_of(both).max().x(), 2.2);
  EXPECT_LT(box_of(neither).max().x(), 1.51);
  // Behind it is what has come round its ends, and no more.
  const auto behind = [](const EffectScene& scene) {
    const auto flow = scene.effect("lava").flow();
    return std::count_if(flow.x.begin(), flow.x.end(), [](const Vec3& x) { return x.x() > 1.6 && std::abs(x.y()) < 0.5; });
  };
  std::cout << "the curtain bulges to " << box_of(both).max().x() << " m; behind it " << behind(both) << " particles, without it " << behind(neither) << "\n";
  EXPECT_GT(behind(neither), 20);
  EXPECT_LT(behind(both), behind(neither) / 4);
}

TEST(SoftLavaSlow, JelloIsTakenAlong) {
  EffectScene both(kLava + kJello), neither(kLava + kJello + "meets_lava = false\n");
  for (EffectScene* each : {&both, &neither}) each->frames(24);
  EXPECT_GT(box_of(both).center().x(), box_of(neither).center().x() + 0.1);
  EXPECT_GT(box_of(both).sizes().minCoeff(), 0.4);
}

TEST(SoftLava, SpringsResumeToTheSameBits) {
  for (const std::string& text : {kLava + kCurtain, kJello + kLava}) EXPECT_TRUE(resumes(text, 10, 2)) << text;
}

TEST(SoftLavaSlow, ABrittleOneBreaksAndIsMetInPieces) {
  EffectScene scene(kLava + kElastic + "strength = \"4 kPa\"\n");
  scene.frames(20);
  EXPECT_GT(scene.figure("soft", "nodes_split"), 0);
  const geometry::TriMesh mesh = scene.effect("soft").meshes()[0].mesh;
  for (const Vec3& x : mesh.positions) EXPECT_TRUE(x.allFinite());
}

}  // namespace
}  // namespace effuse::flow
