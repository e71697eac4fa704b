#include "skin/page/pack_mesh.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <set>

#include "geometry/base/random.h"
#include "geometry/mesh/measure.h"
#include "geometry/procedural/primitives.h"
#include "skin/page/text85.h"
#include "tests/skin/page/unpack.h"
#include "tests/skin/sample_lava.h"

namespace effuse::skin {
namespace {

using geometry::TriMesh;

/// A plane that says which vertex is which: its low byte, and another its high one.
std::vector<BytePlane> numbered(std::size_t vertices) {
  std::vector<BytePlane> planes{{"red", {}}, {"green", {}}};
  for (std::size_t v = 0; v < vertices; ++v) {
    planes[0].values.push_back(static_cast<std::uint8_t>(v & 255));
    planes[1].values.push_back(static_cast<std::uint8_t>(v >> 8));
  }
  return planes;
}

/// What comes out must be what went in: each triangle the same way round, vertices within half a step, normals within a degree.
void expect_same(const TriMesh& mesh) {
  const PackedMesh packed = pack_mesh(mesh, numbered(mesh.positions.size()));
  ASSERT_EQ(packed.triangles, mesh.triangles.size());
  const testing_page::Unpacked back = testing_page::unpack(packed);
  const auto old = [&](Index v) { return static_cast<Index>(back.planes[v][0] | back.planes[v][1] << 8); };
  const Vec3 size = geometry::bounds(mesh).sizes();
  for (Index v = 0; v < back.positions.size(); ++v) {
    const Vec3 off = (back.positions[v] - mesh.positions[old(v)]).cwiseAbs();
    // Half a step, and the box's own rounding to float.
    for (int k = 0; k < 3; ++k) ASSERT_LE(off[k], size[k] / 65535 * 0.51 + 1e-6 * std::abs(mesh.positions[old(v)][k])) << "vertex " << v << " axis " << k;
    // Two bytes on the octahedron: at most 0.95 degrees off.
    ASSERT_GT(back.normals[v].dot(mesh.normals[old(v)]), std::cos(0.95 * kPi / 180)) << "vertex " << v;
  }
  const auto turned = [](geometry::Triangle t) {
    std::rotate(t.begin(), std::min_element(t.begin(), t.end()), t.end());
    return t;
  };
  std::multiset<geometry::Triangle> before, after;
  for (const geometry::Triangle& t : mesh.triangles) before.insert(turned(t));
  for (const geometry::Triangle& t : back.triangles) after.insert(turned({old(t[0]), old(t[1]), old(t[2])}));
  EXPECT_EQ(before, after);
}

TEST(PackMesh, GivesBackWhatItWasGiven) {
  expect_same(testing_meshes::tube(60, 3, 80, 24));
  TriMesh open = geometry::make_grid(Vec3(1e5, -2e5, 7), Vec2(3, 2), 9, 5);
  geometry::compute_normals(open);
  expect_same(open);
}

TEST(PackMesh, KeepsTrianglesInAnyOrderAndOnNonManifoldEdges) {
  TriMesh mesh = testing_meshes::tube(20, 2, 20, 12);
  for (std::size_t k = mesh.triangles.size() - 1; k > 0; --k) std::swap(mesh.triangles[k], mesh.triangles[static_cast<std::size_t>(random_uniform(3, 0, k) * static_cast<Real>(k + 1))]);
  const geometry::Triangle first = mesh.triangles.front();
  mesh.positions.push_back(mesh.positions[first[0]] + Vec3(0, 0, 9));
  mesh.normals.push_back(Vec3::UnitZ());
  for (auto& [name, attribute] : mesh.attributes) attribute.values.resize(attribute.values.size() + static_cast<std::size_t>(attribute.width));
  mesh.triangles.push_back({first[0], first[1], static_cast<Index>(mesh.positions.size() - 1)});
  mesh.triangles.push_back({first[1], first[0], static_cast<Index>(mesh.positions.size() - 1)});
  expect_same(mesh);
}

TEST(PackMesh, LeavesOutVerticesThatNoTriangleHas) {
  TriMesh mesh = geometry::make_box(Vec3(0, 0, 0), Vec3(1, 2, 3));
  mesh.positions.push_back(Vec3(1e6, 0, 0));
  mesh.normals.clear();
  geometry::compute_normals(mesh);
  const PackedMesh packed = pack_mesh(mesh, {});
  EXPECT_EQ(packed.vertices, 8u);
  EXPECT_EQ(packed.box[3], 1);  // nor are they in the box
  EXPECT_EQ(pack_mesh(TriMesh{}, {}).bytes, "");
}

TEST(PackMesh, AFlatMeshHasABoxWithoutHeight) {
  TriMesh flat = geometry::make_grid(Vec3(0, 0, 5), Vec2(1, 1), 3, 3);
  geometry::compute_normals(flat);
  expect_same(flat);
}

TEST(PackMesh, ThePageHoldsAHundredFramesOfTwentyThousandTrianglesIn25Megabytes) {
  // Rough lava with all eight bytes of attributes, each with noise of its own in its lowest three bits: worse than what is smooth.
  TriMesh mesh = testing_meshes::tube(120, 3, 200, 50);
  for (std::size_t v = 0; v < mesh.positions.size(); ++v) mesh.positions[v] += 0.06 * (random_uniform(1, 0, v) - 0.5) * mesh.normals[v];
  geometry::compute_normals(mesh);
  ASSERT_NEAR(static_cast<Real>(mesh.triangles.size()), 20000, 300);
  std::vector<BytePlane> planes;
  for (const char* name : {"red", "green", "blue", "glow", "temperature", "speed", "crust", "thickness"}) {
    BytePlane plane{name, {}};
    for (std::size_t v = 0; v < mesh.positions.size(); ++v)
      plane.values.push_back(static_cast<std::uint8_t>(100 + 100 * std::sin(0.3 * mesh.positions[v].x() + static_cast<Real>(planes.size())) + 8 * random_uniform(2, planes.size(), v)));
    planes.push_back(std::move(plane));
  }
  const std::size_t bytes = text85(deflate_raw(pack_mesh(mesh, planes).bytes)).size();
  RecordProperty("bytes_a_frame", static_cast<int>(bytes));
  EXPECT_LE(100 * bytes, 25'000'000u) << bytes << " a frame";
}

}  // namespace
}  // namespace effuse::skin
