#include "geometry/query/mesh_surface.h"

#include <algorithm>
#include <cmath>
#include <map>
#include <numeric>

#include "geometry/base/error.h"
#include "geometry/mesh/validate.h"
#include "geometry/mesh/weld.h"

namespace effuse::geometry {

namespace {

constexpr Index kBorder = std::numeric_limits<Index>::max();        // nobody across this side
constexpr Index kMany = std::numeric_limits<Index>::max() - 1;      // two or more across this side
using Feature = TrianglePoint::Feature;

Real angle_between(const Vec3& a, const Vec3& b) { return std::atan2(a.cross(b).norm(), a.dot(b)); }

/// a turned towards b by the share s of the angle between them; both unit.
Vec3 turn(const Vec3& a, const Vec3& b, Real s) {
  const Real angle = angle_between(a, b);
  if (angle < 1e-9 || kPi - angle < 1e-9) return a;
  return (std::sin((1 - s) * angle) * a + std::sin(s * angle) * b).normalized();
}

}  // namespace

struct MeshSurface::Impl {
  std::vector<Vec3> positions;
  std::vector<Triangle> triangles;             // of area > 0, on welded vertices
  std::vector<Vec3> face_normal;               // unit, per triangle
  std::vector<std::array<Index, 3>> across;    // per side: 3 * triangle + side of the neighbour, kBorder or kMany
  std::map<std::size_t, Vec3> many_normal;     // pseudonormals of the sides with kMany, by 3 * triangle + side
  std::vector<Vec3> vertex_normal;             // angle-weighted over all triangles around
  std::vector<char> rim, creased;              // vertices on the border; vertices with a sharp edge
  std::vector<Vec3> corner_normal;             // angle-weighted over the triangles reached without crossing a sharp edge
  std::vector<std::array<Index, 3>> corner;    // per triangle: which of them
  std::vector<Index> around, around_start;     // the triangles at each vertex, rising
  std::unique_ptr<MeshTree> tree;

