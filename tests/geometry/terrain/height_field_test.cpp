#include "geometry/terrain/height_field.h"

#include <gtest/gtest.h>

#include <cmath>

#include "geometry/base/error.h"
#include "geometry/mesh/measure.h"
#include "geometry/mesh/validate.h"
#include "tests/geometry/terrain/fields.h"

namespace effuse::geometry {
namespace {

constexpr Real kNaN = std::numeric_limits<Real>::quiet_NaN();

std::string fault_of(const Vec2& spacing, int nx, int ny, std::vector<Real> z) {
  try {
    HeightField({0, 0}, spacing, nx, ny, std::move(z));
    return "";
  } catch (const InputError& error) {
    return error.what();
  }
}

TEST(HeightField, BadGridsAreRefusedWithTheirReason) {
  EXPECT_NE(fault_of({1, 1}, 1, 1, {5}).find("1 x 1 posts, wanted at least 2 x 2"), std::string::npos);
  EXPECT_NE(fault_of({1, 1}, 0, 0, {}).find("at least 2 x 2"), std::string::npos);
  EXPECT_NE(fault_of({1, 1}, -3, 4, {}).find("at least 2 x 2"), std::string::npos);
  EXPECT_NE(fault_of({1, 1}, 3, 2, {1, 2, 3}).find("3 heights for 3 x 2 posts, wanted 6"), std::string::npos);
  EXPECT_NE(fault_of({0, 1}, 2, 2, {1, 2, 3, 4}).find("more than 0"), std::string::npos);
  EXPECT_NE(fault_of({kNaN, 1}, 2, 2, {1, 2, 3, 4}).find("more than 0"), std::string::npos);
  EXPECT_NE(fault_of({1, 1}, 2, 2, {1, 2, 3, -INFINITY}).find("infinite"), std::string::npos);
  EXPECT_NE(fault_of({1, 1}, 2, 2, {1, kNaN, 3, 4}).find("no ground"), std::string::npos);
  EXPECT_NE(fault_of({1, 1}, 3, 3, std::vector<Real>(9, kNaN)).find("no ground"), std::string::npos);
}

TEST(HeightField, IsBilinearBetweenPostsAndExactAtThem) {
  const HeightField field({10, 20}, {2, 4}, 3, 2, {0, 1, 2, 4, 8, 16});
  EXPECT_EQ(field.height(10, 20), 0);
  EXPECT_EQ(field.height(14, 24), 16);
  EXPECT_EQ(field.height(12, 24), 8);
  EXPECT_EQ(field.height(11, 22), (0 + 1 + 4 + 8) / 4.0);
  EXPECT_EQ(field.height(13, 20), 1.5);
  EXPECT_TRUE(std::isnan(field.height(9.999, 21)));
  EXPECT_TRUE(std::isnan(field.height(kNaN, 21)));
  EXPECT_TRUE(std::isnan(field.height(12, INFINITY)));
  EXPECT_EQ(field.bounds().min(), Vec3(10, 20, 0));
  EXPECT_EQ(field.bounds().max(), Vec3(14, 24, 16));
}

TEST(HeightField, CoversItsOuterBorderWhateverTheSpacing) {
  for (const Real spacing : {4.997678230579, 0.1, 1 / 3.0, 10.0}) {
    const HeightField field = fields::sampled({2667400.1, -6478700.3}, {spacing, spacing}, 53, 47, [](Real x, Real y) { return 0.1 * x - 0.2 * y; });
    for (int j = 0; j < 47; ++j) {
      for (int i = 0; i < 53; ++i) {
        const Real x = 2667400.1 + i * spacing, y = -6478700.3 + j * spacing;
        ASSERT_NEAR(field.height(x, y), field.post(i, j), 1e-8) << i << " " << j;
      }
    }
    EXPECT_FALSE(field.covers(field.bounds().max().x() + 1e-6, -6478700));
  }
}

TEST(HeightField, HolesAreNotGroundButTheirBorderIs) {
  std::vector<Real> z(16, 1.0);
  z[0] = kNaN;  // only cell (0, 0) is lost
  const HeightField field({0, 0}, {1, 1}, 4, 4, z);
  EXPECT_EQ(field.holes(), 1u);
  EXPECT_FALSE(field.covers(0.5, 0.5));
  EXPECT_FALSE(field.covers(0, 0));
  EXPECT_TRUE(field.covers(1, 0.5));
  EXPECT_TRUE(field.covers(0.5, 1));
  EXPECT_TRUE(field.covers(1, 1));
  EXPECT_EQ(field.height(0.5, 1), 1);
  EXPECT_TRUE(field.normal(0.5, 0.5).hasNaN());
  EXPECT_EQ(field.normal(1, 0.5), Vec3::UnitZ());
  EXPECT_TRUE(field.extended_normal(0.2, 0.3).allFinite());
  EXPECT_EQ(field.mesh().triangles.size(), 16u);
  EXPECT_EQ(field.mesh().positions.size(), 15u);
  EXPECT_NO_THROW(validate(field.mesh()));
  // A hole on the right: the border between belongs to the cell on the left.
  z.assign(16, 1.0);
  z[3] = kNaN;
  EXPECT_TRUE(HeightField({0, 0}, {1, 1}, 4, 4, z).covers(2, 0.5));
}

TEST(HeightField, NormalOfAPlaneIsExactEverywhere) {
  const HeightField field = fields::sampled({0, 0}, {2, 3}, 9, 7, [](Real x, Real y) { return 0.5 * x - 0.25 * y + 3; });
  const Vec3 expected = Vec3(-0.5, 0.25, 1).normalized();
  for (std::uint64_t k = 0; k < 500; ++k)
    EXPECT_LT((field.normal(16 * random_uniform(1, 0, k), 18 * random_uniform(1, 1, k)) - expected).norm(), 1e-14);
  EXPECT_NEAR(field.max_slope(), std::hypot(0.5, 0.25), 1e-14);
}

TEST(HeightField, NormalsOfASmoothHillConvergeWithSecondOrder) {
  const auto hill = [](Real x, Real y) { return std::sin(x) * std::cos(0.7 * y); };
  const auto error = [&](int n) {
    const HeightField field = fields::sampled({0, 0}, {6.0 / n, 6.0 / n}, n + 1, n + 1, hill);
    Real worst = 0;
    for (std::uint64_t k = 0; k < 2000; ++k) {
      const Real x = 1 + 4 * random_uniform(3, 0, k), y = 1 + 4 * random_uniform(3, 1, k);
      const Vec3 exact = Vec3(-std::cos(x) * std::cos(0.7 * y), 0.7 * std::sin(x) * std::sin(0.7 * y), 1).normalized();
      worst = std::max(worst, (field.normal(x, y) - exact).norm());
    }
    return worst;
  };
  EXPECT_NEAR(std::log2(error(60) / error(120)), 2, 0.1);
}

TEST(HeightField, MaxSlopeIsNeverExceeded) {
  const HeightField field = fields::maunga_whau();
  EXPECT_GT(field.max_slope(), 0.5);
  for (std::uint64_t k = 0; k < 20000; ++k) {
    const Real x = 599 * random_uniform(5, 0, k), y = 859 * random_uniform(5, 1, k), a = 2 * kPi * random_uniform(5, 2, k);
    const Real rise = field.height(x + std::cos(a) * 0.01 + 0.5, y + std::sin(a) * 0.01 + 0.5) - field.height(x + 0.5, y + 0.5);
    EXPECT_LE(std::abs(rise) / 0.01, field.max_slope() * (1 + 1e-9));
  }
}

TEST(HeightField, ItsMeshStandsOnThePostsAndFollowsTheFlatterDiagonals) {
  const HeightField field = fields::maunga_whau();
  const TriMesh mesh = field.mesh();
  const MeshReport report = validate(mesh);
  EXPECT_EQ(report.vertices, 61u * 87u);
  EXPECT_EQ(report.triangles, 2u * 60u * 86u);
  EXPECT_EQ(report.boundary_edges, 2u * (60u + 86u));
  EXPECT_TRUE(report.manifold() && report.oriented());
  EXPECT_EQ(report.euler, 1);
  for (const Triangle& t : mesh.triangles) {
    const Vec3 normal = (mesh.positions[t[1]] - mesh.positions[t[0]]).cross(mesh.positions[t[2]] - mesh.positions[t[0]]);
    ASSERT_GT(normal.z(), 0);
  }
  for (std::size_t i = 0; i < mesh.positions.size(); ++i) {
    const Vec3& x = mesh.positions[i];
    ASSERT_EQ(x.z(), field.height(x.x(), x.y()));
    ASSERT_LT((mesh.normals[i] - field.normal(x.x(), x.y())).norm(), 1e-14);
  }
  // A ridge along the other diagonal.
  EXPECT_TRUE(HeightField({0, 0}, {1, 1}, 2, 2, {5, 0, 0, 5}).splits_rising(0, 0));
  EXPECT_FALSE(HeightField({0, 0}, {1, 1}, 2, 2, {0, 5, 5, 0.1}).splits_rising(0, 0));
}

TEST(HeightField, APlanesNormalIsCarriedOverItsHolesAndPastItsBorder) {
  HeightField plane = fields::sampled({0, 0}, {1, 1}, 21, 16, [](Real x, Real y) { return 0.5 * x - 0.25 * y; });
  std::vector<Real> z = plane.posts();
  for (int j = 4; j < 16; ++j)
    for (int i = 5; i < 14; ++i) z[static_cast<std::size_t>(j) * 21 + i] = kNaN;
  const HeightField field({0, 0}, {1, 1}, 21, 16, z);
  EXPECT_EQ(field.holes(), 10u * 12u);
  for (std::uint64_t k = 0; k < 1000; ++k) {
    const Vec3 n = field.extended_normal(-3 + 26 * random_uniform(1, 0, k), -3 + 21 * random_uniform(1, 1, k));
    EXPECT_LT((n - Vec3(-0.5, 0.25, 1).normalized()).norm(), 1e-14);
  }
}

TEST(HeightField, SlopesAreCarriedOverHolesOfAnySize) {
  const HeightField field = fields::random_field(3, 60, 50, 0.3, 0.7);
  for (std::uint64_t k = 0; k < 5000; ++k) {
    const Vec3 n = field.extended_normal(-20 + 150 * random_uniform(2, 0, k), -10 + 190 * random_uniform(2, 1, k));
    ASSERT_NEAR(n.norm(), 1, 1e-14);
    ASSERT_GT(n.z(), 0);
  }
}

}  // namespace
}  // namespace effuse::geometry
