#include "skin/tessellate/refine_on.h"

#include <algorithm>
#include <numeric>

#include "geometry/base/check.h"
#include "geometry/base/parallel.h"
#include "geometry/base/zones.h"
#include "skin/detail/smooth_surface.h"
#include "skin/tessellate/improve.h"
#include "skin/tessellate/on_particles.h"
#include "skin/tessellate/surface_walk.h"

namespace effuse::skin {

namespace {

using geometry::Triangle;
using geometry::TriMesh;

constexpr int kMostRounds = 16;    // edges that are two to this times too long are no skin's
constexpr Real kMostMoved = 0.5;   // [edges] onto the surface in a round
constexpr Real kBetterAngle = 12;  // [deg] triangles thinner than this are made better,
constexpr int kSweeps = 4;         // so often,
constexpr Real kWander = 0.3;      // [edges] by moving vertices so far

Real longest_edge(const TriMesh& mesh) {
  return parallel_max(mesh.triangles.size(), 0, [&](std::size_t t) {
    const auto& [a, b, c] = mesh.triangles[t];
    const auto& x = mesh.positions;
    return std::max({(x[a] - x[b]).norm(), (x[b] - x[c]).norm(), (x[c] - x[a]).norm()});
  });
}

/// Of the edges at each vertex, in its triangles.
std::vector<Real> mean_edges(const TriMesh& mesh) {
  std::vector<Real> sum(mesh.positions.size(), 0);
  std::vector<int> count(mesh.positions.size(), 0);
  for (const Triangle& t : mesh.triangles)
    for (std::size_t k = 0; k < 3; ++k) {
      const Real length = (mesh.positions[t[k]] - mesh.positions[t[(k + 1) % 3]]).norm();
      for (const Index v : {t[k], t[(k + 1) % 3]}) {
        sum[v] += length;
        ++count[v];
      }
    }
  for (std::size_t v = 0; v < sum.size(); ++v) sum[v] /= std::max(count[v], 1);
  return sum;
}

/// A corner of the triangles that each new vertex is in the middle of: where its walk begins.
std::vector<Index> starts(const std::vector<Triangle>& before, const TriMesh& mesh, const std::vector<Index>& parent, std::size_t first) {
  std::vector<Index> from(mesh.positions.size() - first, Regions::kNone);
  for (std::size_t t = 0; t < mesh.triangles.size(); ++t)
    for (const Index v : mesh.triangles[t])
      if (v >= first && from[v - first] == Regions::kNone) {
        const Triangle& whole = before[parent[t]];
        Index& best = from[v - first] = whole[0];
        for (const Index corner : whole)
          if ((mesh.positions[corner] - mesh.positions[v]).squaredNorm() < (mesh.positions[best] - mesh.positions[v]).squaredNorm())
            best = corner;
      }
  return from;
}

}  // namespace

RefineToReport refine_on(Tessellation& tessellation, const TriMesh& surface, const RefineOptions& options, const ParticleSurface* particles) {
  ZONE("skin.refine_on");
  CHECK_GT(options.edge, 0.0);
  CHECK_EQ(surface.normals.size(), surface.positions.size());
  TriMesh& mesh = tessellation.mesh;
  CHECK_EQ(tessellation.on.size(), mesh.positions.size());
  RefineToReport report;
  report.parent.resize(mesh.triangles.size());
  std::iota(report.parent.begin(), report.parent.end(), Index{0});
  if (mesh.triangles.empty()) return report;

  // On the surface itself first: attributes, and what makes triangles better, want a place in its triangles. Where an edge runs through
  // the inside its middle has far to go, and would leave edges as long as before: so once, and half way to its neighbours at most.
  const SurfaceWalk walk(surface);
  Fans fans;  // no centres: any vertex may move a little
  // On the particles' surface then, from there: how much of the way, for each vertex.
  std::vector<Real> share;
  std::vector<Line> lines;
  const auto take_on = [&](std::size_t first) {
    if (!particles) return;
    share.resize(mesh.positions.size());
    lines.resize(mesh.positions.size());
    take_onto(*particles, walk, mesh.triangles, first, fans.spots, mesh.normals, lines, share);
    for (std::size_t v = first; v < fans.spots.size(); ++v) {
      mesh.positions[v] = fans.spots[v].x;
      tessellation.on[v] = fans.spots[v].triangle;
    }
  };
  const auto settle = [&](std::size_t first) {
    const std::vector<Real> around = mean_edges(mesh);
    fans.spots.resize(mesh.positions.size());
    lines.resize(mesh.positions.size());
    parallel_for(
        mesh.positions.size() - first,
        [&](std::size_t i) {
          const std::size_t v = first + i;
          Spot& spot = fans.spots[v];
          spot = walk.nearest(mesh.positions[v], tessellation.on[v]);
          const Vec3 way = spot.x - mesh.positions[v];
          const Real most = kMostMoved * around[v];
          if (way.squaredNorm() > most * most) spot.x = mesh.positions[v] + most * way.normalized();
          lines[v] = {mesh.positions[v], mesh.normals[v]};
          mesh.normals[v] = walk.normal(spot);
          mesh.positions[v] = spot.x;
          tessellation.on[v] = spot.triangle;
        },
        64);
    take_on(first);
  };
  const auto improve = [&](Real edge) {
    VoronoiOptions better;
    better.min_angle = kBetterAngle;
    better.sweeps = kSweeps;
    better.wander = kWander;
    std::swap(fans.up, mesh.normals);
    std::swap(fans.triangles, mesh.triangles);
    move_for_angles(fans, walk, edge, better);
    std::swap(fans.up, mesh.normals);
    std::swap(fans.triangles, mesh.triangles);
    parallel_for(fans.spots.size(), [&](std::size_t v) {
      mesh.positions[v] = fans.spots[v].x;
      tessellation.on[v] = fans.spots[v].triangle;
    });
    if (!particles) return;
    std::fill(lines.begin(), lines.end(), Line{});
    take_on(0);
  };
  mesh.attributes.clear();
  settle(0);

  RefineOptions step = options;
  step.curved = false;
  // Lengths that do not depend on the one longest edge there is, far away.
  Real edge = options.edge;
  for (const Real longest = longest_edge(mesh); edge < longest;) edge *= 2;
  Real improved = edge;  // once for each length, or vertices would wander on and on
  for (int round = 0; round < kMostRounds; ++round) {
    edge = std::max(options.edge, edge / 2);
    step.edge = edge;
    const std::vector<Triangle> before = mesh.triangles;
    const std::size_t first = mesh.positions.size();
    const RefineToReport cut = refine_to(mesh, step);
    report.enough = cut.enough;
    if (cut.rounds > 0) {
      ++report.rounds;
      const std::vector<Index> from = starts(before, mesh, cut.parent, first);
      tessellation.on.resize(mesh.positions.size());
      for (std::size_t i = 0; i < from.size(); ++i) {
        CHECK_NE(from[i], Regions::kNone);
        tessellation.on[first + i] = tessellation.on[from[i]];
      }
      settle(first);
      if (edge < improved) improve(edge);
      improved = edge;
      std::vector<Index> whose(cut.parent.size());
      for (std::size_t t = 0; t < whose.size(); ++t) whose[t] = report.parent[cut.parent[t]];
      report.parent = std::move(whose);
    }
    if (!cut.enough || (cut.rounds == 0 && edge == options.edge)) break;
  }

  const SmoothSurface smooth(surface);
  parallel_for(mesh.positions.size(), [&](std::size_t v) {
    const Index corner = surface.triangles[fans.spots[v].triangle][0];
    const Vec3 x = mesh.positions[v], n = mesh.normals[v];
    if (particles && share[v] >= 1) return;
    smooth.project(mesh.positions[v], mesh.normals[v], smooth.pieces()[corner], smooth.edges()[corner]);
    if (particles && share[v] > 0) {
      mesh.positions[v] += share[v] * (x - mesh.positions[v]);
      mesh.normals[v] = (mesh.normals[v] + share[v] * (n - mesh.normals[v])).normalized();
    }
    fans.spots[v] = walk.nearest(mesh.positions[v], fans.spots[v].triangle);
  });
  carry_over(surface, fans.spots, mesh);

  std::vector<Index> region(mesh.triangles.size());
  for (std::size_t t = 0; t < region.size(); ++t) region[t] = tessellation.region[report.parent[t]];
  tessellation.region = std::move(region);
  tessellation.center.resize(mesh.positions.size(), Regions::kNone);
  return report;
}

}  // namespace effuse::skin
