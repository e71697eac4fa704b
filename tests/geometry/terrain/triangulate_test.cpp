#include "geometry/terrain/triangulate.h"

#include <gtest/gtest.h>

#include <chrono>
#include <cmath>
#include <cstdio>
#include <filesystem>
#include <limits>

#include "geometry/base/parallel.h"
#include "geometry/base/random.h"
#include "geometry/mesh/validate.h"
#include "geometry/terrain/delaunay_internal.h"
#include "importers/terrain/import_dem.h"
#include "importers/terrain/import_terrain.h"
#include "tests/geometry/terrain/fields.h"
#include "tests/importers/test_files.h"

namespace effuse::geometry {
namespace {

/// Hills of many sizes.
HeightField hills(int nx, int ny, Real roughness) {
  std::vector<Real> z(static_cast<std::size_t>(nx) * static_cast<std::size_t>(ny));
  for (int j = 0; j < ny; ++j)
    for (int i = 0; i < nx; ++i) {
      Real h = 0;
      for (int octave = 0; octave < 8; ++octave) {
        const Real f = 0.011 * std::pow(1.9, octave);
        h += std::pow(0.5, octave) * std::sin(f * i + 1.3 * octave) * std::cos(0.83 * f * j + 0.7 * octave * octave);
      }
      z[static_cast<std::size_t>(j) * static_cast<std::size_t>(nx) + static_cast<std::size_t>(i)] = roughness * h;
    }
  return HeightField({5, -3}, {10, 10}, nx, ny, std::move(z));
}

HeightField with_holes(HeightField field, int every) {
  std::vector<Real> z = field.posts();
  const int nx = field.nx();
  for (int j = 0; j < field.ny(); ++j)
    for (int i = 0; i < nx; ++i)
      if ((i / every + j / every) % 5 == 1 || std::hypot(i, j) < 2 * every) z[static_cast<std::size_t>(j) * static_cast<std::size_t>(nx) + static_cast<std::size_t>(i)] = std::numeric_limits<Real>::quiet_NaN();
  return HeightField(field.corner(), field.spacing(), nx, field.ny(), std::move(z));
}

Real plan_area(const TriMesh& mesh) {
  Real area = 0;
  for (const auto& [a, b, c] : mesh.triangles) area += (mesh.positions[b] - mesh.positions[a]).head<2>().dot(Vec2(mesh.positions[c].y() - mesh.positions[a].y(), mesh.positions[a].x() - mesh.positions[c].x())) / 2;
  return area;
}

std::size_t whole_cells(const HeightField& field) {
  std::size_t cells = 0;
  for (int j = 0; j + 1 < field.ny(); ++j)
    for (int i = 0; i + 1 < field.nx(); ++i) cells += field.whole(i, j);
  return cells;
}

TEST(Triangulate, NoPostIsFartherOffThanAskedAndAllGroundIsCovered) {
  for (const HeightField& field : {fields::maunga_whau(), hills(120, 90, 40), with_holes(hills(120, 90, 40), 7), with_holes(fields::maunga_whau(), 4), fields::random_field(3, 40, 50, 1, 0.05)})
    for (const Real error : {0.0, 0.3, 2.0, 1000.0}) {
      const TriMesh mesh = triangulate(field, error);
      const VerticalError measured = vertical_error(field, mesh);
      EXPECT_LE(measured.at_posts, error + 1e-8) << "rounding of 200 m";
      EXPECT_GE(measured.between, measured.at_posts);
      EXPECT_EQ(measured.uncovered, 0u);
      EXPECT_NEAR(plan_area(mesh), static_cast<Real>(whole_cells(field)) * field.spacing().x() * field.spacing().y(), 1e-6) << "exactly the cells that have heights";
      const MeshReport report = validate(mesh);
      EXPECT_EQ(report.non_manifold_edges, 0u);
      EXPECT_TRUE(report.oriented());
      EXPECT_EQ(report.zero_area, 0u);
      EXPECT_EQ(mesh.normals.size(), mesh.positions.size());
    }
}

TEST(Triangulate, APlaneIsTwoTriangles) {
  std::vector<Real> z(30 * 20);
  for (int k = 0; k < 600; ++k) z[static_cast<std::size_t>(k)] = 0.5 * (k % 30) - 2.25 * (k / 30);
  const HeightField field({0, 0}, {1, 2}, 30, 20, std::move(z));
  EXPECT_EQ(triangulate(field, 0.001).triangles.size(), 2u);
  EXPECT_EQ(triangulate(field, 0).triangles.size(), 2u);
}

TEST(Triangulate, TheSameOnOneThreadAsOnMany) {
  const HeightField field = with_holes(hills(150, 120, 40), 9);
  const TriMesh many = triangulate(field, 0.5);
  const ThreadLimit one(1);
  const TriMesh alone = triangulate(field, 0.5);
  EXPECT_EQ(many.triangles, alone.triangles);
  EXPECT_EQ(many.positions, alone.positions);
}

/// Greedy insertion in the plainest way: of all posts the worst one, each time; the triangulation made anew by flipping
/// every edge that wants it. Errors of all posts are looked at every time.
std::size_t plain_greedy_triangles(const HeightField& field, Real max_error) {
  Delaunay mesh(field.nx() - 1, field.ny() - 1);
  std::vector<std::int32_t> touched;
  for (;;) {
    Real worst = 0;
    Delaunay::Point at{0, 0};
    std::int32_t in = 0;
    for (std::int32_t t = 0; t < mesh.triangles(); ++t) {
      const auto v = mesh.triangle(t);
      const Delaunay::Point a = mesh.point(v[0]), b = mesh.point(v[1]), c = mesh.point(v[2]);
      const Real det = Real(b.x - a.x) * (c.y - a.y) - Real(b.y - a.y) * (c.x - a.x);
      for (int j = std::min({a.y, b.y, c.y}); j <= std::max({a.y, b.y, c.y}); ++j)
        for (int i = std::min({a.x, b.x, c.x}); i <= std::max({a.x, b.x, c.x}); ++i) {
          const Real wb = (Real(i - a.x) * (c.y - a.y) - Real(j - a.y) * (c.x - a.x)) / det, wc = (Real(b.x - a.x) * (j - a.y) - Real(b.y - a.y) * (i - a.x)) / det;
          if (wb < 0 || wc < 0 || wb + wc > 1) continue;
          const Real za = field.post(a.x, a.y);
          const Real error = std::abs(za + wb * (field.post(b.x, b.y) - za) + wc * (field.post(c.x, c.y) - za) - field.post(i, j));
          if (error > worst) worst = error, at = {i, j}, in = t;
        }
    }
    if (worst <= max_error) return static_cast<std::size_t>(mesh.triangles());
    touched.clear();
    mesh.insert(at, in, touched);
  }
}

TEST(Triangulate, TakesNoMoreTrianglesThanPlainGreedyInsertion) {
  const HeightField whau = fields::maunga_whau(), small = hills(60, 50, 40);
  for (const auto& [field, error] : {std::pair{&whau, 5.0}, {&whau, 2.0}, {&small, 1.0}}) {
    const Real ours = static_cast<Real>(triangulate(*field, error).triangles.size()), plain = static_cast<Real>(plain_greedy_triangles(*field, error));
    EXPECT_NEAR(ours / plain, 1, 0.03) << ours << " against " << plain << ": ties may fall otherwise";
  }
}

TEST(TriangulateSlow, OnAvaAlrAndMaungaWhauToo) {
  const std::filesystem::path data = importers::shared_data();
  if (data.empty()) GTEST_SKIP() << "no shared data on this machine (EFFUSE_SHARED_DATA)";
  importers::DemOptions filled;
  filled.holes = importers::HolePolicy::kFill;
  for (const auto& [name, error] : {std::pair{"avaAlr.tif", 20.0}, {"avaAlr.tif", 10.0}, {"maunga-whau.asc", 1.0}}) {
    const geometry::Terrain terrain = importers::terrain_from_grid(importers::import_dem({data / "terrain" / name}, filled), name).terrain;
    const HeightField& field = *terrain.height_field();
    const TriMesh mesh = triangulate(field, error);
    const Real ours = static_cast<Real>(mesh.triangles.size()), plain = static_cast<Real>(plain_greedy_triangles(field, error));
    EXPECT_LT(ours / plain, 1.05) << name << ": ties may fall otherwise; 1.5 is asked for";
    EXPECT_LE(vertical_error(field, mesh).at_posts, error + 1e-7);
    std::printf("%s to %g m: %.0f triangles, plain greedy insertion %.0f\n", name, error, ours, plain);
  }
}

TEST(TriangulateSlow, AMillionPostsTakeLessThanTwentySeconds) {
  // Hills of 30 m with a metre of noise at every post, to two metres: one post in twenty is kept.
  std::vector<Real> z(1000 * 1000);
  for (std::size_t k = 0; k < z.size(); ++k) {
    const Real x = static_cast<Real>(k % 1000), y = static_cast<Real>(k / 1000);
    z[k] = 30 * std::sin(0.02 * x) * std::cos(0.03 * y) + 8 * std::sin(0.31 * x + 0.2 * y) + random_uniform(3, 0, k);
  }
  const HeightField field(Vec2::Zero(), Vec2(10, 10), 1000, 1000, std::move(z));
  const auto start = std::chrono::steady_clock::now();
  const TriMesh mesh = triangulate(field, 2);
  const double seconds = std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
  EXPECT_LT(seconds, 20);
  EXPECT_GT(mesh.triangles.size(), 100'000u) << "too easy";
  EXPECT_LE(vertical_error(field, mesh).at_posts, 2 + 1e-9);
  std::printf("a million posts: %.1f s, %zu triangles\n", seconds, mesh.triangles.size());
}

TEST(VerticalError, IsThatOfAPlaneOverATwistedCell) {
  // One cell, corners 0 0 0 1: the rising diagonal's triangles lie 1/4 off in the middle, flat ones at z = 0 as much as 1.
  const HeightField field({0, 0}, {1, 1}, 2, 2, {0, 0, 0, 1});
  const VerticalError own = vertical_error(field, field.mesh());
  EXPECT_EQ(own.at_posts, 0);
  EXPECT_NEAR(own.between, 0.25, 1e-12);
  EXPECT_NEAR(twist_error(field), 0.25, 1e-12);
  TriMesh flat;
  flat.positions = {{0, 0, 0}, {1, 0, 0}, {1, 1, 0}, {0, 1, 0}};
  flat.triangles = {{0, 1, 2}};
  const VerticalError half = vertical_error(field, flat);
  EXPECT_EQ(half.at_posts, 1);
  EXPECT_EQ(half.where, Vec2(1, 1));
  EXPECT_EQ(half.uncovered, 1u);
}

TEST(Delaunay, NoCircleHoldsAnotherPoint) {
  Delaunay mesh(40, 30);
  std::vector<std::int32_t> touched;
  std::vector<char> taken(41 * 31, 0);
  for (int k = 0; k < 300; ++k) {
    const int x = static_cast<int>(random_bits(1, 0, static_cast<std::uint64_t>(k)) % 41), y = static_cast<int>(random_bits(1, 1, static_cast<std::uint64_t>(k)) % 31);
    const bool corner = (x == 0 || x == 40) && (y == 0 || y == 30);
    if (corner || taken[static_cast<std::size_t>(41 * y + x)]++) continue;
    mesh.insert({x, y}, 0, touched);
  }
  long area = 0;
  for (std::int32_t t = 0; t < mesh.triangles(); ++t) {
    const auto v = mesh.triangle(t);
    const auto a = mesh.point(v[0]), b = mesh.point(v[1]), c = mesh.point(v[2]);
    const long twice = long{b.x - a.x} * (c.y - a.y) - long{b.y - a.y} * (c.x - a.x);
    EXPECT_GT(twice, 0);
    area += twice;
    for (std::int32_t w = 0; w < mesh.vertices(); ++w) {
      const long ax = a.x - mesh.point(w).x, ay = a.y - mesh.point(w).y, bx = b.x - mesh.point(w).x, by = b.y - mesh.point(w).y, cx = c.x - mesh.point(w).x, cy = c.y - mesh.point(w).y;
      EXPECT_LE((ax * ax + ay * ay) * (bx * cy - by * cx) - (bx * bx + by * by) * (ax * cy - ay * cx) + (cx * cx + cy * cy) * (ax * by - ay * bx), 0);
    }
  }
  EXPECT_EQ(area, 2 * 40 * 30);
}

}  // namespace
}  // namespace effuse::geometry
