#include "skin/tessellate/cells.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <numeric>
#include <queue>

#include "geometry/base/check.h"
#include "geometry/base/parallel.h"
#include "geometry/base/zones.h"
#include "skin/tessellate/half_edges.h"

namespace effuse::skin {

namespace {

using geometry::Triangle;

constexpr Real kRoundArea = 0.6;  // [spacings^2] of each part of a bent piece
constexpr Real kFlatArea = 1.2;   // of a large flat one
constexpr int kShapeRounds = 3;   // in which size and bend count; after them only discs do

/// Sets of vertices; the smallest of each stands for it.
class Sets {
 public:
  explicit Sets(std::size_t n) : root_(n) { std::iota(root_.begin(), root_.end(), Index{0}); }
  /// Alone again; all of a set together.
  void reset(Index v) { root_[v] = v; }
  Index find(Index v) {
    while (root_[v] != v) v = root_[v] = root_[root_[v]];
    return v;
  }
  void join(Index a, Index b) {
    a = find(a);
    b = find(b);
    root_[std::max(a, b)] = std::min(a, b);
  }

 private:
  std::vector<Index> root_;
};

/// Vertices that no particle reaches take a label from next door, ring by ring; pieces where nobody has one are left out.
void claim(LabelledMesh& mesh) {
  const auto unclaimed = static_cast<std::size_t>(std::count(mesh.label.begin(), mesh.label.end(), kNone));
  if (unclaimed == 0) return;
  for (bool grown = true; grown;) {
    grown = false;
    const std::vector<Index> before = mesh.label;
    for (const Triangle& t : mesh.triangles)
      for (std::size_t k = 0; k < 3; ++k)
        for (const Index b : {t[(k + 1) % 3], t[(k + 2) % 3]}) {
          if (before[t[k]] != kNone || before[b] == kNone) continue;
          mesh.label[t[k]] = std::min(mesh.label[t[k]], before[b]);
          grown = true;
        }
  }
  // What is left has no label anywhere.
  Sets pieces(mesh.x.size());
  std::vector<std::uint8_t> left_out(mesh.x.size(), 0);
  std::size_t kept = 0;
  for (std::size_t t = 0; t < mesh.triangles.size(); ++t) {
    const Triangle corner = mesh.triangles[t];
    if (mesh.label[corner[0]] == kNone) {
      for (const Index v : corner) {
        pieces.join(corner[0], v);
        left_out[v] = 1;
      }
      continue;
    }
    mesh.triangles[kept] = corner;
    mesh.parent[kept++] = mesh.parent[t];
  }
  mesh.triangles.resize(kept);
  mesh.parent.resize(kept);
  mesh.unclaimed = unclaimed;
  for (std::size_t v = 0; v < left_out.size(); ++v) {
    mesh.unclaimed -= left_out[v];
    mesh.dropped_pieces += left_out[v] && pieces.find(static_cast<Index>(v)) == v;
  }
}

/// Cuts the edges of every triangle of three labels in half, and their other triangles with them.
void refine_corners(LabelledMesh& mesh, std::span<const Vec3> site) {
  const auto start = [&](Index h) { return mesh.triangles[h / 3][h % 3]; };
  const auto three = [&](Index t) {
    const Triangle& c = mesh.triangles[t];
    return mesh.label[c[0]] != mesh.label[c[1]] && mesh.label[c[1]] != mesh.label[c[2]] && mesh.label[c[2]] != mesh.label[c[0]];
  };
  const Edges edges =
      number_edges(mesh.triangles, mesh.x.size(), [&](Index h) { return mesh.label[start(h)] != mesh.label[start(turn(h, 1))]; });
  std::vector<Index> chosen, middle(edges.halves.size(), kNone);
  for (Index e = 0; e < edges.halves.size(); ++e) {
    if (!three(edges.halves[e][0] / 3) && !three(edges.halves[e][1] / 3)) continue;
    middle[e] = static_cast<Index>(mesh.x.size() + chosen.size());
    chosen.push_back(e);
  }
  const std::size_t old = mesh.x.size();
  CHECK_LT(old + chosen.size(), std::size_t{kNone});
  mesh.x.resize(old + chosen.size());
  mesh.label.resize(old + chosen.size());
  parallel_for(chosen.size(), [&](std::size_t n) {
    const auto [h, other] = edges.halves[chosen[n]];
    const Index a = start(h), b = start(other);
    const Vec3 x = (mesh.x[a] + mesh.x[b]) / 2;
    Index best = kNone;
    Real least = std::numeric_limits<Real>::infinity();
    for (const Index i : {mesh.label[a], mesh.label[b], mesh.label[start(turn(h, 2))], mesh.label[start(turn(other, 2))]}) {
      const Real d = (x - site[i]).squaredNorm();
      if (d > least || (d == least && i >= best)) continue;
      least = d;
      best = i;
    }
    mesh.x[old + n] = x;
    mesh.label[old + n] = best;
  });

  // The first part of a cut triangle takes its place, the others come behind all.
  const std::size_t before = mesh.triangles.size();
  for (std::size_t t = 0; t < before; ++t) {
    const Triangle c = mesh.triangles[t];
    std::array<Index, 3> cut;  // middles of the sides, from corner k to k + 1
    std::size_t cuts = 0;
    for (std::size_t k = 0; k < 3; ++k) {
      const Index e = edges.of[3 * t + k];
      cut[k] = e == kNone ? kNone : middle[e];
      cuts += cut[k] != kNone;
    }
    if (cuts == 0) continue;
    const auto add = [&](Index i, Index j, Index k) {
      mesh.triangles.push_back({i, j, k});
      mesh.parent.push_back(Index{mesh.parent[t]});
    };
    if (cuts == 3) {
      for (std::size_t k = 0; k < 3; ++k) add(c[k], cut[k], cut[(k + 2) % 3]);
      mesh.triangles[t] = {cut[0], cut[1], cut[2]};
      continue;
    }
    // One side is cut, that from corner k; or two, those at corner k: a corner, and a quad along its shorter diagonal.
    std::size_t k = 0;
    while (cut[k] == kNone || (cuts == 2 && cut[(k + 2) % 3] == kNone)) ++k;
    const Index p = cut[k], q = c[(k + 1) % 3], r = c[(k + 2) % 3], s = cut[(k + 2) % 3];
    if (cuts == 1) {
      mesh.triangles[t] = {c[k], p, r};
      add(p, q, r);
      continue;
    }
    mesh.triangles[t] = {c[k], p, s};
    if ((mesh.x[p] - mesh.x[r]).squaredNorm() < (mesh.x[q] - mesh.x[s]).squaredNorm()) {
      add(p, q, r);
      add(p, r, s);
    } else {
      add(p, q, s);
      add(q, r, s);
    }
  }
}

/// What decides about a piece.
struct Piece {
  std::ptrdiff_t vertices = 0, half_edges = 0, triangles = 0;  // no vertices: taken apart
  Real area = 0;
  Vec3 normal = Vec3::Zero();  // area vectors summed
  Index particle = kNone, label = kNone;
  Index near = kNone;
  Real least = std::numeric_limits<Real>::infinity();  // squared distance of near to the particle

