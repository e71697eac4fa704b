#include <algorithm>
#include <cmath>
#include <numeric>

#include "geometry/base/check.h"
#include "geometry/base/error.h"
#include "geometry/collide/collision_mesh_internal.h"
#include "geometry/mesh/measure.h"
#include "geometry/mesh/validate.h"
#include "geometry/mesh/weld.h"

/// From triangles to parts: who is joined to whom, what is a solid, which way is out.
namespace effuse::geometry {

using Impl = CollisionMesh::Impl;

namespace {

struct Side {
  Index low, high, id;  // id: 3 * triangle + side
};

/// Sides of all triangles, those between the same two vertices together.
std::vector<Side> sorted_sides(std::span<const Triangle> triangles) {
  std::vector<Side> sides;
  sides.reserve(3 * triangles.size());
  for (std::size_t t = 0; t < triangles.size(); ++t) {
    for (std::size_t k = 0; k < 3; ++k) {
      const Index a = triangles[t][k], b = triangles[t][(k + 1) % 3];
      sides.push_back({std::min(a, b), std::max(a, b), static_cast<Index>(3 * t + k)});
    }
  }
  std::sort(sides.begin(), sides.end(), [](const Side& p, const Side& q) {
    return p.low != q.low ? p.low < q.low : p.high != q.high ? p.high < q.high : p.id < q.id;
  });
  return sides;
}

/// visit(first, last) for every run of sides between the same two vertices.
template <class Visit>
void for_each_edge(std::span<const Side> sides, Visit&& visit) {
  for (std::size_t begin = 0, end; begin < sides.size(); begin = end) {
    for (end = begin + 1; end < sides.size() && sides[end].low == sides[begin].low && sides[end].high == sides[begin].high; ++end) {
    }
    visit(sides.subspan(begin, end - begin));
  }
}

class Sets {
 public:
  explicit Sets(std::size_t n) : parent_(n) { std::iota(parent_.begin(), parent_.end(), Index{0}); }
  Index root(Index i) {
    while (parent_[i] != i) i = parent_[i] = parent_[parent_[i]];
    return i;
  }
  void unite(Index i, Index j) {
    const Index a = root(i), b = root(j);
    parent_[std::max(a, b)] = std::min(a, b);
  }

