#include "skin/tessellate/on_particles.h"

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <vector>

#include "geometry/base/check.h"
#include "geometry/base/parallel.h"
#include "geometry/base/zones.h"
#include "skin/tessellate/improve.h"

namespace effuse::skin {

namespace {

constexpr Real kLeastAngle = 0.1;   // sine of the angle between two planes that have a line in common
constexpr Real kThinnest = 11;      // [deg]
constexpr int kRounds = 3;          // in which triangles beside those whose corners stayed are looked at
constexpr Real kElsewhere = 0.2;    // [spacings]
constexpr Real kLeastSlant = 0.55;  // cosine between a line and the normal

}  // namespace

Line line_between(const Vec3& a, const Vec3& b, const Vec3& p, const Vec3& q, const Vec3& up) {
  const Vec3 m = b - a, n = q - p;
  Vec3 along = m.cross(n);
  const Real length = along.norm();
  if (!(length > kLeastAngle * m.norm() * n.norm())) return {};
  if (along.dot(up) < 0) along = -along;
  // x = middle of a and b + s m + t n, in both planes: counted from there only the second says something.
  const Vec3 middle = (a + b) / 2;
  const Real lacks = n.dot((p + q) / 2 - middle);
  const Vec3 within = n - n.dot(m) / m.squaredNorm() * m;  // in the first plane
  return {middle + lacks / within.dot(n) * within, along / length};
}

Line line_between(const Vec3& a, const Vec3& b, const Vec3& c, const Vec3& up) { return line_between(a, b, a, c, up); }

void take_onto(const ParticleSurface& particles, const SurfaceWalk& walk, std::span<Spot> spots, std::span<Vec3> up, std::span<const Line> lines,
               std::span<Real> share) {
  ZONE("skin.take_onto");
  CHECK_EQ(spots.size(), up.size());
  CHECK_EQ(spots.size(), lines.size());
  std::vector<Vec3> x(spots.size()), along(spots.size());
  parallel_for(spots.size(), [&](std::size_t v) {
    x[v] = spots[v].x;
    along[v] = up[v];
    const Line& line = lines[v];
    const Real slant = line.along.dot(up[v]);
    if (slant < kLeastSlant) return;
    // To where the line meets the plane of the mesh, unless that is somewhere else.
    const Vec3 met = line.at + (spots[v].x - line.at).dot(up[v]) / slant * line.along;
    if ((met - spots[v].x).norm() > kElsewhere * particles.spacing()) return;
    x[v] = met;
    along[v] = line.along;
  });
  particles.project_along(x, up, along, share);
  parallel_for(
      spots.size(),
      [&](std::size_t v) {
        spots[v] = walk.nearest(x[v], spots[v].triangle);
        spots[v].x = x[v];
      },
      64);
}

void take_onto(const ParticleSurface& particles, const SurfaceWalk& walk, std::span<const geometry::Triangle> triangles, std::size_t first, std::span<Spot> spots,
               std::span<Vec3> up, std::span<const Line> lines, std::span<Real> share) {
  CHECK_EQ(share.size(), spots.size());
  const std::vector<Spot> spots_before(spots.begin(), spots.end());
  const std::vector<Vec3> up_before(up.begin(), up.end());
  take_onto(particles, walk, spots.subspan(first), up.subspan(first), lines.subspan(first), share.subspan(first));
  const Real thinnest = std::sin(kThinnest * kPi / 180);
  std::vector<std::uint8_t> worse(triangles.size());
  for (int round = 0; round < kRounds; ++round) {
    parallel_for(triangles.size(), [&](std::size_t t) {
      const auto& [a, b, c] = triangles[t];
      worse[t] = 0;
      if (std::max({a, b, c}) < first) return;
      const Real now = triangle_quality(spots[a].x, spots[b].x, spots[c].x, up[a] + up[b] + up[c]);
      if (now >= thinnest) return;
      worse[t] = now < triangle_quality(spots_before[a].x, spots_before[b].x, spots_before[c].x, up_before[a] + up_before[b] + up_before[c]);
    });
    if (std::find(worse.begin(), worse.end(), std::uint8_t{1}) == worse.end()) break;
    for (std::size_t t = 0; t < worse.size(); ++t) {
      if (!worse[t]) continue;
      for (const Index v : triangles[t]) {
        if (v < first) continue;
        spots[v] = spots_before[v];
        up[v] = Vec3(up_before[v]);
        share[v] = 0;
      }
    }
  }
}

}  // namespace effuse::skin