  std::ptrdiff_t euler() const { return vertices - half_edges / 2 + triangles; }
};

/// Vertices of one label that hang together. Pieces whose labels change are taken apart and grouped again, the others stay.
class Pieces {
 public:
  Pieces(const LabelledMesh& mesh, std::span<const Vec3> site) : mesh_(mesh), site_(site), of_(mesh.x.size(), kNone), sets_(mesh.x.size()) {
    std::vector<Index> vertices;
    vertices.reserve(mesh.x.size());
    for (Index v = 0; v < mesh.x.size(); ++v)
      if (mesh.label[v] != kNone) vertices.push_back(v);
    std::vector<Index> triangles(mesh.triangles.size());
    std::iota(triangles.begin(), triangles.end(), Index{0});
    group(vertices, triangles);
  }

  std::size_t size() const { return pieces_.size(); }
  const Piece& operator[](Index c) const { return pieces_[c]; }
  const std::vector<Index>& of() const { return of_; }

  /// After labels in the pieces marked 1 have changed.
  void regroup(const std::vector<std::uint8_t>& changed) {
    const auto ours = [&](Index v) { return of_[v] != kNone && changed[of_[v]]; };
    std::vector<Index> vertices, triangles;
    for (Index v = 0; v < of_.size(); ++v)
      if (ours(v)) vertices.push_back(v);
    for (Index t = 0; t < mesh_.triangles.size(); ++t) {
      const Triangle& c = mesh_.triangles[t];
      if (ours(c[0]) || ours(c[1]) || ours(c[2])) triangles.push_back(t);
    }
    for (Index c = 0; c < changed.size(); ++c)
      if (changed[c]) pieces_[c] = Piece{};
    for (const Index v : vertices) sets_.reset(v);
    group(vertices, triangles);
  }

