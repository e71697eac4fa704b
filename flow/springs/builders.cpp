#include "flow/springs/builders.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <map>

#include "geometry/base/check.h"
#include "geometry/base/error.h"
#include "geometry/base/parallel.h"
#include "geometry/mesh/validate.h"
#include "geometry/query/cube_lattice.h"

namespace effuse::flow::springs {

namespace {

constexpr Real kLeastShare = 1. / 16;  // of a cube's mass, for a point that the inside hardly touches

/// Places a surface vertex on one point, or eight.
void hang(SpringBody& body, Index point) {
  body.point.push_back({point});
  body.weight.push_back({1});
}

Real length(const SpringBody& body, Index a, Index b) { return (body.state.x[a] - body.state.x[b]).norm(); }

void join(SpringBody& body, Index a, Index b, Index material) { body.network.springs.push_back({a, b, material, length(body, a, b)}); }

void rest(SpringBody& body) {
  body.state.v.assign(body.state.x.size(), Vec3::Zero());
  body.network.held.assign(body.state.x.size(), 0);
}

/// Steps to the half of the 26 neighbours that come later in the order of points.
std::vector<std::array<int, 3>> later_neighbours() {
  std::vector<std::array<int, 3>> steps;
  for (int i = 0; i <= 1; ++i)
    for (int j = -1; j <= 1; ++j)
      for (int k = -1; k <= 1; ++k)
        if (i > 0 || j > 0 || (j == 0 && k > 0)) steps.push_back({i, j, k});
  return steps;
}

}  // namespace

std::vector<Vec3> surface_positions(const SpringBody& body, const std::vector<Vec3>& x) {
  std::vector<Vec3> positions(body.point.size());
  parallel_for(positions.size(), [&](std::size_t q) {
    Vec3 sum = Vec3::Zero();
    for (std::size_t k = 0; k < 8; ++k)
      if (body.weight[q][k] != 0) sum += static_cast<Real>(body.weight[q][k]) * x[body.point[q][k]];
    positions[q] = sum;
  });
  return positions;
}

SpringBody jello_cube(int n, const Vec3& corner, Real side, Real mass_per_point, const SpringMaterial& material) {
  CHECK_GE(n, 2);
  CHECK_GT(side, 0);
  SpringBody body;
  const auto at = [&](int i, int j, int k) { return static_cast<Index>((i * n + j) * n + k); };
  const auto inside = [&](int i) { return i >= 0 && i < n; };
  for (int i = 0; i < n; ++i)
    for (int j = 0; j < n; ++j)
      for (int k = 0; k < n; ++k) body.state.x.push_back(corner + side / (n - 1) * Vec3(i, j, k));
  rest(body);
  body.network.mass.assign(body.state.x.size(), mass_per_point);
  body.network.materials = {material};
  std::vector<std::array<int, 3>> steps = later_neighbours();
  steps.insert(steps.end(), {{2, 0, 0}, {0, 2, 0}, {0, 0, 2}});
  for (int i = 0; i < n; ++i)
    for (int j = 0; j < n; ++j)
      for (int k = 0; k < n; ++k)
        for (const auto& [di, dj, dk] : steps)
          if (inside(i + di) && inside(j + dj) && inside(k + dk)) join(body, at(i, j, k), at(i + di, j + dj, k + dk), 0);

  // Six faces that share their edges' vertices.
  std::map<Index, Index> vertex;
  const auto shown = [&](Index point) {
    const auto [found, added] = vertex.try_emplace(point, static_cast<Index>(vertex.size()));
    if (added) {
      hang(body, point);
      body.surface.positions.push_back(body.state.x[point]);
    }
    return found->second;
  };
  for (int axis = 0; axis < 3; ++axis)
    for (int end = 0; end < 2; ++end)
      for (int a = 0; a + 1 < n; ++a)
        for (int b = 0; b + 1 < n; ++b) {
          const auto corner_at = [&](int u, int v) {
            int ijk[3];
            ijk[axis] = end * (n - 1);
            ijk[(axis + 1) % 3] = u;
            ijk[(axis + 2) % 3] = v;
            return shown(at(ijk[0], ijk[1], ijk[2]));
          };
          Index q[4] = {corner_at(a, b), corner_at(a + 1, b), corner_at(a + 1, b + 1), corner_at(a, b + 1)};
          if (end == 0) std::swap(q[1], q[3]);
          body.surface.triangles.push_back({q[0], q[1], q[2]});
          body.surface.triangles.push_back({q[0], q[2], q[3]});
        }
  return body;
}

SpringBody cloth(const geometry::TriMesh& mesh, Real area_density, const SpringMaterial& stretch, const SpringMaterial& bend) {
  CHECK_GT(area_density, 0);
  geometry::validate(mesh);
  SpringBody body;
  body.surface = mesh;
  body.state.x = mesh.positions;
  rest(body);
  body.network.mass.assign(mesh.positions.size(), 0);
  body.network.materials = {stretch, bend};
  std::map<std::pair<Index, Index>, Index> opposite;  // of an edge: the vertex of the triangle met first
  std::map<std::pair<Index, Index>, bool> bent;
  for (const geometry::Triangle& t : mesh.triangles) {
    const Real area = (mesh.positions[t[1]] - mesh.positions[t[0]]).cross(mesh.positions[t[2]] - mesh.positions[t[0]]).norm() / 2;
    for (std::size_t k = 0; k < 3; ++k) {
      const Index a = t[k], b = t[(k + 1) % 3], c = t[(k + 2) % 3];
      body.network.mass[a] += area_density * area / 3;
      if (a == b) continue;
      const auto [found, added] = opposite.try_emplace(std::minmax(a, b), c);
      if (added)
        join(body, std::min(a, b), std::max(a, b), 0);
      else if (found->second != c && !opposite.contains(std::minmax(c, found->second)) && bent.try_emplace(std::minmax(c, found->second), true).second)
        join(body, std::min(c, found->second), std::max(c, found->second), 1);
    }
  }
  for (std::size_t i = 0; i < mesh.positions.size(); ++i) {
    hang(body, static_cast<Index>(i));
    if (!(body.network.mass[i] > 0)) throw InputError(Place{"cloth"}, fmt::format("vertex {} belongs to no triangle with an area, so it has no mass; remove it first", i));
  }
  return body;
}

SpringBody filled(const geometry::TriMesh& mesh, Real spacing, Real density, const SpringMaterial& material, std::size_t max_points) {
  CHECK_GT(density, 0);
  geometry::CubeLattice lattice = geometry::fill_with_cubes(mesh, spacing, "springs", max_points);
  SpringBody body;
  body.state.x = std::move(lattice.corners);
  rest(body);
  body.network.mass.assign(body.state.x.size(), 0);
  body.network.materials = {material};
  std::map<std::pair<Index, Index>, bool> joined;
  const Real cube_mass = density * spacing * spacing * spacing;
  for (std::size_t c = 0; c < lattice.cubes.size(); ++c)
    for (std::size_t a = 0; a < 8; ++a) {
      body.network.mass[lattice.cubes[c][a]] += std::max(static_cast<Real>(lattice.share[c]), kLeastShare) * cube_mass / 8;
      for (std::size_t b = a + 1; b < 8; ++b) {
        const std::pair<Index, Index> ends = std::minmax(lattice.cubes[c][a], lattice.cubes[c][b]);
        if (joined.try_emplace(ends, true).second) join(body, ends.first, ends.second, 0);
      }
    }
  body.surface = mesh;
  for (const Index cube : lattice.cube_of) body.point.push_back(lattice.cubes[cube]);
  body.weight = std::move(lattice.weight);
  return body;
}

}  // namespace effuse::flow::springs
