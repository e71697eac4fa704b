#include "samples/effuse/jello.h"

#include <gtest/gtest.h>

#include <cmath>
#include <filesystem>
#include <fstream>
#include <sstream>

#include "flow/integrate/integrate.h"
#include "tests/importers/test_files.h"

namespace effuse {
namespace {

namespace fs = std::filesystem;
using flow::springs::SpringState;
using flow::springs::SpringSystem;

const fs::path kWorlds = importers::shared_data() / "jello";

std::vector<Vec3> read_points(const fs::path& csv) {
  std::ifstream in(csv);
  std::vector<Vec3> points;
  for (std::string line; std::getline(in, line);) {
    std::istringstream row(line);
    Vec3 p;
    char comma;
    row >> p.x() >> comma >> p.y() >> comma >> p.z();
    points.push_back(p);
  }
  return points;
}

SpringState run(const JelloScene& scene, Real dt, int steps) {
  SpringSystem system(scene.body.network);
  system.surroundings = scene.surroundings;
  SpringState y = scene.body.state;
  flow::StepStorage<SpringState> storage;
  for (int k = 0; k < steps; ++k) flow::integrate_step(scene.scheme, system, k * dt, dt, y, storage);
  return y;
}

class JelloWorldFile : public testing::TestWithParam<const char*> {};

TEST_P(JelloWorldFile, ReproducesTheReferenceAfterAThousandSteps) {
  if (importers::shared_data().empty()) GTEST_SKIP() << "skipped: the shared data is not here";
  const importers::JelloWorld world = importers::read_jello_world(kWorlds / (std::string(GetParam()) + ".w"));
  const std::vector<Vec3> reference = read_points(kWorlds / (std::string(GetParam()) + ".ref1000.csv"));
  ASSERT_EQ(reference.size(), 512u);
  const SpringState y = run(jello_scene(world), world.dt, 1000);
  Real worst = 0, moved = 0;
  for (std::size_t i = 0; i < 512; ++i) {
    worst = std::max(worst, (y.x[i] - reference[i]).lpNorm<Eigen::Infinity>());
    moved = std::max(moved, (world.positions[i] - reference[i]).norm());
  }
  EXPECT_LT(worst, 1e-6) << "the farthest point moved " << moved;
  EXPECT_GT(moved, 0.01);
}
INSTANTIATE_TEST_SUITE_P(Shared, JelloWorldFile, testing::Values("jello", "gravity"), [](const auto& each) { return std::string(each.param); });

class JelloWorldSlow : public JelloWorldFile {};

TEST_P(JelloWorldSlow, RunsOnForTwentyThousandSteps) {
  if (importers::shared_data().empty()) GTEST_SKIP() << "skipped: the shared data is not here";
  const importers::JelloWorld world = importers::read_jello_world(kWorlds / (std::string(GetParam()) + ".w"));
  const JelloScene scene = jello_scene(world);
  const SpringState y = run(scene, world.dt, 20000);
  Vec3 low = y.x[0], high = y.x[0];
  for (const Vec3& x : y.x) {
    low = low.cwiseMin(x);
    high = high.cwiseMax(x);
  }
  // In the room but for what the walls' springs give, and a cube still: not collapsed, not torn apart.
  EXPECT_GT(low.minCoeff(), -importers::JelloWorld::kRoom - 0.1);
  EXPECT_LT(high.maxCoeff(), importers::JelloWorld::kRoom + 0.1);
  EXPECT_GT((high - low).minCoeff(), 0.5);
  EXPECT_LT((high - low).maxCoeff(), 2.0);
}
INSTANTIATE_TEST_SUITE_P(Shared, JelloWorldSlow, testing::Values("jello", "gravity"), [](const auto& each) { return std::string(each.param); });

}  // namespace
}  // namespace effuse
