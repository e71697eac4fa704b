#include "geometry/remesh/cut_triangles.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "geometry/base/error.h"
#include "geometry/mesh/measure.h"
#include "geometry/mesh/validate.h"
#include "geometry/procedural/primitives.h"
#include "geometry/remesh/remesh.h"

namespace effuse::geometry {
namespace {

Real longest_edge(const TriMesh& mesh) {
  Real longest = 0;
  for (const Triangle& t : mesh.triangles)
    for (std::size_t k = 0; k < 3; ++k) longest = std::max(longest, (mesh.positions[t[k]] - mesh.positions[t[(k + 1) % 3]]).norm());
  return longest;
}

std::size_t most_triangles_at_a_vertex(const TriMesh& mesh) {
  std::vector<std::size_t> count(mesh.positions.size(), 0);
  for (const Triangle& t : mesh.triangles)
    for (const Index v : t) ++count[v];
  return *std::max_element(count.begin(), count.end());
}

TEST(CutTriangles, NoneIsLargerThanAskedAndTheSolidStaysTheSame) {
  // Also of long thin triangles, which have few pieces by their area and many by their length.
  for (const Vec3& high : {Vec3(2, 2, 2), Vec3(30, 1, 0.1), Vec3(30, 20, 0.1), Vec3(1000, 1e-3, 1e-3)}) {
    constexpr Real kLargest = 0.1;
    const TriMesh box = make_box(Vec3::Zero(), high), cut = cut_triangles(box, kLargest);
    for (const Triangle& t : cut.triangles) EXPECT_LE((cut.positions[t[1]] - cut.positions[t[0]]).cross(cut.positions[t[2]] - cut.positions[t[0]]).norm() / 2, kLargest);
    const MeshReport report = validate(cut);
    EXPECT_TRUE(report.solid()) << to_string(report);
    EXPECT_NEAR(signed_volume(cut), high.prod(), 1e-9);
    EXPECT_NEAR(surface_area(cut), surface_area(box), 1e-9);
    EXPECT_LE(most_triangles_at_a_vertex(cut), most_triangles_at_a_vertex(box) + 12);
    // Halves of what was too large, and what stays neighbours by being cut along.
    EXPECT_LT(static_cast<Real>(cut.triangles.size()), 4 * surface_area(box) / kLargest + 100) << high.transpose();
  }
}

TEST(CutTriangles, AMeshOfSmallOnesComesBackAsItIs) {
  const TriMesh grid = make_grid(Vec3(2667400, 6478700, 0), Vec2(1, 1), 5, 4), same = cut_triangles(grid, 0.6);
  EXPECT_EQ(same.triangles, grid.triangles);
  EXPECT_EQ(same.positions, grid.positions);
}

TEST(CutTriangles, ThoseTooSmallForTheirNumbersAreLeft) {
  const Real ulp = 0x1p-21;  // at 2^31 and above
  const Vec3 far(0x1p31, 0x1p31, 0x1p31);
  const TriMesh speck{{far, far + Vec3(ulp, 0, 0), far + Vec3(0, ulp, 0)}, {{0, 1, 2}}, {}, {}};
  EXPECT_EQ(cut_triangles(speck, ulp * ulp / 100).triangles.size(), 1u);
}

TEST(CutTriangles, OneLargeOneDoesNotMakeRemeshingSlow) {
  // Edges 200 times the new ones: CGAL alone hung fans of hundreds of triangles on the corners, and took the square of the time.
  const TriMesh one{{Vec3(0, 0, 0), Vec3(1, 0, 0), Vec3(0, 1, 0)}, {{0, 1, 2}}, {}, {}};
  const Remeshed fine = remesh(one, 0.02);
  EXPECT_LE(most_triangles_at_a_vertex(fine.mesh), 12u);
  EXPECT_NEAR(surface_area(fine.mesh), 0.5, 1e-12);
  EXPECT_LT(longest_edge(fine.mesh), 2 * 0.02);
  // A sliver a kilometre long has hardly an area, and ten thousand million edges of 100 nm.
  const TriMesh sliver{{Vec3(0, 0, 0), Vec3(1000, 0, 0), Vec3(500, 1e-7, 0)}, {{0, 1, 2}}, {}, {}};
  EXPECT_THROW(remesh(sliver, 1e-7), InputError);
}

}  // namespace
}  // namespace effuse::geometry
