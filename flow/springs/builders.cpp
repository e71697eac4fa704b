#include "flow/springs/builders.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <map>

#include "geometry/base/check.h"
#include "geometry/base/error.h"
#include "geometry/base/parallel.h"
#include "geometry/mesh/measure.h"
#include "geometry/mesh/validate.h"
#include "geometry/query/mesh_surface.h"

namespace effuse::flow::springs {

namespace {

constexpr int kSamples = 4;           // a side, of a cube's share of the inside
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
  CHECK_GT(spacing, 0);
  CHECK_GT(density, 0);
  const geometry::MeshReport report = geometry::validate(mesh);
  if (!report.closed()) throw InputError(Place{"springs"}, "the mesh is not closed, so it has no inside to fill: " + geometry::to_string(report));
  const geometry::MeshSurface solid(mesh);
  const Box3 box = geometry::bounds(mesh);
  // One lattice of cubes about the box; the odd half cube is shared out at both ends.
  std::array<std::size_t, 3> cubes;
  Vec3 low;
  for (int a = 0; a < 3; ++a) {
    const Real count = std::max(1.0, std::ceil(box.sizes()[a] / spacing));
    if (!(count < 1e6)) throw InputError(Place{"springs"}, fmt::format("a spacing of {:g} m needs {:g} points along one side of the mesh", spacing, count));
    cubes[static_cast<std::size_t>(a)] = static_cast<std::size_t>(count);
    low[a] = box.center()[a] - count * spacing / 2;
  }
  const std::size_t all = cubes[0] * cubes[1] * cubes[2];
  if (all > 8 * max_points) throw InputError(Place{"springs"}, fmt::format("a spacing of {:g} m fills the mesh's box with {} cubes, more than {}; take a wider one", spacing, all, 8 * max_points));
  const auto cube_low = [&](std::size_t c) {
    return Vec3(low + spacing * Vec3(static_cast<Real>(c / (cubes[1] * cubes[2])), static_cast<Real>(c / cubes[2] % cubes[1]), static_cast<Real>(c % cubes[2])));
  };
  std::vector<float> share(all, -1);  // of the cube inside; -1: not kept
  parallel_for(all, [&](std::size_t c) {
    const Vec3 centre = cube_low(c) + Vec3::Constant(spacing / 2);
    const Real distance = solid.contact(centre).distance, corner = spacing * std::sqrt(3.0) / 2;
    if (distance > corner) return;
    if (distance < -corner) {
      share[c] = 1;
      return;
    }
    int inside = 0;
    for (int s = 0; s < kSamples * kSamples * kSamples; ++s) {
      const Vec3 at(s / (kSamples * kSamples) + 0.5, s / kSamples % kSamples + 0.5, s % kSamples + 0.5);
      inside += solid.contact(cube_low(c) + spacing / kSamples * at, 2 * spacing).distance < 0;
    }
    share[c] = static_cast<float>(inside) / (kSamples * kSamples * kSamples);
  }, 16);

  // Cubes that the mesh runs through stay, whatever their share: its vertices hang in them.
  std::vector<std::uint8_t> kept(all, 0);
  const auto cube_of = [&](const Vec3& p) {
    std::array<std::size_t, 3> at;
    for (int a = 0; a < 3; ++a)
      at[static_cast<std::size_t>(a)] = std::min(cubes[static_cast<std::size_t>(a)] - 1, static_cast<std::size_t>(std::max(0.0, (p[a] - low[a]) / spacing)));
    return (at[0] * cubes[1] + at[1]) * cubes[2] + at[2];
  };
  for (std::size_t c = 0; c < all; ++c) kept[c] = share[c] > 0;
  for (const Vec3& p : mesh.positions) kept[cube_of(p)] = 1;

  SpringBody body;
  const std::array<std::size_t, 3> points = {cubes[0] + 1, cubes[1] + 1, cubes[2] + 1};
  constexpr Index kNone = ~Index{0};
  std::vector<Index> number(points[0] * points[1] * points[2], kNone);
  const auto corner_of = [&](std::size_t c, std::size_t k) {
    const std::size_t i = c / (cubes[1] * cubes[2]) + (k >> 2), j = c / cubes[2] % cubes[1] + ((k >> 1) & 1), l = c % cubes[2] + (k & 1);
    return (i * points[1] + j) * points[2] + l;
  };
  const Real cube_mass = density * spacing * spacing * spacing;
  for (std::size_t c = 0; c < all; ++c) {
    if (!kept[c]) continue;
    for (std::size_t k = 0; k < 8; ++k) {
      Index& point = number[corner_of(c, k)];
      if (point == kNone) {
        point = static_cast<Index>(body.state.x.size());
        body.state.x.push_back(cube_low(c) + spacing * Vec3(static_cast<Real>(k >> 2), static_cast<Real>((k >> 1) & 1), static_cast<Real>(k & 1)));
        body.network.mass.push_back(0);
      }
      body.network.mass[point] += std::max<Real>(static_cast<Real>(share[c]), kLeastShare) * cube_mass / 8;
    }
  }
  if (body.state.x.size() > max_points)
    throw InputError(Place{"springs"}, fmt::format("a spacing of {:g} m fills the mesh with {} points, more than {}; take a wider one", spacing, body.state.x.size(), max_points));
  rest(body);
  body.network.materials = {material};
  std::map<std::pair<Index, Index>, bool> joined;
  for (std::size_t c = 0; c < all; ++c) {
    if (!kept[c]) continue;
    for (std::size_t a = 0; a < 8; ++a)
      for (std::size_t b = a + 1; b < 8; ++b) {
        const std::pair<Index, Index> ends = std::minmax(number[corner_of(c, a)], number[corner_of(c, b)]);
        if (joined.try_emplace(ends, true).second) join(body, ends.first, ends.second, 0);
      }
  }
  body.surface = mesh;
  for (const Vec3& p : mesh.positions) {
    const std::size_t c = cube_of(p);
    const Vec3 f = (p - cube_low(c)) / spacing;
    std::array<Index, 8> point;
    std::array<float, 8> weight;
    for (std::size_t k = 0; k < 8; ++k) {
      point[k] = number[corner_of(c, k)];
      weight[k] = static_cast<float>((k >> 2 ? f.x() : 1 - f.x()) * ((k >> 1) & 1 ? f.y() : 1 - f.y()) * (k & 1 ? f.z() : 1 - f.z()));
    }
    body.point.push_back(point);
    body.weight.push_back(weight);
  }
  return body;
}

}  // namespace effuse::flow::springs
