#include "flow/fem/fill_with_tets.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <map>
#include <unordered_map>

#include "geometry/base/error.h"
#include "geometry/base/parallel.h"
#include "geometry/mesh/measure.h"
#include "geometry/mesh/validate.h"
#include "geometry/query/mesh_surface.h"

namespace effuse::flow::fem {

namespace {

// Nearer than these shares of an edge, its end moves onto the surface: no element gets flatter than 10 degrees (Labelle & Shewchuk, table 1).
constexpr Real kWarpLong = 0.24999, kWarpShort = 0.41189;

/// The lattice over a box: corners (i, j, k) with each of 0..n, centres with each of 0..n - 1.
struct Lattice {
  Vec3 low;
  Real a;
  std::array<int, 3> n;
  std::size_t corners() const { return static_cast<std::size_t>(n[0] + 1) * (n[1] + 1) * (n[2] + 1); }
  std::size_t size() const { return corners() + static_cast<std::size_t>(n[0]) * n[1] * n[2]; }
  Index corner(int i, int j, int k) const { return static_cast<Index>((static_cast<std::size_t>(i) * (n[1] + 1) + j) * (n[2] + 1) + k); }
  Index centre(int i, int j, int k) const { return static_cast<Index>(corners() + (static_cast<std::size_t>(i) * n[1] + j) * n[2] + k); }
};

std::vector<Vec3> points_of(const Lattice& l) {
  std::vector<Vec3> x;
  x.reserve(l.size());
  for (int half = 0; half < 2; ++half)
    for (int i = 0; i <= l.n[0] - half; ++i)
      for (int j = 0; j <= l.n[1] - half; ++j)
        for (int k = 0; k <= l.n[2] - half; ++k) x.push_back(l.low + l.a * (Vec3(i, j, k) + Vec3::Constant(half * 0.5)));
  return x;
}

/// Four tetrahedra about each line from a cube's centre to the next one's, one on each edge of the face between.
std::vector<std::array<Index, 4>> tets_of(const Lattice& l) {
  std::vector<std::array<Index, 4>> tets;
  for (int axis = 0; axis < 3; ++axis) {
    const int u = (axis + 1) % 3, v = (axis + 2) % 3;
    std::array<int, 3> c;
    for (c[0] = 0; c[0] < l.n[0]; ++c[0])
      for (c[1] = 0; c[1] < l.n[1]; ++c[1])
        for (c[2] = 0; c[2] < l.n[2]; ++c[2]) {
          if (c[static_cast<std::size_t>(axis)] + 1 >= l.n[static_cast<std::size_t>(axis)]) continue;
          std::array<int, 3> next = c;
          ++next[static_cast<std::size_t>(axis)];
          std::array<Index, 4> ring;
          for (int q = 0; q < 4; ++q) {
            std::array<int, 3> at = next;
            at[static_cast<std::size_t>(u)] += q == 1 || q == 2;
            at[static_cast<std::size_t>(v)] += q >= 2;
            ring[static_cast<std::size_t>(q)] = l.corner(at[0], at[1], at[2]);
          }
          for (std::size_t q = 0; q < 4; ++q) tets.push_back({l.centre(c[0], c[1], c[2]), l.centre(next[0], next[1], next[2]), ring[q], ring[(q + 1) % 4]});
        }
  }
  return tets;
}

using Edge = std::pair<Index, Index>;
Edge edge_of(Index a, Index b) { return std::minmax(a, b); }

/// A triangular prism, corners 0 1 2 below 3 4 5, cut in three so that every face is cut from its corner of least number.
/// Source: Dompierre, Labbe, Vallet & Camarero 1999, 8th International Meshing Roundtable, 195-204.
void cut_prism(std::array<Index, 6> p, std::vector<std::array<Index, 4>>& out) {
  const auto least = static_cast<std::size_t>(std::min_element(p.begin(), p.end()) - p.begin());
  // Turned so that the least stands first.
  static constexpr std::size_t kTurned[6][6] = {{0, 1, 2, 3, 4, 5}, {1, 2, 0, 4, 5, 3}, {2, 0, 1, 5, 3, 4}, {3, 5, 4, 0, 2, 1}, {4, 3, 5, 1, 0, 2}, {5, 4, 3, 2, 1, 0}};
  std::array<Index, 6> q;
  for (std::size_t k = 0; k < 6; ++k) q[k] = p[kTurned[least][k]];
  // Both faces at corner 0 are cut there; the third, 1 2 5 4, from the least of its own.
  if (std::min(q[1], q[5]) < std::min(q[2], q[4])) out.insert(out.end(), {{q[0], q[1], q[2], q[5]}, {q[0], q[1], q[5], q[4]}, {q[0], q[4], q[5], q[3]}});
  else out.insert(out.end(), {{q[0], q[1], q[2], q[4]}, {q[0], q[4], q[2], q[5]}, {q[0], q[4], q[5], q[3]}});
}

}  // namespace

TetFill fill_with_tets(const geometry::TriMesh& mesh, Real spacing, const std::string& what, std::size_t max_nodes) {
  const auto wrong = [&](const std::string& message) { throw InputError(Place{}, fmt::format("{}: {}", what, message)); };
  const geometry::MeshReport report = geometry::validate(mesh);
  if (!report.closed()) wrong("its mesh is not closed, so it has no inside: importing it with repair, or another mesh, would do");
  const Box3 box = geometry::bounds(mesh);
  Lattice l{Vec3::Zero(), spacing, {}};
  Real all = 2;
  for (int axis = 0; axis < 3; ++axis) {
    const Real cells = std::ceil(box.sizes()[axis] / spacing) + 3;
    all *= cells + 1;
    l.n[static_cast<std::size_t>(axis)] = static_cast<int>(std::min(cells, 1e6));
    l.low[axis] = box.center()[axis] - spacing * cells / 2;
  }
  if (all > static_cast<Real>(max_nodes)) wrong(fmt::format("a spacing of {:g} m makes a lattice of {:.3g} points, {} are the most; take a wider one", spacing, all, max_nodes));

  std::vector<Vec3> x = points_of(l);
  const geometry::MeshSurface surface(mesh);
  std::vector<Real> phi(x.size());  // below 0 inside
  parallel_for(x.size(), [&](std::size_t i) { phi[i] = surface.contact(x[i]).distance; }, 64);
  std::vector<std::array<Index, 4>> lattice = tets_of(l);
  std::erase_if(lattice, [&](const auto& t) { return std::all_of(t.begin(), t.end(), [&](Index i) { return phi[i] >= 0; }); });

  // Where edges meet the surface, as shares from their end of lesser number.
  std::map<Edge, Real> cuts;
  for (const auto& t : lattice)
    for (std::size_t p = 0; p < 4; ++p)
      for (std::size_t q = p + 1; q < 4; ++q)
        if (const auto [a, b] = edge_of(t[p], t[q]); (phi[a] < 0) != (phi[b] < 0)) cuts.try_emplace({a, b}, phi[a] / (phi[a] - phi[b]));
  std::vector<std::pair<Index, std::pair<Real, Vec3>>> nearest;  // a point that moves: how near, where to
  {
    std::unordered_map<Index, std::pair<Real, Vec3>> best;
    for (const auto& [edge, share] : cuts) {
      const auto [a, b] = edge;
      const bool is_long = (a < l.corners()) == (b < l.corners());
      const Vec3 at = x[a] + share * (x[b] - x[a]);
      for (const auto& [end, off] : {std::pair{a, share}, {b, 1 - share}}) {
        if (off >= (is_long ? kWarpLong : kWarpShort)) continue;
        const Real length = off * (x[b] - x[a]).norm();
        const auto [found, fresh] = best.try_emplace(end, length, at);
        if (!fresh && length < found->second.first) found->second = {length, at};
      }
    }
    nearest.assign(best.begin(), best.end());
    std::sort(nearest.begin(), nearest.end(), [](const auto& p, const auto& q) { return p.first < q.first; });
  }
  // One after the other: what has moved lies on the surface, and its edges are cut no more.
  std::vector<std::uint8_t> on(x.size(), 0);
  std::unordered_map<Index, std::vector<Index>> ends;
  for (const auto& [edge, share] : cuts) {
    ends[edge.first].push_back(edge.second);
    ends[edge.second].push_back(edge.first);
  }
  const std::vector<Vec3> before = x;
  for (const auto& [i, how] : nearest) {
    // Another end may have taken the cut that this one was near to: then the nearest that is left.
    Real least = std::numeric_limits<Real>::infinity();
    Vec3 to = x[i];
    for (const Index j : ends[i]) {
      if (on[j]) continue;
      const auto [a, b] = edge_of(i, j);
      const Real share = cuts.at({a, b}), off = i == a ? share : 1 - share;
      const bool is_long = (a < l.corners()) == (b < l.corners());
      if (off >= (is_long ? kWarpLong : kWarpShort)) continue;
      const Vec3 at = before[a] + share * (before[b] - before[a]);
      if ((at - before[i]).norm() < least) least = (at - before[i]).norm(), to = at;
    }
    if (!std::isfinite(least)) continue;
    x[i] = to;
    on[i] = 1;
    phi[i] = 0;
  }

  // Points on cut edges come behind the lattice's.
  std::map<Edge, Index> cut_points;
  const auto cut = [&](Index in, Index out) {
    const Edge edge = edge_of(in, out);
    const auto [found, fresh] = cut_points.try_emplace(edge, static_cast<Index>(x.size()));
    if (fresh) {
      const Vec3 a = before[edge.first], b = before[edge.second];
      x.push_back(a + cuts.at(edge) * (b - a));
    }
    return found->second;
  };
  std::vector<std::array<Index, 4>> tets;
  for (const auto& t : lattice) {
    std::vector<Index> in, zero, out;
    for (const Index i : t) (on[i] ? zero : phi[i] < 0 ? in : out).push_back(i);
    if (in.empty()) continue;
    if (out.empty()) {
      tets.push_back(t);
    } else if (in.size() == 1) {
      std::array<Index, 4> small = {in[0], 0, 0, 0};
      std::size_t k = 1;
      for (const Index i : zero) small[k++] = i;
      for (const Index i : out) small[k++] = cut(in[0], i);
      tets.push_back(small);
    } else if (in.size() == 2 && out.size() == 1) {
      // A pyramid on a quad of both and their cuts.
      const Index a = std::min(in[0], in[1]), b = std::max(in[0], in[1]), ca = cut(a, out[0]), cb = cut(b, out[0]);
      tets.insert(tets.end(), {{a, b, cb, zero[0]}, {a, cb, ca, zero[0]}});
    } else if (in.size() == 2) {
      cut_prism({in[0], cut(in[0], out[0]), cut(in[0], out[1]), in[1], cut(in[1], out[0]), cut(in[1], out[1])}, tets);
    } else {
      cut_prism({in[0], in[1], in[2], cut(in[0], out[0]), cut(in[1], out[0]), cut(in[2], out[0])}, tets);
    }
  }
  if (tets.empty()) wrong(fmt::format("is thinner everywhere than a spacing of {:g} m resolves; take a smaller one", spacing));

  TetFill fill;
  std::vector<Index> number(x.size(), ~Index{0});
  for (std::array<Index, 4>& t : tets) {
    const Real six = (x[t[1]] - x[t[0]]).cross(x[t[2]] - x[t[0]]).dot(x[t[3]] - x[t[0]]);
    if (six < 0) std::swap(t[2], t[3]);
    if (std::abs(six) < 1e-9 * spacing * spacing * spacing) continue;  // flat to rounding: nothing is lost with it
    fill.volume += std::abs(six) / 6;
    for (Index& i : t) {
      if (number[i] == ~Index{0}) {
        number[i] = static_cast<Index>(fill.mesh.nodes.size());
        fill.mesh.nodes.push_back(x[i]);
      }
      i = number[i];
    }
    fill.mesh.tets.push_back(t);
  }
  for (const InTet& in : locate(fill.mesh, mesh.positions)) {
    fill.tet_of.push_back(in.tet);
    fill.weight.push_back({static_cast<float>(in.weight[0]), static_cast<float>(in.weight[1]), static_cast<float>(in.weight[2]), static_cast<float>(in.weight[3])});
  }
  return fill;
}

std::vector<InTet> locate(const TetMesh& mesh, const std::vector<Vec3>& points) {
  Box3 box;
  Real longest = 0;
  for (const Vec3& p : mesh.nodes) box.extend(p);
  for (const auto& t : mesh.tets)
    for (std::size_t a = 0; a < 4; ++a)
      for (std::size_t b = 0; b < a; ++b) longest = std::max(longest, (mesh.nodes[t[a]] - mesh.nodes[t[b]]).norm());
  // Tetrahedra by the cell of their middle; one that holds a point has its middle no farther than its longest edge.
  const auto cell = [&](const Vec3& p) {
    std::array<int, 3> c;
    for (int a = 0; a < 3; ++a) c[static_cast<std::size_t>(a)] = static_cast<int>(std::floor((p[a] - box.min()[a]) / longest));
    return c;
  };
  std::map<std::array<int, 3>, std::vector<Index>> cells;
  for (std::size_t e = 0; e < mesh.tets.size(); ++e) {
    Vec3 middle = Vec3::Zero();
    for (const Index i : mesh.tets[e]) middle += mesh.nodes[i] / 4;
    cells[cell(middle)].push_back(static_cast<Index>(e));
  }
  std::vector<InTet> found(points.size());
  parallel_for(points.size(), [&](std::size_t q) {
    Real best = -std::numeric_limits<Real>::infinity();
    for (int ring = 1; ring < 64 && !std::isfinite(best); ring *= 2) {
      const std::array<int, 3> c = cell(points[q]);
      for (int i = -ring; i <= ring; ++i)
        for (int j = -ring; j <= ring; ++j)
          for (int k = -ring; k <= ring; ++k) {
            const auto at = cells.find({c[0] + i, c[1] + j, c[2] + k});
            if (at == cells.end()) continue;
            for (const Index e : at->second) {
              const auto& t = mesh.tets[e];
              Mat3 edges;
              for (int a = 0; a < 3; ++a) edges.col(a) = mesh.nodes[t[static_cast<std::size_t>(a) + 1]] - mesh.nodes[t[0]];
              const Vec3 b = edges.inverse() * (points[q] - mesh.nodes[t[0]]);
              const Real first = 1 - b.sum(), least = std::min(first, b.minCoeff());
              if (least > best) best = least, found[q] = {e, {first, b[0], b[1], b[2]}};
            }
          }
    }
  }, 64);
  return found;
}

}  // namespace effuse::flow::fem
