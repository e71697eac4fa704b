#include "skin/tessellate/borders.h"

#include <algorithm>
#include <cmath>

#include "geometry/base/check.h"
#include "geometry/base/parallel.h"
#include "geometry/base/zones.h"
#include "skin/tessellate/half_edges.h"

namespace effuse::skin {

namespace {

using geometry::Triangle;

constexpr Real kBent = 1.3;       // a border this much longer than the way between its ends gets a node on its way
constexpr Real kTurned = 0.2;     // so does one at whose ends the surface's normals have no more than this in common
constexpr Real kTurnable = 0.4;   // [spacings] borders longer than this are where the mesh says
constexpr Real kFarthest = 0.35;  // [spacings] a node may be from the triangle where its cells meet

/// Border between two ends before it is made of straight ones.
struct Chain {
  Index from = kNone, to = kNone;  // nodes; kNone: closed
  Index left, right;
  Index begin, end;  // its crossings
};

/// Where a border crosses an edge of the mesh.
struct Crossing {
  Vec3 x;
  Index triangle;  // of the surface, behind it
};

class Tracer {
 public:
  Tracer(const LabelledMesh& mesh, const Cells& cells, std::span<const Vec3> site) : mesh_(mesh), cells_(cells), site_(site) { join(); }

  void trace() {
    const auto triangles = static_cast<Index>(mesh_.triangles.size());
    node_.assign(triangles, kNone);
    for (Index t = 0; t < triangles; ++t) {
      if (mixed_[t] != 7) continue;
      node_[t] = static_cast<Index>(nodes.size());
      Node& node = nodes.emplace_back();
      for (Index k = 0; k < 3; ++k) node.cells[k] = cell(3 * t + k);
      place(t, node.spot);
    }
    done_.assign(3 * triangles, 0);
    for (Index t = 0; t < triangles; ++t)
      if (node_[t] != kNone)
        for (Index k = 0; k < 3; ++k)
          if (!done_[3 * t + k]) follow(3 * t + k);
    for (Index h = 0; h < 3 * triangles; ++h)
      if (mixed(h) && !done_[h]) follow(h);
  }

  std::vector<Node> nodes;
  std::vector<Chain> chains;
  std::vector<Crossing> crossings;

 private:
  Index start(Index h) const { return mesh_.triangles[h / 3][h % 3]; }
  Index end(Index h) const { return start(turn(h, 1)); }
  Index cell(Index h) const { return cells_.of[start(h)]; }
  bool mixed(Index h) const { return mixed_[h / 3] >> (h % 3) & 1; }

  void join() {
    mixed_.resize(mesh_.triangles.size());
    parallel_for(mesh_.triangles.size(), [&](std::size_t t) {
      const Triangle& c = mesh_.triangles[t];
      const std::array<Index, 3> own = {cells_.of[c[0]], cells_.of[c[1]], cells_.of[c[2]]};
      for (std::size_t k = 0; k < 3; ++k) mixed_[t] = static_cast<std::uint8_t>(mixed_[t] | (own[k] != own[(k + 1) % 3]) << k);
    });
    edges_ = number_edges(mesh_.triangles, mesh_.x.size(), [&](Index h) { return mixed(h); });
  }

  /// |x - x_a|^2 - |x - x_b|^2 for the particles of two cells.
  Real difference(const Vec3& x, Index a, Index b) const {
    return (x - site_[cells_.particle[a]]).squaredNorm() - (x - site_[cells_.particle[b]]).squaredNorm();
  }

