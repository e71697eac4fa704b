#pragma once

#include <functional>
#include <vector>

#include "geometry/base/random.h"
#include "geometry/mesh/points.h"
#include "geometry/mesh/tri_mesh.h"

/// Particles that fill shapes, for the skin's tests.
namespace effuse::skin::testing_shapes {

struct Cloud {
  std::vector<Vec3> x;
  std::vector<Real> radius;
  std::vector<Real> temperature, crust, age;
  std::vector<Vec3> velocity, rest, rest2;

  /// Positions and radii only.
  geometry::Points bare() const {
    geometry::Points p;
    p.position = x;
    p.radius = radius;
    return p;
  }
  geometry::Points points() const {
    geometry::Points p = bare();
    p.temperature = temperature;
    p.crust = crust;
    p.age = age;
    p.velocity = velocity;
    p.rest = rest;
    p.rest2 = rest2;
    return p;
  }
  /// [m^3] of one spacing cubed a particle.
  Real volume() const {
    Real sum = 0;
    for (const Real r : radius) sum += 8 * r * r * r;
    return sum;
  }
  void add(const Vec3& p, Real spacing) {
    x.push_back(p);
    radius.push_back(spacing / 2);
    temperature.push_back(1200 + 10 * p.x());
    crust.push_back(0.25);
    age.push_back(3 + p.y());
    velocity.emplace_back(1, p.x(), -2);
    rest.push_back(p + Vec3(100, 0, 0));
    rest2.push_back(p + Vec3(0, 50, 0));
  }
};

/// Particles on a cubic lattice of the spacing, moved by up to jitter spacings in each direction, where inside(x).
inline Cloud fill(const Box3& box, Real spacing, const std::function<bool(const Vec3&)>& inside, Real jitter = 0.1,
                  std::uint64_t seed = 1) {
  Cloud cloud;
  std::uint64_t n = 0;
  const Vec3 first = box.min() + Vec3::Constant(spacing / 2);
  for (Real x = first.x(); x < box.max().x(); x += spacing)
    for (Real y = first.y(); y < box.max().y(); y += spacing)
      for (Real z = first.z(); z < box.max().z(); z += spacing, ++n) {
        const Vec3 p(x, y, z);
        if (!inside(p)) continue;
        const auto off = [&](std::uint64_t axis) { return jitter * spacing * (2 * random_uniform(seed, axis, n) - 1); };
        cloud.add(p + Vec3(off(0), off(1), off(2)), spacing);
      }
  return cloud;
}

inline Box3 cube(Real half) { return Box3(Vec3::Constant(-half), Vec3::Constant(half)); }

}  // namespace effuse::skin::testing_shapes
