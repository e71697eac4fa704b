#include "geometry/remesh/distance_bound.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <vector>

#include "geometry/base/check.h"
#include "geometry/base/parallel.h"
#include "geometry/base/zones.h"
#include "geometry/query/closest_point.h"
#include "geometry/query/mesh_tree.h"

namespace effuse::geometry {

namespace {

using Piece = std::vector<Vec3>;  // corners of a flat convex polygon
using Corners = std::array<Vec3, 3>;

Vec3 middle_of(const Piece& piece) {
  Vec3 sum = Vec3::Zero();
  for (const Vec3& x : piece) sum += x;
  return sum / static_cast<Real>(piece.size());
}

/// A plane: points where normal . x = offset.
struct Cut {
  Vec3 normal;
  Real offset;
};

/// Both sides of a piece, below the plane and above.
std::array<Piece, 2> parts(const Piece& piece, const Cut& cut) {
  std::array<Piece, 2> out;
  for (std::size_t k = 0; k < piece.size(); ++k) {
    const Vec3 &a = piece[k], &b = piece[(k + 1) % piece.size()];
    const Real ha = cut.normal.dot(a) - cut.offset, hb = cut.normal.dot(b) - cut.offset;
    if (ha <= 0) out[0].push_back(a);
    if (ha >= 0) out[1].push_back(a);
    if ((ha < 0 && hb > 0) || (ha > 0 && hb < 0)) {
      const Vec3 x = a + ha / (ha - hb) * (b - a);
      out[0].push_back(x);
      out[1].push_back(x);
    }
  }
  return out;
}

/// Across the longest side, in its middle.
Cut in_two(const Piece& piece) {
  std::size_t longest = 0;
  const auto side = [&](std::size_t k) -> Vec3 { return piece[(k + 1) % piece.size()] - piece[k]; };
  for (std::size_t k = 1; k < piece.size(); ++k)
    if (side(k).squaredNorm() > side(longest).squaredNorm()) longest = k;
  const Vec3 along = side(longest).normalized();
  return {along, along.dot(piece[longest]) + side(longest).norm() / 2};
}

/// Along the side of the triangle's prism that `corner` lies farthest beyond, if that leaves something of the piece on both sides.
Cut along_prism(const Piece& piece, const Corners& t, const Vec3& corner) {
  constexpr Real kSliver = 0.02;  // of the piece's extent across the cut
  const Vec3 normal = (t[1] - t[0]).cross(t[2] - t[0]);
  Cut best{Vec3::Zero(), 0};
  Real beyond = 0;
  for (std::size_t k = 0; k < 3; ++k) {
    const Vec3 outward = (t[(k + 1) % 3] - t[k]).cross(normal).normalized();
    const Real offset = outward.dot(t[k]), h = outward.dot(corner) - offset;
    if (h > beyond) beyond = h, best = {outward, offset};
  }
  if (beyond == 0) return in_two(piece);
  Real low = 0, high = 0;
  for (const Vec3& x : piece) {
    const Real h = best.normal.dot(x) - best.offset;
    low = std::min(low, h);
    high = std::max(high, h);
  }
  return std::min(-low, high) > kSliver * (high - low) ? best : in_two(piece);
}

/// The bound for one triangle.
Real bound_of(const Corners& from, const TriMesh& to, const MeshTree& tree, Real enough) {
  Real bound = 0;
  std::vector<Piece> open = {{from[0], from[1], from[2]}};
  for (std::size_t pieces = 1; !open.empty(); ++pieces) {
    const Piece piece = std::move(open.back());
    open.pop_back();
    const Triangle& nearest = to.triangles[tree.nearest(middle_of(piece))->triangle];
    const Corners t = {to.positions[nearest[0]], to.positions[nearest[1]], to.positions[nearest[2]]};
    Real farthest = 0;
    Vec3 corner = piece.front();
    for (const Vec3& x : piece)
      if (const Real d = (closest_point_on_triangle(x, t[0], t[1], t[2]).point - x).norm(); d > farthest) farthest = d, corner = x;
    if (farthest <= enough) {
      bound = std::max(bound, farthest);
      continue;
    }
    if (!tree.nearest(corner, enough)) return tree.nearest(corner)->distance;
    if (pieces >= kMostPieces) return farthest;
    for (Piece& part : parts(piece, along_prism(piece, t, corner)))
      if (part.size() > 2) open.push_back(std::move(part));
  }
  return bound;
}

}  // namespace

Real distance_bound(const TriMesh& from, const TriMesh& to, Real enough) {
  ZONE("mesh.distance_bound");
  CHECK(std::isfinite(enough) && enough > 0);
  const MeshTree tree(to.positions, to.triangles);
  if (tree.size() == 0) return from.triangles.empty() ? 0 : std::numeric_limits<Real>::infinity();
  return parallel_max(
      from.triangles.size(), 0,
      [&](std::size_t t) {
        const Triangle& v = from.triangles[t];
        return bound_of({from.positions[v[0]], from.positions[v[1]], from.positions[v[2]]}, to, tree, enough);
      },
      64);
}

}  // namespace effuse::geometry