  /// The middle of the triangle, or the point in it (not near its corners) as far from all three particles.
  void place(Index t, Spot& spot) const {
    const Triangle& c = mesh_.triangles[t];
    const std::array<Index, 3> own = {cells_.of[c[0]], cells_.of[c[1]], cells_.of[c[2]]};
    spot.triangle = mesh_.parent[t];
    spot.x = (mesh_.x[c[0]] + mesh_.x[c[1]] + mesh_.x[c[2]]) / 3;
    // Both differences are linear in the triangle: values at its corners, zero at the point.
    Eigen::Matrix2d a;
    Vec2 rhs;
    for (int row = 0; row < 2; ++row) {
      const Index other = own[static_cast<std::size_t>(row + 1)];
      const Real f0 = difference(mesh_.x[c[0]], own[0], other);
      a(row, 0) = difference(mesh_.x[c[1]], own[0], other) - f0;
      a(row, 1) = difference(mesh_.x[c[2]], own[0], other) - f0;
      rhs[row] = -f0;
    }
    const Real det = a.determinant();
    if (std::abs(det) <= 1e-12 * a.squaredNorm()) return;
    const Real u = (rhs[0] * a(1, 1) - rhs[1] * a(0, 1)) / det, v = (a(0, 0) * rhs[1] - a(1, 0) * rhs[0]) / det;
    Vec3 w(1 - u - v, u, v);
    w = w.cwiseMax(0.1);
    w /= w.sum();
    spot.x = w[0] * mesh_.x[c[0]] + w[1] * mesh_.x[c[1]] + w[2] * mesh_.x[c[2]];
  }

  /// From half-edge h out of its triangle and on, until a node or round to h.
  void follow(Index h) {
    Chain chain;
    chain.from = node_[h / 3];
    chain.right = cell(h);  // out of a triangle on the left of h, h's start is on the right
    chain.left = cell(turn(h, 1));
    chain.begin = static_cast<Index>(crossings.size());
    while (true) {
      const Index behind = edges_.mate(h), t = behind / 3;
      done_[h] = done_[behind] = 1;
      const Vec3 &a = mesh_.x[start(h)], &b = mesh_.x[end(h)];
      const Real fa = difference(a, chain.right, chain.left), fb = difference(b, chain.right, chain.left);
      const Real s = fa < 0 && fb > 0 ? std::clamp(fa / (fa - fb), 0.05, 0.95) : 0.5;
      crossings.push_back({a + s * (b - a), mesh_.parent[t]});
      if (node_[t] != kNone) {
        chain.to = node_[t];
        break;
      }
      // Two cells: the other mixed edge.
      h = mixed(turn(behind, 1)) ? turn(behind, 1) : turn(behind, 2);
      if (done_[h]) break;
    }
    chain.end = static_cast<Index>(crossings.size());
    chains.push_back(chain);
  }