 private:
  /// Makes pieces, numbered by their first ones, of vertices that are sets of their own. triangles: all that have one of them.
  void group(const std::vector<Index>& vertices, const std::vector<Index>& triangles) {
    for (const Index number : triangles) {
      const Triangle& t = mesh_.triangles[number];
      for (std::size_t k = 0; k < 3; ++k)
        // Each edge once: the other of its triangles runs it backwards.
        if (t[k] < t[(k + 1) % 3] && mesh_.label[t[k]] == mesh_.label[t[(k + 1) % 3]]) sets_.join(t[k], t[(k + 1) % 3]);
    }
    const auto old = static_cast<Index>(pieces_.size());
    for (const Index v : vertices) {
      const Index root = sets_.find(v);
      if (root == v) {
        of_[v] = static_cast<Index>(pieces_.size());
        Piece& piece = pieces_.emplace_back();
        piece.label = mesh_.label[v];
        piece.particle = mesh_.particle[piece.label];
      }
      of_[v] = of_[root];
      Piece& piece = pieces_[of_[v]];
      ++piece.vertices;
      const Real d = (mesh_.x[v] - site_[piece.particle]).squaredNorm();
      if (d >= piece.least) continue;
      piece.least = d;
      piece.near = v;
    }
    for (const Index number : triangles) {
      const Triangle& t = mesh_.triangles[number];
      const std::array<Index, 3> c = {of_[t[0]], of_[t[1]], of_[t[2]]};
      // Each corner's piece has a third of the triangle.
      const Vec3 n = (mesh_.x[t[1]] - mesh_.x[t[0]]).cross(mesh_.x[t[2]] - mesh_.x[t[0]]) / 6;
      const Real area = n.norm();
      for (std::size_t k = 0; k < 3; ++k) {
        if (c[k] < old) continue;
        Piece& piece = pieces_[c[k]];
        piece.area += area;
        piece.normal += n;
        piece.half_edges += c[k] == c[(k + 1) % 3];
      }
      if (c[0] >= old && c[0] == c[1] && c[1] == c[2]) ++pieces_[c[0]].triangles;
    }
  }

