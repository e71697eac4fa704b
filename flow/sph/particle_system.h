#pragma once

#include <cmath>
#include <span>
#include <vector>

#include "flow/sph/boundary.h"
#include "flow/sph/column_grid.h"
#include "flow/sph/kernel.h"
#include "flow/sph/pressed.h"
#include "geometry/base/types.h"

namespace effuse::flow::sph {

class PairKernels;

/// Particles of one volume, their neighbours and walls at one moment: what the implicit solvers work on. Views.
struct ParticleSystem {
  std::span<const Vec3> x;                 ///< [m]
  const Neighbors* neighbors = nullptr;    ///< symmetric, without oneself, |x_i - x_j| < support
  const Walls* walls = nullptr;
  const BoundaryTable* boundary = nullptr; ///< of the same kernel
  KernelKind kernel = KernelKind::kWendlandC2;
  Real support = 0;                        ///< [m]
  Real spacing = 0;                        ///< [m]; volume V = spacing^3
  Vec2 period = Vec2::Zero();              ///< [m]; 0: not periodic
  std::span<const std::uint8_t> fixed;     ///< 1: its velocity is prescribed; empty: none
  std::span<Movable> movable;              ///< bodies that walls belong to; the solves change their velocities
  std::span<Pressed> pressed;              ///< solids that deform, likewise
  Real density = 0;                        ///< [kg/m^3]; needed beside what gives way only
  PairKernels* pairs = nullptr;            ///< built on this system, shared by all who sum over it; null: each builds its own

  std::size_t size() const { return x.size(); }
  Real volume() const { return spacing * spacing * spacing; }
  Vec3 velocity_of(const Wall& wall) const {
    if (!gives_way(wall)) return wall.velocity;
    return deforms(wall) ? pressed[wall.movable].at(wall, pressed[wall.movable].vertices) : movable[wall.movable].velocity_at(wall.arm);
  }
  bool any_gives_way() const { return !movable.empty() || !pressed.empty(); }
  bool is_fixed(std::size_t i) const { return !fixed.empty() && fixed[i]; }
  /// x_i - x_j, of the nearest image.
  template <bool kPeriodic>
  Vec3 separation(std::size_t i, std::size_t j) const {
    Vec3 d = x[i] - x[j];
    if constexpr (kPeriodic) {
      if (period.x() > 0) d.x() -= period.x() * std::nearbyint(d.x() / period.x());
      if (period.y() > 0) d.y() -= period.y() * std::nearbyint(d.y() / period.y());
    }
    return d;
  }
};

/// Calls f(periodic), std::true_type or std::false_type.
template <class F>
auto with_periodic(const ParticleSystem& s, F&& f) {
  return s.period.isZero() ? f(std::false_type{}) : f(std::true_type{});
}

/// Calls f(kernel, periodic), kernel of the named type, periodic std::true_type or std::false_type.
template <class F>
auto with_kernel(const ParticleSystem& s, F&& f) {
  const auto both = [&](const auto& kernel) {
    return s.period.isZero() ? f(kernel, std::false_type{}) : f(kernel, std::true_type{});
  };
  switch (s.kernel) {
    case KernelKind::kCubicSpline: return both(CubicSpline(s.support));
    case KernelKind::kSpiky: return both(SpikyKernel(s.support));
    default: return both(WendlandC2(s.support));
  }
}

}  // namespace effuse::flow::sph
