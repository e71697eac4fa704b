#pragma once

#include <cmath>
#include <functional>

#include "geometry/base/random.h"
#include "geometry/mesh/measure.h"
#include "geometry/mesh/tri_mesh.h"

namespace effuse::skin::testing_meshes {

/// A closed tube along x from 0 to length over the ground z = ground(x, y), hot at x = 0 and cold at the end, with
/// every attribute that skin makes and none that colour makes. (along + 1) * around + 2 vertices.
inline geometry::TriMesh tube(
    double length, double radius, int along, int around,
    const std::function<double(double, double)>& ground = [](double, double) { return 0.0; }) {
  geometry::TriMesh mesh;
  geometry::VertexAttribute temperature{1, {}}, crust{1, {}}, velocity{3, {}}, detail{1, {}};
  const auto add = [&](double x, double y, double z) {
    const double s = x / length;
    mesh.positions.emplace_back(x, y, z);
    temperature.values.push_back(static_cast<float>(1470 - 570 * s));
    crust.values.push_back(static_cast<float>(s));
    for (double v : {2 - s, 0.1 * y, -0.3}) velocity.values.push_back(static_cast<float>(v));
    detail.values.push_back(static_cast<float>(std::sin(1.7 * x) * std::cos(2.3 * y)));
  };
  for (int i = 0; i <= along; ++i)
    for (int k = 0; k < around; ++k) {
      const double x = length * i / along, a = 2 * kPi * k / around, y = radius * std::cos(a);
      add(x, y, ground(x, y) + 0.6 * radius * std::sin(a));
    }
  const Index first = static_cast<Index>(mesh.positions.size());
  add(0, 0, ground(0, 0));
  add(length, 0, ground(length, 0));
  const auto at = [&](int i, int k) { return static_cast<Index>(i * around + k % around); };
  for (int k = 0; k < around; ++k) {
    for (int i = 0; i < along; ++i) {
      mesh.triangles.push_back({at(i, k), at(i, k + 1), at(i + 1, k + 1)});
      mesh.triangles.push_back({at(i, k), at(i + 1, k + 1), at(i + 1, k)});
    }
    mesh.triangles.push_back({first, at(0, k + 1), at(0, k)});
    mesh.triangles.push_back({first + 1, at(along, k), at(along, k + 1)});
  }
  mesh.attributes = {{"temperature", temperature}, {"crust", crust}, {"velocity", velocity}, {"detail", detail}};
  geometry::compute_normals(mesh);
  return mesh;
}

}  // namespace effuse::skin::testing_meshes