  void link_sides();
  void make_normals();
  void list_around();
  /// Of the triangles that share the feature the nearest point lies on, the first of those at the least distance: which one a search meets
  /// first does not tell.
  MeshTree::Nearest settled(const Vec3& p, MeshTree::Nearest nearest) const;
  Contact contact_at(const Vec3& p, const MeshTree::Nearest& nearest) const;
  bool sharp(std::size_t t, int side) const {
    const Index other = across[t][side];
    return other >= kMany || face_normal[t].dot(face_normal[other / 3]) < std::cos(kCreaseAngle);
  }
  Vec3 edge_normal(std::size_t t, int side) const {
    const Index other = across[t][side];
    if (other == kMany) return many_normal.at(3 * t + side);
    return other == kBorder ? face_normal[t] : Vec3(face_normal[t] + face_normal[other / 3]);
  }
  /// Vertex normals of triangle t, blended; the face's own where they cancel.
  Vec3 blended(std::size_t t, const Vec3& weights) const {
    Vec3 sum = Vec3::Zero();
    for (int k = 0; k < 3; ++k) sum += weights[k] * corner_normal[corner[t][k]];
    const Real length = sum.norm();
    return length > 1e-6 ? Vec3(sum / length) : face_normal[t];
  }
  /// Out of triangle t across a side, in its plane.
  Vec3 outward(std::size_t t, int side) const {
    return (positions[triangles[t][(side + 1) % 3]] - positions[triangles[t][side]]).cross(face_normal[t]).normalized();
  }
  bool beyond_rim(std::size_t t, const TrianglePoint& at, const Vec3& offset) const;
  Vec3 smooth_normal(std::size_t t, const TrianglePoint& at, const Vec3& offset, bool inside) const;
};

void MeshSurface::Impl::link_sides() {
  struct Side {
    Index low, high, id;
  };
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
  across.resize(triangles.size());
  rim.assign(positions.size(), 0);
  for (std::size_t begin = 0, end; begin < sides.size(); begin = end) {
    for (end = begin + 1; end < sides.size() && sides[end].low == sides[begin].low && sides[end].high == sides[begin].high; ++end) {
    }
    const auto set = [&](Index id, Index value) { across[id / 3][id % 3] = value; };
    if (end - begin == 1) {
      set(sides[begin].id, kBorder);
      rim[sides[begin].low] = rim[sides[begin].high] = 1;
    } else if (end - begin == 2) {
      set(sides[begin].id, sides[begin + 1].id);
      set(sides[begin + 1].id, sides[begin].id);
    } else {
      Vec3 sum = Vec3::Zero();
      for (std::size_t k = begin; k < end; ++k) sum += face_normal[sides[k].id / 3];
      for (std::size_t k = begin; k < end; ++k) {
        set(sides[k].id, kMany);
        many_normal[sides[k].id] = sum;
      }
    }
  }
}

void MeshSurface::Impl::make_normals() {
  // Corners of one vertex that no sharp edge parts share a normal: sets of corners, joined across smooth edges.
  std::vector<Index> parent(3 * triangles.size());
  std::iota(parent.begin(), parent.end(), Index{0});
  const auto root = [&](Index i) {
    while (parent[i] != i) i = parent[i] = parent[parent[i]];
    return i;
  };
  const auto unite = [&](Index i, Index j) {
    const Index a = root(i), b = root(j);
    parent[std::max(a, b)] = std::min(a, b);
  };
  creased.assign(positions.size(), 0);
  for (std::size_t t = 0; t < triangles.size(); ++t) {
    for (int k = 0; k < 3; ++k) {
      const Index from = triangles[t][k], to = triangles[t][(k + 1) % 3];
      if (sharp(t, k)) {
        if (across[t][k] != kBorder) creased[from] = creased[to] = 1;
        continue;
      }
      const Index other = across[t][k] / 3;
      for (Index mine : {3 * static_cast<Index>(t) + k, 3 * static_cast<Index>(t) + (k + 1) % 3}) {
        for (Index theirs = 3 * other; theirs < 3 * other + 3; ++theirs)
          if (triangles[t][mine % 3] == triangles[other][theirs % 3]) unite(mine, theirs);
      }
    }
  }

  vertex_normal.assign(positions.size(), Vec3::Zero());
  corner.resize(triangles.size());
  std::vector<Index> slot(parent.size(), kBorder);
  for (std::size_t t = 0; t < triangles.size(); ++t) {
    for (int k = 0; k < 3; ++k) {
      const Vec3& x = positions[triangles[t][k]];
      const Real angle = angle_between(positions[triangles[t][(k + 1) % 3]] - x, positions[triangles[t][(k + 2) % 3]] - x);
      Index& mine = slot[root(static_cast<Index>(3 * t + k))];
      if (mine == kBorder) {
        mine = static_cast<Index>(corner_normal.size());
        corner_normal.push_back(Vec3::Zero());
      }
      corner[t][k] = mine;
      corner_normal[mine] += angle * face_normal[t];
      vertex_normal[triangles[t][k]] += angle * face_normal[t];
    }
  }
  for (Vec3& n : corner_normal) n.normalize();  // a zero sum stays zero: blended() falls back on the face
  for (Vec3& n : vertex_normal) n.normalize();
}

void MeshSurface::Impl::list_around() {
  around_start.assign(positions.size() + 1, 0);
  for (const Triangle& t : triangles)
    for (const Index v : t) ++around_start[v + 1];
  for (std::size_t v = 0; v < positions.size(); ++v) around_start[v + 1] += around_start[v];
  around.resize(3 * triangles.size());
  std::vector<Index> next(around_start.begin(), around_start.end() - 1);
  for (std::size_t t = 0; t < triangles.size(); ++t)
    for (const Index v : triangles[t]) around[next[v]++] = static_cast<Index>(t);
}

MeshTree::Nearest MeshSurface::Impl::settled(const Vec3& p, MeshTree::Nearest nearest) const {
  // Away from its sides a triangle shares the point with nobody.
  constexpr Real kAside = 1e-7;
  const Vec3 weights = nearest.at.weights;
  if (weights.minCoeff() > kAside) return nearest;
  Eigen::Index heaviest = 0;
  weights.maxCoeff(&heaviest);
  const Index v = triangles[nearest.triangle][static_cast<std::size_t>(heaviest)];
  for (Index k = around_start[v]; k < around_start[v + 1]; ++k) {
    const Index t = around[k];
    if (t == nearest.triangle) continue;
    const auto& [a, b, c] = triangles[t];
    const TrianglePoint at = closest_point_on_triangle(p, positions[a], positions[b], positions[c]);
    const Real distance = (p - at.point).norm();
    if (distance < nearest.distance || (distance == nearest.distance && t < nearest.triangle)) nearest = {t, at, distance};
  }
  return nearest;
}

bool MeshSurface::Impl::beyond_rim(std::size_t t, const TrianglePoint& at, const Vec3& offset) const {
  // Straight above the rim still counts; rounding of the offset must not decide.
  constexpr Real kStraight = 1e-9;
  const Real slack = kStraight * offset.norm();
  if (at.feature == Feature::kEdge) return across[t][at.index] == kBorder && outward(t, at.index).dot(offset) > slack;
  if (at.feature != Feature::kVertex || !rim[triangles[t][at.index]]) return false;
  // At a vertex of the border: beyond either border side that ends there. The closest triangle may be any around
  // the vertex; a plane of the surface continued past the rim is tested by the vertex normal.
  const Vec3& n = vertex_normal[triangles[t][at.index]];
  if (offset.norm() == 0) return false;
  return angle_between(offset, n) > kStraight && kPi - angle_between(offset, n) > kStraight;
}

Vec3 MeshSurface::Impl::smooth_normal(std::size_t t, const TrianglePoint& at, const Vec3& offset, bool inside) const {
  const Real distance = offset.norm();
  const bool on_surface = distance <= 1e-12 * (1 + at.point.cwiseAbs().maxCoeff());
  if (at.feature == Feature::kEdge && across[t][at.index] < kMany && sharp(t, at.index)) {
    // Across a sharp edge: from this face's blend to the other's, as the offset turns from one face to the other.
    const Index other = across[t][at.index] / 3;
    Vec3 weights = Vec3::Zero();
    for (int k = 0; k < 3; ++k)
      for (int m = 0; m < 3; ++m)
        if (triangles[t][k] == triangles[other][m]) weights[m] = at.weights[k];
    const Vec3 &mine = face_normal[t], &theirs = face_normal[other];
    Real share = 0.5;
    if (!on_surface) {
      const Vec3 direction = inside ? Vec3(-offset / distance) : Vec3(offset / distance);
      const Real from = angle_between(mine, direction), to = angle_between(direction, theirs);
      if (from + to > 0) share = from / (from + to);
    }
    return turn(blended(t, at.weights), blended(other, weights), share);
  }
  if (at.feature == Feature::kVertex && creased[triangles[t][at.index]]) {
    if (!on_surface) return inside ? Vec3(-offset / distance) : Vec3(offset / distance);
    const Vec3& n = vertex_normal[triangles[t][at.index]];
    return n.isZero() ? face_normal[t] : n;
  }
  return blended(t, at.weights);
}

MeshSurface::MeshSurface(const TriMesh& mesh) : impl_(std::make_unique<Impl>()) {
  validate(mesh);
  Impl& s = *impl_;
  s.positions = mesh.positions;
  const std::vector<Index> first = first_coincident(mesh.positions);
  for (const auto& [a, b, c] : mesh.triangles) {
    const Triangle triangle{first[a], first[b], first[c]};
    const Vec3 cross = (s.positions[triangle[1]] - s.positions[triangle[0]]).cross(s.positions[triangle[2]] - s.positions[triangle[0]]);
    const Real twice_area = cross.norm();
    if (!(twice_area > 0)) continue;
    s.triangles.push_back(triangle);
    s.face_normal.push_back(cross / twice_area);
  }
  if (s.triangles.empty()) throw InputError(Place{}, "the mesh has no triangle with an area, wanted at least one");
  s.link_sides();
  s.make_normals();
  s.list_around();
  s.tree = std::make_unique<MeshTree>(s.positions, s.triangles);
  if (s.tree->size() == 0) throw InputError(Place{}, "the mesh has no triangle with an area, wanted at least one");
}

MeshSurface::~MeshSurface() = default;
MeshSurface::MeshSurface(MeshSurface&&) noexcept = default;
MeshSurface& MeshSurface::operator=(MeshSurface&&) noexcept = default;

const MeshTree& MeshSurface::tree() const { return *impl_->tree; }

Contact MeshSurface::contact(const Vec3& p, Real reach) const {
  const auto nearest = impl_->tree->nearest(p, reach);
  return nearest ? impl_->contact_at(p, impl_->settled(p, *nearest)) : Contact{};
}

Contact MeshSurface::contact(const Vec3& p, Real reach, const NearTriangles& cache) const {
  const auto nearest = cache.nearest(p, reach);
  return nearest ? impl_->contact_at(p, impl_->settled(p, *nearest)) : Contact{};
}

std::optional<NearTriangles> MeshSurface::make_cache(Real reach) const { return NearTriangles::build(impl_->positions, impl_->triangles, reach); }

Contact MeshSurface::Impl::contact_at(const Vec3& p, const MeshTree::Nearest& nearest) const {
  Contact contact;
  const std::size_t t = nearest.triangle;
  const TrianglePoint& at = nearest.at;
  const Vec3 offset = p - at.point;
  if (beyond_rim(t, at, offset)) return contact;

  Vec3 pseudonormal = face_normal[t];
  if (at.feature == Feature::kEdge) pseudonormal = edge_normal(t, at.index);
  if (at.feature == Feature::kVertex) pseudonormal = vertex_normal[triangles[t][at.index]];
  const bool inside = offset.dot(pseudonormal) < 0;
  contact.point = at.point;
  contact.distance = inside ? -nearest.distance : nearest.distance;
  contact.normal = smooth_normal(t, at, offset, inside);
  return contact;
}

std::vector<Real> MeshSurface::tops(Real x, Real y) const {
  std::vector<Real> tops;
  for (const MeshTree::Crossing& crossing : impl_->tree->vertical(x, y)) {
    if (impl_->face_normal[crossing.triangle].z() < 0) continue;
    if (tops.empty() || tops.back() != crossing.t) tops.push_back(crossing.t);
  }
  return tops;
}

}  // namespace effuse::geometry
