#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <ctime>
#include <vector>

#include "geometry/base/hash.h"
#include "geometry/base/random.h"
#include "geometry/mesh/points.h"
#include "geometry/mesh/tri_mesh.h"
#include "skin/surface/level_set.h"

/// Particles for the skin's benchmarks, and what is read off their runs.
namespace effuse::skin::bench {

inline constexpr Real kVoxel = 0.25;  // [m] half a particle's radius

/// About n particles, spacing 1 m, each moved by up to 0.1 in each direction: a cube, or a sheet of that many layers. They fill `box`.
struct Lava {
  std::vector<Vec3> x, velocity;
  std::vector<Real> radius, temperature, crust;
  geometry::Points points;
  Box3 box;

  explicit Lava(std::size_t n, int layers) {
    const Real size = static_cast<Real>(n);
    const int height = layers > 0 ? layers : static_cast<int>(std::lround(std::cbrt(size))),
              across = static_cast<int>(std::lround(std::sqrt(size / height)));
    for (int i = 0; i < across; ++i)
      for (int j = 0; j < across; ++j)
        for (int k = 0; k < height; ++k) {
          const auto off = [&](std::uint64_t axis) { return 0.2 * random_uniform(1, axis, x.size()) - 0.1; };
          x.emplace_back(i + off(0), j + off(1), k + 0.5 + off(2));
        }
    box = Box3(Vec3(-0.5, -0.5, 0), Vec3(across - 0.5, across - 0.5, height));
    radius.assign(x.size(), 0.5);
    temperature.assign(x.size(), 1400);
    crust.assign(x.size(), 0.5);
    velocity.assign(x.size(), Vec3(1, 0, 0));
    points.position = x;
    points.radius = radius;
    points.temperature = temperature;
    points.crust = crust;
    points.velocity = velocity;
  }
  Lava(const Lava&) = delete;
  Real volume() const { return static_cast<Real>(x.size()); }
  /// Positions and radii only.
  void bare() { points.temperature = points.crust = {}, points.velocity = {}; }
};

inline LevelSetOptions metre(Real voxel = 0) {
  LevelSetOptions options;
  options.spacing = 1;
  options.voxel = voxel;
  return options;
}

inline std::uint64_t hash_of(const geometry::TriMesh& mesh) {
  StateHash hash;
  hash.add(std::span<const Vec3>(mesh.positions));
  return hash.value();
}

/// Of the process, all threads [s]: what else runs on the machine counts only by the caches it takes.
inline double processor_time() { return static_cast<double>(std::clock()) / CLOCKS_PER_SEC; }

/// f() and how long it took.
template <class F>
double seconds_of(F&& f) {
  const double begin = processor_time();
  f();
  return processor_time() - begin;
}

inline double median(std::vector<double> values) {
  std::sort(values.begin(), values.end());
  return values[values.size() / 2];
}

}  // namespace effuse::skin::bench
