#include "flow/effects/elastic_shape.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <numeric>

#include "geometry/base/error.h"
#include "geometry/mesh/creased.h"
#include "geometry/mesh/measure.h"

namespace effuse::flow {

namespace {

constexpr Real kCrease = 35 * kPi / 180;
constexpr Real kMostCells = 200000;
constexpr Real kUsual[] = {0.62, 0.30, 0.24};  // sRGB
constexpr float kPale = 1.35f;                 // of faces that breaking has made
constexpr std::array<std::array<std::size_t, 3>, 4> kFaces = {{{1, 2, 3}, {0, 3, 2}, {0, 1, 3}, {0, 2, 1}}};

/// Faces of one tetrahedron only: numbers 4 tet + corner they are opposite to.
std::vector<std::size_t> border(const std::vector<std::array<Index, 4>>& tets) {
  struct Face {
    std::array<Index, 3> key;
    std::size_t number;
  };
  std::vector<Face> faces;
  faces.reserve(4 * tets.size());
  for (std::size_t e = 0; e < tets.size(); ++e)
    for (std::size_t f = 0; f < 4; ++f) {
      std::array<Index, 3> key = {tets[e][kFaces[f][0]], tets[e][kFaces[f][1]], tets[e][kFaces[f][2]]};
      std::sort(key.begin(), key.end());
      faces.push_back({key, 4 * e + f});
    }
  std::sort(faces.begin(), faces.end(), [](const Face& a, const Face& b) { return a.key != b.key ? a.key < b.key : a.number < b.number; });
  std::vector<std::size_t> alone;
  for (std::size_t k = 0; k < faces.size(); ++k)
    if ((k == 0 || faces[k - 1].key != faces[k].key) && (k + 1 == faces.size() || faces[k + 1].key != faces[k].key)) alone.push_back(faces[k].number);
  std::sort(alone.begin(), alone.end());
  return alone;
}

void mark_outer(ElasticShape& shape) {
  shape.outer.assign(4 * shape.tets.tets.size(), 0);
  for (const std::size_t face : border(shape.tets.tets)) shape.outer[face] = 1;
}

}  // namespace

ElasticShape box_shape(const Vec3& edges, Real spacing, const fem::ElasticMaterial& material, const geometry::RigidPose& pose, const std::string& what) {
  ElasticShape shape;
  int n[3];
  Real cells = 1;
  for (int a = 0; a < 3; ++a) cells *= std::max(1.0, std::round(edges[a] / spacing));
  if (cells > kMostCells) throw InputError(Place{}, fmt::format("{}: a spacing of {:g} m makes {:.3g} cells, {:g} are the most; take a wider one", what, spacing, cells, kMostCells));
  for (int a = 0; a < 3; ++a) n[a] = static_cast<int>(std::max(1.0, std::round(edges[a] / spacing)));
  shape.tets = fem::box_of_tets(-edges / 2, edges / 2, n[0], n[1], n[2]);
  for (Vec3& x : shape.tets.nodes) x = pose.world(x);
  shape.material = material;
  shape.spacing = spacing;
  mark_outer(shape);
  return shape;
}

ElasticShape mesh_shape(geometry::TriMesh mesh, Real spacing, const fem::ElasticMaterial& material, const geometry::RigidPose& pose, const std::string& what) {
  ElasticShape shape;
  const Real volume = std::abs(geometry::signed_volume(mesh));
  for (Vec3& x : mesh.positions) x = pose.world(x);
  fem::TetFill fill = fem::fill_with_tets(mesh, spacing, what);
  shape.tets = std::move(fill.mesh);
  shape.material = material;
  shape.material.density *= volume / fill.volume;
  shape.spacing = spacing;
  mark_outer(shape);
  if (material.strength > 0) return shape;
  shape.surface = std::move(mesh);
  shape.surface.attributes.clear();
  shape.tet_of = std::move(fill.tet_of);
  shape.weight = std::move(fill.weight);
  return shape;
}

geometry::TriMesh ElasticShape::look(const fem::ElasticSolid& solid, const Vec3& color) const {
  const fem::SolidState& state = solid.state();
  geometry::TriMesh mesh;
  std::vector<Vec3> velocity;
  std::vector<float> inner;
  if (!surface.positions.empty()) {
    mesh.triangles = surface.triangles;
    for (std::size_t q = 0; q < tet_of.size(); ++q) {
      Vec3 x = Vec3::Zero(), v = Vec3::Zero();
      for (std::size_t k = 0; k < 4; ++k) {
        const Index node = solid.tets()[tet_of[q]][k];
        x += weight[q][k] * state.x[node];
        v += weight[q][k] * state.v[node];
      }
      mesh.positions.push_back(x);
      velocity.push_back(v);
    }
    geometry::compute_normals(mesh);
  } else {
    geometry::TriMesh faces;
    faces.positions = state.x;
    std::vector<std::uint8_t> made;
    for (const std::size_t face : border(solid.tets())) {
      const std::array<Index, 4>& t = solid.tets()[face / 4];
      const auto& corners = kFaces[face % 4];
      faces.triangles.push_back({t[corners[0]], t[corners[1]], t[corners[2]]});
      made.push_back(!outer[face]);
    }
    std::vector<Index> from;
    mesh = geometry::creased(faces, kCrease, &from);
    for (const Index i : from) velocity.push_back(state.v[i]);
    for (std::size_t q = 0; q < from.size(); ++q) inner.push_back(made[q / 3]);
  }
  geometry::VertexAttribute& v = mesh.attributes["velocity"];
  geometry::VertexAttribute& c = mesh.attributes["color"];
  v.width = c.width = 3;
  for (std::size_t q = 0; q < mesh.positions.size(); ++q)
    for (int a = 0; a < 3; ++a) {
      v.values.push_back(static_cast<float>(velocity[q][a]));
      const auto light = static_cast<float>(std::pow(color[0] < 0 ? kUsual[a] : color[a], 2.2));
      c.values.push_back(std::min(1.0f, light * (!inner.empty() && inner[q] > 0 ? kPale : 1)));
    }
  if (material.strength > 0) mesh.attributes["inner"] = {1, std::move(inner)};
  return mesh;
}

std::size_t ElasticShape::memory() const {
  return surface.positions.capacity() * sizeof(Vec3) + surface.triangles.capacity() * sizeof(geometry::Triangle) + tet_of.capacity() * 20 + outer.capacity() + tets.nodes.capacity() * sizeof(Vec3) + tets.tets.capacity() * 16;
}

std::size_t pieces_of(const fem::ElasticSolid& solid) {
  std::vector<Index> root(solid.nodes());
  std::iota(root.begin(), root.end(), Index{0});
  const auto find = [&](Index i) {
    while (root[i] != i) i = root[i] = root[root[i]];
    return i;
  };
  std::vector<std::uint8_t> used(solid.nodes(), 0);
  for (const auto& t : solid.tets())
    for (const Index i : t) {
      used[i] = 1;
      root[find(i)] = find(t[0]);
    }
  std::size_t pieces = 0;
  for (Index i = 0; i < solid.nodes(); ++i) pieces += used[i] && find(i) == i;
  return pieces;
}

}  // namespace effuse::flow
