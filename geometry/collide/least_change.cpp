#include "geometry/collide/least_change.h"

#include <cmath>
#include <limits>

namespace effuse::geometry {

std::optional<Vec3> least_change(const Vec3& wish, std::span<const HalfSpace> bounds, Real fastest) {
  Real scale = wish.norm();
  for (const HalfSpace& bound : bounds) scale = std::max(scale, bound.velocity.norm());
  const Real slack = 1e-12 * scale;
  const auto allowed = [&](const Vec3& w) {
    for (const HalfSpace& bound : bounds)
      if ((w - bound.velocity).dot(bound.normal) < -slack) return false;
    return true;
  };
  if (allowed(wish)) return wish;

  std::optional<Vec3> best;
  Real least = std::numeric_limits<Real>::infinity();
  const auto try_it = [&](const Vec3& w) {
    const Real change = (w - wish).squaredNorm();
    if (!(change < least) || !(w.norm() <= fastest) || !allowed(w)) return;
    best = w;
    least = change;
  };
  // Lying in the borders of a set of bounds:  n_i . w = n_i . V_i,  w = wish + sum of l_i n_i.
  constexpr Real kParallel = 1e-9;
  const std::size_t n = bounds.size();
  const auto miss = [&](std::size_t i) { return bounds[i].normal.dot(bounds[i].velocity - wish); };
  for (std::size_t i = 0; i < n; ++i) {
    const Vec3& a = bounds[i].normal;
    try_it(wish + miss(i) * a);
    for (std::size_t j = i + 1; j < n; ++j) {
      const Vec3& b = bounds[j].normal;
      const Real c = a.dot(b), det = 1 - c * c;
      if (det > kParallel) try_it(wish + (miss(i) - c * miss(j)) / det * a + (miss(j) - c * miss(i)) / det * b);
      for (std::size_t k = j + 1; k < n; ++k) {
        const Vec3& d = bounds[k].normal;
        const Real volume = a.dot(b.cross(d));
        if (std::abs(volume) > kParallel) try_it(wish + (miss(i) * b.cross(d) + miss(j) * d.cross(a) + miss(k) * a.cross(b)) / volume);
      }
    }
  }
  return best;
}

}  // namespace effuse::geometry
