#include "flow/scene/rigid_bodies.h"

#include <gtest/gtest.h>

#include <cmath>

#include "flow/effects/registry.h"
#include "flow/scene/scene.h"
#include "geometry/terrain/plane.h"
#include "importers/scene/scene_file.h"

namespace effuse::flow {
namespace {

const std::string kFilm = "[film]\nframes = 24\n[terrain.plane]\nsize = [\"40 m\", \"30 m\"]\nslope = \"10 deg\"\n";

Scene read(const std::string& text, std::vector<std::string>* faults = nullptr, Node* resolved = nullptr) {
  const Node node = importers::read_scene_text(text, "test.toml");
  Parameters root(node);
  Scene scene = read_scene(root, effect_kinds());
  if (resolved) *resolved = root.resolved();
  try {
    root.finish();
  } catch (const InputError& error) {
    if (!faults) throw;
    for (const Fault& fault : error.faults()) faults->push_back(to_string(fault));
  }
  return scene;
}

TEST(SceneBodies, AreBoxesBallsAndFilesAndCopiesOfThem) {
  const Scene scene = read(kFilm + R"(
[[body]]
box = ["1 m", "2 m", "50 cm"]
position = [1, 2, 3]
copies = 3
step = [0, 0, 1]
density = 500
rolling = "1 cm"
[[body]]
ball = 0.5
name = "b"
position = [0, 0, 1]
density = 1000
color = [1, 0.5, 0]
)");
  ASSERT_EQ(scene.bodies.size(), 4u);
  EXPECT_EQ(scene.bodies[2].name, "box.3");
  EXPECT_NEAR((scene.bodies[2].pose.position - Vec3(1, 2, 5)).norm(), 0, 1e-12);
  EXPECT_EQ(scene.bodies[3].name, "b");
  const geometry::Terrain flat = geometry::Terrain::from_height_field(geometry::make_plane(Vec2(40, 40)));
  std::vector<PlacedBody> placed;
  std::vector<Fault> faults;
  for (const PlannedBody& plan : scene.bodies) place_body(plan, mesh_of(plan), flat, placed, faults);
  ASSERT_TRUE(faults.empty()) << faults[0].message;
  EXPECT_NEAR(placed[0].volume, 1, 1e-12);
  EXPECT_EQ(placed[0].rolling, 0.01);
  EXPECT_NEAR(placed[3].volume, kPi / 6, 1e-12) << "the ball's, not its mesh's";
  EXPECT_EQ(placed[3].color, Vec3(1, 0.5, 0));
}

TEST(SceneBodies, AloneMakeAnEffectAndTheGroundMayBeAPlane) {
  const Scene scene = read(kFilm + "[bodies]\ncontact = \"penalty\"\npenalty_frequency = 100\nstep = \"5 ms\"\n[[body]]\nball = 1\nposition = [0, 0, 1]\ndensity = 1000\n");
  ASSERT_EQ(scene.effects.size(), 1u);
  EXPECT_EQ(scene.effects[0].name, "bodies");
  EXPECT_EQ(scene.effects[0].estimate.steps, 200);
  EXPECT_TRUE(scene.body_settings.penalty);
  EXPECT_EQ(scene.body_settings.penalty_frequency, 100);
  ASSERT_TRUE(scene.terrain.plane);
  EXPECT_EQ(scene.terrain.plane->size, Vec2(40, 30));
  EXPECT_NEAR(scene.terrain.plane->slope, 10 * kPi / 180, 1e-12);
}

TEST(SceneBodies, AResolvedSceneReadsBackToTheSame) {
  Node resolved, again;
  const std::string text = kFilm + "[bodies]\nsubsteps = 6\n[[obstacle]]\nname = \"wall\"\nbox = [1, 1, 1]\nposition = [3, 0, 0]\n[[body]]\nball = 1\nposition = [0, 0, 1]\ndensity = 1000\n"
                           "[[joint]]\nkind = \"hinge\"\nbodies = [\"wall\", \"ball\"]\npoint = [1, 0, 1]\naxis = [0, 0, 1]\nlimits = [-1, 1]\nmotor = { speed = 1, torque = 5 }\n";
  read(text, nullptr, &resolved);
  const std::string toml = importers::to_toml(resolved);
  read(toml, nullptr, &again);
  EXPECT_EQ(importers::to_toml(again), toml);
}

struct Wrong {
  const char *text, *part;
};
class SceneBodyFault : public testing::TestWithParam<Wrong> {};

TEST_P(SceneBodyFault, IsToldOnce) {
  std::vector<std::string> faults;
  read(kFilm + GetParam().text, &faults);
  std::string all;
  for (const std::string& fault : faults) all += fault + "\n";
  ASSERT_EQ(faults.size(), 1u) << all;
  EXPECT_NE(all.find(GetParam().part), std::string::npos) << all;
}

INSTANTIATE_TEST_SUITE_P(
    Of, SceneBodyFault,
    testing::Values(Wrong{"[[body]]\nposition = [0, 0, 1]\ndensity = 1", "or box or ball instead"}, Wrong{"[[body]]\nbox = [1, 0, 1]\nposition = [0, 0, 1]\ndensity = 1", "longer than 0"},
                    Wrong{"[[body]]\nbox = [1, 1, 1]\nball = 1\nposition = [0, 0, 1]\ndensity = 1", "wanted one of file, box and ball"},
                    Wrong{"[[body]]\nball = 0\nposition = [0, 0, 1]\ndensity = 1", "radius above 0"}, Wrong{"[[body]]\nball = 1\nscale = 2\nposition = [0, 0, 1]\ndensity = 1", "is of a file's mesh"},
                    Wrong{"[[body]]\nball = 1\nname = \"world\"\nposition = [0, 0, 1]\ndensity = 1", "no name for a thing"},
                    Wrong{"[[body]]\nball = 1\nposition = [0, 0, 1]\ndensity = 1\ncolor = [1, 2, 0]", "not from 0 to 1"},
                    Wrong{"[[body]]\nball = 1\nposition = [0, 0, 1]\ndensity = 1\ncopies = 2", "need a step"},
                    Wrong{"[[body]]\nball = 1\nposition = [0, 0, 1]\ndensity = 1\nstep = [0, 0, 1]", "goes with copies"},
                    Wrong{"[[body]]\nball = 1\nposition = [0, 0, 1]\ndensity = 1\n[bodies]\ncontact = \"penaltie\"", "did you mean 'penalty'?"},
                    Wrong{"[[body]]\nball = 1\nposition = [0, 0, 1]\ndensity = 1\n[bodies]\nsubstep = 3", "did you mean 'substeps'?"},
                    Wrong{"[[obstacle]]\nbox = [1, 1, 1]\nposition = [0, 0, 0]\n[bodies]\nsubsteps = 3", "the scene has none"}, Wrong{"", ", [[body]]"}));

TEST(SceneBodies, AMisspeltFormIsToldWithTheNameItMeant) {
  std::vector<std::string> faults;
  read(kFilm + "[[body]]\nbal = 1\nposition = [0, 0, 1]\ndensity = 1", &faults);
  ASSERT_EQ(faults.size(), 2u);
  EXPECT_NE(faults[0].find("or box or ball instead"), std::string::npos) << faults[0];
  EXPECT_NE(faults[1].find("did you mean 'ball'?"), std::string::npos) << faults[1];
}

TEST(ScenePlane, IsToldWhenItMakesNoSense) {
  const std::string body = "[[body]]\nball = 1\nposition = [0, 0, 1]\ndensity = 1\n";
  for (const auto& [terrain, part] : {std::pair{"plane = { size = [0, 4] }", "0.01 to 1e6"}, {"plane = { size = [4] }", "wanted an array of 2"}, {"plane = { size = [4, 4] }\nfile = \"a.asc\"", "one or the other"},
                                      {"plane = { size = [4, 4], slop = 1 }", "did you mean 'slope'?"}, {"plan = { size = [4, 4] }", "did you mean 'plane'?"}}) {
    std::vector<std::string> faults;
    read("[film]\nframes = 1\n[terrain]\n" + std::string(terrain) + "\n" + body, &faults);
    ASSERT_FALSE(faults.empty()) << terrain;
    std::string all;
    for (const std::string& fault : faults) all += fault + "\n";
    EXPECT_NE(all.find(part), std::string::npos) << all;
  }
}

}  // namespace
}  // namespace effuse::flow
