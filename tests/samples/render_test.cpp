#include <fmt/format.h>
#include <gtest/gtest.h>
#include <sys/wait.h>
#include <unistd.h>

#include <cmath>
#include <cstdlib>
#include <filesystem>

#include "geometry/base/files.h"
#include "skin/write/png.h"

/// Pictures of a run again, by another camera (`effuse render`).
namespace effuse {
namespace {

namespace fs = std::filesystem;

class Render : public testing::Test {
 protected:
  Render() {
    folder_ = fs::temp_directory_path() / fmt::format("effuse.Render.{}.{}", testing::UnitTest::GetInstance()->current_test_info()->name(), ::getpid());
    fs::remove_all(folder_);
    fs::create_directories(folder_);
  }
  ~Render() override { fs::remove_all(folder_); }

  struct Outcome {
    int code = -1;
    std::string err;
  };
  Outcome effuse(const std::string& words) const {
    const int status = std::system(fmt::format("'{}' {} >/dev/null 2>'{}'", EFFUSE_PROGRAM, words, (folder_ / "err").string()).c_str());
    return {WIFEXITED(status) ? WEXITSTATUS(status) : -1, read_file(folder_ / "err")};
  }
  void simulate(const std::string& scene, const std::string& settings) const {
    const Outcome made = effuse(fmt::format("run '{}/samples/scenes/{}' -o '{}' --set preview.width=160 --set preview.height=90 --set 'output.formats=[\"ply\", \"vdb\"]' {}", EFFUSE_SOURCE_DIR, scene, run().string(), settings));
    ASSERT_EQ(made.code, 0) << made.err;
  }
  fs::path run() const { return folder_ / "a run"; }

  /// Mean difference of two pictures, of 255.
  static double apart(const fs::path& a, const fs::path& b) {
    const skin::Rgb8Image x = skin::read_png(a), y = skin::read_png(b);
    EXPECT_EQ(x.rgb.size(), y.rgb.size());
    double sum = 0;
    for (std::size_t i = 0; i < x.rgb.size(); ++i) sum += std::abs(x.rgb[i] - y.rgb[i]);
    return sum / static_cast<double>(x.rgb.size());
  }