 private:
  std::vector<Index> parent_;
};

Real angle_between(const Vec3& a, const Vec3& b) { return std::atan2(a.cross(b).norm(), a.dot(b)); }

void flip(Triangle& t) { std::swap(t[1], t[2]); }

constexpr char kOnly = 0, kWall = 1, kCopy = 2;

/// Of each triangle: kOnly, the first of several on its vertices too; kWall: the first of two that face each other;
/// kCopy: a later one.
std::vector<char> doubled_triangles(std::span<const Triangle> triangles) {
  struct Entry {
    Triangle sorted;
    Index number;
    bool even;  // how its corners are permuted
  };
  std::vector<Entry> entries;
  entries.reserve(triangles.size());
  for (std::size_t k = 0; k < triangles.size(); ++k) {
    const auto& [a, b, c] = triangles[k];
    Triangle sorted = triangles[k];
    std::sort(sorted.begin(), sorted.end());
    entries.push_back({sorted, static_cast<Index>(k), (a < b) == ((b < c) == (a < c))});
  }
  std::sort(entries.begin(), entries.end(), [](const Entry& p, const Entry& q) { return p.sorted != q.sorted ? p.sorted < q.sorted : p.number < q.number; });
  std::vector<char> kind(triangles.size(), kOnly);
  for (std::size_t begin = 0, end; begin < entries.size(); begin = end) {
    for (end = begin + 1; end < entries.size() && entries[end].sorted == entries[begin].sorted; ++end) kind[entries[end].number] = kCopy;
    if (end - begin == 2 && entries[begin].even != entries[begin + 1].even) kind[entries[begin].number] = kWall;
  }
  return kind;
}

constexpr Real kOnSurface = 1e-12;  // of the largest coordinate

Real largest_coordinate(std::span<const Vec3> positions) {
  Real largest = 0;
  for (const Vec3& x : positions) largest = std::max(largest, x.cwiseAbs().maxCoeff());
  return largest;
}

}  // namespace

void Impl::prepare(const TriMesh& input) {
  validate(input);
  mesh.positions = input.positions;
  mesh.triangles = input.triangles;
  const WeldReport welded = weld(mesh);
  report.merged_vertices = welded.merged_vertices;
  report.dropped = welded.dropped_triangles;

  // A triangle lower than what rounding of its coordinates may cost has no plane of its own.
  const Real largest = largest_coordinate(mesh.positions);
  constexpr Real kFlat = 1e-15;
  const auto height_of = [&](const Triangle& t) {
    const Vec3 &a = mesh.positions[t[0]], &b = mesh.positions[t[1]], &c = mesh.positions[t[2]];
    const Real longest = std::sqrt(std::max({(b - a).squaredNorm(), (c - b).squaredNorm(), (a - c).squaredNorm()}));
    return longest > 0 ? (b - a).cross(c - a).norm() / longest : 0;
  };
  // Of those on the same three vertices one stays; of just two that face each other perhaps none (inner walls).
  const std::vector<char> copies = doubled_triangles(mesh.triangles);
  std::vector<Triangle> flat, seen, walls;
  for (std::size_t k = 0; k < mesh.triangles.size(); ++k) {
    report.doubled += copies[k] == kCopy;
    if (copies[k] == kCopy) continue;
    const bool area = height_of(mesh.triangles[k]) > kFlat * largest;
    (!area ? flat : copies[k] == kWall ? walls : seen).push_back(mesh.triangles[k]);
  }
  if (seen.empty() && walls.empty()) throw InputError(Place{}, "the mesh has no triangle with an area, wanted at least one");
  const auto use = [&](std::vector<Triangle> used) {
    mesh.triangles = used;
    triangles = std::move(used);
    triangles.insert(triangles.end(), flat.begin(), flat.end());
    find_parts();
  };
  if (!walls.empty()) {
    // Between two solids that share a face there is no wall, unless it takes the wall to close one.
    use(seen);
    for (const Triangle& wall : standing_walls(walls)) {
      seen.push_back(wall);
      walls.pop_back();
    }
    report.doubled += walls.size();
  }
  report.dropped += flat.size();
  report.triangles = seen.size();
  use(std::move(seen));
  on_surface = kOnSurface * largest;
  orient_parts();
  find_cavities();
  std::copy_n(triangles.begin(), mesh.triangles.size(), mesh.triangles.begin());
  make_normals();
  make_trees();
  find_hollows();
}

void Impl::follow(std::span<const Vec3> positions) {
  mesh.positions.assign(positions.begin(), positions.end());
  on_surface = kOnSurface * largest_coordinate(positions);
  make_normals();
  bounds = geometry::bounds(mesh);
  tree.refit([&](Index t) {
    Box3 box;
    for (const Vec3& x : corners[t]) box.extend(x);
    return box;
  });
  find_hollows();
}

/// Walls, of which no triangle is among `triangles`, that must stand: of a wall to go, all of the rim lies on solids.
std::vector<Triangle> Impl::standing_walls(std::span<const Triangle> walls) const {
  std::vector<Triangle> all(triangles);
  all.insert(all.end(), walls.begin(), walls.end());
  const std::size_t others = triangles.size();
  Sets sets(walls.size());
  std::vector<char> stands(walls.size(), 0), held(walls.size(), 0);
  const std::vector<Side> sides = sorted_sides(all);
  for (const bool joining : {true, false}) {
    for_each_edge(sides, [&](std::span<const Side> edge) {
      std::size_t wall_sides = 0, solid_sides = 0;
      Index first = kNobody;
      for (const Side& side : edge) {
        const Index t = side.id / 3;
        if (t < others) {
          solid_sides += is_solid[part[t]] != 0;
          continue;
        }
        ++wall_sides;
        if (first == kNobody) first = static_cast<Index>(t - others);
        if (joining) sets.unite(first, static_cast<Index>(t - others));
      }
      if (joining || wall_sides == 0) return;
      const bool inner = wall_sides == edge.size() && wall_sides > 1, on_solids = solid_sides > 0 && solid_sides + wall_sides == edge.size();
      if (!inner && !on_solids) stands[sets.root(first)] = 1;
      if (on_solids) held[sets.root(first)] = 1;
    });
  }
  std::vector<Triangle> standing;
  for (std::size_t w = 0; w < walls.size(); ++w)
    if (const Index root = sets.root(static_cast<Index>(w)); stands[root] || !held[root]) standing.push_back(walls[w]);
  return standing;
}

void Impl::find_parts() {
  const std::vector<Side> sides = sorted_sides(triangles);
  across.assign(triangles.size(), {kNobody, kNobody, kNobody});
  const auto join = [&](Index a, Index b) {
    across[a / 3][a % 3] = b;
    across[b / 3][b % 3] = a;
  };
  Sets sets(triangles.size());
  for_each_edge(sides, [&](std::span<const Side> edge) {
    if (edge.size() != 2) return;
    join(edge[0].id, edge[1].id);
    sets.unite(edge[0].id / 3, edge[1].id / 3);
  });
  // Where more than two meet: those that are one part's only two there belong together.
  for_each_edge(sides, [&](std::span<const Side> edge) {
    if (edge.size() <= 2) return;
    for (std::size_t i = 0; i < edge.size(); ++i) {
      std::size_t same = 0, other = 0;
      for (std::size_t j = 0; j < edge.size(); ++j) {
        if (j == i || sets.root(edge[j].id / 3) != sets.root(edge[i].id / 3)) continue;
        ++same;
        other = j;
      }
      if (same == 1) join(edge[i].id, edge[other].id);
    }
  });
  // Numbered in the order of their first triangles.
  part.resize(triangles.size());
  std::vector<Index> number(triangles.size(), kNobody);
  Index parts = 0;
  for (Index t = 0; t < triangles.size(); ++t) {
    Index& mine = number[sets.root(t)];
    if (mine == kNobody) mine = parts++;
    part[t] = mine;
  }
  is_solid.assign(parts, 1);
  for (Index t = 0; t < triangles.size(); ++t)
    for (const Index side : across[t])
      if (side == kNobody) is_solid[part[t]] = 0;
}

void Impl::orient_parts() {
  // Turned over or not, as seen from each part's first triangle.
  std::vector<char> seen(triangles.size(), 0), over(triangles.size(), 0);
  std::vector<std::vector<Index>> members(is_solid.size());
  for (Index t = 0; t < triangles.size(); ++t) members[part[t]].push_back(t);
  std::vector<Index> open;
  for (std::size_t p = 0; p < is_solid.size(); ++p) {
    if (!is_solid[p]) continue;
    open.assign(1, members[p].front());
    seen[open.front()] = 1;
    std::size_t turned_over = 0;
    while (!open.empty() && is_solid[p]) {
      const Index t = open.back();
      open.pop_back();
      for (Index k = 0; k < 3; ++k) {
        const Index to = across[t][k], other = to / 3;
        const bool same_way = triangles[t][k] == triangles[other][to % 3];
        const char wanted = static_cast<char>(over[t] ^ (same_way ? 1 : 0));
        if (!seen[other]) {
          seen[other] = 1;
          over[other] = wanted;
          turned_over += wanted;
          open.push_back(other);
        } else if (over[other] != wanted) {
          is_solid[p] = 0;  // one side only, as Moebius' strip
        }
      }
    }
    if (!is_solid[p]) continue;
    // The fewer are turned; then all, if it faces inward.
    const bool the_rest = 2 * turned_over > members[p].size();
    const std::size_t flipped = the_rest ? members[p].size() - turned_over : turned_over;
    const Vec3 origin = mesh.positions[triangles[members[p].front()][0]];
    Real six_volumes = 0, twice_area = 0, furthest = 0;
    for (const Index t : members[p]) {
      const Vec3 a = mesh.positions[triangles[t][0]] - origin, b = mesh.positions[triangles[t][1]] - origin, c = mesh.positions[triangles[t][2]] - origin;
      const bool turn = (over[t] != 0) != the_rest;
      six_volumes += (turn ? -1 : 1) * a.dot(b.cross(c));
      twice_area += (b - a).cross(c - a).norm();
      furthest = std::max(furthest, a.norm());
    }
    // Two sheets back to back enclose nothing but rounding.
    constexpr Real kNothing = 1e-12;
    if (std::abs(six_volumes) <= kNothing * twice_area * furthest) {
      is_solid[p] = 0;
      continue;
    }
    const bool inward = six_volumes < 0;
    for (const Index t : members[p]) {
      if (((over[t] != 0) != the_rest) == inward) continue;
      // The sides are renumbered with the corners: (a b c) becomes (a c b).
      flip(triangles[t]);
      std::swap(across[t][0], across[t][2]);
    }
    report.flipped += flipped;
    report.turned += inward;
    if (inward) turned_parts.push_back(static_cast<Index>(p));
  }
  renumber_sides();
  report.parts = is_solid.size();
  report.solids = static_cast<std::size_t>(std::count(is_solid.begin(), is_solid.end(), 1));
  report.sheets = report.parts - report.solids;
}

void Impl::renumber_sides() {
  // Who was flipped is met at other sides now.
  for (Index t = 0; t < triangles.size(); ++t) {
    for (Index k = 0; k < 3; ++k) {
      Index& to = across[t][k];
      if (to == kNobody) continue;
      const Index a = std::min(triangles[t][k], triangles[t][(k + 1) % 3]), b = std::max(triangles[t][k], triangles[t][(k + 1) % 3]);
      for (Index m = 0; m < 3; ++m) {
        const Triangle& other = triangles[to / 3];
        if (std::min(other[m], other[(m + 1) % 3]) == a && std::max(other[m], other[(m + 1) % 3]) == b) {
          to = 3 * (to / 3) + m;
          break;
        }
      }
    }
  }
}

void Impl::make_normals() {
  const std::size_t n = mesh.triangles.size();
  face_normal.assign(triangles.size(), Vec3::Zero());
  corners.resize(n);
  for (std::size_t t = 0; t < n; ++t) {
    for (int k = 0; k < 3; ++k) corners[t][k] = mesh.positions[triangles[t][k]];
    face_normal[t] = (corners[t][1] - corners[t][0]).cross(corners[t][2] - corners[t][0]).normalized();
  }
  // One without area lies in the plane of its neighbour across the longest side; chains of them are few and short.
  for (int round = 0; round < 4; ++round) {
    for (std::size_t t = n; t < triangles.size(); ++t) {
      Index longest = 0;
      const auto length2 = [&](Index k) { return (mesh.positions[triangles[t][(k + 1) % 3]] - mesh.positions[triangles[t][k]]).squaredNorm(); };
      for (Index k = 1; k < 3; ++k)
        if (length2(k) > length2(longest)) longest = k;
      if (across[t][longest] != kNobody) face_normal[t] = face_normal[across[t][longest] / 3];
    }
  }
  // Corners of one vertex, joined across the sides that their triangles share.
  Sets sets(3 * triangles.size());
  for (Index t = 0; t < triangles.size(); ++t) {
    for (Index k = 0; k < 3; ++k) {
      if (across[t][k] == kNobody) continue;
      const Index other = across[t][k] / 3;
      for (const Index mine : {k, (k + 1) % 3})
        for (Index m = 0; m < 3; ++m)
          if (triangles[t][mine] == triangles[other][m]) sets.unite(3 * t + mine, 3 * other + m);
    }
  }
  std::vector<Index> slot(3 * triangles.size(), kNobody);
  fan_normal.clear();
  fan.resize(triangles.size());
  for (Index t = 0; t < triangles.size(); ++t) {
    for (Index k = 0; k < 3; ++k) {
      const Vec3& x = mesh.positions[triangles[t][k]];
      Index& mine = slot[sets.root(3 * t + k)];
      if (mine == kNobody) {
        mine = static_cast<Index>(fan_normal.size());
        fan_normal.push_back(Vec3::Zero());
      }
      fan[t][k] = mine;
      fan_normal[mine] += angle_between(mesh.positions[triangles[t][(k + 1) % 3]] - x, mesh.positions[triangles[t][(k + 2) % 3]] - x) * face_normal[t];
    }
  }
  for (Vec3& normal : fan_normal) {
    const Real length = normal.norm();
    normal = length > 1e-9 ? Vec3(normal / length) : Vec3(Vec3::Zero());
  }
}

void Impl::make_trees() {
  tree = triangle_tree(mesh.positions, mesh.triangles);
  bounds = geometry::bounds(mesh);

  // Solids into whose boxes triangles of other parts reach get a tree of their own.
  std::vector<Box3> box(is_solid.size());
  for (std::size_t t = 0; t < mesh.triangles.size(); ++t)
    for (const Vec3& x : corners[t]) box[part[t]].extend(x);
  std::vector<Index> place(box.size(), kNobody);
  for (Index p = 0; p < box.size(); ++p) {
    if (!is_solid[p] || report.parts == 1) continue;
    bool alone = true;
    tree.meeting(box[p], [&](Index t) { return alone = part[t] == p; });
    if (alone) continue;
    place[p] = static_cast<Index>(crossing.size());
    crossing.push_back({box[p], p, {}, {}});
  }
  for (Index t = 0; t < mesh.triangles.size(); ++t)
    if (place[part[t]] != kNobody) crossing[place[part[t]]].members.push_back(t);
  std::vector<Index> local(mesh.positions.size(), kNobody);
  for (Crossing& solid : crossing) {
    // With vertices of its own only: FCL copies all it is given.
    std::vector<Vec3> own_positions;
    std::vector<Triangle> own;
    for (const Index t : solid.members) {
      Triangle mine;
      for (int k = 0; k < 3; ++k) {
        Index& number = local[triangles[t][k]];
        if (number == kNobody) {
          number = static_cast<Index>(own_positions.size());
          own_positions.push_back(corners[t][k]);
        }
        mine[k] = number;
      }
      own.push_back(mine);
    }
    for (const Index t : solid.members)
      for (const Index v : triangles[t]) local[v] = kNobody;
    solid.tree = triangle_tree(own_positions, own);
  }
  report.crossing = crossing.size();
}

}  // namespace effuse::geometry
