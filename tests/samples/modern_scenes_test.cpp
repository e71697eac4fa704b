#include <gtest/gtest.h>

#include <algorithm>
#include <cstdio>
#include <filesystem>
#include <map>
#include <nlohmann/json.hpp>
#include <string>

#include "geometry/base/files.h"
#include "samples/effuse/load_scene.h"

/// The scenes of the modern lava, coarse and short.
namespace effuse {
namespace {

const std::filesystem::path kScenes = std::filesystem::path(EFFUSE_SOURCE_DIR) / "samples" / "scenes";

class ModernScene : public testing::Test {
 protected:
  void load(const char* scene, std::vector<std::string> overrides, int frames) { loaded_ = load_scene(kScenes / scene, overrides, frames); }
  template <class Visit>
  void run(Visit&& visit) {
    while (loaded_->simulation->frame() < loaded_->scene.frames) {
      ASSERT_TRUE(loaded_->simulation->advance([] { return true; }));
      visit();
    }
  }
  const flow::Effect& lava() const { return *loaded_->simulation->effects().front(); }
  std::map<std::string, double> figures() const {
    std::map<std::string, double> all;
    for (const auto& [key, value] : lava().figures()) all[key] = value;
    return all;
  }
  /// Particles whose centre is below the ground, or beside it.
  std::size_t astray() const {
    std::size_t count = 0;
    for (const Vec3& x : lava().points().position) {
      const auto height = loaded_->terrain->height(x.x(), x.y());
      count += !height || x.z() < *height;
    }
    return count;
  }
  std::unique_ptr<LoadedScene> loaded_;
};

TEST_F(ModernScene, InTheGullyLavaRunsDownCoolsAndLosesNothing) {
  load("gully-modern.toml", {"lava.spacing=1 m"}, 40);
  double front = 1e9;
  std::size_t astray_in_all = 0;
  run([&] {
    astray_in_all += astray();
    for (const Vec3& x : lava().points().position) front = std::min(front, x.y());
  });
  const auto f = figures();
  EXPECT_EQ(astray_in_all, 0u);
  EXPECT_EQ(f.at("mass_left_kg"), 0);
  EXPECT_EQ(f.at("mass_present_kg"), f.at("mass_emitted_kg"));
  EXPECT_NEAR(f.at("volume_m3"), 8 * 29, 15) << "rate, 30 s less a ramp at each end; to one particle a site";
  EXPECT_LT(front, 30) << "13 m down from y = 43";
  const double lost = f.at("radiated_J") + f.at("convected_J") + f.at("ground_J");
  EXPECT_GT(lost, 1e8);
  EXPECT_NEAR((f.at("vent_J") + f.at("viscous_J") - f.at("stored_J") - f.at("left_J")) / lost, 1, 1e-6);
  EXPECT_LT(f.at("min_temperature_K"), 1359.5);

  // What glows is the skin, not the whole particle.
  const geometry::Points points = lava().points();
  double coldest = 1e9, crust = 0;
  for (const double T : points.temperature) coldest = std::min(coldest, T);
  for (const double c : points.crust) crust = std::max(crust, c);
  EXPECT_LT(coldest, 1200) << "a skin of 40 s";
  EXPECT_GT(coldest, 400);
  EXPECT_GT(crust, 0);
}

TEST_F(ModernScene, TheResolvedSceneOfMaungaWhauReadsBack) {
  load("maunga-whau-modern.toml", {"lava.spacing=4 m"}, 1);
  const std::string resolved = loaded_->resolved, key = loaded_->key;
  const std::filesystem::path file =
      std::filesystem::temp_directory_path() / ("effuse.resolved." + std::to_string(std::hash<std::string>()(resolved)) + ".toml");
  write_file(file, resolved);
  loaded_ = load_scene(file, {}, 0);
  std::filesystem::remove(file);
  EXPECT_EQ(loaded_->resolved, resolved);
  EXPECT_EQ(loaded_->key, key);
}

TEST(EffectsVerb, ListsTheParametersOfEveryModelAndLaw) {
  std::string out;
  FILE* pipe = ::popen((std::string("'") + EFFUSE_PROGRAM + "' effects --json").c_str(), "r");
  ASSERT_TRUE(pipe);
  for (char buffer[4096]; const std::size_t n = std::fread(buffer, 1, sizeof buffer, pipe);) out.append(buffer, n);
  ASSERT_EQ(::pclose(pipe), 0);
  const auto kinds = nlohmann::json::parse(out);
  std::map<std::string, std::string> with;
  for (const auto& parameter : kinds.at(0).at("parameters")) {
    const std::string path = parameter.at("path");
    EXPECT_FALSE(with.contains(path)) << path << " is listed twice";
    with[path] = parameter.value("with", "");
  }
  ASSERT_TRUE(with.contains("lava.heat.latent_heat"));
  EXPECT_EQ(with.at("lava.heat.latent_heat"), "");
  EXPECT_EQ(with.at("lava.stiffness"), "model = classic");
  EXPECT_EQ(with.at("lava.rheology.b"), "preset = etna");
  EXPECT_EQ(with.at("lava.rheology.oxides.sio2"), "law = grd08");
  EXPECT_EQ(with.at("lava.rheology.yield.strength"), "law = constant");
}

}  // namespace
}  // namespace effuse
