#include "skin/write/write_animation.h"

#include <gtest/gtest.h>
#include <unistd.h>

#include <cstring>
#include <filesystem>
#include <nlohmann/json.hpp>

#include "geometry/base/error.h"
#include "geometry/base/files.h"
#include "geometry/procedural/primitives.h"

namespace effuse::skin {
namespace {

namespace fs = std::filesystem;
using geometry::RigidPose;

struct Glb {
  nlohmann::json json;
  std::string bin;

  explicit Glb(const std::string& bytes) {
    std::uint32_t length = 0;
    std::memcpy(&length, bytes.data() + 12, 4);
    json = nlohmann::json::parse(bytes.substr(20, length));
    if (bytes.size() > 20 + length) bin = bytes.substr(20 + length + 8);
  }
  std::vector<float> floats(std::size_t accessor) const {
    const auto& a = json["accessors"][accessor];
    const auto& view = json["bufferViews"][a["bufferView"].get<std::size_t>()];
    std::vector<float> values(view["byteLength"].get<std::size_t>() / sizeof(float));
    std::memcpy(values.data(), bin.data() + view["byteOffset"].get<std::size_t>(), values.size() * sizeof(float));
    return values;
  }
};

class WriteAnimation : public testing::Test {
 protected:
  WriteAnimation() : file_(fs::temp_directory_path() / ("effuse_animation_" + std::to_string(::getpid()) + ".glb")) {}
  ~WriteAnimation() override { fs::remove(file_); }
  fs::path file_;
};

TEST_F(WriteAnimation, MovesEachVertexWhereThePoseDoesInAxesWithYUp) {
  const geometry::TriMesh box = geometry::make_box(Vec3(0, 0, 0), Vec3(1, 2, 3));
  const std::vector<RigidPose> poses = {{Vec3(1, 2, 3), Quat(0.2, -0.4, 0.1, 0.8).normalized()}, {Vec3(4, -1, 2), Quat(-0.3, 0.5, 0.2, -0.7).normalized()}, {Vec3(4, 0, 2), Quat(0.9, 0.1, 0.2, 0.3).normalized()}};
  const std::vector<Real> times = {0, 0.5, 2};
  write_animated_glb(file_, std::vector<MovingMesh>{{"a", &box, poses}, {"b", &box, {poses[0], poses[0], poses[0]}}}, times, {{"scene", "s"}});
  const Glb glb(read_file(file_));
  EXPECT_EQ(glb.json["meshes"].size(), 1u) << "shared";
  EXPECT_EQ(glb.json["nodes"].size(), 2u);
  EXPECT_EQ(glb.json["nodes"][1]["name"], "b");
  const auto& animation = glb.json["animations"][0];
  ASSERT_EQ(animation["channels"].size(), 2u) << "what stands has none";
  EXPECT_EQ(glb.floats(animation["samplers"][0]["input"].get<std::size_t>()), (std::vector<float>{0, 0.5f, 2}));
  const std::vector<float> shift = glb.floats(animation["samplers"][0]["output"].get<std::size_t>()), turn = glb.floats(animation["samplers"][1]["output"].get<std::size_t>());
  const std::vector<float> vertices = glb.floats(glb.json["meshes"][0]["primitives"][0]["attributes"]["POSITION"].get<std::size_t>());
  for (std::size_t f = 0; f < 3; ++f) {
    const Quat q(turn[4 * f + 3], turn[4 * f], turn[4 * f + 1], turn[4 * f + 2]);
    const Vec3 t(shift[3 * f], shift[3 * f + 1], shift[3 * f + 2]);
    for (std::size_t v = 0; v < box.positions.size(); ++v) {
      const Vec3 shown = q * Vec3(vertices[3 * v], vertices[3 * v + 1], vertices[3 * v + 2]) + t, world = poses[f].world(box.positions[v]);
      EXPECT_NEAR((shown - Vec3(world.x(), world.z(), -world.y())).norm(), 0, 1e-5);
    }
    if (f == 0) continue;
    const Quat before(turn[4 * f - 1], turn[4 * f - 4], turn[4 * f - 3], turn[4 * f - 2]);
    EXPECT_GE(q.coeffs().dot(before.coeffs()), 0) << "the long way round";
  }
}

TEST_F(WriteAnimation, OfNothingIsAFileAndOfABrokenMeshIsNone) {
  write_animated_glb(file_, {}, std::vector<Real>{0});
  EXPECT_FALSE(Glb(read_file(file_)).json.contains("nodes"));
  fs::remove(file_);
  geometry::TriMesh broken = geometry::make_box(Vec3(0, 0, 0), Vec3(1, 2, 3));
  broken.triangles[0][0] = 99;
  EXPECT_THROW(write_animated_glb(file_, std::vector<MovingMesh>{{"a", &broken, {RigidPose{}}}}, std::vector<Real>{0}), InputError);
  EXPECT_FALSE(fs::exists(file_));
}

}  // namespace
}  // namespace effuse::skin