  const LabelledMesh& mesh_;
  const Cells& cells_;
  std::span<const Vec3> site_;
  Edges edges_;  // between cells
  std::vector<Index> node_;
  std::vector<std::uint8_t> mixed_;  // bit k: side k of the triangle is between two cells
  std::vector<std::uint8_t> done_;
};

/// Moves a spot along the surface to where it is as far from all three of x: Newton's steps in the planes of the triangles met. False, and it
/// stays: there is no such place nearby.
bool find_corner(Spot& spot, const std::array<Vec3, 3>& x, Real spacing, const SurfaceWalk& walk) {
  Spot at = spot;
  bool found = false;
  for (int step = 0; step < 4 && !found; ++step) {
    const geometry::Triangle& t = walk.mesh().triangles[at.triangle];
    const Vec3& corner = walk.mesh().positions[t[0]];
    Mat3 a;
    a.row(0) = 2 * (x[1] - x[0]);
    a.row(1) = 2 * (x[2] - x[0]);
    a.row(2) = (walk.mesh().positions[t[1]] - corner).cross(walk.mesh().positions[t[2]] - corner);
    const Vec3 rhs((at.x - x[0]).squaredNorm() - (at.x - x[1]).squaredNorm(), (at.x - x[0]).squaredNorm() - (at.x - x[2]).squaredNorm(), 0);
    const Real det = a.determinant();
    if (std::abs(det) <= 1e-6 * a.row(0).norm() * a.row(1).norm() * a.row(2).norm()) return false;
    const Vec3 move = -(a.inverse() * rhs);
    if ((at.x + move - spot.x).norm() > kFarthest * spacing) return false;
    at = walk.nearest(at.x + move, at.triangle);
    found = move.norm() < 1e-2 * spacing;
  }
  if (found) spot = at;
  return found;
}

/// Puts a node of three particles where it is as far from all three, if no fourth is nearer there.
void settle(Node& node, const Cells& cells, const Regions& regions, std::span<const Vec3> site, const SurfaceWalk& walk) {
  node.spot = walk.nearest(node.spot.x, node.spot.triangle);
  std::array<Index, 3> p;
  for (std::size_t k = 0; k < 3; ++k) p[k] = cells.particle[node.cells[k]];
  if (p[0] == p[1] || p[1] == p[2] || p[2] == p[0]) return;
  Spot spot = node.spot;
  if (!find_corner(spot, {site[p[0]], site[p[1]], site[p[2]]}, regions.spacing(), walk)) return;
  // Not if a fourth particle is nearer: then the cells meet otherwise than the mesh could tell.
  const Index nearest = regions.nearest(spot.x, p[0]);
  if (nearest == Regions::kNone) return;
  if ((spot.x - site[nearest]).norm() < (spot.x - site[p[0]]).norm() - 0.01 * regions.spacing()) return;
  node.spot = spot;
  node.settled = true;
}

/// Where four cells nearly meet the mesh's vertices may have it that the wrong two of them touch: turns such short borders by a quarter, when
/// from where three of the cells meet the fourth is nearer than they are.
class Turning {
 public:
  Turning(std::vector<Node>& nodes, std::vector<Chain>& chains, std::vector<Crossing>& crossings, const Cells& cells, const Regions& regions, std::span<const Vec3> site,
          const SurfaceWalk& walk)
      : nodes_(nodes), chains_(chains), crossings_(crossings), cells_(cells), regions_(regions), site_(site), walk_(walk), at_(nodes.size(), {kNone, kNone, kNone}), sides_(cells.size(), 0) {
    for (Index c = 0; c < chains.size(); ++c) {
      if (chains[c].from == kNone) continue;
      for (const Index n : {chains[c].from, chains[c].to}) *std::find(at_[n].begin(), at_[n].end() - 1, kNone) = c;
      for (const Index cell : {chains[c].left, chains[c].right}) ++sides_[cell];
    }
  }
  void turn_all() {
    std::vector<std::pair<Real, Index>> order;
    for (Index c = 0; c < chains_.size(); ++c) {
      const Chain& chain = chains_[c];
      if (chain.from == kNone || (nodes_[chain.from].settled && nodes_[chain.to].settled)) continue;
      const Real far = (nodes_[chain.from].spot.x - nodes_[chain.to].spot.x).norm();
      if (far < kTurnable * regions_.spacing()) order.emplace_back(far, c);
    }
    std::sort(order.begin(), order.end());
    for (const auto& [far, c] : order) turn(c);
  }

 private:
  static Index third(const Node& node, Index a, Index b) {
    for (const Index c : node.cells)
      if (c != a && c != b) return c;
    return kNone;
  }
  const Vec3& particle(Index cell) const { return site_[cells_.particle[cell]]; }
  Index chain_between(Index node, Index a, Index b) const {
    for (const Index c : at_[node])
      if (c != kNone && std::minmax(chains_[c].left, chains_[c].right) == std::minmax(a, b)) return c;
    return kNone;
  }
  Index other_end(Index c, Index node) const { return chains_[c].from == node ? chains_[c].to : chains_[c].from; }
  /// c ends at b from now on instead of a, d at a instead of b.
  void swap_ends(Index c, Index a, Index d, Index b) {
    (chains_[c].from == a ? chains_[c].from : chains_[c].to) = b;
    (chains_[d].from == b ? chains_[d].from : chains_[d].to) = a;
    *std::find(at_[a].begin(), at_[a].end(), c) = d;
    *std::find(at_[b].begin(), at_[b].end(), d) = c;
  }

