#include "skin/preview/ground.h"

#include <algorithm>
#include <map>
#include <numeric>
#include <set>

#include "geometry/mesh/measure.h"
#include "skin/preview/ground_texture.h"
#include "skin/write/mesh_arrays.h"

namespace effuse::skin {

using geometry::TriMesh;

namespace {

using Edge = std::array<Index, 2>;

/// Edges of one triangle only, in that triangle's direction.
std::vector<Edge> border_edges(const TriMesh& mesh) {
  struct Side {
    std::uint64_t key;  // smaller vertex, larger vertex
    Edge edge;
  };
  std::vector<Side> sides;
  sides.reserve(3 * mesh.triangles.size());
  for (const geometry::Triangle& t : mesh.triangles)
    for (std::size_t k = 0; k < 3; ++k) {
      const Index a = t[k], b = t[(k + 1) % 3];
      sides.push_back({std::uint64_t{std::min(a, b)} << 32 | std::max(a, b), {a, b}});
    }
  std::sort(sides.begin(), sides.end(), [](const Side& a, const Side& b) { return a.key < b.key || (a.key == b.key && a.edge < b.edge); });
  std::vector<Edge> border;
  for (std::size_t i = 0; i < sides.size();) {
    std::size_t end = i + 1;
    while (end < sides.size() && sides[end].key == sides[i].key) ++end;
    if (end == i + 1) border.push_back(sides[i].edge);
    i = end;
  }
  return border;
}

/// The border that spans the largest box in the plane: the outer one, not a hole's.
std::vector<Edge> outer_border(const TriMesh& mesh) {
  const std::vector<Edge> border = border_edges(mesh);
  std::vector<Index> parent(mesh.positions.size());
  std::iota(parent.begin(), parent.end(), Index{0});
  const auto root = [&](Index v) {
    while (parent[v] != v) v = parent[v] = parent[parent[v]];
    return v;
  };
  for (const Edge& e : border) parent[root(e[0])] = root(e[1]);
  std::map<Index, Eigen::AlignedBox2d> boxes;
  for (const Edge& e : border) boxes[root(e[0])].extend(mesh.positions[e[0]].head<2>());
  Index best = 0;
  Real best_size = -1;
  for (const auto& [r, box] : boxes)
    if (box.sizes().norm() > best_size) {
      best_size = box.sizes().norm();
      best = r;
    }
  std::vector<Edge> outer;
  for (const Edge& e : border)
    if (root(e[0]) == best) outer.push_back(e);
  return outer;
}

/// Of the border's edges, those that see the outside straight away from the centre: none further out in their direction.
std::vector<Edge> facing_outward(const TriMesh& mesh, const std::vector<Edge>& border) {
  constexpr int kSectors = 720;
  const auto sector = [&](Index v) {
    const Vec3& p = mesh.positions[v];
    return std::clamp(static_cast<int>((std::atan2(p.y(), p.x()) / (2 * kPi) + 0.5) * kSectors), 0, kSectors - 1);
  };
  std::vector<Real> farthest(kSectors, 0);
  for (const Edge& e : border)
    for (const Index v : e)
      farthest[static_cast<std::size_t>(sector(v))] =
          std::max(farthest[static_cast<std::size_t>(sector(v))], mesh.positions[v].head<2>().norm());
  std::vector<Edge> facing;
  for (const Edge& e : border) {
    bool sees = true;
    for (const Index v : e) sees = sees && mesh.positions[v].head<2>().norm() > 0.96 * farthest[static_cast<std::size_t>(sector(v))];
    if (sees) facing.push_back(e);
  }
  return facing;
}

/// The border of ground that hangs over runs back under itself, as seen from the centre, and an apron there would be folded, with a side that
/// faces down. Such a stretch is left out, and a wall drawn from its upper end to where the border comes out below it; what runs forward
/// below the roof is the floor of the hollow.
struct Outline {
  std::vector<Edge> edges;
  std::set<Edge> under_roof;
};

Outline without_folds(const TriMesh& mesh, std::vector<Edge> border) {
  constexpr Real kFold = 0.01;  // [rad] less is a rim that is not quite straight
  std::map<Index, Index> next;
  for (const Edge& e : border) next[e[0]] = e[1];
  // In the border's order, with angles that go on past a whole turn.
  std::vector<Index> chain;
  std::vector<Real> angle;
  const auto direction = [&](Index v) { return std::atan2(mesh.positions[v].y(), mesh.positions[v].x()); };
  for (Index v = border.front()[0]; chain.size() <= border.size(); v = next[v]) {
    if (!next.contains(v)) return {std::move(border), {}};
    angle.push_back(chain.empty() ? direction(v) : angle.back() + std::remainder(direction(v) - direction(chain.back()), 2 * kPi));
    chain.push_back(v);
    if (chain.size() > 1 && v == chain.front()) break;
  }
  const std::size_t n = chain.size() - 1;
  if (chain.back() != chain.front() || std::abs(angle.back() - angle.front() - 2 * kPi) > 0.1) return {std::move(border), {}};
  // Three rounds: a fold may lie across the start.
  for (std::size_t k = n + 1; k < 3 * n; ++k) {
    chain.push_back(chain[k - n]);
    angle.push_back(angle[k - n] + 2 * kPi);
  }

  std::vector<Edge> walls;
  std::set<Edge> folded, under_roof;
  for (std::size_t first = n; first < 2 * n; ++first) {
    if (!(angle[first + 1] < angle[first]) || angle[first] < angle[first - 1]) continue;
    std::size_t last = first + 1;
    while (angle[last + 1] <= angle[last]) ++last;
    if (angle[first] - angle[last] < kFold) continue;
    for (std::size_t k = first; k < last; ++k) folded.insert({chain[k], chain[k + 1]});
    const bool upper_first = mesh.positions[chain[first]].z() > mesh.positions[chain[last]].z();
    std::size_t below = upper_first ? last : first;
    if (upper_first) {
      while (angle[below] <= angle[first]) ++below;
      walls.push_back({chain[first], chain[below]});
    } else {
      while (angle[below] >= angle[last]) --below;
      walls.push_back({chain[below], chain[last]});
    }
    for (std::size_t k = upper_first ? last : below; k < (upper_first ? below : first); ++k) under_roof.insert({chain[k], chain[k + 1]});
  }
  std::erase_if(border, [&](const Edge& e) { return folded.contains(e); });
  border.insert(border.end(), walls.begin(), walls.end());
  return {std::move(border), std::move(under_roof)};
}

/// Appends the apron to mesh (whose centre is the origin).
void add_apron(TriMesh& mesh, Real radius, Real base) {
  std::vector<Edge> border = outer_border(mesh);
  if (border.empty()) return;
  const Outline outline = without_folds(mesh, std::move(border));
  const std::vector<Edge> edges = facing_outward(mesh, outline.edges);
  if (edges.empty()) return;

  // The border's vertices and their neighbours along it.
  std::map<Index, std::size_t> slot;
  for (const Edge& e : edges)
    for (const Index v : e) slot.emplace(v, slot.size());
  const std::size_t n = slot.size();
  std::vector<std::array<std::size_t, 2>> links;
  std::vector<char> hollow;
  for (const Edge& e : edges) {
    links.push_back({slot[e[0]], slot[e[1]]});
    hollow.push_back(outline.under_roof.contains(e));
  }
  std::vector<Vec3> start(n);
  for (const auto& [v, s] : slot) start[s] = mesh.positions[v];
  std::vector<Real> height(n), blurred(n), count(n);
  for (std::size_t s = 0; s < n; ++s) height[s] = start[s].z();

  std::vector<Index> ring(n);
  for (const auto& [v, s] : slot) ring[s] = v;
  constexpr int kRings = 30;
  for (int k = 0; k < kRings; ++k) {
    // Distances grow by a third from one ring to the next.
    const Real d = radius * 0.02 * (std::pow(1.34, k + 1) - 1) / 0.34;
    // The border's own ups and downs blur along it, or they would run outward as rays.
    for (int pass = 0; pass < 1 + k / 2; ++pass) {
      blurred = height;
      std::fill(count.begin(), count.end(), 1);
      for (const auto& [a, b] : links) {
        blurred[a] += height[b];
        blurred[b] += height[a];
        count[a] += 1;
        count[b] += 1;
      }
      for (std::size_t s = 0; s < n; ++s) height[s] = blurred[s] / count[s];
    }
    std::vector<Index> next(n);
    for (std::size_t s = 0; s < n; ++s) {
      const Vec2 plane = start[s].head<2>() + d * start[s].head<2>().normalized();
      const float x = static_cast<float>(plane.x() / radius), y = static_cast<float>(plane.y() / radius),
                  far = static_cast<float>(d / radius);
      const float ease = 1 - smooth(0.0f, 0.6f, far);
      const float low_hills = 0.035f * smooth(0.05f, 0.9f, far) *
                              (1 + plane_noise(1.3f * x, 1.3f * y, 11).value + 0.4f * plane_noise(3.1f * x, 3.1f * y, 12).value);
      const float far_hills = 0.5f * smooth(3.0f, 14.0f, far) * (1 + plane_noise(0.17f * x, 0.17f * y, 13).value);
      const Real z = base + (height[s] - base) * static_cast<Real>(ease) +
                     radius * static_cast<Real>(std::max(0.0f, low_hills) + std::max(0.0f, far_hills));
      next[s] = static_cast<Index>(mesh.positions.size());
      mesh.positions.emplace_back(plane.x(), plane.y(), z);
    }
    for (std::size_t l = 0; l < links.size(); ++l) {
      const auto& [a, b] = links[l];
      // Where roof and floor have both come down to the base, one of them is drawn.
      if (hollow[l] && d > 0.4 * radius) continue;
      mesh.triangles.push_back({ring[b], ring[a], next[a]});
      mesh.triangles.push_back({ring[b], next[a], next[b]});
    }
    ring = std::move(next);
  }
}

/// Normals averaged over the triangles around each vertex.
void smooth_normals(const TriMesh& mesh, std::vector<Vec3>& normals) {
  std::vector<Vec3> sum(normals.size(), Vec3::Zero());
  for (const geometry::Triangle& t : mesh.triangles) {
    const Vec3 all = normals[t[0]] + normals[t[1]] + normals[t[2]];
    for (const Index v : t) sum[v] += all;
  }
  for (std::size_t i = 0; i < normals.size(); ++i)
    if (sum[i].norm() > 1e-9) normals[i] = sum[i].normalized();
}

}  // namespace

Ground build_ground(const TriMesh& terrain) {
  TriMesh bare;
  bare.positions = terrain.positions;
  bare.triangles = terrain.triangles;
  require_well_formed("the terrain of the preview", bare);

  Ground ground;
  const Box3 box = geometry::bounds(bare);
  Real base = 0;
  if (!box.isEmpty() && !bare.triangles.empty()) {
    ground.origin = box.center();
    for (Vec3& p : bare.positions) p -= ground.origin;
    ground.radius = static_cast<float>(std::max(box.sizes().norm() / 2, 1e-3));
    ground.low = static_cast<float>(-box.sizes().z() / 2);
    ground.high = static_cast<float>(std::max(box.sizes().z() / 2, -box.sizes().z() / 2 + 1e-3));
    Real edges = 0;
    for (const geometry::Triangle& t : bare.triangles) edges += (bare.positions[t[0]] - bare.positions[t[1]]).norm();
    ground.edge = static_cast<float>(std::max(edges / static_cast<Real>(bare.triangles.size()), 1e-3));
    const std::vector<Edge> border = outer_border(bare);
    base = ground.low;
    if (!border.empty()) {
      base = ground.high;
      for (const Edge& e : border) base = std::min(base, bare.positions[e[0]].z());
    }
    // An open surface wound upside down would be lit from below.
    Real facing_up = 0;
    for (const geometry::Triangle& t : bare.triangles)
      facing_up += (bare.positions[t[1]] - bare.positions[t[0]]).cross(bare.positions[t[2]] - bare.positions[t[0]]).z();
    if (!border.empty() && facing_up < 0)
      for (geometry::Triangle& t : bare.triangles) std::swap(t[1], t[2]);
    ground.terrain_vertices = bare.positions.size();
    add_apron(bare, ground.radius, base);
  }
  geometry::compute_normals(bare);
  for (int pass = 0; pass < 2; ++pass) smooth_normals(bare, bare.normals);

  // The floor: two triangles just under the apron, for what the apron leaves open, and under any hollow of the terrain.
  const Real side = 100 * static_cast<Real>(ground.radius), z = std::min(base, static_cast<Real>(ground.low)) - 0.01 * static_cast<Real>(ground.radius);
  const Index first = static_cast<Index>(bare.positions.size());
  for (const auto& [x, y] : {std::pair{-side, -side}, {side, -side}, {side, side}, {-side, side}}) {
    bare.positions.emplace_back(x, y, z);
    bare.normals.emplace_back(0, 0, 1);
  }
  bare.triangles.push_back({first, first + 1, first + 2});
  bare.triangles.push_back({first, first + 2, first + 3});

  ground.positions.reserve(bare.positions.size());
  ground.normals.reserve(bare.normals.size());
  for (const Vec3& p : bare.positions) ground.positions.push_back(p.cast<float>());
  for (const Vec3& v : bare.normals) ground.normals.push_back(v.cast<float>());
  ground.triangles = std::move(bare.triangles);
  return ground;
}

}  // namespace effuse::skin
