#include "geometry/remesh/distance_bound.h"

#include <gtest/gtest.h>

#include <cmath>

#include "geometry/base/parallel.h"
#include "geometry/base/random.h"
#include "geometry/procedural/primitives.h"
#include "geometry/remesh/remesh.h"
#include "geometry/remesh/surface_distance.h"

namespace effuse::geometry {
namespace {

TEST(DistanceBound, OfAShiftedSheetIsTheShift) {
  const TriMesh sheet = make_grid(Vec3(2667400, 6478700, 0), Vec2(1, 1), 7, 5);
  TriMesh above = sheet;
  for (Vec3& p : above.positions) p.z() += 0.25;
  EXPECT_NEAR(distance_bound(above, sheet, 0.3), 0.25, 1e-9);
  EXPECT_GT(distance_bound(above, sheet, 0.2), 0.2) << "a bound that is not there is not found";
  // One that reaches beyond the other is as far off as its farthest corner.
  EXPECT_NEAR(distance_bound(make_grid(Vec3(0, 0, 0), Vec2(1, 1), 4, 4), make_grid(Vec3(0, 0, 0), Vec2(1, 1), 4, 3), 1.001), 1, 2e-3);
}

TEST(DistanceBound, SeesASpikeThatNoVertexAndNoMiddleShows) {
  TriMesh tent = make_grid(Vec3::Zero(), Vec2(1, 1), 10, 10);
  for (Vec3& p : tent.positions)
    if (p.x() == 3 && p.y() == 4) p.z() = 0.7;
  const TriMesh flat = make_grid(Vec3::Zero(), Vec2(10, 10), 1, 1);
  // From the flat side the spike's foot is nearer than its top: slope 0.7, so that the point below it is 0.7 cos(atan 0.7) away, or a little less.
  const Real sampled = distance_to(flat, tent, 0.05).largest;
  EXPECT_GT(distance_bound(flat, tent, 0.9 * sampled), 0.9 * sampled);
  const Real bound = distance_bound(flat, tent, 1.02 * sampled);
  EXPECT_LE(bound, 1.02 * sampled);
  EXPECT_GE(bound, sampled) << "a sample is a lower bound";
}

/// A sheet of n by n quads with heights from random numbers: folds, peaks and ridges everywhere.
TriMesh rough(std::uint64_t seed, int n, Real height) {
  TriMesh mesh = make_grid(Vec3::Zero(), Vec2(1, 1), n, n);
  for (std::size_t v = 0; v < mesh.positions.size(); ++v) mesh.positions[v].z() = height * random_uniform(seed, 0, v);
  return mesh;
}

TEST(DistanceBound, HoldsBetweenRoughSheetsOfRandomHeights) {
  for (std::uint64_t seed = 1; seed <= 8; ++seed) {
    const TriMesh a = rough(seed, 6, 1), b = rough(seed + 100, 6, 1);
    const Real sampled = distance_to(a, b, 0.04).largest;
    const Real bound = distance_bound(a, b, 1.05 * sampled);
    EXPECT_LE(bound, 1.05 * sampled) << "seed " << seed;
    EXPECT_GE(bound, sampled) << "seed " << seed;
    EXPECT_GT(distance_bound(a, b, 0.95 * sampled), 0.95 * sampled) << "seed " << seed;
  }
}

TEST(DistanceBound, IsTheSameOnAnyNumberOfThreads) {
  const TriMesh fine = make_sphere(Vec3::Zero(), 1, 4), coarse = make_sphere(Vec3::Zero(), 1, 2);
  const Real many = distance_bound(fine, coarse, 0.1);
  const ThreadLimit one(1);
  EXPECT_EQ(distance_bound(fine, coarse, 0.1), many);
}

TEST(DistanceBound, OfNothingIsNothing) {
  const TriMesh sheet = make_grid(Vec3::Zero(), Vec2(1, 1), 2, 2);
  EXPECT_EQ(distance_bound(TriMesh{}, sheet, 1), 0);
  EXPECT_EQ(distance_bound(sheet, TriMesh{}, 1), INFINITY);
}

}  // namespace
}  // namespace effuse::geometry