  void turn(Index c) {
    Chain& chain = chains_[c];
    const Index a = chain.from, b = chain.to, L = chain.left, R = chain.right;
    const Index X = third(nodes_[a], L, R), Y = third(nodes_[b], L, R);
    if (a == b || X == kNone || Y == kNone || (nodes_[a].settled && nodes_[b].settled)) return;
    const std::array<Index, 4> own = {cells_.particle[L], cells_.particle[R], cells_.particle[X], cells_.particle[Y]};
    for (std::size_t i = 0; i < 4; ++i)
      for (std::size_t k = 0; k < i; ++k)
        if (own[i] == own[k]) return;
    // A fan keeps three triangles.
    if (sides_[L] <= 3 || sides_[R] <= 3) return;
    const Index LX = chain_between(a, L, X), RX = chain_between(a, R, X), LY = chain_between(b, L, Y), RY = chain_between(b, R, Y);
    if (LX == kNone || RX == kNone || LY == kNone || RY == kNone) return;
    if (other_end(LX, a) == other_end(LY, b) || other_end(RX, a) == other_end(RY, b) || other_end(LX, a) == b ||
        other_end(RX, a) == b)
      return;

    // Both new corners must be nobody else's.
    Node left = nodes_[a], right = nodes_[b];
    const Vec3 middle = (left.spot.x + right.spot.x) / 2;
    left.spot = right.spot = walk_.nearest(middle, left.spot.triangle);
    left.cells = {X, Y, L};
    right.cells = {X, Y, R};
    left.settled = right.settled = false;
    settle(left, cells_, regions_, site_, walk_);
    settle(right, cells_, regions_, site_, walk_);
    if (!left.settled || !right.settled) return;
    nodes_[a] = left;
    nodes_[b] = right;
    swap_ends(RX, a, LY, b);
    --sides_[L], --sides_[R], ++sides_[X], ++sides_[Y];
    // From the corner on the left to that on the right.
    chain.left = Y;
    chain.right = X;
    chain.begin = static_cast<Index>(crossings_.size());
    crossings_.push_back({(left.spot.x + right.spot.x) / 2, left.spot.triangle});
    chain.end = chain.begin + 1;
  }