  fs::path folder_;
};
using RenderSlow = Render;

TEST_F(RenderSlow, ByTheSameCameraIsTheRunsOwnPictureAndByAnotherIsNot) {
  simulate("lava.toml", "--frames 3 --set lava.spacing=1.2 --set film.time_scale=30");
  const Outcome same = effuse(fmt::format("render '{}'", run().string()));
  ASSERT_EQ(same.code, 0) << same.err;
  for (int frame = 1; frame <= 3; ++frame)
    EXPECT_LT(apart(run() / fmt::format("preview/preview.{:04}.png", frame), run() / fmt::format("render/render.{:04}.png", frame)), 0.5) << frame;
  const Outcome other = effuse(fmt::format("render '{}' -o '{}' --frames 2-3 --to exr,png --set preview.azimuth=1 --set preview.sun_elevation=0.9", run().string(), (folder_ / "other").string()));
  ASSERT_EQ(other.code, 0) << other.err;
  EXPECT_FALSE(fs::exists(folder_ / "other/render.0001.png"));
  EXPECT_GT(apart(run() / "preview/preview.0003.png", folder_ / "other/render.0003.png"), 5);
  // A way of placing the camera replaces the scene's, which the run's scene.toml has in full: here keys, a fly-along.
  const Outcome along = effuse(fmt::format("render '{}' -o '{}' --frames 2 --set 'preview.key=[{{time=0, position=[30, 10, 6], target=[18, 46, 0]}}, {{time=2, position=[8, 20, 4]}}]'", run().string(), (folder_ / "along").string()));
  ASSERT_EQ(along.code, 0) << along.err;
  EXPECT_GT(apart(run() / "preview/preview.0002.png", folder_ / "along/render.0002.png"), 5);
  EXPECT_EQ(read_file(folder_ / "other/render.0002.exr").substr(0, 4), "\x76\x2f\x31\x01");
}

TEST_F(RenderSlow, HasTheSmokeToo) {
  simulate("smoke.toml", "--frames 12");
  const auto render = [&] {
    const Outcome made = effuse(fmt::format("render '{}' --frames 12 --force", run().string()));
    EXPECT_EQ(made.code, 0) << made.err;
    return apart(run() / "preview/preview.0012.png", run() / "render/render.0012.png");
  };
  const double with_smoke = render();
  std::vector<fs::path> volumes;
  for (const fs::directory_entry& entry : fs::directory_iterator(run() / "frames"))
    if (entry.path().extension() == ".vdb" && !entry.path().filename().string().starts_with("lava")) volumes.push_back(entry.path());
  ASSERT_FALSE(volumes.empty());
  for (const fs::path& file : volumes) fs::remove(file);
  // Half floats, and what is thinner than a thousandth is not in the file.
  EXPECT_LT(with_smoke, 1);
  EXPECT_GT(render(), 3 * with_smoke);
}

TEST_F(RenderSlow, HasFlamesPuffsAndSparksAsDenseAsTheyAre) {
  simulate("campfire.toml", "--frames 20");
  const auto render = [&] {
    const Outcome made = effuse(fmt::format("render '{}' --frames 20 --force", run().string()));
    EXPECT_EQ(made.code, 0) << made.err;
    EXPECT_EQ(made.err.find("not drawn"), std::string::npos) << made.err;
    return apart(run() / "preview/preview.0020.png", run() / "render/render.0020.png");
  };
  const double with_all = render();
  EXPECT_LT(with_all, 0.5);
  int without = 0;
  for (const fs::directory_entry& entry : fs::directory_iterator(run() / "frames")) {
    const std::string name = entry.path().filename().string(), bytes = entry.path().extension() == ".ply" ? read_file(entry.path()) : "";
    if (!name.ends_with(".0020.ply") || bytes.find("property float opacity") == std::string::npos) continue;
    ++without;
    const fs::path aside = folder_ / name;
    fs::rename(entry.path(), aside);
    EXPECT_GT(render(), with_all + 0.05) << name << " is not in the picture";
    fs::rename(aside, entry.path());
  }
  EXPECT_GE(without, 2);
}

TEST_F(RenderSlow, RefusesWhatItCannotDoAndKeepsWhatIsThere) {
  simulate("lava.toml", "--frames 1 --set lava.spacing=1.2 --set film.time_scale=30");
  const std::string dir = "'" + run().string() + "'";
  const auto refused = [&](const std::string& words, const std::string& message) {
    const Outcome outcome = effuse("render " + words);
    EXPECT_EQ(outcome.code, 2) << words;
    EXPECT_NE(outcome.err.find(message), std::string::npos) << outcome.err;
  };
  refused("'" + folder_.string() + "'", "holds no run");
  refused(dir + " --frames 2", "the run has frames 1 to 1");
  refused(dir + " --frames 3-1", "the run has frames");
  refused(dir + " --frames one", "wanted a frame's number");
  refused(dir + " --set lava.spacing=2", "only [preview] can change");
  refused(dir + " --set preview.azimut=2", "azimuth");
  refused(dir + " --to jpg", "jpg");
  EXPECT_FALSE(fs::exists(run() / "render"));
  ASSERT_EQ(effuse("render " + dir).code, 0);
  const std::string picture = read_file(run() / "render/render.0001.png");
  refused(dir + " --set preview.azimuth=1", "holds pictures already");
  EXPECT_EQ(read_file(run() / "render/render.0001.png"), picture);
  ASSERT_EQ(effuse("render --force " + dir + " --set preview.azimuth=1").code, 0);
  EXPECT_NE(read_file(run() / "render/render.0001.png"), picture);
  fs::remove(run() / "frames/skin.0001.ply");
  refused(dir + " --force", "skin.0001.ply");
}

}  // namespace
}  // namespace effuse
