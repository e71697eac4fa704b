#include "skin/tessellate/improve.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <numeric>

#include "geometry/base/check.h"
#include "geometry/base/parallel.h"
#include "geometry/base/zones.h"
#include "skin/tessellate/stars.h"

namespace effuse::skin {

namespace {

using geometry::Triangle;

Real quality_of(const Fans& fans, const Triangle& c) {
  return triangle_quality(fans.spots[c[0]].x, fans.spots[c[1]].x, fans.spots[c[2]].x, fans.up[c[0]] + fans.up[c[1]] + fans.up[c[2]]);
}

struct Sheet {
  Fans& fans;
  const SurfaceWalk& walk;
  Stars stars;

  Sheet(Fans& f, const SurfaceWalk& w) : fans(f), walk(w), stars(f.spots.size(), f.triangles) {}
  /// Of triangle t as if vertex v were at x with normal n.
  Real quality(Index t, Index v, const Vec3& x, const Vec3& n) const {
    Vec3 sum = Vec3::Zero();
    std::array<Vec3, 3> p;
    for (std::size_t k = 0; k < 3; ++k) {
      const Index c = fans.triangles[t][k];
      p[k] = c == v ? x : fans.spots[c].x;
      sum += c == v ? n : fans.up[c];
    }
    return triangle_quality(p[0], p[1], p[2], sum);
  }
  Real quality(Index t) const { return quality_of(fans, fans.triangles[t]); }
  Real worst(Index v, const Vec3& x, const Vec3& n, Real floor = -10) const {
    Real least = 10;
    for (const Index t : stars.of(v)) {
      least = std::min(least, quality(t, v, x, n));
      if (least < floor) break;
    }
    return least;
  }
};

}  // namespace

Real triangle_quality(const Vec3& a, const Vec3& b, const Vec3& c, const Vec3& up) {
  const Vec3 ab = b - a, bc = c - b, ca = a - c, n = ab.cross(c - a);
  const Real area = n.norm(), along = n.dot(up);
  const Real length = up.norm();
  if (!(area > 0)) return 0;
  const Real x = ab.squaredNorm(), y = bc.squaredNorm(), z = ca.squaredNorm();
  const Real sine = area * std::sqrt(std::min({x, y, z}) / (x * y * z));
  // Less than 6 degrees from edge-on counts as folded: there the surface and the triangle do not agree. Of folded ones the thinner is the
  // better: on the way out they have no area.
  if (along <= 0.1 * area * length) return length > 0 ? sine * along / (area * length) - 1 : -1;
  return sine;
}

std::size_t merge_short_borders(Fans& fans, const SurfaceWalk& walk, Real length, Real only_below) {
  ZONE("skin.merge");
  struct Short {
    Real length;
    Index a, b;
  };
  const auto is_node = [&](Index v) { return v >= fans.centers; };
  std::vector<Short> shorts;
  for (const Triangle& t : fans.triangles) {
    // Corners: the centre, and the border's ends.
    const Index a = t[1], b = t[2];
    const Real far = (fans.spots[a].x - fans.spots[b].x).norm();
    if (far >= length || (only_below >= 1 ? a > b : quality_of(fans, t) >= only_below)) continue;
    shorts.push_back({far, std::min(a, b), std::max(a, b)});
  }
  if (shorts.empty()) return 0;
  std::sort(shorts.begin(), shorts.end(), [](const Short& p, const Short& q) {
    if (p.length != q.length) return p.length < q.length;
    return p.a != q.a ? p.a < q.a : p.b < q.b;
  });

  Sheet sheet(fans, walk);
  std::vector<std::uint8_t> gone(fans.triangles.size(), 0);
  std::vector<Index> alias(fans.spots.size());
  std::iota(alias.begin(), alias.end(), Index{0});
  const auto now = [&](Index v) {
    while (alias[v] != v) v = alias[v];
    return v;
  };
  std::size_t merged = 0;
  std::vector<Index> ring_a, ring_b;
  const auto ring = [&](Index v, std::vector<Index>& out) {
    out.clear();
    for (const Index t : sheet.stars.of(v))
      for (const Index w : fans.triangles[t])
        if (w != v) out.push_back(w);
    std::sort(out.begin(), out.end());
    out.erase(std::unique(out.begin(), out.end()), out.end());
  };
  for (const Short& s : shorts) {
    const Index a = now(s.a), b = now(s.b);
    if (a == b || (fans.spots[a].x - fans.spots[b].x).norm() >= length) continue;
    ring(a, ring_a);
    ring(b, ring_b);
    std::vector<Index> common;
    std::set_intersection(ring_a.begin(), ring_a.end(), ring_b.begin(), ring_b.end(), std::back_inserter(common));
    if (common.size() != 2 || is_node(common[0]) || is_node(common[1])) continue;
    // A fan keeps three triangles.
    if (sheet.stars.of(common[0]).size() <= 3 || sheet.stars.of(common[1]).size() <= 3) continue;

    const Spot spot = walk.nearest((fans.spots[a].x + fans.spots[b].x) / 2, fans.spots[a].triangle);
    const Vec3 n = walk.normal(spot);
    Real before = 10, after = 10;
    for (const Index v : {a, b})
      for (const Index t : sheet.stars.of(v)) {
        before = std::min(before, sheet.quality(t));
        const Triangle& c = fans.triangles[t];
        if ((c[0] == a || c[1] == a || c[2] == a) && (c[0] == b || c[1] == b || c[2] == b)) continue;
        after = std::min(after, sheet.quality(t, v, spot.x, n));
      }
    if (after < before) continue;

    const std::vector<Index> star(sheet.stars.of(b).begin(), sheet.stars.of(b).end());
    for (const Index t : star) {
      Triangle& c = fans.triangles[t];
      if (c[0] != a && c[1] != a && c[2] != a) {
        std::replace(c.begin(), c.end(), b, a);
        continue;
      }
      gone[t] = 1;
      for (const Index v : c) sheet.stars.remove(v, t);
    }
    sheet.stars.join(a, b);
    alias[b] = a;
    fans.spots[a] = spot;
    fans.up[a] = n;
    ++merged;
  }
  if (merged == 0) return 0;

  // What is left, in order.
  std::size_t kept = 0;
  std::vector<Index> place(fans.spots.size(), 0);
  for (std::size_t v = 0; v < fans.spots.size(); ++v) {
    if (alias[v] != v) continue;
    place[v] = static_cast<Index>(kept);
    fans.spots[kept] = fans.spots[v];
    fans.up[kept++] = Vec3(fans.up[v]);
  }
  fans.spots.resize(kept);
  fans.up.resize(kept);
  kept = 0;
  for (std::size_t t = 0; t < fans.triangles.size(); ++t) {
    if (gone[t]) continue;
    for (std::size_t k = 0; k < 3; ++k) fans.triangles[kept][k] = place[fans.triangles[t][k]];
    ++kept;
  }
  fans.triangles.resize(kept);
  return merged;
}

std::size_t move_for_angles(Fans& fans, const SurfaceWalk& walk, Real spacing, const VoronoiOptions& options) {
  ZONE("skin.angles");
  Sheet sheet(fans, walk);
  const Real wanted = std::sin(options.min_angle * kPi / 180), wander = options.wander * spacing;
  std::vector<Vec3> home(fans.spots.size());
  for (std::size_t v = 0; v < home.size(); ++v) home[v] = fans.spots[v].x;
  std::vector<std::uint8_t> moved(fans.spots.size(), 0), bad(fans.spots.size());

  // Steps as shares of the mean edge: wide ones first, small ones to finish, then once more.
  constexpr std::array<Real, 4> kSteps = {0.3, 0.15, 0.08, 0.2};
  std::vector<Real> quality(fans.triangles.size());
  for (int sweep = 0; sweep < options.sweeps; ++sweep) {
    parallel_for(fans.triangles.size(), [&](std::size_t t) { quality[t] = sheet.quality(static_cast<Index>(t)); });
    std::fill(bad.begin(), bad.end(), 0);
    bool any = false;
    for (std::size_t t = 0; t < fans.triangles.size(); ++t) {
      if (quality[t] >= wanted) continue;
      for (const Index v : fans.triangles[t]) bad[v] = 1;
      any = true;
    }
    if (!any) break;
    for (Index v = 0; v < fans.spots.size(); ++v) {
      if (!bad[v]) continue;
      const Spot here = fans.spots[v];
      const Vec3 up = fans.up[v];
      const Real before = sheet.worst(v, here.x, up);
      if (before >= wanted) continue;
      // Around on the tangent plane, and towards the neighbours' middle.
      Vec3 middle = Vec3::Zero();
      Real edge = 0, count = 0;
      for (const Index t : sheet.stars.of(v))
        for (const Index w : fans.triangles[t]) {
          if (w == v) continue;
          middle += fans.spots[w].x;
          edge += (fans.spots[w].x - here.x).norm();
          count += 1;
        }
      middle /= count;
      const Vec3 side = (std::abs(up.x()) < 0.6 ? up.cross(Vec3::UnitX()) : up.cross(Vec3::UnitY())).normalized(), ahead = up.cross(side);
      const Real step = kSteps[static_cast<std::size_t>(sweep) % kSteps.size()] * edge / count;
      Vec3 best = here.x;
      Real most = before;
      const auto consider = [&](Vec3 x) {
        if (v >= fans.centers && (x - home[v]).norm() > wander) x = home[v] + (x - home[v]).normalized() * wander;
        const Real q = sheet.worst(v, x, up, most);
        if (q <= most) return;
        most = q;
        best = x;
      };
      for (int k = 0; k < 8; ++k) {
        const Real angle = 2 * kPi * (k + 0.5 * (sweep % 2)) / 8;
        consider(here.x + step * (std::cos(angle) * side + std::sin(angle) * ahead));
      }
      consider((here.x + middle) / 2);
      if (most <= before + 1e-3) continue;
      const Spot there = walk.nearest(best, here.triangle);
      const Vec3 n = walk.normal(there);
      if (sheet.worst(v, there.x, n, before) <= before) continue;
      fans.spots[v] = there;
      fans.up[v] = n;
      moved[v] = 1;
    }
  }
  return static_cast<std::size_t>(std::count(moved.begin(), moved.end(), 1));
}

}  // namespace effuse::skin
