#include "geometry/procedural/primitives.h"

#include <cmath>
#include <utility>

#include "geometry/base/check.h"

namespace effuse::geometry {

TriMesh make_box(const Vec3& low, const Vec3& high) {
  CHECK((low.array() < high.array()).all());
  TriMesh mesh;
  // Vertex k stands at the high end of axis a where bit a of k is set.
  for (int k = 0; k < 8; ++k) mesh.positions.emplace_back(k & 1 ? high.x() : low.x(), k & 2 ? high.y() : low.y(), k & 4 ? high.z() : low.z());
  mesh.triangles = {{0, 2, 3}, {0, 3, 1}, {4, 5, 7}, {4, 7, 6}, {0, 1, 5}, {0, 5, 4},
                    {2, 6, 7}, {2, 7, 3}, {0, 4, 6}, {0, 6, 2}, {1, 3, 7}, {1, 7, 5}};
  return mesh;
}

TriMesh make_sphere(const Vec3& centre, Real radius, int subdivisions) {
  CHECK_GT(radius, 0);
  CHECK_GE(subdivisions, 0);
  CHECK_LE(subdivisions, 10);
  const Real phi = (1 + std::sqrt(5.0)) / 2;
  TriMesh mesh;
  mesh.positions = {{-1, phi, 0}, {1, phi, 0}, {-1, -phi, 0}, {1, -phi, 0}, {0, -1, phi}, {0, 1, phi},
                    {0, -1, -phi}, {0, 1, -phi}, {phi, 0, -1}, {phi, 0, 1}, {-phi, 0, -1}, {-phi, 0, 1}};
  mesh.triangles = {{0, 11, 5}, {0, 5, 1},  {0, 1, 7},   {0, 7, 10}, {0, 10, 11}, {1, 5, 9}, {5, 11, 4}, {11, 10, 2}, {10, 7, 6}, {7, 1, 8},
                    {3, 9, 4},  {3, 4, 2},  {3, 2, 6},   {3, 6, 8},  {3, 8, 9},   {4, 9, 5}, {2, 4, 11}, {6, 2, 10},  {8, 6, 7},  {9, 8, 1}};
  for (Vec3& x : mesh.positions) x.normalize();

  for (int level = 0; level < subdivisions; ++level) {
    std::map<std::pair<Index, Index>, Index> middle_of;
    const auto middle = [&](Index a, Index b) {
      const auto [entry, is_new] = middle_of.try_emplace(std::minmax(a, b), static_cast<Index>(mesh.positions.size()));
      if (is_new) mesh.positions.push_back((mesh.positions[a] + mesh.positions[b]).normalized());
      return entry->second;
    };
    std::vector<Triangle> finer;
    finer.reserve(4 * mesh.triangles.size());
    for (const auto& [a, b, c] : mesh.triangles) {
      const Index ab = middle(a, b), bc = middle(b, c), ca = middle(c, a);
      finer.insert(finer.end(), {{a, ab, ca}, {b, bc, ab}, {c, ca, bc}, {ab, bc, ca}});
    }
    mesh.triangles = std::move(finer);
  }
  for (Vec3& x : mesh.positions) x = centre + radius * x;
  return mesh;
}

namespace {
/// Two triangles for each quad of a grid of m by n quads whose vertex (i, j) has the index at(i, j).
template <class At>
void add_quads(int m, int n, At&& at, std::vector<Triangle>& triangles) {
  for (int j = 0; j < n; ++j) {
    for (int i = 0; i < m; ++i) {
      triangles.push_back({at(i, j), at(i + 1, j), at(i + 1, j + 1)});
      triangles.push_back({at(i, j), at(i + 1, j + 1), at(i, j + 1)});
    }
  }
}
}  // namespace

TriMesh make_torus(const Vec3& centre, Real ring, Real tube, int around, int across) {
  CHECK_GT(tube, 0);
  CHECK_GT(ring, tube);
  CHECK_GE(around, 3);
  CHECK_GE(across, 3);
  TriMesh mesh;
  for (int j = 0; j < across; ++j) {
    const Real b = 2 * kPi * j / across;
    for (int i = 0; i < around; ++i) {
      const Real a = 2 * kPi * i / around, r = ring + tube * std::cos(b);
      mesh.positions.push_back(centre + Vec3(r * std::cos(a), r * std::sin(a), tube * std::sin(b)));
    }
  }
  add_quads(around, across, [&](int i, int j) { return static_cast<Index>((j % across) * around + i % around); }, mesh.triangles);
  return mesh;
}

TriMesh make_grid(const Vec3& corner, const Vec2& quad, int nx, int ny) {
  CHECK((quad.array() > 0).all());
  CHECK_GE(nx, 1);
  CHECK_GE(ny, 1);
  TriMesh mesh;
  for (int j = 0; j <= ny; ++j)
    for (int i = 0; i <= nx; ++i) mesh.positions.push_back(corner + Vec3(i * quad.x(), j * quad.y(), 0));
  add_quads(nx, ny, [&](int i, int j) { return static_cast<Index>(j * (nx + 1) + i); }, mesh.triangles);
  return mesh;
}

void append(TriMesh& mesh, const TriMesh& other) {
  CHECK(&mesh != &other);
  const std::size_t before = mesh.positions.size();
  const bool first = before == 0;
  mesh.positions.insert(mesh.positions.end(), other.positions.begin(), other.positions.end());
  for (const auto& [a, b, c] : other.triangles) {
    const auto shift = static_cast<Index>(before);
    mesh.triangles.push_back({a + shift, b + shift, c + shift});
  }

  // What only one of them has cannot be continued.
  const bool both_normals = (first || mesh.normals.size() == before) && other.normals.size() == other.positions.size();
  if (both_normals)
    mesh.normals.insert(mesh.normals.end(), other.normals.begin(), other.normals.end());
  else
    mesh.normals.clear();
  if (first) {
    mesh.attributes = other.attributes;
    return;
  }
  std::erase_if(mesh.attributes, [&](const auto& entry) {
    const auto found = other.attributes.find(entry.first);
    return found == other.attributes.end() || found->second.width != entry.second.width;
  });
  for (auto& [name, attribute] : mesh.attributes) {
    const std::vector<float>& more = other.attributes.at(name).values;
    attribute.values.insert(attribute.values.end(), more.begin(), more.end());
  }
}

}  // namespace effuse::geometry
