#include "geometry/procedural/plant.h"

#include <gtest/gtest.h>

#include "geometry/mesh/measure.h"
#include "geometry/mesh/validate.h"

namespace effuse::geometry {
namespace {

Plant grown(const std::string& word, const TurtleOptions& options = {}) { return grow(derive({word, {}, {}}, 0, 1), options); }

TEST(Plant, TheTurtleTurnsAsItIsTold) {
  const TurtleOptions quarter{1, kPi / 2, 0.1, 0.7, 0.2};
  EXPECT_LT((grown("F", quarter).limbs[0].to - Vec3(0, 0, 1)).norm(), 1e-12);
  // Left of a turtle that looks up is -x; its back is +y.
  EXPECT_LT((grown("F+F", quarter).limbs[1].to - Vec3(-1, 0, 1)).norm(), 1e-12);
  EXPECT_LT((grown("F-F", quarter).limbs[1].to - Vec3(1, 0, 1)).norm(), 1e-12);
  EXPECT_LT((grown("F&F", quarter).limbs[1].to - Vec3(0, 1, 1)).norm(), 1e-12);
  EXPECT_LT((grown("F^F", quarter).limbs[1].to - Vec3(0, -1, 1)).norm(), 1e-12);
  EXPECT_LT((grown("F/(90)+F", quarter).limbs[1].to - Vec3(0, 1, 1)).norm(), 1e-12);
  EXPECT_LT((grown("F|F", quarter).limbs[1].to).norm(), 1e-12);
  EXPECT_LT((grown("F(2)f(1)F(0.5)", quarter).limbs[1].to - Vec3(0, 0, 3.5)).norm(), 1e-12);
  // A closed square.
  EXPECT_LT((grown("F+F+F+F", quarter).limbs[3].to).norm(), 1e-12);
}

TEST(Plant, BranchesThinAndRememberWhereTheyGrew) {
  const Plant plant = grown("F[+F]F");
  ASSERT_EQ(plant.limbs.size(), 3u);
  EXPECT_EQ(plant.limbs[0].parent, Plant::kNone);
  EXPECT_EQ(plant.limbs[1].parent, 0u);
  EXPECT_EQ(plant.limbs[2].parent, 0u);
  EXPECT_EQ(plant.limbs[2].branch, plant.limbs[0].branch);
  EXPECT_NE(plant.limbs[1].branch, plant.limbs[0].branch);
  EXPECT_DOUBLE_EQ(plant.limbs[1].thick_from, 0.07);
  EXPECT_DOUBLE_EQ(plant.height(), 2);
}

TEST(Plant, EachBranchIsAClosedTube) {
  const TriMesh mesh = plant_mesh(grown("F(2)&(20)F(1)[+F]F(1)"), 24);
  const MeshReport report = validate(mesh);
  EXPECT_TRUE(report.solid()) << to_string(report);
  EXPECT_EQ(report.components, 2u);
  // Cylinders of diameter 0.1, 0.07 (thinning to 0.7 of it at the ends): a little less than straight ones.
  EXPECT_NEAR(signed_volume(mesh), kPi * 0.0025 * (3 + 0.73) + kPi * 0.001225 * 0.73, 0.06 * 0.03);
}

TEST(Plant, EveryKindStandsUprightAndItsSeedIsReproducible) {
  for (const PlantKind& kind : plant_kinds()) {
    const Plant plant = grow(derive(kind.system, kind.generations, 3), kind.turtle), again = grow(derive(kind.system, kind.generations, 3), kind.turtle);
    EXPECT_GT(plant.height(), 0.4) << kind.name;
    EXPECT_LT(plant.height(), 2) << kind.name;
    EXPECT_EQ(plant.limbs.size(), again.limbs.size()) << kind.name;
    for (const Limb& limb : plant.limbs) ASSERT_GT(limb.to.z(), -0.05) << kind.name;
    const TriMesh mesh = plant_mesh(plant, 5);
    EXPECT_NO_THROW(validate(mesh)) << kind.name;
    EXPECT_LT(mesh.triangles.size(), 200000u) << kind.name;
  }
}

TEST(Plant, SwaysDownwindAboutItsFootAndKeepsItsLengths) {
  const PlantKind& kind = plant_kinds()[0];
  const Plant plant = grow(derive(kind.system, 6, 3), kind.turtle);
  Sway sway;
  sway.wind = Vec2(8, 0);
  sway.gust = 0;
  const Plant bent = swayed(plant, sway, 1.3);
  Real lean = 0;
  for (std::size_t k = 0; k < plant.limbs.size(); ++k) {
    EXPECT_NEAR((bent.limbs[k].to - bent.limbs[k].from).norm(), (plant.limbs[k].to - plant.limbs[k].from).norm(), 1e-12);
    if (plant.limbs[k].parent != Plant::kNone) {
      // It still grows where it grew: at the same place along its parent.
      const Limb &p = plant.limbs[plant.limbs[k].parent], &q = bent.limbs[plant.limbs[k].parent];
      EXPECT_NEAR((plant.limbs[k].from - p.from).norm(), (bent.limbs[k].from - q.from).norm(), 1e-12);
    }
    lean += (bent.limbs[k].to - plant.limbs[k].to).x();
  }
  EXPECT_GT(lean, 0);
  EXPECT_EQ(bent.limbs[0].from, plant.limbs[0].from);
  // Without wind it stands still, with gusts it swings with their period.
  EXPECT_EQ(swayed(plant, {}, 5).limbs.back().to, plant.limbs.back().to);
  sway.gust = 0.5;
  EXPECT_LT((swayed(plant, sway, 0.4).limbs.back().to - swayed(plant, sway, 0.4 + sway.period).limbs.back().to).norm(), 1e-9);
  EXPECT_GT((swayed(plant, sway, 0.4).limbs.back().to - swayed(plant, sway, 0.4 + sway.period / 2).limbs.back().to).norm(), 1e-4);
}

}  // namespace
}  // namespace effuse::geometry
