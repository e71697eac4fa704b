#include "geometry/repair/repair.h"

#include <fmt/format.h>
#include <fmt/ranges.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <limits>

#include "geometry/base/parallel.h"
#include "geometry/base/random.h"
#include "geometry/mesh/measure.h"
#include "geometry/procedural/primitives.h"

namespace effuse::geometry {
namespace {

constexpr Real kAll = std::numeric_limits<Real>::infinity();

/// A box from low to high, vertices from `first` on, appended.
void add_box(TriMesh& mesh, const Vec3& low, const Vec3& high, bool inward = false) {
  const auto first = static_cast<Index>(mesh.positions.size());
  for (int k = 0; k < 8; ++k) mesh.positions.emplace_back(k & 1 ? high.x() : low.x(), k & 2 ? high.y() : low.y(), k & 4 ? high.z() : low.z());
  const Index quads[6][4] = {{0, 2, 3, 1}, {4, 5, 7, 6}, {0, 1, 5, 4}, {2, 6, 7, 3}, {0, 4, 6, 2}, {1, 3, 7, 5}};
  for (const auto& q : quads) {
    mesh.triangles.push_back({first + q[0], first + q[1], first + q[2]});
    mesh.triangles.push_back({first + q[0], first + q[2], first + q[3]});
    if (inward)
      for (std::size_t k = 1; k <= 2; ++k) std::swap(mesh.triangles[mesh.triangles.size() - k][1], mesh.triangles[mesh.triangles.size() - k][2]);
  }
}

TriMesh box(const Vec3& low = Vec3::Zero(), const Vec3& high = Vec3(1, 2, 3)) {
  TriMesh mesh;
  add_box(mesh, low, high);
  return mesh;
}

std::string told(const RepairReport& r) { return to_string(r.before) + " -> " + to_string(r.after) + fmt::format(" {}", to_lines(r)); }

TEST(Repair, LeavesASoundMeshAloneToTheBit) {
  TriMesh two = box();
  add_box(two, {1, 2, 3}, {2, 3, 4});  // touches the first in a corner, with a vertex of its own
  TriMesh sheet;
  sheet.positions = {{0, 0, 0}, {1, 0, 0}, {1, 1, 0.2}, {0, 1, 0}};
  sheet.triangles = {{0, 1, 2}, {0, 2, 3}};
  sheet.normals.assign(4, Vec3(0, 0, 1));
  sheet.attributes["temperature"] = {1, {1, 2, 3, 4}};
  for (const TriMesh& mesh : {two, sheet, make_box(Vec3::Zero(), Vec3::Ones())}) {
    TriMesh repaired = mesh;
    const RepairReport report = repair(repaired);
    EXPECT_FALSE(report.changed()) << told(report);
    EXPECT_TRUE(to_lines(report).empty()) << told(report);
    EXPECT_EQ(repaired.positions, mesh.positions);
    EXPECT_EQ(repaired.triangles, mesh.triangles);
    EXPECT_EQ(repaired.normals, mesh.normals);
  }
}

TEST(Repair, ASoupOfTrianglesBecomesTheSolidItWas) {
  const TriMesh whole = box();
  TriMesh soup;
  for (std::size_t t = 0; t < whole.triangles.size(); ++t) {
    Triangle corners;
    for (std::size_t k = 0; k < 3; ++k) {
      // Half of them a hair off, as other programs' floats are.
      corners[k] = static_cast<Index>(soup.positions.size());
      soup.positions.push_back(whole.positions[whole.triangles[t][k]] + (t % 2 ? 1e-7 : 0) * Vec3(random_uniform(1, t, k), random_uniform(2, t, k), 0));
    }
    if (t % 3 == 0) std::swap(corners[1], corners[2]);
    soup.triangles.push_back(corners);
  }
  const RepairReport report = repair(soup);
  EXPECT_TRUE(report.after.solid() && sound(report.after)) << told(report);
  EXPECT_EQ(report.after.vertices, 8u) << told(report);
  EXPECT_NEAR(signed_volume(soup), 6, 1e-5);
  EXPECT_EQ(report.turned_triangles, 4u);
  EXPECT_GT(report.stitched_vertices, 0u);
}

TEST(Repair, SolidsThatTouchArePartedAndStaySolid) {
  // Two boxes that share an edge: four triangles there.
  TriMesh edge = box({0, 0, 0}, {1, 1, 1});
  add_box(edge, {1, 1, 0}, {2, 2, 1});
  RepairReport report = repair(edge);
  EXPECT_FALSE(report.changed()) << "with vertices of their own they are sound";

  TriMesh vertex = box({0, 0, 0}, {1, 1, 1});
  add_box(vertex, {1, 1, 1}, {2, 2, 2});
  for (TriMesh* mesh : {&edge, &vertex}) {
    // The same with shared vertices.
    for (Triangle& t : mesh->triangles)
      for (Index& v : t)
        for (Index w = 0; w < v; ++w)
          if (mesh->positions[w] == mesh->positions[v]) {
            v = w;
            break;
          }
    report = repair(*mesh);
    EXPECT_FALSE(report.before.manifold());
    EXPECT_TRUE(report.after.solid() && sound(report.after)) << told(report);
    EXPECT_EQ(report.after.components, 2u);
    EXPECT_NEAR(signed_volume(*mesh), 2, 1e-12);
    EXPECT_EQ(report.turned_triangles, 0u);
  }
}

TEST(Repair, AWallBetweenTwoSolidsGoes) {
  // Joined tetrahedra: the face they share is there twice, back to back.
  TriMesh mesh;
  mesh.positions = {{0, 0, 0}, {1, 0, 0}, {0, 1, 0}, {0, 0, 1}, {0, 0, -1}};
  mesh.triangles = {{0, 2, 1}, {0, 1, 3}, {1, 2, 3}, {2, 0, 3}, {0, 1, 2}, {0, 4, 1}, {1, 4, 2}, {2, 4, 0}};
  const RepairReport report = repair(mesh);
  EXPECT_EQ(report.inner_walls, 1u);
  EXPECT_TRUE(report.after.solid() && sound(report.after)) << told(report);
  EXPECT_NEAR(signed_volume(mesh), 1.0 / 3, 1e-12);

  // A sheet with two faces, and a triangle given three times, keep one.
  TriMesh sheet;
  sheet.positions = {{0, 0, 0}, {1, 0, 0}, {1, 1, 0}, {0, 1, 0}};
  sheet.triangles = {{0, 1, 2}, {0, 2, 3}, {0, 2, 1}, {0, 3, 2}, {1, 2, 0}};
  const RepairReport twice = repair(sheet);
  EXPECT_EQ(twice.duplicate_triangles, 3u);
  EXPECT_EQ(twice.after.triangles, 2u);
  EXPECT_TRUE(sound(twice.after)) << told(twice);
}

TEST(Repair, AFlatTriangleGoesAndLeavesNoCrack) {
  // A box whose top has a vertex in the middle of its diagonal, with the triangle of no area that modellers leave there.
  TriMesh mesh = box();
  mesh.positions.emplace_back(0.5, 1, 3);
  const Triangle half = mesh.triangles[2];  // 4 5 7, its diagonal 7 4
  mesh.triangles[2] = {half[0], half[1], 8};
  mesh.triangles.push_back({half[1], half[2], 8});
  mesh.triangles.push_back({half[0], 8, half[2]});
  ASSERT_EQ(validate(mesh).zero_area, 1u);
  const RepairReport report = repair(mesh);
  EXPECT_EQ(report.flat_triangles, 1u);
  EXPECT_TRUE(report.after.solid() && sound(report.after)) << told(report);
  EXPECT_NEAR(signed_volume(mesh), 6, 1e-12);
}

TEST(Repair, FacesOutwardButLeavesARoomWithinASolid) {
  TriMesh inside_out;
  add_box(inside_out, {0, 0, 0}, {1, 1, 1}, true);
  EXPECT_EQ(repair(inside_out).turned_triangles, 12u);
  EXPECT_NEAR(signed_volume(inside_out), 1, 1e-12);

  TriMesh room = box({0, 0, 0}, {3, 3, 3});
  add_box(room, {1, 1, 1}, {2, 2, 2}, true);
  RepairReport report = repair(room);
  EXPECT_FALSE(report.changed()) << told(report);
  EXPECT_NEAR(signed_volume(room), 26, 1e-12);
  std::swap(room.triangles[0][1], room.triangles[0][2]);
  report = repair(room);
  EXPECT_EQ(report.turned_triangles, 1u);
  EXPECT_EQ(report.inward_shells, 1u);
  EXPECT_NEAR(signed_volume(room), 26, 1e-12);
}

TEST(Repair, AnyStitchEnds) {
  // Two sheets a centimetre apart: nothing of them is joined, their rims are at the seam, or each rim is one point and two bags
  // touch there, with four vertices inside and one each.
  TriMesh sheets = make_grid(Vec3::Zero(), Vec2(1, 1), 3, 3);
  const TriMesh other = make_grid(Vec3(3.01, 0, 0), Vec2(1, 1), 3, 3);
  for (const Triangle& t : other.triangles) sheets.triangles.push_back({t[0] + 16, t[1] + 16, t[2] + 16});
  sheets.positions.insert(sheets.positions.end(), other.positions.begin(), other.positions.end());
  for (const auto& [stitch, left] : {std::pair{0.0, 32u}, {5e-324, 32u}, {1e-9, 32u}, {0.02, 28u}, {1e300, 10u}}) {
    TriMesh mesh = sheets;
    RepairOptions options;
    options.stitch = stitch;
    const RepairReport report = repair(mesh, options);
    EXPECT_EQ(mesh.positions.size(), left) << stitch;
    EXPECT_EQ(report.stitched_vertices, left == 28 ? 4u : left == 32 ? 0u : report.stitched_vertices) << stitch;
  }
}

TEST(Repair, FillsHolesUpToTheSizeAsked) {
  TriMesh open = make_box(Vec3::Zero(), Vec3::Ones());
  const TriMesh whole = open;
  open.triangles.erase(open.triangles.begin(), open.triangles.begin() + 2);
  TriMesh left = open;
  RepairReport report = repair(left, {.fill_holes = 1.4});
  EXPECT_EQ(report.filled_holes, 0u);
  EXPECT_EQ(report.open_holes, 1u);
  EXPECT_NEAR(report.largest_hole, std::sqrt(2), 1e-12);
  report = repair(open, {.fill_holes = 1.5});
  EXPECT_EQ(report.filled_holes, 1u);
  EXPECT_TRUE(report.after.solid() && sound(report.after)) << told(report);
  EXPECT_NEAR(signed_volume(open), signed_volume(whole), 1e-12);
}

TEST(Repair, ABallWithManyHolesIsClosedAndNearlyAsLarge) {
  TriMesh ball = make_sphere(Vec3::Zero(), 1, 3);
  const Real volume = signed_volume(ball);
  std::size_t n = 0;
  std::erase_if(ball.triangles, [&](const Triangle&) { return random_uniform(3, 0, n++) < 0.2; });
  const RepairReport report = repair(ball, {.fill_holes = kAll});
  EXPECT_GT(report.filled_holes, 50u);
  EXPECT_TRUE(sound(report.after)) << told(report);
  // Triangles that hung on by a vertex alone have no hole to fill.
  EXPECT_EQ(report.after.boundary_edges, 3 * 4u) << told(report);
  EXPECT_NEAR(signed_volume(ball), volume, 0.05 * volume);
}

TEST(Repair, AMoebiusStripIsCutOnce) {
  TriMesh strip;
  const int n = 24;
  for (int i = 0; i < n; ++i) {
    const Real a = 2 * kPi * i / n, half = a / 2;
    for (const Real r : {-0.3, 0.3}) strip.positions.emplace_back((1 + r * std::cos(half)) * std::cos(a), (1 + r * std::cos(half)) * std::sin(a), r * std::sin(half));
  }
  for (int i = 0; i < n; ++i) {
    const auto a = static_cast<Index>(2 * i), b = a + 1;
    const Index c = i + 1 < n ? a + 2 : 1, d = i + 1 < n ? a + 3 : 0;
    strip.triangles.push_back({a, c, b});
    strip.triangles.push_back({b, c, d});
  }
  const RepairReport report = repair(strip);
  EXPECT_EQ(report.cut_edges, 1u) << told(report);
  EXPECT_TRUE(sound(report.after)) << told(report);
  EXPECT_EQ(report.after.components, 1u);
}

TEST(Repair, AttributesGoWithTheirVertices) {
  TriMesh mesh = box({0, 0, 0}, {1, 1, 1});
  mesh.positions.emplace_back(9, 9, 9);  // unused
  mesh.attributes["height"].width = 1;
  for (const Vec3& p : mesh.positions) mesh.attributes["height"].values.push_back(static_cast<float>(p.z()));
  mesh.triangles.erase(mesh.triangles.begin() + 2, mesh.triangles.begin() + 4);  // the top
  const RepairReport report = repair(mesh, {.fill_holes = kAll});
  EXPECT_EQ(report.unused_vertices, 1u);
  ASSERT_EQ(mesh.attributes.at("height").values.size(), mesh.positions.size());
  for (std::size_t v = 0; v < mesh.positions.size(); ++v) EXPECT_EQ(mesh.attributes.at("height").values[v], static_cast<float>(mesh.positions[v].z()));
}

/// Whatever triangles there are on a few points, among them coinciding ones and ones in a line: sound afterwards.
void any_soup_becomes_sound(std::uint64_t seed, std::size_t times) {
  for (std::size_t n = 0; n < times; ++n) {
    std::uint64_t k = 0;
    const auto dice = [&](std::uint64_t below) { return random_bits(seed, n, k++) % below; };
    TriMesh mesh;
    const std::size_t vertices = 3 + dice(12), triangles = 1 + dice(30);
    const std::uint64_t grid = 2 + dice(3);
    for (std::size_t v = 0; v < vertices; ++v) mesh.positions.emplace_back(static_cast<Real>(dice(grid)), static_cast<Real>(dice(grid)), static_cast<Real>(dice(grid)));
    for (std::size_t t = 0; t < triangles; ++t) mesh.triangles.push_back({static_cast<Index>(dice(vertices)), static_cast<Index>(dice(vertices)), static_cast<Index>(dice(vertices))});
    RepairOptions options;
    options.fill_holes = n % 2 ? kAll : 0;
    TriMesh once = mesh, again;
    const RepairReport report = repair(once, options);
    ASSERT_TRUE(sound(report.after)) << "seed " << seed << " case " << n << ": " << told(report);
    // Repaired again it may be welded and parted again, and is as sound.
    again = once;
    ASSERT_TRUE(sound(repair(again, options).after)) << "seed " << seed << " case " << n;
    const ThreadLimit one(1);
    TriMesh alone = mesh;
    repair(alone, options);
    ASSERT_EQ(alone.positions, once.positions);
    ASSERT_EQ(alone.triangles, once.triangles);
  }
}

TEST(Repair, AnySoupBecomesSound) { any_soup_becomes_sound(1, 3000); }
TEST(RepairSlow, AnySoupBecomesSound) { any_soup_becomes_sound(2, 200000); }

}  // namespace
}  // namespace effuse::geometry
