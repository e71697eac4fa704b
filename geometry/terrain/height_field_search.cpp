#include "geometry/terrain/height_field_search.h"

#include <algorithm>
#include <array>
#include <cmath>

#include "geometry/base/check.h"

namespace effuse::geometry {

namespace {

constexpr int kLeaf = 4;  // cells along a side of the smallest block
constexpr Real kInfinity = std::numeric_limits<Real>::infinity();

/// One cell's surface, seen from its lower left post: height a + b X + c Y + e X Y over [0, sx] x [0, sy].
/// The query point is at (x, y, z) in the same frame, z relative to the height a.
struct Patch {
  Real sx, sy, b, c, e;
  Real x, y, z;

  Real height(Real X, Real Y) const { return b * X + c * Y + e * X * Y; }
};

struct PatchPoint {
  Real X = 0, Y = 0, distance2 = kInfinity;
};

void keep_nearer(const Patch& q, Real X, Real Y, PatchPoint& best) {
  X = std::clamp(X, Real{0}, q.sx);
  Y = std::clamp(Y, Real{0}, q.sy);
  const Real dx = X - q.x, dy = Y - q.y, dz = q.height(X, Y) - q.z;
  const Real distance2 = dx * dx + dy * dy + dz * dz;
  if (distance2 < best.distance2) best = {X, Y, distance2};
}

/// Edges X = const and Y = const are straight lines in space: their nearest points are plain projections.
void try_edge_x(const Patch& q, Real X, PatchPoint& best) {
  const Real slope = q.c + q.e * X;
  keep_nearer(q, X, (q.y + slope * (q.z - q.b * X)) / (1 + slope * slope), best);
}
void try_edge_y(const Patch& q, Real Y, PatchPoint& best) {
  const Real slope = q.b + q.e * Y;
  keep_nearer(q, (q.x + slope * (q.z - q.c * Y)) / (1 + slope * slope), Y, best);
}

/// f = (X - x)^2 + (Y - y)^2 + (h - z)^2 is convex over the whole cell while |h - z| |e| < 1 at its corners:
/// the determinant of its Hessian is then at least (1 - |(h - z) e|)(1 + |(h - z) e|) > 0.
bool convex(const Patch& q) {
  const Real h10 = q.b * q.sx, h01 = q.c * q.sy, h11 = h10 + h01 + q.e * q.sx * q.sy;
  const Real farthest = std::max(std::max(std::abs(q.z), std::abs(h10 - q.z)), std::max(std::abs(h01 - q.z), std::abs(h11 - q.z)));
  return farthest * std::abs(q.e) < 1;
}

/// Roots of a polynomial of degree five on [0, 1] from its Bernstein coefficients: no change of sign, no root;
/// one change, one root; else halve.
void roots(const std::array<Real, 6>& bernstein, Real low, Real high, int depth, std::array<Real, 8>& found, int& count) {
  int changes = 0;
  for (std::size_t k = 0; k + 1 < bernstein.size(); ++k) changes += (bernstein[k] < 0) != (bernstein[k + 1] < 0);
  if (changes == 0 || count == static_cast<int>(found.size())) return;
  if (depth == 0) {
    found[count++] = (low + high) / 2;
    return;
  }
  // De Casteljau's halving.
  std::array<Real, 6> left = bernstein, right = bernstein;
  for (std::size_t level = 1; level < 6; ++level) {
    for (std::size_t k = 0; k + level < 6; ++k) right[k] = (right[k] + right[k + 1]) / 2;
    left[level] = right[0];
  }
  const Real middle = (low + high) / 2;
  roots(left, low, middle, depth - 1, found, count);
  roots(right, middle, high, depth - 1, found, count);
}

/// Every inner critical point. For a fixed Y the best X is a projection onto a line, X = (x + B (z - c Y)) / D with
/// B = b + e Y, D = 1 + B^2; what is left is (Y - y)^2 + N^2 / D, N = c Y + B x - z, whose derivative is zero where
///   (Y - y) D^2 + N (N' D - N B e) = 0.
void try_critical_points(const Patch& q, PatchPoint& best) {
  // In t = Y / sy, lowest power first.
  const Real B0 = q.b, B1 = q.e * q.sy;
  const std::array<Real, 3> D{1 + B0 * B0, 2 * B0 * B1, B1 * B1};
  const std::array<Real, 2> N{q.b * q.x - q.z, q.c * q.sy + q.e * q.sy * q.x};
  const Real dN = q.c + q.e * q.x;
  std::array<Real, 6> P{};
  for (std::size_t i = 0; i < 3; ++i) {
    for (std::size_t j = 0; j < 3; ++j) {
      P[i + j] -= q.y * D[i] * D[j];
      P[i + j + 1] += q.sy * D[i] * D[j];
    }
  }
  const std::array<Real, 3> M{dN * D[0] - q.e * N[0] * B0, dN * D[1] - q.e * (N[0] * B1 + N[1] * B0), dN * D[2] - q.e * N[1] * B1};
  for (std::size_t i = 0; i < 2; ++i)
    for (std::size_t j = 0; j < 3; ++j) P[i + j] += N[i] * M[j];

  // To Bernstein form: beta_k = sum_i C(k, i) / C(5, i) P_i.
  static constexpr Real kChoose[6][6] = {{1, 0, 0, 0, 0, 0}, {1, 1, 0, 0, 0, 0}, {1, 2, 1, 0, 0, 0}, {1, 3, 3, 1, 0, 0}, {1, 4, 6, 4, 1, 0}, {1, 5, 10, 10, 5, 1}};
  std::array<Real, 6> bernstein{};
  for (std::size_t k = 0; k < 6; ++k)
    for (std::size_t i = 0; i <= k; ++i) bernstein[k] += kChoose[k][i] / kChoose[5][i] * P[i];
  std::array<Real, 8> t;
  int count = 0;
  constexpr int kHalvings = 40;  // to 1e-12 of the cell
  roots(bernstein, 0, 1, kHalvings, t, count);
  for (int k = 0; k < count; ++k) try_edge_y(q, t[k] * q.sy, best);
}

/// The patch's point nearest to the query.
PatchPoint nearest_on(const Patch& q) {
  const bool is_convex = convex(q);
  PatchPoint best;

  // Newton's method from the point below.
  Real X = std::clamp(q.x, Real{0}, q.sx), Y = std::clamp(q.y, Real{0}, q.sy);
  bool converged = false;
  for (int iteration = 0; is_convex && iteration < 16; ++iteration) {
    const Real hx = q.b + q.e * Y, hy = q.c + q.e * X, up = q.height(X, Y) - q.z;
    const Real gx = X - q.x + up * hx, gy = Y - q.y + up * hy;
    const Real xx = 1 + hx * hx, yy = 1 + hy * hy, xy = hx * hy + up * q.e;
    const Real per_determinant = 1 / (xx * yy - xy * xy);
    const Real dX = (xy * gy - yy * gx) * per_determinant, dY = (xy * gx - xx * gy) * per_determinant;
    X += dX;
    Y += dY;
    // Two cells away the patch may no longer be convex, nor the answer in it.
    if (!(X > -q.sx && X < 2 * q.sx && Y > -q.sy && Y < 2 * q.sy)) break;
    // What is left is less than the square of this step: 1e-10 cells.
    if (std::abs(dX) < 1e-5 * q.sx && std::abs(dY) < 1e-5 * q.sy) {
      converged = true;
      break;
    }
  }
  if (converged && X >= 0 && X <= q.sx && Y >= 0 && Y <= q.sy) {
    keep_nearer(q, X, Y, best);
    return best;
  }

  try_edge_x(q, 0, best);
  try_edge_x(q, q.sx, best);
  try_edge_y(q, 0, best);
  try_edge_y(q, q.sy, best);
  if (is_convex) {
    // On an edge, with no descent into the cell: done.
    const Real up = q.height(best.X, best.Y) - q.z;
    const Real gx = best.X - q.x + up * (q.b + q.e * best.Y), gy = best.Y - q.y + up * (q.c + q.e * best.X);
    const bool x_done = best.X <= 0 ? gx >= 0 : best.X >= q.sx ? gx <= 0 : true;
    const bool y_done = best.Y <= 0 ? gy >= 0 : best.Y >= q.sy ? gy <= 0 : true;
    if (x_done && y_done) return best;
  }
  try_critical_points(q, best);
  return best;
}

/// Up to four blocks by rising key; equal keys in the order they came.
struct NearestFirst {
  struct Block {
    Real key;
    int i, j;
  };
  std::array<Block, 4> block;
  int count = 0;
  void add(const Block& b) {
    int at = count++;
    for (; at > 0 && b.key < block[at - 1].key; --at) block[at] = block[at - 1];
    block[at] = b;
  }
};

Real squared(Real x) { return x * x; }

Real outside(Real x, Real low, Real high) { return x < low ? low - x : x > high ? x - high : 0; }

}  // namespace

struct HeightFieldSearch::Best {
  Real distance2;
  Vec3 point = Vec3::Zero();
  bool found = false;
  int own_i = -1, own_j = -1;  // already done
};

HeightFieldSearch::HeightFieldSearch(const HeightField& field) : field_(field), cone_(1 / std::sqrt(1 + squared(field.max_slope()))) {
  // Ranges of heights of the leaves, from the whole cells; blocks of holes have low > high.
  const int cells_x = field.nx() - 1, cells_y = field.ny() - 1;
  Level leaves{(cells_x + kLeaf - 1) / kLeaf, (cells_y + kLeaf - 1) / kLeaf, {}};
  leaves.range.assign(static_cast<std::size_t>(leaves.nx) * leaves.ny, {kInfinity, -kInfinity});
  for (int j = 0; j < cells_y; ++j) {
    for (int i = 0; i < cells_x; ++i) {
      if (!field.whole(i, j)) continue;
      Range& range = leaves.range[static_cast<std::size_t>(j / kLeaf) * leaves.nx + i / kLeaf];
      for (const Real z : {field.post(i, j), field.post(i + 1, j), field.post(i, j + 1), field.post(i + 1, j + 1)})
        range = {std::min(range.low, z), std::max(range.high, z)};
    }
  }
  levels_.push_back(std::move(leaves));
  while (levels_.back().nx > 1 || levels_.back().ny > 1) {
    const Level& fine = levels_.back();
    Level coarse{(fine.nx + 1) / 2, (fine.ny + 1) / 2, {}};
    coarse.range.assign(static_cast<std::size_t>(coarse.nx) * coarse.ny, {kInfinity, -kInfinity});
    for (int j = 0; j < fine.ny; ++j) {
      for (int i = 0; i < fine.nx; ++i) {
        const Range& part = fine.range[static_cast<std::size_t>(j) * fine.nx + i];
        Range& range = coarse.range[static_cast<std::size_t>(j / 2) * coarse.nx + i / 2];
        range = {std::min(range.low, part.low), std::max(range.high, part.high)};
      }
    }
    levels_.push_back(std::move(coarse));
  }

  // Distance to the nearest hole in cells: two sweeps give the Chebyshev distance.
  if (field.holes() == 0) return;
  hole_near_.resize(static_cast<std::size_t>(cells_x) * cells_y);
  const auto at = [&](int i, int j) -> int {
    return i < 0 || j < 0 || i >= cells_x || j >= cells_y ? 255 : hole_near_[static_cast<std::size_t>(j) * cells_x + i];
  };
  const auto lower = [&](int i, int j, int through) {
    std::uint8_t& mine = hole_near_[static_cast<std::size_t>(j) * cells_x + i];
    mine = static_cast<std::uint8_t>(std::min<int>(mine, std::min(through + 1, 255)));
  };
  for (int j = 0; j < cells_y; ++j) {
    for (int i = 0; i < cells_x; ++i) {
      hole_near_[static_cast<std::size_t>(j) * cells_x + i] = field.whole(i, j) ? 255 : 0;
      lower(i, j, std::min({at(i - 1, j), at(i - 1, j - 1), at(i, j - 1), at(i + 1, j - 1)}));
    }
  }
  for (int j = cells_y - 1; j >= 0; --j)
    for (int i = cells_x - 1; i >= 0; --i) lower(i, j, std::min({at(i + 1, j), at(i + 1, j + 1), at(i, j + 1), at(i - 1, j + 1)}));
}

Real HeightFieldSearch::distance_bound(const HeightField::Cell& c, Real dz, Real reach) const {
  if (!hole_near_.empty()) {
    // Ground within reach lies at most this many cells away; with no hole among them the slope bounds the surface.
    const Real cells = reach / std::min(field_.spacing().x(), field_.spacing().y()) + 1;
    const int hole = hole_near_[static_cast<std::size_t>(c.j) * (field_.nx() - 1) + c.i];
    if (!(cells < hole)) return 0;
  }
  return std::abs(dz) * cone_;
}

void HeightFieldSearch::try_cell(int i, int j, const Vec3& p, Best& best) const {
  const Vec2 spacing = field_.spacing();
  const Real z00 = field_.post(i, j), z10 = field_.post(i + 1, j), z01 = field_.post(i, j + 1), z11 = field_.post(i + 1, j + 1);
  if (!(z00 + z10 + z01 + z11 == z00 + z10 + z01 + z11)) return;  // a hole
  const Vec2 corner(field_.corner().x() + i * spacing.x(), field_.corner().y() + j * spacing.y());
  const Real b = (z10 - z00) / spacing.x(), c = (z01 - z00) / spacing.y(), e = (z11 - z10 - z01 + z00) / (spacing.x() * spacing.y());
  const Patch patch{spacing.x(), spacing.y(), b, c, e, p.x() - corner.x(), p.y() - corner.y(), p.z() - z00};
  const PatchPoint nearest = nearest_on(patch);
  if (!(nearest.distance2 < best.distance2)) return;
  best.distance2 = nearest.distance2;
  best.point = {corner.x() + nearest.X, corner.y() + nearest.Y, z00 + patch.height(nearest.X, nearest.Y)};
  best.found = true;
}

void HeightFieldSearch::try_window(const Vec3& p, Best& best) const {
  const Vec2 spacing = field_.spacing(), corner = field_.corner();
  const Real r = std::sqrt(best.distance2);
  const auto first = [](Real u, int cells) { return static_cast<int>(std::clamp(std::floor(u), Real{0}, Real(cells - 1))); };
  const int cells_x = field_.nx() - 1, cells_y = field_.ny() - 1;
  const int i0 = first((p.x() - r - corner.x()) / spacing.x(), cells_x), i1 = first((p.x() + r - corner.x()) / spacing.x(), cells_x);
  const int j0 = first((p.y() - r - corner.y()) / spacing.y(), cells_y), j1 = first((p.y() + r - corner.y()) / spacing.y(), cells_y);
  constexpr Real kFewCells = 9;
  if (Real(i1 - i0 + 1) * Real(j1 - j0 + 1) > kFewCells) {
    descend(static_cast<int>(levels_.size()) - 1, 0, 0, p, best);
    return;
  }
  for (int j = j0; j <= j1; ++j) {
    for (int i = i0; i <= i1; ++i) {
      if (i == best.own_i && j == best.own_j) continue;
      const Real dx = outside(p.x() - corner.x(), i * spacing.x(), (i + 1) * spacing.x());
      const Real dy = outside(p.y() - corner.y(), j * spacing.y(), (j + 1) * spacing.y());
      const auto [low, high] = std::minmax({field_.post(i, j), field_.post(i + 1, j), field_.post(i, j + 1), field_.post(i + 1, j + 1)});
      if (dx * dx + dy * dy + squared(outside(p.z(), low, high)) < best.distance2) try_cell(i, j, p, best);
    }
  }
}

Box3 HeightFieldSearch::box(int level, int i, int j) const {
  const Level& blocks = levels_[static_cast<std::size_t>(level)];
  const Range& range = blocks.range[static_cast<std::size_t>(j) * blocks.nx + i];
  const int side = kLeaf << level;
  const Vec2 corner = field_.corner(), spacing = field_.spacing();
  const auto x = [&](long post) { return corner.x() + static_cast<Real>(std::min<long>(post, field_.nx() - 1)) * spacing.x(); };
  const auto y = [&](long post) { return corner.y() + static_cast<Real>(std::min<long>(post, field_.ny() - 1)) * spacing.y(); };
  return {Vec3(x(long(i) * side), y(long(j) * side), range.low), Vec3(x(long(i + 1) * side), y(long(j + 1) * side), range.high)};
}

void HeightFieldSearch::descend(int level, int i, int j, const Vec3& p, Best& best) const {
  if (level == 0) {
    for (int cj = j * kLeaf; cj < std::min((j + 1) * kLeaf, field_.ny() - 1); ++cj) {
      for (int ci = i * kLeaf; ci < std::min((i + 1) * kLeaf, field_.nx() - 1); ++ci) {
        if ((ci == best.own_i && cj == best.own_j) || !field_.whole(ci, cj)) continue;
        const Vec2 corner = field_.corner(), spacing = field_.spacing();
        const Real dx = outside(p.x() - corner.x(), ci * spacing.x(), (ci + 1) * spacing.x());
        const Real dy = outside(p.y() - corner.y(), cj * spacing.y(), (cj + 1) * spacing.y());
        const auto [low, high] = std::minmax({field_.post(ci, cj), field_.post(ci + 1, cj), field_.post(ci, cj + 1), field_.post(ci + 1, cj + 1)});
        if (dx * dx + dy * dy + squared(outside(p.z(), low, high)) < best.distance2) try_cell(ci, cj, p, best);
      }
    }
    return;
  }
  NearestFirst children;
  const Level& fine = levels_[static_cast<std::size_t>(level) - 1];
  for (int cj = 2 * j; cj < std::min(2 * j + 2, fine.ny); ++cj) {
    for (int ci = 2 * i; ci < std::min(2 * i + 2, fine.nx); ++ci) {
      const Box3 child = box(level - 1, ci, cj);
      if (child.min().z() > child.max().z()) continue;
      children.add({child.squaredExteriorDistance(p), ci, cj});
    }
  }
  for (int k = 0; k < children.count; ++k)
    if (children.block[k].key < best.distance2) descend(level - 1, children.block[k].i, children.block[k].j, p, best);
}

std::optional<HeightFieldSearch::Nearest> HeightFieldSearch::nearest(const Vec3& p, Real reach) const {
  return nearest(p, reach, field_.cell(p.x(), p.y()));
}

std::optional<HeightFieldSearch::Nearest> HeightFieldSearch::nearest(const Vec3& p, Real reach, const std::optional<HeightField::Cell>& own) const {
  if (!p.allFinite() || !(reach > 0)) return std::nullopt;
  // Just beyond reach, so that ground at exactly reach is found in spite of rounding.
  Best best{reach * reach * (1 + 1e-14)};
  if (own) {
    best.own_i = own->i;
    best.own_j = own->j;
    try_cell(own->i, own->j, p, best);
    // Ground nearer than that lies in the ball around p; mostly the ball stays within the cell.
    const Real r = std::sqrt(best.distance2);
    const Vec2 spacing = field_.spacing();
    const Real X = p.x() - field_.corner().x() - own->i * spacing.x(), Y = p.y() - field_.corner().y() - own->j * spacing.y();
    if (X < r || Y < r || X + r > spacing.x() || Y + r > spacing.y()) try_window(p, best);
  } else {
    try_window(p, best);
  }
  if (!best.found) return std::nullopt;
  return Nearest{best.point, std::sqrt(best.distance2)};
}

struct HeightFieldSearch::RayState {
  Vec3 p, d, per_d;
  Real t;  // nearest hit so far, or t_max
  bool found = false;
};

namespace {

/// Where p + t d, t in [0, t_max], enters the box; infinity if it does not. pad [m] widens the box.
Real entry(const Box3& box, const Vec3& p, const Vec3& d, const Vec3& per_d, Real t_max, Real pad) {
  Real from = 0, to = t_max;
  for (int k = 0; k < 3; ++k) {
    const Real low = box.min()[k] - pad - p[k], high = box.max()[k] + pad - p[k];
    if (d[k] == 0) {
      if (low > 0 || high < 0) return kInfinity;
      continue;
    }
    const Real a = low * per_d[k], b = high * per_d[k];
    from = std::max(from, std::min(a, b));
    to = std::min(to, std::max(a, b));
  }
  return from <= to ? from : kInfinity;
}

/// Moeller & Trumbore 1997, with a margin so that a ray along a shared edge cannot slip between two triangles.
Real hit_triangle(const Vec3& p, const Vec3& d, const Vec3& a, const Vec3& b, const Vec3& c) {
  constexpr Real kMargin = 1e-12;  // barycentric
  const Vec3 u = b - a, v = c - a, q = d.cross(v);
  const Real determinant = u.dot(q);
  if (determinant == 0) return kInfinity;
  const Vec3 s = p - a, r = s.cross(u);
  const Real s1 = s.dot(q) / determinant, s2 = d.dot(r) / determinant;
  if (!(s1 >= -kMargin && s2 >= -kMargin && s1 + s2 <= 1 + kMargin)) return kInfinity;
  return v.dot(r) / determinant;
}

}  // namespace

void HeightFieldSearch::descend_ray(int level, int i, int j, RayState& state) const {
  if (level == 0) {
    const Vec2 corner = field_.corner(), spacing = field_.spacing();
    const auto vertex = [&](int a, int b) { return Vec3(corner.x() + a * spacing.x(), corner.y() + b * spacing.y(), field_.post(a, b)); };
    for (int cj = j * kLeaf; cj < std::min((j + 1) * kLeaf, field_.ny() - 1); ++cj) {
      for (int ci = i * kLeaf; ci < std::min((i + 1) * kLeaf, field_.nx() - 1); ++ci) {
        if (!field_.whole(ci, cj)) continue;
        const Vec3 sw = vertex(ci, cj), se = vertex(ci + 1, cj), nw = vertex(ci, cj + 1), ne = vertex(ci + 1, cj + 1);
        const bool rising = field_.splits_rising(ci, cj);
        for (const Real t : {hit_triangle(state.p, state.d, sw, se, rising ? ne : nw), hit_triangle(state.p, state.d, rising ? sw : se, ne, nw)}) {
          if (t > 0 && t <= state.t) {
            state.t = t;
            state.found = true;
          }
        }
      }
    }
    return;
  }
  NearestFirst children;
  const Real pad = 1e-9 * field_.spacing().norm();  // rounding of the slabs
  const Level& fine = levels_[static_cast<std::size_t>(level) - 1];
  for (int cj = 2 * j; cj < std::min(2 * j + 2, fine.ny); ++cj) {
    for (int ci = 2 * i; ci < std::min(2 * i + 2, fine.nx); ++ci) {
      const Box3 child = box(level - 1, ci, cj);
      if (child.min().z() > child.max().z()) continue;
      const Real t = entry(child, state.p, state.d, state.per_d, state.t, pad);
      if (t < kInfinity) children.add({t, ci, cj});
    }
  }
  for (int k = 0; k < children.count; ++k)
    if (children.block[k].key <= state.t) descend_ray(level - 1, children.block[k].i, children.block[k].j, state);
}

std::optional<Real> HeightFieldSearch::ray(const Vec3& p, const Vec3& d, Real t_max) const {
  if (!p.allFinite() || !d.allFinite() || d.isZero(0) || !(t_max > 0)) return std::nullopt;
  RayState state{p, d, d.cwiseInverse(), t_max};
  descend_ray(static_cast<int>(levels_.size()) - 1, 0, 0, state);
  return state.found ? std::optional(state.t) : std::nullopt;
}

}  // namespace effuse::geometry
