#pragma once

#include <functional>
#include <vector>

#include "flow/sph/density.h"
#include "flow/sph/particle_system.h"
#include "geometry/base/random.h"
#include "geometry/collide/contact.h"

/// Small particle systems for the tests of the implicit solvers' operators.
namespace effuse::flow::sph {

/// nx * ny * nz points of a cubic lattice in (0, nx dx) x (0, ny dx) x (0, nz dx), each moved by up to jitter dx an axis.
inline std::vector<Vec3> lattice_block(int nx, int ny, int nz, Real dx, Real jitter = 0, std::uint64_t seed = 1) {
  std::vector<Vec3> x;
  for (int k = 0; k < nz; ++k)
    for (int j = 0; j < ny; ++j)
      for (int i = 0; i < nx; ++i) {
        const std::uint64_t id = x.size();
        const Vec3 off(random_uniform(seed, 0, id), random_uniform(seed, 1, id), random_uniform(seed, 2, id));
        x.push_back(dx * (Vec3(i + 0.5, j + 0.5, k + 0.5) + jitter * (2 * off - Vec3::Ones())));
      }
  return x;
}

inline std::vector<Vec3> random_vectors(std::size_t n, std::uint64_t seed) {
  std::vector<Vec3> v(n);
  for (std::size_t i = 0; i < n; ++i) v[i] = Vec3(random_normal(seed, 0, i), random_normal(seed, 1, i), random_normal(seed, 2, i));
  return v;
}

/// One solid, as a function of place; any() false: further than support away.
using Solid = std::function<geometry::Contact(const Vec3&)>;

inline Solid plane_solid(const Vec3& point, const Vec3& normal, const Vec3& velocity = Vec3::Zero(), Index surface = 0) {
  return [=](const Vec3& x) {
    const Real d = (x - point).dot(normal);
    return geometry::Contact{Vec3(x - d * normal), normal, d, velocity, 0, surface};
  };
}

/// Particles, their neighbours, images of them where it is periodic, and walls, as ModernLava would hold them.
struct SampleSystem {
  Real dx, support;
  KernelKind kernel;
  BoundaryTable table;
  FilmFriction film;
  Real lattice;
  Vec2 period = Vec2::Zero();
  std::vector<Vec3> x;
  std::vector<std::uint8_t> fixed;
  std::vector<Solid> solids;
  Neighbors neighbors;
  Walls walls;

  static BoundaryTable make_table(KernelKind kind, Real support, Real spacing) {
    if (kind == KernelKind::kCubicSpline) return {CubicSpline(support), spacing};
    if (kind == KernelKind::kSpiky) return {SpikyKernel(support), spacing};
    return {WendlandC2(support), spacing};
  }

  /// supports: the support in spacings.
  explicit SampleSystem(std::vector<Vec3> positions, Real spacing, Real supports = 3, KernelKind kind = KernelKind::kWendlandC2)
      : dx(spacing),
        support(supports * spacing),
        kernel(kind),
        table(make_table(kind, support, spacing)),
        film(table, spacing),
        lattice(lattice_sum(kind, support, spacing)),
        x(std::move(positions)) {
    find();
  }

  std::size_t size() const { return x.size(); }
  Real volume() const { return dx * dx * dx; }

  /// After a change of x, period or solids.
  void find() {
    std::vector<Vec3> all = x;
    std::vector<Index> image;
    for (int a = -1; a <= 1; ++a)
      for (int b = -1; b <= 1; ++b) {
        if ((a == 0 && b == 0) || (a != 0 && period.x() == 0) || (b != 0 && period.y() == 0)) continue;
        for (std::size_t i = 0; i < x.size(); ++i) {
          all.push_back(x[i] + Vec3(a * period.x(), b * period.y(), 0));
          image.push_back(static_cast<Index>(i));
        }
      }
    ColumnGrid grid;
    grid.build(all, support);
    neighbors.find(grid, support);
    neighbors.fold(x.size(), image);

    walls.first.assign(x.size() + 1, 0);
    walls.walls.clear();
    for (std::size_t i = 0; i < x.size(); ++i) {
      for (const Solid& solid : solids) {
        const geometry::Contact c = solid(x[i]);
        if (c.distance < support)
          walls.walls.push_back({.normal = c.normal, .distance = c.distance, .reach = c.distance, .surface = c.surface, .velocity = c.surface_velocity});
      }
      walls.first[i + 1] = static_cast<Index>(walls.walls.size());
    }
  }

  ParticleSystem system() const {
    ParticleSystem s;
    s.x = x;
    s.neighbors = &neighbors;
    s.walls = &walls;
    s.boundary = &table;
    s.kernel = kernel;
    s.support = support;
    s.spacing = dx;
    s.period = period;
    s.fixed = fixed;
    return s;
  }
};

}  // namespace effuse::flow::sph
