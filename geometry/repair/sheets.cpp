#include <algorithm>
#include <cmath>
#include <utility>

#include "geometry/repair/repair_internal.h"

namespace effuse::geometry {

namespace {

/// Each triangle's neighbour across each of its sides, one at most.
using Links = std::vector<Side>;

void link(Links& links, Side a, Side b) {
  links[a] = b;
  links[b] = a;
}

/// A walk over linked triangles from each that was not met before. visit(t, side it was reached by or kNoSide).
template <class Visit>
void flood(const TriMesh& mesh, const Links& links, Visit&& visit) {
  std::vector<char> met(mesh.triangles.size(), 0);
  std::vector<std::size_t> stack;
  for (std::size_t first = 0; first < met.size(); ++first) {
    if (met[first]) continue;
    met[first] = 1;
    visit(first, kNoSide);
    stack.assign(1, first);
    while (!stack.empty()) {
      const std::size_t t = stack.back();
      stack.pop_back();
      for (Side s = 3 * t; s < 3 * t + 3; ++s) {
        if (links[s] == kNoSide || met[links[s] / 3]) continue;
        met[links[s] / 3] = 1;
        visit(links[s] / 3, s);
        stack.push_back(links[s] / 3);
      }
    }
  }
}

void turn_over(TriMesh& mesh, Links& links, std::size_t t, Turned& turned) {
  // Corners a b c become a c b: sides ab bc ca become ac cb ba, so the first and the last change places.
  std::swap(mesh.triangles[t][1], mesh.triangles[t][2]);
  std::swap(links[3 * t], links[3 * t + 2]);
  for (Side s = 3 * t; s < 3 * t + 3; ++s)
    if (links[s] != kNoSide && links[s] / 3 != t) links[links[s]] = s;
  turned.triangle[t] ^= 1;
}

bool alike(const TriMesh& mesh, Side a, Side b) { return from_of(mesh, a) == to_of(mesh, b); }

/// Winds linked triangles alike, as most of their area was; links that contradict are cut.
void wind_alike(TriMesh& mesh, Links& links, Turned& turned, RepairReport& report) {
  // Which triangles of a component are to be turned so that all agree with its first; then the smaller area is.
  std::vector<char> other(mesh.triangles.size(), 0);
  std::vector<std::size_t> component(mesh.triangles.size(), 0);
  std::vector<Real> balance;
  flood(mesh, links, [&](std::size_t t, Side by) {
    if (by == kNoSide) {
      balance.push_back(0);
    } else {
      other[t] = other[by / 3] ^ !alike(mesh, by, links[by]);
    }
    component[t] = balance.size() - 1;
    const auto [a, b, c] = mesh.triangles[t];
    const Real area = (mesh.positions[b] - mesh.positions[a]).cross(mesh.positions[c] - mesh.positions[a]).norm();
    balance.back() += other[t] ? -area : area;
  });
  for (Side s = 0; s < links.size(); ++s) {
    const Side mate = links[s];
    if (mate == kNoSide || mate < s) continue;
    if ((other[s / 3] ^ other[mate / 3]) != static_cast<char>(!alike(mesh, s, mate))) {
      links[s] = links[mate] = kNoSide;
      ++report.cut_edges;
    }
  }
  for (std::size_t t = 0; t < mesh.triangles.size(); ++t)
    if (other[t] == (balance[component[t]] >= 0)) turn_over(mesh, links, t, turned);
}

/// Joins the sides of an edge of more than two triangles in pairs that enclose something between them, as wound now.
void pair_around(const TriMesh& mesh, std::span<const Side> sides, Links& links) {
  const Index low = std::min(from_of(mesh, sides[0]), to_of(mesh, sides[0])), high = std::max(from_of(mesh, sides[0]), to_of(mesh, sides[0]));
  const Vec3 axis = (mesh.positions[high] - mesh.positions[low]).normalized();
  struct Leaf {
    Real angle;
    bool rising;
    Side side;
  };
  std::vector<Leaf> leaves;
  Vec3 zero = Vec3::Zero(), quarter = Vec3::Zero();
  for (const Side s : sides) {
    const Vec3 apex = mesh.positions[from_of(mesh, next_side(next_side(s)))] - mesh.positions[low];
    const Vec3 out = apex - apex.dot(axis) * axis;
    if (leaves.empty()) {
      zero = out.normalized();
      quarter = axis.cross(zero);
    }
    Real angle = std::atan2(out.dot(quarter), out.dot(zero));
    if (angle < 0 && angle > -1e-9) angle = 0;
    leaves.push_back({angle < 0 ? angle + 2 * kPi : angle, from_of(mesh, s) == low, s});
  }
  std::sort(leaves.begin(), leaves.end(), [](const Leaf& p, const Leaf& q) { return p.angle != q.angle ? p.angle < q.angle : p.side < q.side; });
  // Of a triangle that runs the edge upward what it encloses lies at smaller angles, of one that runs it downward at larger ones.
  for (bool again = true; again && leaves.size() > 1;) {
    again = false;
    for (std::size_t k = 0; k < leaves.size() && leaves.size() > 1; ++k) {
      const std::size_t next = (k + 1) % leaves.size();
      if (leaves[k].rising || !leaves[next].rising) continue;
      link(links, leaves[k].side, leaves[next].side);
      leaves.erase(leaves.begin() + static_cast<std::ptrdiff_t>(std::max(k, next)));
      leaves.erase(leaves.begin() + static_cast<std::ptrdiff_t>(std::min(k, next)));
      again = true;
      break;
    }
  }
  // Two that are left run alike: sheets that meet here, one of them wound the other way.
  if (leaves.size() == 2) link(links, leaves[0].side, leaves[1].side);
}

/// A vertex for each fan of triangles: corners that links join share one. The first fan keeps the number.
void part_vertices(TriMesh& mesh, const Links& links, RepairReport& report) {
  const std::size_t corners = 3 * mesh.triangles.size();
  std::vector<std::size_t> parent(corners);
  for (std::size_t c = 0; c < corners; ++c) parent[c] = c;
  const auto root = [&](std::size_t c) {
    while (parent[c] != c) c = parent[c] = parent[parent[c]];
    return c;
  };
  const auto unite = [&](std::size_t a, std::size_t b) {
    const std::size_t p = root(a), q = root(b);
    parent[std::max(p, q)] = std::min(p, q);
  };
  // A side begins at the corner of its own number; mates run against each other.
  for (Side s = 0; s < corners; ++s) {
    if (links[s] == kNoSide) continue;
    unite(s, next_side(links[s]));
    unite(next_side(s), links[s]);
  }
  std::vector<char> taken(mesh.positions.size(), 0);
  std::vector<Index> vertex(corners);
  for (std::size_t c = 0; c < corners; ++c) {
    if (root(c) != c) {
      vertex[c] = vertex[root(c)];
      continue;
    }
    const Index v = mesh.triangles[c / 3][c % 3];
    if (!taken[v]) {
      taken[v] = 1;
      vertex[c] = v;
    } else {
      vertex[c] = copy_vertex(mesh, v);
      ++report.split_vertices;
    }
  }
  for (std::size_t c = 0; c < corners; ++c) mesh.triangles[c / 3][c % 3] = vertex[c];
}

/// Where one sheet runs along an edge twice, between the same two vertices, all but the first of its passages get a vertex
/// in the middle: the edge is then another one, and the surface the same.
void bend_repeats(TriMesh& mesh, Links& links, Turned& turned, RepairReport& report) {
  for (bool again = true; again;) {
    again = false;
    const EdgeList edges = edges_of(mesh);
    std::vector<char> touched(mesh.triangles.size(), 0);  // the list does not know their sides any more: next time
    for (std::size_t e = 0; e < edges.size(); ++e) {
      bool first = true;
      for (const Side s : edges.of(e)) {
        const Side mate = links[s];
        if (mate != kNoSide && mate < s) continue;  // with its mate
        if (std::exchange(first, false)) continue;
        again = true;
        if (touched[s / 3] || (mate != kNoSide && touched[mate / 3])) continue;
        const Index ends[] = {from_of(mesh, s), to_of(mesh, s)};
        const Index middle = mean_vertex(mesh, ends);
        ++report.midpoint_vertices;
        // Triangle a b c, cut from the middle of its side ab: a m c stays, m b c is new.
        const auto cut = [&](Side at) {
          const std::size_t t = at / 3, k = at % 3;
          touched[t] = 1;
          const Triangle corners = mesh.triangles[t];
          const Index b = corners[(k + 1) % 3], c = corners[(k + 2) % 3];
          const std::size_t made = mesh.triangles.size();
          mesh.triangles[t][(k + 1) % 3] = middle;
          mesh.triangles.push_back({middle, b, c});
          turned.triangle.push_back(turned.triangle[t]);
          links.resize(links.size() + 3, kNoSide);
          const Side behind = 3 * t + (k + 1) % 3;  // was bc
          if (links[behind] != kNoSide) {
            touched[links[behind] / 3 < touched.size() ? links[behind] / 3 : t] = 1;
            link(links, 3 * made + 1, links[behind]);
          }
          link(links, behind, 3 * made + 2);
          return 3 * made;  // the side m b
        };
        const Side half = cut(s);
        if (mate == kNoSide) continue;
        const Side other_half = cut(mate);
        link(links, s, other_half);
        link(links, mate, half);
      }
    }
  }
}

}  // namespace

void part_sheets(TriMesh& mesh, Turned& turned, RepairReport& report) {
  Links links(3 * mesh.triangles.size(), kNoSide);
  const EdgeList edges = edges_of(mesh);
  std::vector<std::size_t> crowded;
  for (std::size_t e = 0; e < edges.size(); ++e) {
    const std::span<const Side> sides = edges.of(e);
    if (sides.size() == 2) link(links, sides[0], sides[1]);
    if (sides.size() > 2) crowded.push_back(e);
  }
  // First what hangs together without doubt, so that the pairs at crowded edges are found by a winding that holds.
  wind_alike(mesh, links, turned, report);
  report.parted_edges = crowded.size();
  if (!crowded.empty()) {
    // The sides of a triangle that was turned have changed places: found again by their vertices.
    const EdgeList wound = edges_of(mesh);
    for (const std::size_t e : crowded) pair_around(mesh, wound.of(e), links);
    wind_alike(mesh, links, turned, report);
  }
  part_vertices(mesh, links, report);
  bend_repeats(mesh, links, turned, report);
}

void face_outward(TriMesh& mesh, Turned& turned, RepairReport& report) {
  Links links(3 * mesh.triangles.size(), kNoSide);
  const EdgeList edges = edges_of(mesh);
  for (std::size_t e = 0; e < edges.size(); ++e)
    if (edges.of(e).size() == 2) link(links, edges.of(e)[0], edges.of(e)[1]);
  struct Component {
    std::vector<std::size_t> triangles;
    Box3 box;
    Real volume = 0;
    bool closed = true;
  };
  std::vector<Component> components;
  flood(mesh, links, [&](std::size_t t, Side by) {
    if (by == kNoSide) components.emplace_back();
    Component& c = components.back();
    c.triangles.push_back(t);
    for (Side s = 3 * t; s < 3 * t + 3; ++s) {
      c.box.extend(mesh.positions[from_of(mesh, s)]);
      c.closed = c.closed && links[s] != kNoSide;
    }
  });
  for (Component& c : components) {
    const Vec3 middle = c.box.center();
    for (const std::size_t t : c.triangles) {
      const auto [p, q, r] = mesh.triangles[t];
      c.volume += (mesh.positions[p] - middle).dot((mesh.positions[q] - middle).cross(mesh.positions[r] - middle)) / 6;
    }
  }
  // How often a component goes round a point, by the sum of the solid angles of its triangles (van Oosterom & Strackee 1983).
  const auto winds_round = [&](const Component& c, const Vec3& p) {
    Real angle = 0;
    for (const std::size_t t : c.triangles) {
      Vec3 v[3];
      for (std::size_t k = 0; k < 3; ++k) v[k] = mesh.positions[mesh.triangles[t][k]] - p;
      const Real l[3] = {v[0].norm(), v[1].norm(), v[2].norm()};
      angle += 2 * std::atan2(v[0].dot(v[1].cross(v[2])), l[0] * l[1] * l[2] + v[0].dot(v[1]) * l[2] + v[1].dot(v[2]) * l[0] + v[2].dot(v[0]) * l[1]);
    }
    return std::abs(angle) > 2 * kPi;
  };
  for (const Component& c : components) {
    if (!c.closed || !(c.volume < 0)) continue;
    const Vec3 p = mesh.positions[mesh.triangles[c.triangles.front()][0]];
    const bool within = std::any_of(components.begin(), components.end(), [&](const Component& other) { return &other != &c && other.closed && other.box.contains(c.box) && winds_round(other, p); });
    if (within) {
      ++report.inward_shells;
      continue;
    }
    for (const std::size_t t : c.triangles) turn_over(mesh, links, t, turned);
  }
}

void fill_holes(TriMesh& mesh, Real largest, Turned& turned, RepairReport& report) {
  // After part_sheets a border vertex is left by one border side.
  std::vector<Side> out(mesh.positions.size(), kNoSide);
  std::vector<Side> border;
  const EdgeList edges = edges_of(mesh);
  for (std::size_t e = 0; e < edges.size(); ++e)
    if (edges.of(e).size() == 1) border.push_back(edges.of(e)[0]);
  std::sort(border.begin(), border.end());
  for (const Side s : border) out[from_of(mesh, s)] = s;

  std::vector<std::pair<Index, Index>> known;  // edges of the mesh between vertices of borders
  std::vector<char> on_border(mesh.positions.size(), 0);
  for (const Side s : border) on_border[from_of(mesh, s)] = 1;
  for (std::size_t e = 0; e < edges.size(); ++e) {
    const Index a = from_of(mesh, edges.of(e)[0]), b = to_of(mesh, edges.of(e)[0]);
    if (on_border[a] && on_border[b]) known.emplace_back(std::min(a, b), std::max(a, b));
  }
  const auto is_known = [&](Index a, Index b) { return std::binary_search(known.begin(), known.end(), std::pair(std::min(a, b), std::max(a, b))); };
  const auto has_area = [&](Index a, Index b, Index c) {
    return (mesh.positions[b] - mesh.positions[a]).cross(mesh.positions[c] - mesh.positions[a]).squaredNorm() > 0;
  };

  std::vector<char> done(mesh.positions.size(), 0);
  for (const Side start : border) {
    if (done[from_of(mesh, start)]) continue;
    std::vector<Index> loop;
    Box3 box;
    Side s = start;
    do {
      loop.push_back(from_of(mesh, s));
      done[loop.back()] = 1;
      box.extend(mesh.positions[loop.back()]);
      s = out[to_of(mesh, s)];
    } while (s != start && s != kNoSide && loop.size() <= border.size());
    const Real size = box.diagonal().norm();
    const bool lone_triangle = loop.size() == 3 && start / 3 == out[loop[1]] / 3 && start / 3 == out[loop[2]] / 3;
    std::vector<Triangle> patch;
    if (s == start && !lone_triangle && size <= largest && loop.size() <= kLargestHole) {
      std::reverse(loop.begin(), loop.end());  // the patch runs the border the other way
      std::vector<Vec3> places;
      for (const Index v : loop) places.push_back(mesh.positions[v]);
      for (Triangle t : triangulate_border(places)) {
        std::sort(t.begin(), t.end());  // ascending along the loop: wound as it is
        patch.push_back({loop[t[0]], loop[t[1]], loop[t[2]]});
      }
      // A patch may not use an edge that the mesh has, nor be flat: then a fan about the middle does.
      const auto next_in_loop = [&](const Triangle& t, std::size_t k) {
        const auto at = static_cast<std::size_t>(std::find(loop.begin(), loop.end(), t[k]) - loop.begin());
        return loop[(at + 1) % loop.size()] == t[(k + 1) % 3] || loop[(at + loop.size() - 1) % loop.size()] == t[(k + 1) % 3];
      };
      bool fits = !patch.empty();
      for (const Triangle& t : patch) {
        fits = fits && has_area(t[0], t[1], t[2]);
        for (std::size_t k = 0; k < 3 && fits; ++k) fits = next_in_loop(t, k) || !is_known(t[k], t[(k + 1) % 3]);
      }
      if (!fits) {
        patch.clear();
        const Index middle = mean_vertex(mesh, loop);
        for (std::size_t k = 0; k < loop.size(); ++k) patch.push_back({loop[k], loop[(k + 1) % loop.size()], middle});
        if (!std::all_of(patch.begin(), patch.end(), [&](const Triangle& t) { return has_area(t[0], t[1], t[2]); })) patch.clear();
        if (patch.empty()) drop_last_vertex(mesh);
        report.hole_vertices += !patch.empty();
      }
    }
    if (patch.empty()) {
      if (lone_triangle) continue;
      ++report.open_holes;
      report.largest_hole = std::max(report.largest_hole, size);
      continue;
    }
    ++report.filled_holes;
    report.hole_triangles += patch.size();
    mesh.triangles.insert(mesh.triangles.end(), patch.begin(), patch.end());
    turned.triangle.resize(mesh.triangles.size(), 0);
  }
}

}  // namespace effuse::geometry
