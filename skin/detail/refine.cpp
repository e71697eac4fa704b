#include "skin/detail/refine.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <numeric>
#include <tuple>
#include <utility>
#include <vector>

#include "geometry/base/check.h"
#include "geometry/base/parallel.h"
#include "geometry/base/zones.h"
#include "geometry/mesh/measure.h"
#include "skin/detail/smooth_surface.h"
#include "skin/surface/key_table.h"

namespace effuse::skin {

namespace {

using geometry::TriMesh;

constexpr int kSpareRounds = 4;

struct Edge {
  Index high, corner;  // larger end; 3 * triangle + corner it starts at
};

/// Edges that are to be cut, each once, by rising ends; and for each corner of each triangle which of them starts there, or kNone.
struct Cuts {
  std::vector<std::array<Index, 2>> edges;
  std::vector<Index> at_corner;
};

template <class Wanted>
Cuts find_cuts(const TriMesh& mesh, const Wanted& wanted) {
  const std::size_t n = mesh.positions.size(), m = mesh.triangles.size();
  CHECK_LT(n + 3 * m, std::size_t{1} << 32);
  const auto ends = [&](std::size_t corner) {
    const Index a = mesh.triangles[corner / 3][corner % 3], b = mesh.triangles[corner / 3][(corner % 3 + 1) % 3];
    return std::pair{std::min(a, b), std::max(a, b)};
  };
  // The smaller end first, so that both triangles ask the same question.
  std::vector<std::uint8_t> cut(3 * m);
  parallel_for(3 * m, [&](std::size_t c) {
    const auto [low, high] = ends(c);
    cut[c] = wanted(low, high);
  });

  // Corners by their edge's smaller end, then the larger: each run of equals is one edge.
  std::vector<Index> begin(n + 1, 0);
  for (std::size_t c = 0; c < 3 * m; ++c)
    if (cut[c]) ++begin[ends(c).first + 1];
  std::partial_sum(begin.begin(), begin.end(), begin.begin());
  std::vector<Edge> edges(begin.back());
  std::vector<Index> filled(begin.begin(), begin.end() - 1);
  for (std::size_t c = 0; c < 3 * m; ++c) {
    if (!cut[c]) continue;
    const auto [low, high] = ends(c);
    edges[filled[low]++] = {high, static_cast<Index>(c)};
  }
  parallel_for(n, [&](std::size_t v) {
    std::sort(edges.begin() + begin[v], edges.begin() + begin[v + 1],
              [](const Edge& a, const Edge& b) { return std::tie(a.high, a.corner) < std::tie(b.high, b.corner); });
  });
  Cuts cuts;
  cuts.at_corner.assign(3 * m, kNone);
  for (std::size_t v = 0; v < n; ++v)
    for (Index e = begin[v]; e < begin[v + 1]; ++e) {
      if (e == begin[v] || edges[e].high != edges[e - 1].high) cuts.edges.push_back({static_cast<Index>(v), edges[e].high});
      cuts.at_corner[edges[e].corner] = static_cast<Index>(cuts.edges.size() - 1);
    }
  return cuts;
}

/// One new vertex on each cut edge: in its middle, or on the curve at right angles to the normals at its ends.
void add_vertices(TriMesh& mesh, const Cuts& cuts, bool curved) {
  const std::size_t n = mesh.positions.size(), more = cuts.edges.size();
  mesh.positions.resize(n + more);
  const bool normals = !mesh.normals.empty();
  if (normals) mesh.normals.resize(n + more);
  parallel_for(more, [&](std::size_t i) {
    const auto& [a, b] = cuts.edges[i];
    const Vec3 &p = mesh.positions[a], &q = mesh.positions[b], along = q - p;
    Vec3& x = mesh.positions[n + i];
    x = (p + q) / 2;
    if (!normals) return;
    const Vec3 &np = mesh.normals[a], &nq = mesh.normals[b];
    Vec3 sum = np + nq;
    if (curved && np.dot(nq) > 0) {
      // Hermite's cubic with the ends' tangents  along - (along . n) n:  its middle, and its direction there.
      const Vec3 rise_p = along.dot(np) * np, rise_q = along.dot(nq) * nq;
      x += (rise_q - rise_p) / 8;
      const Vec3 direction = along + (rise_p + rise_q) / 4;
      sum -= sum.dot(direction) / direction.squaredNorm() * direction;
    }
    mesh.normals[n + i] = sum.norm() > 1e-9 ? Vec3(sum.normalized()) : np;
  });
  for (auto& [name, attribute] : mesh.attributes) {
    const std::size_t width = static_cast<std::size_t>(attribute.width);
    std::vector<float>& values = attribute.values;
    values.resize((n + more) * width);
    parallel_for(more, [&](std::size_t i) {
      const auto& [a, b] = cuts.edges[i];
      for (std::size_t k = 0; k < width; ++k) values[(n + i) * width + k] = (values[a * width + k] + values[b * width + k]) / 2;
    });
  }
}

/// Triangles of one, two or three cut edges become two, three or four; first: index of the cuts' first vertex.
void cut_triangles(TriMesh& mesh, std::vector<Index>& parent, const Cuts& cuts, Index first) {
  const std::size_t m = mesh.triangles.size();
  std::vector<std::size_t> begin(m + 1, 0);
  for (std::size_t t = 0; t < m; ++t) {
    begin[t + 1] = begin[t] + 1;
    for (int k = 0; k < 3; ++k) begin[t + 1] += cuts.at_corner[3 * t + static_cast<std::size_t>(k)] != kNone;
  }
  std::vector<geometry::Triangle> fine(begin[m]);
  std::vector<Index> fine_parent(begin[m]);
  const auto& x = mesh.positions;
  parallel_for(m, [&](std::size_t t) {
    geometry::Triangle* to = &fine[begin[t]];
    std::fill(fine_parent.begin() + static_cast<std::ptrdiff_t>(begin[t]), fine_parent.begin() + static_cast<std::ptrdiff_t>(begin[t + 1]), parent[t]);
    const geometry::Triangle& v = mesh.triangles[t];
    const Index* cut = &cuts.at_corner[3 * t];
    const auto middle = [&](std::size_t k) { return first + cut[k]; };
    switch (begin[t + 1] - begin[t]) {
      case 1: to[0] = v; return;
      case 2: {
        std::size_t k = 0;
        while (cut[k] == kNone) ++k;
        const Index a = v[k], b = v[(k + 1) % 3], c = v[(k + 2) % 3];
        to[0] = {a, middle(k), c};
        to[1] = {middle(k), b, c};
        return;
      }
      case 3: {
        // Edges ab and bc are cut, ca is not: the corner at b, and the shorter diagonal of what is left.
        std::size_t k = 0;
        while (cut[(k + 2) % 3] != kNone) ++k;
        const Index a = v[k], b = v[(k + 1) % 3], c = v[(k + 2) % 3], ab = middle(k), bc = middle((k + 1) % 3);
        to[0] = {ab, b, bc};
        const Real from_a = (x[bc] - x[a]).squaredNorm(), from_c = (x[ab] - x[c]).squaredNorm();
        if (from_a < from_c || (from_a == from_c && a < c)) {
          to[1] = {a, ab, bc};
          to[2] = {a, bc, c};
        } else {
          to[1] = {a, ab, c};
          to[2] = {ab, bc, c};
        }
        return;
      }
      default:
        to[0] = {v[0], middle(0), middle(2)};
        to[1] = {middle(0), v[1], middle(1)};
        to[2] = {middle(2), middle(1), v[2]};
        to[3] = {middle(0), middle(1), middle(2)};
    }
  });
  mesh.triangles = std::move(fine);
  parent = std::move(fine_parent);
}

}  // namespace

Real mean_edge(const TriMesh& mesh) {
  if (mesh.triangles.empty()) return 0;
  const Real sum = parallel_sum(mesh.triangles.size(), Real{0}, [&](std::size_t t) {
    const auto& [a, b, c] = mesh.triangles[t];
    const auto& x = mesh.positions;
    return (x[a] - x[b]).norm() + (x[b] - x[c]).norm() + (x[c] - x[a]).norm();
  });
  return sum / (3 * static_cast<Real>(mesh.triangles.size()));
}

TriMesh refine(const TriMesh& mesh) {
  ZONE("skin.refine");
  TriMesh fine = mesh;
  const Cuts cuts = find_cuts(fine, [](Index, Index) { return true; });
  add_vertices(fine, cuts, false);
  std::vector<Index> parent(mesh.triangles.size());
  cut_triangles(fine, parent, cuts, static_cast<Index>(mesh.positions.size()));
  return fine;
}

Real View::edge_at(const Vec3& x) const {
  const Vec3 to = x - eye;
  const Real distance = to.norm(), edge = pixels * pixel_angle * distance;
  if (half_angle >= kPi || !(distance > 0)) return edge;
  const Real angle = std::acos(std::clamp(to.dot(direction) / (distance * direction.norm()), Real{-1}, Real{1}));
  return angle > half_angle ? unseen * edge : edge;
}

RefineToReport refine_to(TriMesh& mesh, const RefineOptions& o) {
  ZONE("skin.refine");
  CHECK_GT(o.edge, 0.0);
  if (o.view) {
    CHECK_GT(o.view->pixel_angle, 0.0);
    CHECK_GT(o.view->pixels, 0.0);
    CHECK_GE(o.view->unseen, 1.0);
    CHECK_GT(o.view->direction.norm(), 0.0);
  }
  if (o.curved && mesh.normals.empty()) geometry::compute_normals(mesh);
  RefineToReport report;
  report.parent.resize(mesh.triangles.size());
  std::iota(report.parent.begin(), report.parent.end(), Index{0});
  // How many times longer than asked for, squared.
  const auto excess = [&](Index low, Index high) {
    const Vec3 &p = mesh.positions[low], &q = mesh.positions[high];
    const Real wanted = o.view ? std::max(o.edge, o.view->edge_at((p + q) / 2)) : o.edge;
    return (q - p).squaredNorm() / (wanted * wanted);
  };
  const auto cuts_now = [&] { return find_cuts(mesh, [&](Index low, Index high) { return excess(low, high) > 1; }); };
  // Every round halves what is cut; a few more for edges that a cut triangle gains, then something else is wrong.
  const Real most = parallel_max(mesh.triangles.size(), 1, [&](std::size_t t) {
    const auto& [a, b, c] = mesh.triangles[t];
    return std::max({excess(a, b), excess(b, c), excess(c, a)});
  });
  const int most_rounds = static_cast<int>(std::ceil(std::log2(std::min(most, 1e12)) / 2)) + kSpareRounds;

  std::optional<SmoothSurface> smooth;
  std::vector<Index> piece;
  if (o.curved) {
    smooth.emplace(mesh);
    piece.assign(smooth->pieces().begin(), smooth->pieces().end());
    parallel_for(piece.size(), [&](std::size_t v) { smooth->project(mesh.positions[v], mesh.normals[v], piece[v], smooth->edges()[v]); });
  }
  for (Cuts cuts = cuts_now(); !cuts.edges.empty(); ++report.rounds, cuts = cuts_now()) {
    const auto more = static_cast<std::size_t>(std::count_if(cuts.at_corner.begin(), cuts.at_corner.end(), [](Index c) { return c != kNone; }));
    if (mesh.triangles.size() + more > o.most_triangles || report.rounds == most_rounds) {
      report.enough = false;
      break;
    }
    const std::size_t first = mesh.positions.size();
    add_vertices(mesh, cuts, o.curved);
    cut_triangles(mesh, report.parent, cuts, static_cast<Index>(first));
    if (!smooth) continue;
    for (const auto& ends : cuts.edges) piece.push_back(piece[ends[0]]);
    parallel_for(cuts.edges.size(), [&](std::size_t i) {
      const auto& [a, b] = cuts.edges[i];
      const std::size_t v = first + i;
      smooth->project(mesh.positions[v], mesh.normals[v], piece[v], (mesh.positions[a] - mesh.positions[b]).norm());
    });
  }
  return report;
}

}  // namespace effuse::skin
