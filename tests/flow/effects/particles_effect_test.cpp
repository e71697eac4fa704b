#include "flow/effects/particles_effect.h"

#include <gtest/gtest.h>

#include <cmath>

#include "flow/particles/presets.h"
#include "tests/flow/effects/effect_scene.h"

namespace effuse::flow {
namespace {

const std::string kPoint = "[[particles.emitter]]\nat = [0, 0, 5]\nrate = 48\n";
constexpr const char* kLava = "[lava]\nspacing = 0.5\npreset = \"etna\"\n[[lava.vent]]\nat = [0, 0]\nwidth = 2\nrate = 4\n";

TEST(ParticlesEffect, EveryPresetRunsAsItIs) {
  for (const particles::Preset& preset : particles::presets()) {
    EffectScene scene("[[particles]]\npreset = \"" + preset.name + "\"\n" + kPoint);
    scene.frames(24);
    EXPECT_EQ(scene.figure(preset.name, "born"), 48) << preset.name;
    const std::vector<NamedCloud> clouds = scene.effect(preset.name).clouds();
    ASSERT_EQ(clouds.size(), 1u);
    EXPECT_EQ(clouds[0].x.size(), scene.figure(preset.name, "particles")) << preset.name;
    EXPECT_EQ(clouds[0].look == NamedCloud::Look::kPuffs, preset.volume && !preset.glows) << preset.name;
    EXPECT_EQ(scene.effect(preset.name).volumes().size(), preset.volume ? 1u : 0u) << preset.name;
  }
}

TEST(ParticlesEffect, AKeyOfTheTableBeatsThePreset) {
  EffectScene scene("[[particles]]\npreset = \"sparks\"\ngravity = 0\nresponse = 0\ncooling = 0\n" + kPoint + "speed = 3\nspeed_spread = 0\nspread = 0\nlifetime = 100\nlifetime_spread = 0\ntemperature = 1000\ntemperature_spread = 0\nsize = 0.25\nsize_spread = 0\n");
  scene.frames(24);
  const NamedCloud cloud = scene.effect("sparks").clouds()[0];
  ASSERT_EQ(cloud.x.size(), 48u);
  for (std::size_t i = 0; i < cloud.x.size(); ++i) {
    EXPECT_NEAR(cloud.x[i].z(), 5 + 3 * cloud.age[i], 1e-9);
    EXPECT_EQ(cloud.temperature[i], 1000);
    EXPECT_EQ(cloud.radius[i], 0.25);
  }
}

TEST(ParticlesEffect, TheyLieOnGroundAndObstacles) {
  EffectScene scene("[[particles]]\npreset = \"snow\"\nturbulence = 0\nresponse = 0.5\n[[particles.emitter]]\nfrom = \"disk\"\nat = [0, 0, 5]\nradius = 4\ndirection = [0, 0, -1]\nrate = 200\nstop = 1\nsize_spread = 0\n"
                    "[[obstacle]]\nbox = [4, 20, 1]\nposition = [2, 0, 0.5]\n");
  scene.frames(24 * 4);
  const NamedCloud cloud = scene.effect("snow").clouds()[0];
  ASSERT_EQ(cloud.x.size(), 200u);
  int on_box = 0, on_ground = 0, on_its_side = 0;
  for (const Vec3& x : cloud.x) {
    on_box += std::abs(x.z() - 1.003) < 2e-3 && x.x() >= -0.01;
    on_ground += std::abs(x.z() - 0.003) < 2e-3 && x.x() <= 0.01;
    on_its_side += x.z() > 0.01 && x.z() < 0.99 && std::abs(x.x()) < 0.01;
  }
  EXPECT_EQ(on_box + on_ground + on_its_side, 200);
  EXPECT_LE(on_its_side, 5);  // what comes down there
  EXPECT_NEAR(on_box, 100, 30);
}

TEST(ParticlesEffect, AWarmUpIsAsIfTheyHadComeBefore) {
  const std::string text = "[[particles]]\nmeets_ground = false\ngravity = 0\nwarm_up = 2\n" + kPoint + "lifetime = 1.5\n";
  EffectScene scene(text);
  // One more or less: births fall on the ends of frames.
  EXPECT_NEAR(scene.figure("particles", "born"), 96, 1);
  EXPECT_NEAR(scene.figure("particles", "particles"), 72, 1);
  scene.frames(24);
  EXPECT_NEAR(scene.figure("particles", "born"), 144, 1);
  // Those that start later start later still.
  EffectScene late(text + "start = 0.5\n");
  EXPECT_EQ(late.figure("particles", "born"), 0);
  late.frames(24);
  EXPECT_NEAR(late.figure("particles", "born"), 24, 1);
}

TEST(ParticlesEffect, SparksComeOutOfTheVentWhileItIsOpen) {
  EffectScene scene(std::string(kLava) + "start = 0.5\nstop = 1\n[[particles]]\npreset = \"sparks\"\n[[particles.emitter]]\nfrom = \"vent\"\nrate = 100\nspeed = 0\nspread = 0\n");
  scene.frames(12);
  EXPECT_EQ(scene.figure("sparks", "born"), 0);
  scene.frames(24);
  EXPECT_EQ(scene.figure("sparks", "born"), 50);
  const std::vector<NamedCloud> clouds = scene.effect("sparks").clouds();
  for (const Vec3& x : clouds.at(0).x) EXPECT_LE(x.head<2>().norm(), 1 + 1e-9);
}

TEST(ParticlesEffect, TheyComeOffLavaWhereItIsHot) {
  const std::string emitter = "[[particles]]\npreset = \"smoke\"\nmeets_ground = false\n[[particles.emitter]]\nfrom = \"lava\"\nrate = 100\n";
  EffectScene scene(kLava + emitter);
  scene.frames(24);
  EXPECT_GT(scene.figure("smoke", "born"), 60);  // but for the frames before there is any
  EffectScene cold(kLava + emitter + "hotter_than = 3000\n");
  cold.frames(24);
  EXPECT_EQ(cold.figure("smoke", "born"), 0);
  // A little of it lets out a little.
  EffectScene little(kLava + emitter + "full_area = 100\n");
  little.frames(24);
  EXPECT_GT(little.figure("smoke", "born"), 0);
  EXPECT_LT(little.figure("smoke", "born"), 30);
}

TEST(ParticlesEffect, GoesOnToTheSameBits) {
  EXPECT_TRUE(resumes("[[particles]]\npreset = \"snow\"\nwarm_up = 1\n" + kPoint + "[[obstacle]]\nbox = [4, 4, 1]\nposition = [0, 0, 0.5]\n", 10, 14));
  EXPECT_TRUE(resumes(std::string(kLava) + "[[particles]]\npreset = \"smoke\"\n[[particles.emitter]]\nfrom = \"lava\"\nrate = 50\nfull_area = 10\n", 8, 8));
}

TEST(ParticlesEffect, SaysWhatDoesNotFit) {
  EXPECT_TRUE(contains(fault_of("[[particles]]\npreset = \"snow\"\n"), "particles[0].emitter: is missing"));
  EXPECT_TRUE(contains(fault_of("[[particles]]\npreset = \"snwo\"\n" + kPoint), "snow"));
  EXPECT_TRUE(contains(fault_of("[[particles]]\nturbulance = 1\nresponse = 1\n" + kPoint), "turbulence"));
  EXPECT_TRUE(contains(fault_of("[[particles]]\nwind = [1, 0, 0]\n" + kPoint), "they feel no air"));
  EXPECT_TRUE(contains(fault_of("[[particles]]\n[[particles.emitter]]\nfrom = \"vent\"\nrate = 1\n"), "the scene has no [lava]"));
  EXPECT_TRUE(contains(fault_of(std::string(kLava) + "[[particles]]\n[[particles.emitter]]\nfrom = \"water\"\nrate = 1\n"), "the scene has no [waves] or [ocean]"));
  EXPECT_TRUE(contains(fault_of(std::string(kLava) + "[[waves]]\nname = \"lagoon\"\nlevel = 1\ncell = 1\n[[particles]]\n[[particles.emitter]]\nfrom = \"water\"\nwater = \"lagon\"\nrate = 1\n"), "did you mean lagoon?"));
  EXPECT_TRUE(contains(fault_of("[[particles]]\nname = \"skin\"\n" + kPoint), "is the name of files of something else"));
  EXPECT_TRUE(contains(fault_of("[[particles]]\n" + kPoint + "rate2 = 1\n"), "rate2"));
  EXPECT_TRUE(contains(fault_of("[[particles]]\n[[particles.emitter]]\nat = [0, 0, 5]\n"), "rate"));
  EXPECT_TRUE(contains(fault_of("[[particles]]\n" + kPoint + "direction = [0, 0, 0]\n"), "has no length"));
  EXPECT_TRUE(contains(fault_of("[[particles]]\n[[particles.emitter]]\nfrom = \"curve\"\nline = [[0, 0, 0]]\nrate = 1\n"), "fewer than two corners"));
  EXPECT_TRUE(contains(fault_of("[[particles]]\nfiles = [\"points\", \"spheres\"]\n" + kPoint), "wanted one of them"));
  EXPECT_TRUE(contains(fault_of("[[particles]]\n[[particles.emitter]]\nat = [500, 0, 0]\non_ground = true\nrate = 1\n"), "is not on the terrain"));
  EXPECT_TRUE(contains(fault_of("[[particles]]\nroom = [0, 0, 0, 1, 1, 0]\n" + kPoint), "room"));
  EXPECT_TRUE(contains(fault_of("[[particles]]\n[[particles.emitter]]\nat = [0, 0, 1]\nrate = 1e8\nlifetime = 1e6\n"), "at most 1e8"));
}

}  // namespace
}  // namespace effuse::flow
