#include "geometry/fracture/cell_layout.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <numeric>

#include "geometry/base/check.h"
#include "geometry/base/error.h"
#include "geometry/base/parallel.h"
#include "geometry/base/random.h"
#include "geometry/base/zones.h"
#include "geometry/collide/collision_mesh.h"
#include "geometry/fracture/convex_clip.h"
#include "geometry/mesh/measure.h"

namespace effuse::geometry {
namespace {

constexpr int kTries = 2000;        ///< for a seed: a body that fills a thousandth of its box still gets its seeds
constexpr Real kTolerance = 1e-12;  ///< of the box's diagonal: nearer to a plane is on it

/// A Voronoi region in the box, as polygons; seeds in order of distance.
std::vector<ClipPolygon> region_in(const Box3& box, const CellRegion& region) {
  std::vector<ClipPolygon> polygons = box_polygons(box);
  const Real tolerance = kTolerance * box.diagonal().norm();
  for (Index k = 0; k < region.sides.size(); ++k) clip(polygons, region.sides[k].normal, region.sides[k].offset, k, tolerance);
  return polygons;
}

/// Centre of mass of a closed convex solid.
Vec3 middle_of(const std::vector<ClipPolygon>& solid) {
  const Vec3 origin = solid[0].corners[0];
  Real volume = 0;
  Vec3 sum = Vec3::Zero();
  for (const ClipPolygon& f : solid)
    for (std::size_t k = 1; k + 1 < f.corners.size(); ++k) {
      const Vec3 a = f.corners[0] - origin, b = f.corners[k] - origin, c = f.corners[k + 1] - origin;
      const Real d = a.dot(b.cross(c));
      volume += d;
      sum += d * (a + b + c) / 4;
    }
  return volume > 0 ? Vec3(origin + sum / volume) : origin;
}

/// Seeds inside the body, denser where `weight` (0..1) is larger.
template <class Weight>
std::vector<Vec3> scatter(const CollisionMesh& body, std::size_t count, std::uint64_t seed, Weight&& weight) {
  const Box3 box = body.bounds();
  std::vector<Vec3> seeds(count);
  std::vector<std::uint8_t> found(count, 0);
  parallel_for(
      count,
      [&](std::size_t i) {
        for (std::uint64_t k = 0; k < kTries && !found[i]; ++k) {
          Vec3 p;
          for (int a = 0; a < 3; ++a) p[a] = box.min()[a] + box.sizes()[a] * random_uniform(seed, 4 * i + static_cast<std::uint64_t>(a), k);
          if (random_uniform(seed, 4 * i + 3, k) >= weight(p) || !body.inside(p)) continue;
          seeds[i] = p;
          found[i] = 1;
        }
      },
      8);
  for (std::size_t i = 0; i < count; ++i)
    if (!found[i]) throw InputError(Place{}, fmt::format("no place was found for seed {} of {} in {} tries: the mesh fills too little of its box", i + 1, count, kTries));
  return seeds;
}

/// Courses square to the axis, bricks along the longer of the other two, every second course shifted by half a brick.
std::vector<CellRegion> bricks(const Box3& box, const CellOptions& options) {
  const int up = options.axis, u = (up + 1) % 3, w = (up + 2) % 3;
  const int along = box.sizes()[u] >= box.sizes()[w] ? u : w;
  const Real height = box.sizes()[up], length = box.sizes()[along];
  // courses * (length / (flatness * height / courses)) = cells
  const int courses = std::max(1, static_cast<int>(std::lround(std::sqrt(static_cast<Real>(options.cells) * options.flatness * height / length))));
  const int row = std::max(1, static_cast<int>(std::lround(static_cast<Real>(options.cells) / courses)));
  struct Brick {
    Real low, high;
    int course, place;
  };
  std::vector<Brick> all;
  std::vector<std::pair<std::size_t, std::size_t>> range;  // of each course
  for (int c = 0; c < courses; ++c) {
    std::vector<Real> joints;
    const Real one = length / row, first = c % 2 == 0 ? one : one / 2;
    for (Real at = first; at < length * (1 - 1e-9); at += one) joints.push_back(at);
    range.emplace_back(all.size(), all.size() + joints.size() + 1);
    for (std::size_t k = 0; k <= joints.size(); ++k) all.push_back({k == 0 ? 0 : joints[k - 1], k == joints.size() ? length : joints[k], c, static_cast<int>(k)});
  }
  const Vec3 n_along = Vec3::Unit(along), n_up = Vec3::Unit(up);
  std::vector<CellRegion> out(all.size());
  for (std::size_t i = 0; i < all.size(); ++i) {
    const Brick& b = all[i];
    const auto [first, last] = range[static_cast<std::size_t>(b.course)];
    const Real base = box.min()[along], floor = box.min()[up] + height * b.course / courses, ceiling = box.min()[up] + height * (b.course + 1) / courses;
    if (i > first) out[i].sides.push_back({-n_along, -(base + b.low), {static_cast<Index>(i - 1)}});
    if (i + 1 < last) out[i].sides.push_back({n_along, base + b.high, {static_cast<Index>(i + 1)}});
    const auto beside = [&](int course, const Vec3& normal, Real offset) {
      if (course < 0 || course >= courses) return;
      CellRegion::Side side{normal, offset, {}};
      const auto [from, to] = range[static_cast<std::size_t>(course)];
      for (std::size_t j = from; j < to; ++j)
        if (std::min(all[j].high, b.high) - std::max(all[j].low, b.low) > 1e-9 * length) side.beyond.push_back(static_cast<Index>(j));
      out[i].sides.push_back(std::move(side));
    };
    beside(b.course - 1, -n_up, -floor);
    beside(b.course + 1, n_up, ceiling);
  }
  return out;
}

}  // namespace

std::vector<CellRegion> voronoi_regions(std::span<const Vec3> seeds, const Box3& box, const Vec3& scale) {
  ZONE("fracture.voronoi");
  const std::size_t n = seeds.size();
  std::vector<CellRegion> regions(n);
  parallel_for(
      n,
      [&](std::size_t i) {
        const Vec3 own = scale.cwiseProduct(seeds[i]);
        std::vector<std::pair<Real, Index>> order;
        for (std::size_t j = 0; j < n; ++j)
          if (j != i) order.emplace_back((scale.cwiseProduct(seeds[j]) - own).norm(), static_cast<Index>(j));
        std::sort(order.begin(), order.end());
        const Real tolerance = kTolerance * box.diagonal().norm();
        std::vector<ClipPolygon> polygons = box_polygons(box);
        for (const auto& [distance, j] : order) {
          CHECK_GT(distance, 0);
          // A seed twice as far as the region reaches, and all beyond it, cuts nothing off.
          Real reach = 0;
          for (const ClipPolygon& f : polygons)
            for (const Vec3& p : f.corners) reach = std::max(reach, (scale.cwiseProduct(p) - own).norm());
          if (distance > 2 * reach) break;
          const Vec3 other = scale.cwiseProduct(seeds[j]);
          // |S x - s_i|^2 <= |S x - s_j|^2; measured from the seed, so that nothing cancels far from the origin.
          const Vec3 d = other - own, m = scale.cwiseProduct(d);
          const Real length = m.norm();
          const Vec3 normal = m / length;
          const Real offset = normal.dot(seeds[i]) + d.squaredNorm() / (2 * length);
          regions[i].sides.push_back({normal, offset, {j}});
          clip(polygons, normal, offset, j, tolerance);
        }
        // Sides that do not show in the box are not its.
        std::vector<std::uint8_t> shows(n, 0);
        for (const ClipPolygon& f : polygons)
          if (f.side != kOuterFace) shows[f.side] = 1;
        std::erase_if(regions[i].sides, [&](const CellRegion::Side& side) { return !shows[side.beyond[0]]; });
      },
      4);
  return regions;
}

std::vector<CellRegion> cell_regions(const TriMesh& body, const CellOptions& options) {
  CHECK_GE(options.cells, 1u);
  CHECK_GE(options.flatness, 1);
  CHECK(options.axis >= 0 && options.axis < 3);
  const Box3 box = bounds(body);
  if (options.layout == CellLayout::kBricks) return bricks(box, options);
  const CollisionMesh inside(body);
  const Real reach = options.reach > 0 ? options.reach : box.diagonal().norm() / 4;
  std::vector<Vec3> seeds = scatter(inside, options.cells, options.seed, [&](const Vec3& p) {
    if (options.layout != CellLayout::kNear) return Real{1};
    const Real far = 1 + (p - options.centre).squaredNorm() / (reach * reach);
    return 1 / (far * far);
  });
  Vec3 scale = Vec3::Ones();
  if (options.layout == CellLayout::kSlabs) scale[options.axis] = options.flatness;
  for (int round = 0; round < options.relax && options.layout != CellLayout::kNear; ++round) {
    const std::vector<CellRegion> regions = voronoi_regions(seeds, box, scale);
    std::vector<Vec3> moved(seeds.size());
    parallel_for(seeds.size(), [&](std::size_t i) {
      const Vec3 middle = middle_of(region_in(box, regions[i]));
      moved[i] = inside.inside(middle) ? middle : seeds[i];
    }, 8);
    seeds.swap(moved);
  }
  return voronoi_regions(seeds, box, scale);
}

}  // namespace effuse::geometry
