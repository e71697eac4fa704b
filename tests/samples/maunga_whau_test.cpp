#include <fmt/format.h>
#include <gtest/gtest.h>
#include <unistd.h>

#include <algorithm>
#include <cstdlib>
#include <filesystem>
#include <nlohmann/json.hpp>

#include "geometry/base/error.h"
#include "geometry/base/files.h"
#include "geometry/mesh/measure.h"
#include "geometry/mesh/validate.h"
#include "samples/effuse/load_scene.h"
#include "skin/scene/skin_settings.h"
#include "skin/tessellate/make_skin.h"
#include "tests/skin/skin_checks.h"

/// The real scene, shortened: what must be conserved on a real mountain.
namespace effuse {
namespace {

const std::filesystem::path kScene = std::filesystem::path(EFFUSE_SOURCE_DIR) / "samples" / "scenes" / "maunga-whau.toml";

/// Share of the ground's lines that may be in gaps: single particles thrown out, whose drops of half a spacing hang over the ground. A body of lava
/// has none.
constexpr Real kHanging = 0.003;

class MaungaWhau : public testing::Test {
 protected:
  /// Runs to the last of `frames` at about twice the scene's spacing and calls visit(frame) after each.
  template <class Visit>
  void run(int frames, Visit&& visit, const std::string& spacing = "2.5 m") {
    loaded_ = load_scene(kScene, {"lava.spacing=" + spacing}, frames);
    while (loaded_->simulation->frame() < frames) {
      ASSERT_TRUE(loaded_->simulation->advance([] { return true; }));
      visit(loaded_->simulation->frame());
    }
  }
  const flow::Effect& lava() const { return *loaded_->simulation->effects().front(); }
  double figure(const std::string& name) const {
    for (const auto& [key, value] : lava().figures())
      if (key == name) return value;
    ADD_FAILURE() << "no figure " << name;
    return 0;
  }
  /// The frame's skins, smooth and displaced by each of the kinds, by both tessellations: sound, cut clean at the ground; kNoise, the
  /// default, and kAa within three per cent of the particles' volume.
  ///   edge  of the displaced mesh [spacings]
  void expect_skins(const std::vector<skin::SkinKind>& kinds, Real edge) {
    const geometry::Points points = lava().points();
    const geometry::Terrain& ground = *loaded_->terrain;
    skin::SkinSettings settings = loaded_->skin;
    settings.detail.edge = edge;
    for (const auto tessellation : {skin::TessellationKind::kLevelSet, skin::TessellationKind::kVoronoi})
      for (std::size_t k = 0; k <= kinds.size(); ++k) {
        settings.tessellation = tessellation;
        skin::SkinOptions options = skin::skin_at(settings, ground, 0, lava().spacing());
        if (k < kinds.size()) {
          options.detail->kind = kinds[k];
          options.detail->rest_ratio = points.rest_ratio;
        } else {
          options.detail.reset();
        }
        SCOPED_TRACE(fmt::format("{}, {}", skin::kTessellationNames[static_cast<std::size_t>(tessellation)],
                                 k < kinds.size() ? skin::kSkinKindNames[static_cast<std::size_t>(kinds[k])] : "smooth"));
        const skin::Skin skin = skin::make_skin(points, lava().volume(), &ground, options);
        skin::skin_checks::expect_sound(skin, points, options, &ground);
        skin::skin_checks::expect_clean_ground(skin.mesh, ground, lava().spacing(), 1.5 * skin.surface.voxel(), kHanging);
        if (k < kinds.size() && kinds[k] != skin::SkinKind::kNoise && kinds[k] != skin::SkinKind::kAa) continue;
        EXPECT_NEAR(skin::skin_checks::volume_above(skin.mesh, ground) / lava().volume(), 1, 0.03);
      }
  }
  std::unique_ptr<LoadedScene> loaded_;
};

TEST_F(MaungaWhau, LosesNoMassAndNoParticleUnderTheTerrain) {
  double lowest = 1e9;
  run(60, [&](int) {
    const geometry::Points points = lava().points();
    for (const Vec3& x : points.position) {
      const auto ground = loaded_->terrain->height(x.x(), x.y());
      ASSERT_TRUE(ground);
      lowest = std::min(lowest, x.z() - *ground);
    }
  });
  EXPECT_GT(figure("particles"), 400);
  EXPECT_EQ(figure("mass_left_kg"), 0);
  EXPECT_NEAR(figure("mass_present_kg") / figure("mass_emitted_kg"), 1, 1e-14);
  EXPECT_GT(lowest, -0.01 * lava().spacing()) << "of a spacing under the terrain";
}

class MaungaWhauSlow : public MaungaWhau {};

TEST_F(MaungaWhauSlow, SkinEnclosesTheParticlesVolumeWithinFivePercentAndStaysNearThem) {
  run(60, [&](int frame) {
    if (frame % 20 != 0) return;
    skin::LevelSetOptions options = loaded_->skin.level_set;
    options.spacing = lava().spacing();
    options.voxel = loaded_->skin.voxel * options.spacing;
    const geometry::Points points = lava().points();
    const skin::LevelSet surface = skin::build_level_set(points, lava().volume(), &*loaded_->terrain, options);
    const geometry::TriMesh mesh = skin::mesh_level_set(surface);
    EXPECT_TRUE(geometry::validate(mesh).solid()) << to_string(geometry::validate(mesh));
    EXPECT_NEAR(skin::volume_above_ground(surface, &*loaded_->terrain) / lava().volume(), 1, 0.05) << "frame " << frame;

    // No skin far from particles, no gap above the ground at its foot.
    double farthest = 0;
    for (std::size_t v = 0; v < mesh.positions.size(); v += 7) {
      double nearest = 1e9;
      for (const Vec3& x : points.position) nearest = std::min(nearest, (x - mesh.positions[v]).norm());
      farthest = std::max(farthest, nearest);
    }
    EXPECT_LT(farthest, 2 * options.spacing) << "frame " << frame;
    if (frame == 60) expect_skins({skin::SkinKind::kNoise, skin::SkinKind::kAa}, 0.5);
  });
}

TEST(MaungaWhauRunSlow, WritesRegionsAndTellsOfThemInRunJson) {
  namespace fs = std::filesystem;
  const fs::path folder = fs::temp_directory_path() / fmt::format("effuse.maunga_whau_run.{}", ::getpid());
  fs::remove_all(folder);
  for (const std::string tessellation : {"levelset", "voronoi"}) {
    const std::string command = fmt::format("'{}' run '{}' -o '{}' --frames 12 --quiet --force --set lava.spacing='3 m' --set skin.tessellation={} --set output.formats='[\"ply\"]' "
                                            "--set output.maps=false --set output.series=false --set preview.pictures=false",
                                            EFFUSE_PROGRAM, kScene.string(), folder.string(), tessellation);
    ASSERT_EQ(std::system(command.c_str()), 0) << command;
    const auto run = nlohmann::json::parse(read_file(folder / "run.json"));
    const auto& skin = run.at("skin");
    EXPECT_EQ(skin.at("frame"), 12);
    EXPECT_EQ(skin.at("triangles"), run.at("frames").back().at("triangles"));
    EXPECT_GT(skin.at("regions").get<int>(), 10);
    EXPECT_LE(skin.at("regions").get<double>(), run.at("effects").at("lava").at("particles").get<double>());
    EXPECT_LE(skin.at("thin_triangles_share").get<double>(), 0.005);
    EXPECT_LE(skin.at("folded_triangles").get<int>(), 2);
    const std::string ply = read_file(folder / "frames" / "skin.0012.ply");
    EXPECT_NE(ply.find("property uint region\nelement face"), std::string::npos);
    EXPECT_EQ(ply.find("vertex_indices\nproperty uint region\n") != std::string::npos, tessellation == "voronoi");
  }
  // Triangles that belong to a particle are not to be merged with others'.
  EXPECT_THROW(load_scene(kScene, {"skin.tessellation=voronoi", "skin.coarsen=0.1"}, 1), InputError);
  EXPECT_THROW(load_scene(kScene, {"skin.tessellation=fans"}, 1), InputError);
  EXPECT_EQ(load_scene(kScene, {"skin.coarsen=0.1"}, 1)->skin.coarsen, 0.1);
  fs::remove_all(folder);
}

TEST_F(MaungaWhauSlow, EveryKindOfSkinIsSoundInAFineFrame) {
  run(
      100, [&](int frame) { if (frame == 100) expect_skins({skin::SkinKind::kNoise, skin::SkinKind::kAa, skin::SkinKind::kPahoehoe, skin::SkinKind::kBlock, skin::SkinKind::kObsidian}, 0.25); }, "1.6 m");
}

}  // namespace
}  // namespace effuse