  const LabelledMesh& mesh_;
  std::span<const Vec3> site_;
  std::vector<Index> of_;
  std::vector<Piece> pieces_;
  Sets sets_;
};

/// Gives small pieces, unless they are their particle's largest, to the piece with which they share most of their border.
std::size_t dissolve_islands(LabelledMesh& mesh, Pieces& pieces, std::size_t particles, Real smallest) {
  std::vector<Index> largest(particles, kNone);
  for (Index c = 0; c < pieces.size(); ++c) {
    if (pieces[c].vertices == 0) continue;
    Index& best = largest[pieces[c].particle];
    if (best == kNone || pieces[c].area > pieces[best].area) best = c;
  }
  std::vector<std::uint8_t> island(pieces.size(), 0);
  bool any = false;
  for (Index c = 0; c < pieces.size(); ++c) {
    if (pieces[c].vertices == 0 || pieces[c].area >= smallest || largest[pieces[c].particle] == c) continue;
    island[c] = 1;
    any = true;
  }
  if (!any) return 0;

  // How many sides each island has with whom that stays.
  std::vector<std::pair<Index, Index>> sides;
  for (const Triangle& t : mesh.triangles)
    for (std::size_t k = 0; k < 3; ++k) {
      const Index a = pieces.of()[t[k]], b = pieces.of()[t[(k + 1) % 3]];
      if (a != b && island[a] && !island[b]) sides.emplace_back(a, b);
    }
  std::sort(sides.begin(), sides.end());
  std::vector<Index> to(pieces.size(), kNone);
  std::vector<std::uint8_t> changed(pieces.size(), 0);
  std::size_t given = 0;
  for (std::size_t from = 0; from < sides.size(); ++given) {
    std::size_t most = 0;
    const Index a = sides[from].first;
    while (from < sides.size() && sides[from].first == a) {
      std::size_t end = from;
      while (end < sides.size() && sides[end] == sides[from]) ++end;
      if (end - from > most) {
        most = end - from;
        to[a] = sides[from].second;
      }
      from = end;
    }
    changed[a] = 1;
  }
  if (given == 0) return 0;
  for (Index v = 0; v < mesh.x.size(); ++v)
    if (const Index c = pieces.of()[v]; c != kNone && to[c] != kNone) mesh.label[v] = pieces[to[c]].label;
  // An island may have been what kept two pieces of one label apart.
  for (const Triangle& t : mesh.triangles)
    for (std::size_t k = 0; k < 3; ++k) {
      const Index a = t[k], b = t[(k + 1) % 3], piece_a = pieces.of()[a], piece_b = pieces.of()[b];
      if (piece_a != piece_b && mesh.label[a] == mesh.label[b]) changed[piece_a] = changed[piece_b] = 1;
    }
  pieces.regroup(changed);
  return given;
}

/// Into how many parts a piece is to be cut; 1: it may stay.
std::size_t parts_wanted(const Piece& piece, Real spacing, const VoronoiOptions& options, int round) {
  if (piece.vertices == 0) return 1;
  const bool disc = piece.euler() == 1;
  if (disc && round >= kShapeRounds) return 1;
  const Real area = piece.area / (spacing * spacing);
  const bool bent = piece.normal.norm()<options.flattest * piece.area, large = area> options.largest_fan;
  if (disc && !bent && !large) return 1;
  Real parts = disc ? 2 : 3;
  if (round < kShapeRounds) parts = std::max(parts, std::ceil(area / (bent ? kRoundArea : kFlatArea)));
  // Where that was not enough, twice as many each time: in the end single vertices, which are discs.
  parts = std::ldexp(parts, std::max(0, round - kShapeRounds));
  return static_cast<std::size_t>(std::min(parts, static_cast<Real>(piece.vertices)));
}

/// The graph of the vertices of the pieces to be cut.
struct Graph {
  std::vector<Index> begin, members;  // of piece w: members[begin[w]] ..
  std::vector<Index> first, next;     // neighbours, in members' order of numbers
  std::vector<Index> number;          // of a vertex among members; kNone
};

/// Cuts a piece round seeds as far from each other as can be, moved to the middles of their parts twice.
/// step: a length added to each edge, so that vertices at one place can part. part: out, for the members.
void cut_piece(const LabelledMesh& mesh, const Graph& graph, std::size_t w, Index start, std::size_t parts, Real step,
               std::span<Index> part) {
  const Index from = graph.begin[w], to = graph.begin[w + 1];
  const std::span<const Index> member = std::span(graph.members).subspan(from, to - from);
  std::vector<Real> distance(member.size());
  std::vector<Index> seeds{graph.number[start] - from};
  using Entry = std::pair<Real, Index>;
  std::priority_queue<Entry, std::vector<Entry>, std::greater<>> queue;
  // Distances along edges from one more seed.
  const auto spread = [&](Index seed, Index name) {
    distance[seed] = 0;
    part[seed] = name;
    queue.emplace(0, seed);
    while (!queue.empty()) {
      const auto [d, m] = queue.top();
      queue.pop();
      if (d > distance[m] || part[m] != name) continue;
      for (Index k = graph.first[from + m]; k < graph.first[from + m + 1]; ++k) {
        const Index other = graph.next[k] - from;
        const Real there = d + step + (mesh.x[member[m]] - mesh.x[member[other]]).norm();
        if (there >= distance[other]) continue;
        distance[other] = there;
        part[other] = name;
        queue.emplace(there, other);
      }
    }
  };
  for (int round = 0; round < 3; ++round) {
    std::fill(distance.begin(), distance.end(), std::numeric_limits<Real>::infinity());
    for (Index s = 0; s < seeds.size(); ++s) spread(seeds[s], s);
    while (seeds.size() < parts) {
      const auto farthest = std::max_element(distance.begin(), distance.end());
      seeds.push_back(static_cast<Index>(farthest - distance.begin()));
      spread(seeds.back(), static_cast<Index>(seeds.size() - 1));
    }
    if (round == 2) break;
    std::vector<Vec3> middle(seeds.size(), Vec3::Zero());
    std::vector<Real> count(seeds.size(), 0), least(seeds.size(), std::numeric_limits<Real>::infinity());
    for (std::size_t m = 0; m < member.size(); ++m) {
      middle[part[m]] += mesh.x[member[m]];
      count[part[m]] += 1;
    }
    for (std::size_t m = 0; m < member.size(); ++m) {
      const Real d = (mesh.x[member[m]] - middle[part[m]] / count[part[m]]).squaredNorm();
      if (d >= least[part[m]]) continue;
      least[part[m]] = d;
      seeds[part[m]] = static_cast<Index>(m);
    }
  }
}

/// New labels for the parts of every piece that wants some. Returns how many pieces were cut.
std::size_t cut_pieces(LabelledMesh& mesh, Pieces& pieces, Real spacing, const VoronoiOptions& options, int round) {
  std::vector<Index> work(pieces.size(), kNone), list;
  std::vector<std::size_t> parts;
  for (Index c = 0; c < pieces.size(); ++c) {
    const std::size_t wanted = parts_wanted(pieces[c], spacing, options, round);
    if (wanted <= 1) continue;
    work[c] = static_cast<Index>(list.size());
    list.push_back(c);
    parts.push_back(wanted);
  }
  if (list.empty()) return 0;

  const std::vector<Index>& of = pieces.of();
  Graph graph;
  graph.begin.assign(1, 0);
  for (const Index c : list) graph.begin.push_back(graph.begin.back() + static_cast<Index>(pieces[c].vertices));
  graph.members.resize(graph.begin.back());
  graph.number.assign(mesh.x.size(), kNone);
  std::vector<Index> filled(graph.begin.begin(), graph.begin.end() - 1);
  for (Index v = 0; v < mesh.x.size(); ++v) {
    if (of[v] == kNone || work[of[v]] == kNone) continue;
    graph.number[v] = filled[work[of[v]]]++;
    graph.members[graph.number[v]] = v;
  }
  std::vector<std::pair<Index, Index>> edges;
  for (const Triangle& t : mesh.triangles)
    for (std::size_t k = 0; k < 3; ++k) {
      const Index a = t[k], b = t[(k + 1) % 3];
      if (graph.number[a] != kNone && of[a] == of[b]) edges.emplace_back(graph.number[a], graph.number[b]);
    }
  graph.first.assign(graph.members.size() + 1, 0);
  for (const auto& [a, b] : edges) ++graph.first[a + 1];
  std::partial_sum(graph.first.begin(), graph.first.end(), graph.first.begin());
  graph.next.resize(edges.size());
  std::vector<Index> at(graph.first.begin(), graph.first.end() - 1);
  for (const auto& [a, b] : edges) graph.next[at[a]++] = b;

  std::vector<Index> part(graph.members.size(), 0);
  parallel_for(
      list.size(),
      [&](std::size_t w) {
        cut_piece(mesh, graph, w, pieces[list[w]].near, parts[w], 1e-6 * spacing,
                  std::span(part).subspan(graph.begin[w], graph.begin[w + 1] - graph.begin[w]));
      },
      8);
  std::vector<std::uint8_t> changed(pieces.size(), 0);
  for (std::size_t w = 0; w < list.size(); ++w) {
    const auto base = static_cast<Index>(mesh.particle.size());
    mesh.particle.resize(base + parts[w], pieces[list[w]].particle);
    for (Index m = graph.begin[w]; m < graph.begin[w + 1]; ++m) mesh.label[graph.members[m]] = base + part[m];
    changed[list[w]] = 1;
  }
  pieces.regroup(changed);
  return list.size();
}

}  // namespace

LabelledMesh label_surface(const geometry::TriMesh& surface, const Regions& regions, std::span<const Vec3> site, int refinement) {
  ZONE("skin.label");
  LabelledMesh mesh;
  mesh.x = surface.positions;
  mesh.triangles = surface.triangles;
  mesh.parent.resize(mesh.triangles.size());
  std::iota(mesh.parent.begin(), mesh.parent.end(), Index{0});
  mesh.label.assign(mesh.x.size(), kNone);
  std::vector<std::uint8_t> used(mesh.x.size(), 0);
  for (const Triangle& t : mesh.triangles)
    for (const Index v : t) used[v] = 1;
  // Vertices come in an order in which the next is near the last.
  parallel_ranges(mesh.x.size(), 256, [&](std::size_t begin, std::size_t end) {
    Index last = kNone;
    for (std::size_t v = begin; v < end; ++v)
      if (used[v]) mesh.label[v] = last = regions.nearest(mesh.x[v], last);
  });
  claim(mesh);
  mesh.particle.resize(site.size());
  std::iota(mesh.particle.begin(), mesh.particle.end(), Index{0});
  for (int level = 0; level < refinement; ++level) refine_corners(mesh, site);
  return mesh;
}

Cells cut_into_discs(LabelledMesh& mesh, std::span<const Vec3> site, Real spacing, const VoronoiOptions& options) {
  ZONE("skin.discs");
  Cells cells;
  Pieces pieces(mesh, site);
  // Islands among islands wait for their neighbours.
  while (const std::size_t given = dissolve_islands(mesh, pieces, site.size(), options.island * spacing * spacing)) cells.islands += given;
  for (int round = 0; cut_pieces(mesh, pieces, spacing, options, round) > 0;) ++round;

  std::vector<Index> number(pieces.size(), kNone);
  for (Index c = 0; c < pieces.size(); ++c) {
    const Piece& piece = pieces[c];
    if (piece.vertices == 0) continue;
    CHECK_EQ(piece.euler(), 1);
    number[c] = static_cast<Index>(cells.size());
    cells.particle.push_back(piece.particle);
    cells.near.push_back(piece.near);
    cells.whole.push_back(piece.label < site.size());
  }
  cells.of.resize(mesh.x.size());
  for (std::size_t v = 0; v < mesh.x.size(); ++v) cells.of[v] = pieces.of()[v] == kNone ? kNone : number[pieces.of()[v]];
  return cells;
}

}  // namespace effuse::skin
