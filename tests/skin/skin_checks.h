#pragma once

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <set>
#include <vector>

#include "geometry/mesh/validate.h"
#include "geometry/query/mesh_tree.h"
#include "skin/detail/refine.h"
#include "skin/tessellate/make_skin.h"

/// What every skin must be, looked at without the code that made it.
namespace effuse::skin::skin_checks {

/// How much nearer a particle must be than others to be sure of a vertex in its region [spacings]: a region is about as wide, and vertices
/// half a spacing apart miss smaller ones (one particle in two hundred has such a one).
inline constexpr Real kFootMargin = 0.2;
/// Deeper than `sink` by no more than this [spacings]: a dual mesh's vertices lie off the level set by so much at its lower edge.
inline constexpr Real kDeeper = 0.12;

/// Share of the triangles whose least angle is under 5 degrees, and how many look away from the skin round them.
inline Real share_of_thin(const geometry::TriMesh& mesh) {
  std::size_t thin = 0;
  for (const geometry::Triangle& t : mesh.triangles) {
    Real least = kPi;
    for (std::size_t k = 0; k < 3; ++k) {
      const Vec3 a = mesh.positions[t[(k + 1) % 3]] - mesh.positions[t[k]], b = mesh.positions[t[(k + 2) % 3]] - mesh.positions[t[k]];
      least = std::min(least, std::atan2(a.cross(b).norm(), a.dot(b)));
    }
    thin += least < 5 * kPi / 180;
  }
  return mesh.triangles.empty() ? 0 : static_cast<Real>(thin) / static_cast<Real>(mesh.triangles.size());
}

/// Whose foot on the surface is nobody else's: particles that are nearer to the point of the surface nearest to them than any other is, by
/// more than `margin` [m]. What a solver would call a surface particle, found without the mesh's vertices.
inline std::vector<Index> standing_on(const geometry::TriMesh& surface, const geometry::Points& points, Real margin,
                                      const geometry::Terrain* ground) {
  const geometry::MeshTree tree(surface.positions, surface.triangles);
  std::vector<Index> found;
  for (std::size_t i = 0; i < points.size(); ++i) {
    const auto foot = tree.nearest(points.position[i]);
    if (!foot || (ground && ground->signed_distance(foot->at.point) < 0)) continue;  // what is under the ground is a cut, no surface
    bool mine = true;
    for (std::size_t j = 0; j < points.size() && mine; ++j)
      mine = j == i || (points.position[j] - foot->at.point).norm() > foot->distance + margin;
    if (mine) found.push_back(static_cast<Index>(i));
  }
  return found;
}

/// Closed, oriented, manifold; few thin triangles; regions and surface particles one to one.
///   options  that made it; not coarsened
///   ground   that it was cut at, or none
inline void expect_sound(const Skin& skin, const geometry::Points& points, const SkinOptions& options,
                         const geometry::Terrain* ground = nullptr) {
  const geometry::TriMesh& mesh = skin.mesh;
  const bool voronoi = options.tessellation == TessellationKind::kVoronoi;
  const geometry::MeshReport report = geometry::validate(mesh);
  ASSERT_TRUE(report.solid()) << geometry::to_string(report);
  EXPECT_EQ(report.unused_vertices, 0u);
  EXPECT_LE(share_of_thin(mesh), 0.005);
  EXPECT_NEAR(skin.report.shapes.thin, share_of_thin(mesh), 1e-12);

  // In as many pieces, with as many handles, as the level set's own mesh.
  geometry::TriMesh surface = voronoi ? mesh_level_set(skin.surface) : tessellate_level_set(skin.surface);
  const geometry::MeshReport whole = geometry::validate(surface);
  EXPECT_EQ(report.components, whole.components);
  EXPECT_EQ(report.euler, whole.euler);

  // Every vertex, and with voronoi every triangle, has a region; every region has one.
  const RegionLabels& regions = skin.regions;
  ASSERT_EQ(regions.of_vertex.size(), mesh.positions.size());
  ASSERT_EQ(regions.of_triangle.size(), voronoi ? mesh.triangles.size() : 0);
  ASSERT_EQ(regions.id.size(), regions.particle.size());
  EXPECT_EQ(regions.unreached, 0u);
  std::vector<std::uint8_t> has(regions.size(), 0);
  for (const Index r : voronoi ? regions.of_triangle : regions.of_vertex) {
    ASSERT_LT(r, regions.size());
    has[r] = 1;
  }
  EXPECT_EQ(std::count(has.begin(), has.end(), 1), static_cast<std::ptrdiff_t>(regions.size())) << "a region with nothing in it";
  for (std::size_t r = 0; r < regions.size(); ++r)
    EXPECT_EQ(regions.id[r], points.id.empty() ? regions.particle[r] : points.id[regions.particle[r]]);
  // A vertex is of a region of one of its triangles.
  if (voronoi) {
    std::vector<std::uint8_t> agrees(mesh.positions.size(), 0);
    for (std::size_t t = 0; t < mesh.triangles.size(); ++t)
      for (const Index v : mesh.triangles[t]) agrees[v] |= regions.of_triangle[t] == regions.of_vertex[v];
    EXPECT_EQ(std::count(agrees.begin(), agrees.end(), 0), 0);
  }

  // The surface particles: those nearest to a vertex of the smooth surface, which is where it is displaced from. They have regions, and
  // nobody else.
  const Regions places(points, options.level_set.spacing);
  const geometry::TriMesh coarse = surface;
  if (!voronoi && options.detail) {
    DisplaceOptions detail = *options.detail;
    detail.spacing = options.level_set.spacing;
    refine_for(surface, detail);
  }
  std::set<Index> nearest;
  for (std::size_t v = 0; v < surface.positions.size(); ++v) {
    const Index p = places.nearest(surface.positions[v]);
    nearest.insert(p);
    if (!voronoi) {
      ASSERT_EQ(regions.particle[regions.of_vertex[v]], p) << "vertex " << v;
    }
  }
  EXPECT_EQ(std::vector<Index>(nearest.begin(), nearest.end()), regions.particle);
  // By the other notion of a surface particle, too.
  for (const Index i : standing_on(coarse, points, kFootMargin * options.level_set.spacing, ground))
    EXPECT_TRUE(std::binary_search(regions.particle.begin(), regions.particle.end(), i)) << "particle " << i;
}

/// Volume of a closed mesh above the ground [m^3]: of each triangle, as much as lies between it and the ground under it, signed.
inline Real volume_above(const geometry::TriMesh& mesh, const geometry::Terrain& ground) {
  constexpr int kParts = 4;  // of a triangle's sides: the ground bends little over a triangle
  Real sum = 0;
  for (const geometry::Triangle& t : mesh.triangles) {
    const Vec3 &a = mesh.positions[t[0]], &b = mesh.positions[t[1]], &c = mesh.positions[t[2]];
    Real height = 0;
    for (int i = 0; i < kParts; ++i)
      for (int j = 0; i + j < kParts; ++j)
        for (const Real third : {1.0, 2.0}) {
          if (third > 1 && i + j == kParts - 1) continue;
          const Vec3 p = a + (i + third / 3) / kParts * (b - a) + (j + third / 3) / kParts * (c - a);
          if (const auto z = ground.height(p.x(), p.y())) height += std::max(p.z() - *z, 0.0);
        }
    sum += (b - a).cross(c - a).z() / 2 * height / (kParts * kParts);
  }
  return sum;
}

/// How far the mesh, its triangles' insides too, reaches under the ground [m].
inline Real deepest(const geometry::TriMesh& mesh, const geometry::Terrain& ground) {
  Real most = 0;
  for (const geometry::Triangle& t : mesh.triangles)
    for (int i = 0; i <= 3; ++i)
      for (int j = 0; i + j <= 3; ++j)
        most = std::max(
            most, -ground.signed_distance((i * mesh.positions[t[0]] + j * mesh.positions[t[1]] + (3 - i - j) * mesh.positions[t[2]]) / 3));
  return most;
}

/// Of lines along the ground's normal, from points of it a third of a spacing apart, the share in gaps: the line meets the mesh less than
/// a spacing over the ground and not under it, and so do, if they meet it at all, the lines two thirds of a spacing around. (A flank that
/// leans out over its foot has such lines one beside the other, no more.)
inline Real share_of_gaps(const geometry::TriMesh& mesh, const geometry::Terrain& ground, Real spacing) {
  const geometry::MeshTree tree(mesh.positions, mesh.triangles);
  Box3 box;
  for (const Vec3& x : mesh.positions) box.extend(x);
  const Real step = spacing / 3, below = 3 * spacing;
  const int nx = static_cast<int>(box.sizes().x() / step) + 4, ny = static_cast<int>(box.sizes().y() / step) + 4;
  enum : char { kNothing, kClean, kOver };
  std::vector<char> lines(static_cast<std::size_t>(nx) * static_cast<std::size_t>(ny), kNothing);
  const auto line = [&](int i, int j) -> char& { return lines[static_cast<std::size_t>(i * ny + j)]; };
  for (int i = 0; i < nx; ++i)
    for (int j = 0; j < ny; ++j) {
      const Real x = box.min().x() + (i - 2) * step, y = box.min().y() + (j - 2) * step;
      const auto z = ground.height(x, y);
      if (!z) continue;
      const Vec3 foot(x, y, *z), up = ground.contact(foot).normal;
      if (const auto crossing = tree.ray(foot - below * up, up, below + spacing)) line(i, j) = crossing->t > below ? kOver : kClean;
    }
  std::size_t met = 0, gaps = 0;
  for (int i = 2; i + 2 < nx; ++i)
    for (int j = 2; j + 2 < ny; ++j) {
      met += line(i, j) != kNothing;
      bool gap = line(i, j) == kOver;
      for (int a = -2; a <= 2 && gap; ++a)
        for (int b = -2; b <= 2; ++b) gap = gap && line(i + a, j + b) != kClean;
      gaps += gap;
    }
  EXPECT_GT(met, 100u);
  return met == 0 ? 1 : static_cast<Real>(gaps) / static_cast<Real>(met);
}

/// Cut clean: the skin goes down into the ground everywhere, so that there is no gap at its foot, and no farther than `sink` [m].
///   hanging  share of lines that may be in gaps: under drops and falls
inline void expect_clean_ground(const geometry::TriMesh& mesh, const geometry::Terrain& ground, Real spacing, Real sink, Real hanging = 0) {
  EXPECT_LE(deepest(mesh, ground), sink + kDeeper * spacing);
  EXPECT_LE(share_of_gaps(mesh, ground, spacing), hanging);
}

}  // namespace effuse::skin::skin_checks
