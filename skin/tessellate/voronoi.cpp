#include "skin/tessellate/voronoi.h"

#include <algorithm>
#include <cmath>

#include "geometry/base/check.h"
#include "geometry/base/parallel.h"
#include "geometry/base/zones.h"
#include "skin/tessellate/borders.h"
#include "skin/tessellate/cells.h"
#include "skin/tessellate/improve.h"
#include "skin/tessellate/on_particles.h"
#include "skin/tessellate/surface_walk.h"

namespace effuse::skin {

namespace {

using geometry::Triangle;
using geometry::TriMesh;

constexpr int kSteps = 8;     // from a centre's first place to the middle of its fan
constexpr int kStraight = 3;  // walks to the point straight out
constexpr Real kLeastSlant = 0.5;  // cosine between that way and the normal
constexpr Real kUnfolded = 2;   // [deg] enough for a triangle that was folded
constexpr Real kFarther = 0.8;  // [spacings] that its corners may move
constexpr Real kLongest = 3;  // a border of a folded triangle that shrinks, in options.merge

/// A triangle of the surface at each vertex of the labelled mesh that a cell wants to begin at.
std::vector<Index> triangle_at(const LabelledMesh& mesh, const Cells& cells) {
  std::vector<Index> wanted(mesh.x.size(), kNone), result(cells.size(), kNone);
  for (Index c = 0; c < cells.size(); ++c) wanted[cells.near[c]] = c;
  for (std::size_t t = 0; t < mesh.triangles.size(); ++t)
    for (const Index v : mesh.triangles[t])
      if (wanted[v] != kNone) result[wanted[v]] = mesh.parent[t];
  return result;
}

/// Where the fans have their centres: the surface point nearest the particle, if the fan is a good one from there, else as far on the
/// way from there to the middle of its border that makes it so.
///   particles  if given: not the nearest point, but that outward from the particle; both on the particles' surface
void place_centers(const LabelledMesh& mesh, const Cells& cells, std::span<const Vec3> site, const SurfaceWalk& walk, Real wanted,
                   const ParticleSurface* particles, Fans& fans) {
  std::vector<Index> begin(cells.size() + 1, 0), own(fans.triangles.size());
  for (const Triangle& t : fans.triangles) ++begin[t[0] + 1];
  for (std::size_t c = 0; c < cells.size(); ++c) begin[c + 1] += begin[c];
  std::vector<Index> filled(begin.begin(), begin.end() - 1);
  for (Index t = 0; t < fans.triangles.size(); ++t) own[filled[fans.triangles[t][0]]++] = t;
  const std::vector<Index> start = triangle_at(mesh, cells);
  std::vector<Line> lines(cells.size());

  parallel_for(
      cells.size(),
      [&](std::size_t c) {
        const std::span<const Index> fan = std::span(own).subspan(begin[c], begin[c + 1] - begin[c]);
        const auto worst = [&](const Spot& spot) {
          const Vec3 up = walk.normal(spot);
          Real least = 10;
          for (const Index t : fan) {
            const Spot &p = fans.spots[fans.triangles[t][1]], &q = fans.spots[fans.triangles[t][2]];
            least = std::min(least, triangle_quality(spot.x, p.x, q.x, up + fans.up[fans.triangles[t][1]] + fans.up[fans.triangles[t][2]]));
          }
          return least;
        };
        // The border's middle, by length, so that nodes may come and go; and how far its nodes are from there.
        Vec3 middle = Vec3::Zero();
        Real border = 0, reach = 0;
        for (const Index t : fan) {
          const Vec3 &p = fans.spots[fans.triangles[t][1]].x, &q = fans.spots[fans.triangles[t][2]].x;
          const Real length = (p - q).norm();
          border += length;
          middle += length * (p + q) / 2;
        }
        middle = border > 0 ? Vec3(middle / border) : fans.spots[fans.triangles[fan[0]][1]].x;
        // Outward: the vector area that the border spans, whatever lies between.
        Vec3 outward = Vec3::Zero();
        for (const Index t : fan) outward += (fans.spots[fans.triangles[t][1]].x - middle).cross(fans.spots[fans.triangles[t][2]].x - middle);
        if (outward.norm() > 0) outward.normalize();
        /// Where the line outward from a point meets the surface, nearly.
        const auto straight_out = [&](const Vec3& at, Index first) {
          Spot spot = walk.nearest(at, first);
          for (int step = 0; step < kStraight; ++step) {
            const Vec3 n = walk.normal(spot);
            const Real slant = n.dot(outward);
            if (slant < kLeastSlant) return spot;
            spot = walk.nearest(at + (spot.x - at).dot(n) / slant * outward, spot.triangle);
          }
          return spot;
        };
        const auto reached = [&](const Vec3& at, Index first) { return particles ? straight_out(at, first) : walk.nearest(at, first); };
        for (const Index t : fan) reach = std::max(reach, (fans.spots[fans.triangles[t][1]].x - middle).norm());
        Spot best;
        Real most = -10;
        bool own_place = cells.whole[c];
        if (own_place) {
          best = reached(site[cells.particle[c]], start[c]);
          lines[c] = {site[cells.particle[c]], outward};
          // Of a region in two pieces, on a sheet's rim say, the particle may be nearest to the other one.
          own_place = (best.x - middle).norm() <= reach;
          if (own_place) most = worst(best);
        }
        if (most < wanted) {
          // Towards the middle, no farther than it takes.
          const Vec3 from = own_place ? best.x : middle;
          const Index first = own_place ? best.triangle : start[c];
          const auto consider = [&](Real way, bool always) {
            const Vec3 at = from + way * (middle - from);
            const Spot spot = reached(at, first);
            const Real q = worst(spot);
            if (q > most || always) {
              most = q;
              best = spot;
              lines[c] = {at, outward};
            }
            return q;
          };
          Real before = most;  // a step ago
          for (int step = own_place ? 1 : kSteps; step <= kSteps && most < wanted; ++step) {
            const Real way = static_cast<Real>(step) / kSteps;
            const Real now = consider(way, step == kSteps && most <= 0);
            // Between two steps, so that it hangs on them continuously.
            if (particles && now >= wanted && before < wanted && before > 0 && own_place) consider(way - (now - wanted) / (now - before) / kSteps, true);
            before = now;
          }
        }
        fans.spots[c] = best;
        fans.up[c] = walk.normal(best);
      },
      64);
  if (particles) take_onto(*particles, walk, std::span(fans.spots).first(cells.size()), std::span(fans.up).first(cells.size()), lines);
}

void measure(const Fans& fans, VoronoiReport& report) {
  std::size_t thin = 0;
  Real least = 1;
  const Real five = std::sin(5 * kPi / 180);
  for (const Triangle& t : fans.triangles) {
    const Spot &a = fans.spots[t[0]], &b = fans.spots[t[1]], &c = fans.spots[t[2]];
    report.folded += (b.x - a.x).cross(c.x - a.x).dot(fans.up[t[0]] + fans.up[t[1]] + fans.up[t[2]]) <= 0;
    // Of the angle itself, wherever the triangle looks.
    const Real sine = triangle_quality(a.x, b.x, c.x, (b.x - a.x).cross(c.x - a.x));
    thin += sine < five;
    least = std::min(least, sine);
  }
  if (fans.triangles.empty()) return;
  report.thin = static_cast<Real>(thin) / static_cast<Real>(fans.triangles.size());
  report.least_angle = std::asin(std::max(0.0, least)) * 180 / kPi;
}

}  // namespace

Tessellation tessellate_voronoi(const TriMesh& surface, const Regions& regions, const geometry::Points& points,
                                const VoronoiOptions& options, const ParticleSurface* particles) {
  ZONE("skin.voronoi");
  CHECK_EQ(regions.size(), points.size());
  CHECK(options.refinement >= 0 && options.refinement <= 4);
  for (const auto& [name, attribute] : surface.attributes)
    CHECK_EQ(attribute.values.size(), surface.positions.size() * static_cast<std::size_t>(attribute.width));
  if (!surface.normals.empty()) CHECK_EQ(surface.normals.size(), surface.positions.size());

  Tessellation result;
  const Real spacing = regions.spacing();
  LabelledMesh labelled = label_surface(surface, regions, points.position, options.refinement);
  const Cells cells = cut_into_discs(labelled, points.position, spacing, options);
  const SurfaceWalk walk(surface);
  const Borders borders = trace_borders(labelled, cells, regions, points.position, walk, particles);

  // The fans: each border is a side of two triangles.
  Fans fans;
  fans.centers = cells.size();
  fans.spots.resize(fans.centers);
  for (const Node& node : borders.nodes) fans.spots.push_back(node.spot);
  fans.up.resize(fans.spots.size());
  parallel_for(borders.nodes.size(), [&](std::size_t n) { fans.up[fans.centers + n] = borders.nodes[n].up; });
  const auto node = [&](Index n) { return static_cast<Index>(fans.centers + n); };
  for (const Border& b : borders.borders) {
    fans.triangles.push_back({b.left, node(b.from), node(b.to)});
    fans.triangles.push_back({b.right, node(b.to), node(b.from)});
  }
  place_centers(labelled, cells, points.position, walk, std::sin(options.min_angle * kPi / 180), particles, fans);
  result.report.merged = merge_short_borders(fans, walk, options.merge * spacing);
  result.report.moved = move_for_angles(fans, walk, spacing, options);
  // Where moving did not help, the border itself may be on the wrong side: longer ones go too.
  if (const std::size_t more = merge_short_borders(fans, walk, kLongest * options.merge * spacing, std::sin(5 * kPi / 180))) {
    result.report.merged += more;
    result.report.moved += move_for_angles(fans, walk, spacing, options);
  }
  // What is still folded may go farther: its nodes are on the wrong side of one another.
  VoronoiOptions unfold = options;
  unfold.min_angle = std::min(options.min_angle, kUnfolded);
  unfold.wander = std::max(options.wander, kFarther);
  result.report.moved += move_for_angles(fans, walk, spacing, unfold);
  // What was merged or moved is where the mesh says.
  std::vector<Real> share(fans.spots.size());
  if (particles) take_onto(*particles, walk, fans.triangles, 0, fans.spots, fans.up, std::vector<Line>(fans.spots.size()), share);

  // Regions: the particles that have a cell, in rising order.
  result.particle = cells.particle;
  std::sort(result.particle.begin(), result.particle.end());
  result.particle.erase(std::unique(result.particle.begin(), result.particle.end()), result.particle.end());
  for (const Index p : result.particle) result.id.push_back(points.id.empty() ? p : points.id[p]);
  std::vector<Index> region_of(cells.size());
  for (std::size_t c = 0; c < cells.size(); ++c)
    region_of[c] =
        static_cast<Index>(std::lower_bound(result.particle.begin(), result.particle.end(), cells.particle[c]) - result.particle.begin());
  result.center.assign(fans.spots.size(), Regions::kNone);
  std::copy(region_of.begin(), region_of.end(), result.center.begin());
  result.region.reserve(fans.triangles.size());
  for (const Triangle& t : fans.triangles) result.region.push_back(region_of[t[0]]);

  result.mesh.positions.resize(fans.spots.size());
  result.on.resize(fans.spots.size());
  for (std::size_t v = 0; v < fans.spots.size(); ++v) {
    result.mesh.positions[v] = fans.spots[v].x;
    result.on[v] = fans.spots[v].triangle;
  }
  carry_over(surface, fans.spots, result.mesh);
  result.report.regions = result.particle.size();
  result.report.fans = cells.size();
  result.report.islands = cells.islands;
  result.report.unclaimed = labelled.unclaimed;
  result.report.dropped_pieces = labelled.dropped_pieces;
  measure(fans, result.report);
  result.mesh.normals = std::move(fans.up);
  result.mesh.triangles = std::move(fans.triangles);
  return result;
}

}  // namespace effuse::skin
