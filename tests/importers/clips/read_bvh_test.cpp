#include "importers/clips/read_bvh.h"

#include <gtest/gtest.h>

#include <unistd.h>

#include <fstream>
#include <sstream>

#include "geometry/base/error.h"
#include "geometry/base/files.h"
#include "geometry/base/random.h"
#include "geometry/motion/walk.h"

namespace effuse::importers {
namespace {

namespace fs = std::filesystem;

/// Another reading of BVH: its words one by one, each channel a matrix, in its own axes (y up) and units. Places of joints and ends, frame by frame.
struct Plain {
  struct Joint {
    int parent;
    Vec3 offset;
    std::vector<std::string> channels;
  };
  std::vector<Joint> joints;
  std::vector<std::vector<Vec3>> frames;

  explicit Plain(const std::string& text) {
    std::istringstream in(text);
    std::string word;
    std::vector<int> open;
    int next = -1;
    while (in >> word && word != "MOTION") {
      if (word == "ROOT" || word == "JOINT" || word == "End") {
        in >> word;
        joints.push_back({open.empty() ? -1 : open.back(), Vec3::Zero(), {}});
        next = static_cast<int>(joints.size()) - 1;
      } else if (word == "{") {
        open.push_back(next);
      } else if (word == "}") {
        open.pop_back();
      } else if (word == "OFFSET") {
        Vec3& o = joints.back().offset;
        in >> o.x() >> o.y() >> o.z();
      } else if (word == "CHANNELS") {
        int n;
        in >> n;
        for (int k = 0; k < n && in >> word; ++k) joints.back().channels.push_back(word);
      }
    }
    int count;
    double time;
    in >> word >> count >> word >> word >> time;
    for (int f = 0; f < count; ++f) {
      std::vector<Vec3> at;
      std::vector<Mat3> turned;
      for (const Joint& joint : joints) {
        Mat3 R = Mat3::Identity();
        Vec3 p = joint.offset;
        if (joint.parent < 0 && !joint.channels.empty() && joint.channels.size() > 3) p = Vec3::Zero();
        for (const std::string& channel : joint.channels) {
          double v;
          in >> v;
          const int axis = channel[0] - 'X';
          if (channel.find("position") != std::string::npos) p[axis] = v;
          else R = R * Eigen::AngleAxisd(v * kPi / 180, Vec3::Unit(axis)).toRotationMatrix();
        }
        if (joint.parent < 0) at.push_back(p), turned.push_back(R);
        else {
          const auto q = static_cast<std::size_t>(joint.parent);
          at.push_back(at[q] + turned[q] * p);
          turned.push_back(turned[q] * R);
        }
      }
      frames.push_back(at);
    }
  }
};

void agree(const fs::path& file, Real scale) {
  const Plain plain(read_file(file));
  const geometry::SkeletonClip clip = read_bvh(file, scale);
  ASSERT_EQ(clip.joints.size(), plain.joints.size());
  ASSERT_EQ(clip.frames.size(), plain.frames.size());
  for (std::size_t f = 0; f < clip.frames.size(); ++f) {
    const auto world = geometry::forward_kinematics(clip.joints, clip.frames[f]);
    // Order of children may differ: each place of the one is a place of the other.
    for (const Vec3& p : plain.frames[f]) {
      const Vec3 there = scale * Vec3(p.x(), -p.z(), p.y());
      Real nearest = 1e9;
      for (const auto& joint : world) nearest = std::min(nearest, (joint.position - there).norm());
      ASSERT_LT(nearest, 1e-4) << "frame " << f;  // assimp keeps floats
    }
  }
}

class ReadBvh : public testing::Test {
 protected:
  ReadBvh() : folder_(fs::temp_directory_path() / ("effuse.bvh." + std::to_string(::getpid()))) { fs::create_directories(folder_); }
  ~ReadBvh() override { fs::remove_all(folder_); }
  fs::path write(const std::string& name, const std::string& text) {
    std::ofstream(folder_ / name) << text;
    return folder_ / name;
  }
  fs::path folder_;
};

constexpr const char* kArm =
    "HIERARCHY\nROOT Hips\n{\n OFFSET 0 0 0\n CHANNELS 6 Xposition Yposition Zposition Zrotation Xrotation Yrotation\n JOINT Arm\n {\n  OFFSET 1 2 3\n  CHANNELS 3 Yrotation Xrotation Zrotation\n"
    "  JOINT Hand\n  {\n   OFFSET 4 -1 0.5\n   CHANNELS 3 Zrotation Yrotation Xrotation\n   End Site\n   {\n    OFFSET 0 2 1\n   }\n  }\n }\n}\n";

TEST_F(ReadBvh, ItsPlacesAreThoseOfAnotherReadingInEveryOrderOfTurns) {
  std::string text = std::string(kArm) + "MOTION\nFrames: 40\nFrame Time: 0.025\n";
  for (int f = 0; f < 40; ++f)
    for (int c = 0; c < 12; ++c) text += std::to_string(360 * random_uniform(3, 1, static_cast<std::uint64_t>(12 * f + c)) - 180) + (c == 11 ? "\n" : " ");
  const fs::path file = write("arm.bvh", text);
  agree(file, 0.01);
  EXPECT_NEAR(read_bvh(file, 1).frame_time, 0.025, 1e-6);
}

TEST_F(ReadBvh, TheWalkOfTheSamplesWalks) {
  const fs::path file = fs::path(EFFUSE_SOURCE_DIR) / "samples/scenes/walk.bvh";
  agree(file, 0.01);
  const geometry::SkeletonClip clip = read_bvh(file, 0.01);
  geometry::WalkOptions o;
  o.path = {Vec2(0, 0), Vec2(6, 0), Vec2(9, 4)};
  o.duration = 12;
  const geometry::Walk walk = geometry::walk_along(clip, [](const Vec2& p) { return 0.1 * p.x(); }, o);
  EXPECT_GT(walk.plants.size(), 14u);
  EXPECT_LT(walk.slide, 0.01);
}

TEST_F(ReadBvh, RefusesWhatIsNone) {
  EXPECT_THROW(read_bvh(folder_ / "none.bvh", 1), InputError);
  EXPECT_THROW(read_bvh(write("a.txt", kArm), 1), InputError);
  EXPECT_THROW(read_bvh(write("empty.bvh", ""), 1), InputError);
  EXPECT_THROW(read_bvh(write("words.bvh", "not a clip at all\n"), 1), InputError);
  EXPECT_THROW(read_bvh(write("still.bvh", std::string(kArm) + "MOTION\nFrames: 0\nFrame Time: 0.1\n"), 1), InputError);
  EXPECT_THROW(read_bvh(write("short.bvh", std::string(kArm) + "MOTION\nFrames: 3\nFrame Time: 0.1\n1 2 3\n"), 1), InputError);
  EXPECT_THROW(read_bvh(write("cut.bvh", std::string(kArm).substr(0, 200)), 1), InputError);
}

}  // namespace
}  // namespace effuse::importers