  std::vector<Node>& nodes_;
  std::vector<Chain>& chains_;
  std::vector<Crossing>& crossings_;
  const Cells& cells_;
  const Regions& regions_;
  std::span<const Vec3> site_;
  const SurfaceWalk& walk_;
  std::vector<std::array<Index, 3>> at_;  // chains that end at a node
  std::vector<int> sides_;                // of each cell
};

/// The nodes from `first` on, on their lines.
void take_onto(const ParticleSurface& particles, const SurfaceWalk& walk, std::vector<Node>& nodes, std::size_t first, std::span<const Line> lines) {
  const std::size_t n = nodes.size() - first;
  std::vector<Spot> spots(n);
  std::vector<Vec3> up(n);
  for (std::size_t i = 0; i < n; ++i) {
    spots[i] = nodes[first + i].spot;
    up[i] = nodes[first + i].up;
  }
  take_onto(particles, walk, spots, up, lines);
  for (std::size_t i = 0; i < n; ++i) {
    nodes[first + i].spot = spots[i];
    nodes[first + i].up = up[i];
  }
}

}  // namespace

Borders trace_borders(const LabelledMesh& mesh, const Cells& cells, const Regions& regions, std::span<const Vec3> site,
                      const SurfaceWalk& walk, const ParticleSurface* particles) {
  ZONE("skin.borders");
  Tracer tracer(mesh, cells, site);
  tracer.trace();
  Borders result;
  result.nodes = std::move(tracer.nodes);
  parallel_for(
      result.nodes.size(),
      [&](std::size_t n) {
        settle(result.nodes[n], cells, regions, site, walk);
        result.nodes[n].up = walk.normal(result.nodes[n].spot);
      },
      64);
  const std::size_t corners = result.nodes.size();
  std::vector<Line> lines(corners);  // of nodes
  if (particles) {
    Turning(result.nodes, tracer.chains, tracer.crossings, cells, regions, site, walk).turn_all();
    for (std::size_t n = 0; n < corners; ++n) {
      result.nodes[n].up = walk.normal(result.nodes[n].spot);
      const Node& node = result.nodes[n];
      const auto at = [&](std::size_t k) -> const Vec3& { return site[cells.particle[node.cells[k]]]; };
      if (node.settled) lines[n] = line_between(at(0), at(1), at(2), node.up);
    }
    take_onto(*particles, walk, result.nodes, 0, lines);
  }
  lines.clear();

  // Chains with the same two ends.
  const std::vector<Chain>& chains = tracer.chains;
  std::vector<std::pair<std::uint64_t, Index>> ends;
  for (Index c = 0; c < chains.size(); ++c) {
    if (chains[c].from == kNone) continue;
    const auto [low, high] = std::minmax(chains[c].from, chains[c].to);
    ends.emplace_back(std::uint64_t{low} << 32 | high, c);
  }
  std::sort(ends.begin(), ends.end());
  std::vector<std::uint8_t> twin(chains.size(), 0);
  for (std::size_t e = 1; e < ends.size(); ++e)
    if (ends[e].first == ends[e - 1].first) twin[ends[e].second] = twin[ends[e - 1].second] = 1;

  const auto turned = [&](const Chain& chain) {
    return result.nodes[chain.from].up.dot(result.nodes[chain.to].up) < kTurned;
  };

  // Then its way is known, too, better than by edges crossed in zigzag: it lies in the plane between the two particles.
  const auto exact = [&](const Chain& chain) { return particles && result.nodes[chain.from].settled && result.nodes[chain.to].settled; };

  std::vector<Real> along;
  for (Index c = 0; c < chains.size(); ++c) {
    const Chain& chain = chains[c];
    const std::span<const Crossing> way = std::span(tracer.crossings).subspan(chain.begin, chain.end - chain.begin);
    const bool closed = chain.from == kNone;
    if (closed) CHECK_GE(way.size(), 3u);
    // Lengths from the beginning to each crossing.
    along.clear();
    Vec3 last = closed ? way[0].x : result.nodes[chain.from].spot.x;
    Real length = 0;
    for (const Crossing& crossing : way) {
      along.push_back(length += (crossing.x - last).norm());
      last = crossing.x;
    }
    const Vec3 end = closed ? way[0].x : result.nodes[chain.to].spot.x;
    length += (end - last).norm();

    std::size_t added = 0;
    if (closed)
      added = 3;
    else if (const Real straight = (end - result.nodes[chain.from].spot.x).norm();
             twin[c] || (!exact(chain) && length > kBent * straight && length > 0.3 * regions.spacing()) || turned(chain))
      added = 1;

    Index from = chain.from;
    std::size_t next = 0;
    Index first = kNone;
    for (std::size_t k = 0; k < added; ++k) {
      // The crossing nearest the k-th part of the way that leaves enough for the rest.
      const Real wanted = length * (closed ? static_cast<Real>(k) / 3 : 0.5);
      std::size_t at = next;
      while (at + (added - k) < way.size() && std::abs(along[at + 1] - wanted) < std::abs(along[at] - wanted)) ++at;
      next = at + 1;
      const auto node = static_cast<Index>(result.nodes.size());
      const Spot spot = walk.nearest(way[at].x, way[at].triangle);
      result.nodes.push_back({spot, walk.normal(spot), false, {chain.left, chain.right, kNone}});
      // Half way between its ends, if they are as far from both particles.
      const Vec3 &left = site[cells.particle[chain.left]], &right = site[cells.particle[chain.right]];
      lines.push_back(closed || left == right ? Line{} : line_between(left, right, result.nodes[chain.from].spot.x, end, result.nodes.back().up));
      if (from != kNone) result.borders.push_back({from, node, chain.left, chain.right});
      if (first == kNone) first = node;
      from = node;
    }
    result.borders.push_back({from, closed ? first : chain.to, chain.left, chain.right});
  }
  if (particles) take_onto(*particles, walk, result.nodes, corners, lines);
  return result;
}

}  // namespace effuse::skin
