#include <gtest/gtest.h>

#include <filesystem>
#include <fstream>
#include <sstream>

#include "flow/springs/builders.h"
#include "importers/worlds/jello_world.h"
#include "samples/effuse/load_scene.h"
#include "tests/importers/test_files.h"

namespace effuse {
namespace {

namespace fs = std::filesystem;

fs::path world_file(const std::string& name) { return importers::shared_data() / "jello" / name; }

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

/// Surface of the cube after so many frames of the world's file, each a step in these two.
geometry::TriMesh run(const std::string& name, int frames) {
  const std::unique_ptr<LoadedScene> loaded = load_scene(world_file(name + ".w"), {}, std::min(frames, 9999));
  for (int frame = 0; frame < frames; ++frame) loaded->simulation->advance([] { return true; });
  return loaded->simulation->effects().at(0)->meshes().at(0).mesh;
}

class JelloWorldFile : public testing::TestWithParam<const char*> {};

TEST_P(JelloWorldFile, ReproducesTheReferenceAfterAThousandSteps) {
  if (importers::shared_data().empty()) GTEST_SKIP() << "skipped: the shared data is not here";
  const std::vector<Vec3> reference = read_points(world_file(std::string(GetParam()) + ".ref1000.csv"));
  ASSERT_EQ(reference.size(), 512u);
  const std::vector<Vec3> start = importers::read_jello_world(world_file(std::string(GetParam()) + ".w")).positions;
  const geometry::TriMesh cube = run(GetParam(), 1000);
  // The surface's vertices hang on one point each: 512 less the 6^3 inside, which pull on them.
  const flow::springs::SpringBody same = flow::springs::jello_cube(8, Vec3::Zero(), 1, 1, {1, 0, 0});
  ASSERT_EQ(cube.positions.size(), 296u);
  Real worst = 0, moved = 0;
  for (std::size_t q = 0; q < cube.positions.size(); ++q) {
    const Index point = same.point[q][0];
    worst = std::max(worst, (cube.positions[q] - reference[point]).lpNorm<Eigen::Infinity>());
    moved = std::max(moved, (start[point] - reference[point]).norm());
  }
  EXPECT_LT(worst, 1e-6) << "the farthest point moved " << moved;
  EXPECT_GT(moved, 0.01);
}
INSTANTIATE_TEST_SUITE_P(Shared, JelloWorldFile, testing::Values("jello", "gravity"), [](const auto& each) { return std::string(each.param); });

class JelloWorldSlow : public JelloWorldFile {};

TEST_P(JelloWorldSlow, RunsOnForTwentyThousandSteps) {
  if (importers::shared_data().empty()) GTEST_SKIP() << "skipped: the shared data is not here";
  const geometry::TriMesh cube = run(GetParam(), 20000);
  Vec3 low = cube.positions[0], high = low;
  for (const Vec3& x : cube.positions) {
    low = low.cwiseMin(x);
    high = high.cwiseMax(x);
  }
  // In the room but for what the walls' springs give, and a cube still: not collapsed, not torn apart.
  constexpr Real kRoom = importers::JelloWorld::kRoom;
  EXPECT_GT(low.minCoeff(), -kRoom - 0.1);
  EXPECT_LT(high.maxCoeff(), kRoom + 0.1);
  EXPECT_GT((high - low).minCoeff(), 0.5);
  EXPECT_LT((high - low).maxCoeff(), 2.0);
}
INSTANTIATE_TEST_SUITE_P(Shared, JelloWorldSlow, testing::Values("jello", "gravity"), [](const auto& each) { return std::string(each.param); });

}  // namespace
}  // namespace effuse
