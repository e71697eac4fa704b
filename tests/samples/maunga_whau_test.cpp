#include <gtest/gtest.h>

#include <algorithm>
#include <filesystem>

#include "geometry/mesh/measure.h"
#include "geometry/mesh/validate.h"
#include "samples/effuse/load_scene.h"
#include "skin/surface/level_set.h"

/// The real scene, shortened: what must be conserved on a real mountain.
namespace effuse {
namespace {

const std::filesystem::path kScene = std::filesystem::path(EFFUSE_SOURCE_DIR) / "samples" / "scenes" / "maunga-whau.toml";

class MaungaWhau : public testing::Test {
 protected:
  /// Runs to the last of `frames` at twice the scene's spacing and calls visit(frame) after each.
  template <class Visit>
  void run(int frames, Visit&& visit) {
    loaded_ = load_scene(kScene, {"lava.spacing=2.5 m"}, frames);
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

TEST_F(MaungaWhau, SkinEnclosesTheParticlesVolumeWithinFivePercentAndStaysNearThem) {
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
  });
}

}  // namespace
}  // namespace effuse
