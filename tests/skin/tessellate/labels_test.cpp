#include "skin/tessellate/labels.h"

#include <gtest/gtest.h>

#include <limits>

#include "geometry/base/random.h"
#include "geometry/mesh/measure.h"
#include "geometry/procedural/primitives.h"

namespace effuse::skin {
namespace {

using geometry::TriMesh;

TEST(Labels, EachVertexIsOfItsNearestParticle) {
  const TriMesh mesh = geometry::make_sphere(Vec3::Zero(), 3, 3);
  std::vector<Vec3> x;
  std::vector<std::uint64_t> id;
  for (std::uint64_t n = 0; n < 200; ++n) {
    x.push_back(3 * Vec3(2 * random_uniform(1, 0, n) - 1, 2 * random_uniform(1, 1, n) - 1, 2 * random_uniform(1, 2, n) - 1));
    id.push_back((std::uint64_t{1} << 40) + 1000 - n);  // falling
  }
  geometry::Points points;
  points.position = x;
  points.id = id;
  const RegionLabels labels = label_vertices(mesh, Regions(points, 1), points);
  ASSERT_EQ(labels.of_vertex.size(), mesh.positions.size());
  EXPECT_EQ(labels.unreached, 0u);
  EXPECT_TRUE(labels.of_triangle.empty());
  std::vector<std::uint8_t> seen(labels.size(), 0);
  for (std::size_t v = 0; v < mesh.positions.size(); ++v) {
    Index best = 0;
    for (Index i = 0; i < x.size(); ++i)
      if ((x[i] - mesh.positions[v]).norm() < (x[best] - mesh.positions[v]).norm()) best = i;
    ASSERT_EQ(labels.particle[labels.of_vertex[v]], best);
    ASSERT_EQ(labels.id[labels.of_vertex[v]], id[best]);
    seen[labels.of_vertex[v]] = 1;
  }
  EXPECT_EQ(std::count(seen.begin(), seen.end(), 0), 0);
  EXPECT_TRUE(std::is_sorted(labels.particle.begin(), labels.particle.end()));
  EXPECT_LT(labels.size(), x.size()) << "some are inside";
}

TEST(Labels, WhatNobodyReachesIsTheNearestsAllTheSameAndCounted) {
  const TriMesh mesh = geometry::make_sphere(Vec3::Zero(), 10, 2);
  const std::vector<Vec3> x = {Vec3(9, 0, 0), Vec3(-5, 0, 0)};
  geometry::Points points;
  points.position = x;
  const RegionLabels labels = label_vertices(mesh, Regions(points, 1), points);
  EXPECT_GT(labels.unreached, mesh.positions.size() / 2);
  for (std::size_t v = 0; v < mesh.positions.size(); ++v)
    EXPECT_EQ(labels.particle[labels.of_vertex[v]], (mesh.positions[v] - x[1]).norm() < (mesh.positions[v] - x[0]).norm() ? 1u : 0u);
}

}  // namespace
}  // namespace effuse::skin
