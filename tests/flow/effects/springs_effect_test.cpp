#include "flow/effects/springs_effect.h"

#include <gtest/gtest.h>

#include "geometry/base/error.h"
#include "geometry/mesh/measure.h"
#include "tests/flow/effects/small_scene.h"

namespace effuse::flow {
namespace {

constexpr const char* kCube = "[[springs]]\npoints = 4\nsize = 1\nposition = [0, 0, 1.5]\ndensity = 100\nstiffness = 2000\ndamping = 20\n";

TEST(SpringsEffectSlow, ACubeFallsAndComesToRestOnTheGround) {
  for (const char* scheme : {"symplectic_euler", "rk4", "implicit_euler"}) {
    SmallScene scene(std::string(kCube) + "contact_damping = 50\nscheme = \"" + scheme + "\"\n");
    scene.frames(24 * 8);
    const Box3 box = geometry::bounds(scene.mesh());
    // 16 points stand on springs of 4000 N/m each under 981 N: 15 mm.
    EXPECT_NEAR(box.min().z(), -981 / 16.0 / 4000, 3e-3) << scheme;
    EXPECT_GT(box.sizes().z(), 0.8) << scheme;
    EXPECT_LT(scene.figure("kinetic_energy_j"), 1e-2) << scheme;
  }
}

TEST(SpringsEffect, StandsOnObstaclesToo) {
  SmallScene scene(std::string(kCube) + "contact_damping = 50\n[[obstacle]]\nbox = [4, 4, 1]\nposition = [0, 0, 0]\non_ground = false\n");
  scene.frames(24 * 6);
  EXPECT_NEAR(geometry::bounds(scene.mesh()).min().z(), 0.5, 0.03);
}

TEST(SpringsEffect, PinsHoldAndAnObstacleCarriesThem) {
  const std::string pinned = std::string(kCube) + "gravity = [0, 0, -1]\npins = [[-0.5, -0.5, 2, 0.01], [0.5, -0.5, 2, 0.01], [-0.5, 0.5, 2, 0.01], [0.5, 0.5, 2, 0.01]]\n";
  SmallScene still(pinned);
  still.frames(48);
  EXPECT_NEAR(geometry::bounds(still.mesh()).max().z(), 2, 1e-9);
  SmallScene carried(pinned + "pinned_to = \"crane\"\n[[obstacle]]\nname = \"crane\"\nbox = [0.1, 0.1, 0.1]\non_ground = false\nmotion = \"linear\"\n[[obstacle.key]]\ntime = 0\nposition = [0, 0, 5]\n[[obstacle.key]]\ntime = 2\nposition = [4, 0, 7]\n");
  carried.frames(48);
  EXPECT_NEAR(geometry::bounds(carried.mesh()).max().z(), 4, 0.05);  // what hangs free about the four swings
  EXPECT_NEAR(geometry::bounds(carried.mesh()).center().x(), 4, 0.3);
}

TEST(SpringsEffect, TornFacesAreGoneAndStayGoneInACheckpoint) {
  // Too heavy for its springs, it falls off where it is held.
  const std::string text = "[[springs]]\npoints = 4\nsize = 1\nposition = [0, 0, 3]\nmass = 600\nstiffness = 500\ndamping = 5\ntear_strain = 0.3\npins = [[0, 0, 3.5, 0.8]]\nspin = [0, 0, 0]\n";
  SmallScene scene(text);
  scene.frames(24);
  EXPECT_GT(scene.figure("torn"), 0);
  EXPECT_LT(scene.mesh().triangles.size(), 6u * 9 * 2);
  const std::string bytes = scene.simulation->checkpoint("key");
  SmallScene again(text);
  again.simulation->restore(bytes, "key", "checkpoint");
  scene.frames(5);
  again.frames(5);
  EXPECT_EQ(scene.simulation->state_hash(), again.simulation->state_hash());
  EXPECT_EQ(scene.mesh().triangles.size(), again.mesh().triangles.size());
}

TEST(SpringsEffect, TornSidesOfACubeAreThoseOfThePointsThatCameApart) {
  // Its top is held, and two points of a lower edge are thrown apart.
  std::string velocities = "velocities = [";
  for (int n = 0; n < 64; ++n) velocities += n == 48 ? "[900, 0, 0]," : n == 32 ? "[-900, 0, 0]," : "[0, 0, 0],";  // (3, 0, 0) and (2, 0, 0)
  SmallScene scene("[[springs]]\npoints = 4\nsize = 1.5\nposition = [0, 0, 3]\nmass = 64\nstiffness = 5000\ndamping = 1\ngravity = [0, 0, 0]\nstep = 0.0002\ntear_strain = 0.3\n" + velocities + "]\n");
  scene.simulation->advance([n = 0]() mutable { return ++n < 2; });
  const geometry::TriMesh mesh = scene.mesh();
  ASSERT_GT(scene.figure("torn"), 0);
  ASSERT_LT(mesh.triangles.size(), 6u * 9 * 2);
  // What is left has no long side, what is gone is at that edge: every vertex of the opposite faces is in use.
  for (const geometry::Triangle& t : mesh.triangles)
    for (std::size_t k = 0; k < 3; ++k) EXPECT_LT((mesh.positions[t[k]] - mesh.positions[t[(k + 1) % 3]]).norm(), 1.3 * 0.5 * std::sqrt(2.0));
  EXPECT_GE(mesh.triangles.size(), 6u * 9 * 2 - 24);
}

TEST(SpringsEffect, GoesOnFromACheckpointInTheStepsItHad) {
  // The longest stable step is that of the start, when it is squeezed: found again half way it would be another.
  for (const char* more : {"spin = [0, 9, 0]\n", "scheme = \"rk4\"\nspin = [0, 9, 0]\n", "pins = [[0, 0, 2.5, 9]]\n"}) {
    const std::string text = std::string(kCube) + more;
    SmallScene whole(text), again(text);
    whole.frames(4);
    again.simulation->restore(whole.simulation->checkpoint("key"), "key", "checkpoint");
    whole.frames(4);
    again.frames(4);
    EXPECT_EQ(whole.simulation->state_hash(), again.simulation->state_hash()) << more;
    EXPECT_EQ(whole.figure("steps"), again.figure("steps")) << more;
  }
}

TEST(SpringsEffect, StandsWhereTheMapSays) {
  const Vec3 origin(2667000, 6478000, 50);
  const std::string how = "[[springs]]\npoints = 3\nsize = 1\ndensity = 100\nstiffness = 2000\ngravity = [0, 0, 0]\n";
  SmallScene above(how + "position = [2667001, 6478002, 53]\npins = [[2667001, 6478002, 53, 0.1]]\nwalls = [[0, 0, 1, -50]]\n", origin);
  above.frames(2);
  EXPECT_NEAR((geometry::bounds(above.mesh()).center() - Vec3(1, 2, 3)).norm(), 0, 1e-9);
  SmallScene on(how + "position = [2667001, 6478002, 0.7]\non_ground = true\n", origin);
  on.frames(2);
  EXPECT_NEAR(geometry::bounds(on.mesh()).center().z(), 0.7, 1e-9);
}

TEST(SpringsEffect, AStepThatBlowsUpIsTakenInSmallerOnesOrRefused) {
  // Euler without damping is unstable at any step: it is found out, the state is that of before.
  SmallScene scene("[[springs]]\npoints = 3\nsize = 1\nposition = [0, 0, 2]\nmass = 1\nstiffness = 1e6\nscheme = \"euler\"\nstep = 0.02\nvelocity = [0, 0, -1]\n");
  EXPECT_THROW(scene.frames(2000), UnstableError);
  EXPECT_TRUE(geometry::bounds(scene.mesh()).sizes().allFinite());
}

TEST(SpringsEffect, RemarksOnAStepThatIsTooLong) {
  const SmallScene own(kCube), longer(std::string(kCube) + "step = 0.1\n"), implicit(std::string(kCube) + "step = 0.1\nscheme = \"implicit_euler\"\n");
  for (const SmallScene* sound : {&own, &implicit}) EXPECT_TRUE(sound->simulation->effects()[0]->remarks().empty());
  ASSERT_EQ(longer.simulation->effects()[0]->remarks().size(), 1u);
  EXPECT_NE(longer.simulation->effects()[0]->remarks()[0].find("longer than the longest stable one"), std::string::npos);
}

TEST(SpringsEffect, SaysWhatDoesNotFit) {
  const auto contains = [](const std::string& text, const char* part) { return text.find(part) != std::string::npos; };
  EXPECT_TRUE(contains(fault_of("[[springs]]\nstiffness = 1\n"), "springs[0].density: is missing, wanted density or mass above 0"));
  EXPECT_TRUE(contains(fault_of("[[springs]]\nstiffness = 1\nmass = 1\ndensity = 2\n"), "found with density"));
  EXPECT_TRUE(contains(fault_of("[[springs]]\nmass = 1\n"), "stiffness"));
  EXPECT_TRUE(contains(fault_of("[[springs]]\nstiffness = 1\nmass = 1\n[[springs]]\nstiffness = 1\nmass = 1\n"), "'springs' is the name of another effect"));
  EXPECT_TRUE(contains(fault_of("[[springs]]\nstiffness = 1\nmass = 1\nname = \"a/b\"\n"), "cannot be part of a file's name"));
  EXPECT_TRUE(contains(fault_of("[[springs]]\nstiffness = 1\nmass = 1\npositions = [[0, 0, 0]]\n"), "1 positions, wanted one for each of its 512 points"));
  EXPECT_TRUE(contains(fault_of("[[springs]]\nstiffness = 1\nmass = 1\npinned_to = \"crane\"\n"), "no obstacle of the scene"));
  EXPECT_TRUE(contains(fault_of("[[springs]]\nstiffness = 1\nmass = 1\nwalls = [[0, 0, 0, 1]]\n"), "has no normal"));
  EXPECT_TRUE(contains(fault_of("[[springs]]\nstiffness = 1\nmass = 1\nstiffnes = 3\n"), "stiffness"));
  EXPECT_TRUE(contains(fault_of("[[springs]]\nstiffness = 1\nmass = 1\nposition = [0, 0, 2]\npins = [[0, 0, 9, 1]]\n"), "pins[0] holds no point"));
  EXPECT_TRUE(contains(fault_of("[[springs]]\nstiffness = 1\nmass = 1\nposition = [0, 0, 2]\npins = [[0, 0, 2, -1]]\n"), "radius of -1 m"));
  EXPECT_TRUE(contains(fault_of("[[springs]]\nstiffness = 1\nmass = 1\nposition = [0, 0, -3]\n"), "under the ground"));
  EXPECT_EQ(fault_of("[[springs]]\nstiffness = 1\nmass = 1\nposition = [0, 0, -3]\nmeets_ground = false\n"), "");
  EXPECT_TRUE(contains(fault_of("[[springs]]\nshape = \"solid\"\nball = 1\nspacing = 1e-9\ndensity = 1\nstiffness = 1\n"), "take a wider one"));
}

}  // namespace
}  // namespace effuse::flow
