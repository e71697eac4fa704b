#include "flow/reference/channel.h"

#include <algorithm>
#include <cmath>

#include "geometry/base/check.h"

namespace effuse::flow::reference {
namespace {

// Terms beyond are below rounding of the first one (exp(-40) = 4e-18), or, at the very start, of a cubic series' head.
constexpr Real kNegligibleExponent = 40;
constexpr int kMostTerms = 20000;

}  // namespace

Real PlanePoiseuille::velocity(Real y) const {
  CHECK_GT(nu, 0);
  return force / (2 * nu) * y * (width - y);
}

Real PlanePoiseuille::velocity(Real y, Real t) const {
  CHECK_GT(nu, 0);
  CHECK_GT(width, 0);
  CHECK_GE(t, 0);
  if (t <= 0) return 0;
  const Real decay = kPi * kPi * nu * t / (width * width);
  Real sum = 0;
  for (int n = 0; n < kMostTerms; ++n) {
    const Real k = 2 * n + 1;
    if (k * k * decay > kNegligibleExponent) break;
    sum += std::sin(kPi * k * y / width) * std::exp(-k * k * decay) / (k * k * k);
  }
  return velocity(y) - 4 * force * width * width / (nu * kPi * kPi * kPi) * sum;
}

Real PlanePoiseuille::peak() const { return velocity(width / 2); }

Real PlanePoiseuille::flux() const {
  CHECK_GT(nu, 0);
  return force * width * width * width / (12 * nu);
}

Real PlanePoiseuille::flux(Real t) const {
  CHECK_GT(nu, 0);
  CHECK_GT(width, 0);
  CHECK_GE(t, 0);
  if (t <= 0) return 0;
  const Real decay = kPi * kPi * nu * t / (width * width);
  Real sum = 0;
  for (int n = 0; n < kMostTerms; ++n) {
    const Real k = 2 * n + 1;
    if (k * k * decay > kNegligibleExponent) break;
    sum += std::exp(-k * k * decay) / (k * k * k * k);
  }
  // sin(pi k y / W) over the gap: 2 W / (pi k).
  return flux() - 8 * force * width * width * width / (nu * kPi * kPi * kPi * kPi) * sum;
}

Real Couette::velocity(Real y) const {
  CHECK_GT(width, 0);
  return speed * y / width;
}

Real Couette::velocity(Real y, Real t) const {
  CHECK_GT(nu, 0);
  CHECK_GT(width, 0);
  CHECK_GE(t, 0);
  if (t <= 0) return y < width ? 0 : speed;
  // The series converges too slowly at first: there, diffusion from the plate and its images in the two walls.
  const Real reach = 2 * std::sqrt(nu * t);
  if (reach < width / 4) {
    Real u = 0;
    for (int n = 0; n < 3; ++n) u += std::erfc(((2 * n + 1) * width - y) / reach) - std::erfc(((2 * n + 1) * width + y) / reach);
    return speed * u;
  }
  const Real decay = kPi * kPi * nu * t / (width * width);
  Real sum = 0;
  for (int n = 1; n * n * decay <= kNegligibleExponent; ++n)
    sum += (n % 2 ? -1 : 1) * 2 / (n * kPi) * std::sin(n * kPi * y / width) * std::exp(-n * n * decay);
  return velocity(y) + speed * sum;
}

Real Couette::flux() const { return speed * width / 2; }

Real NusseltFilm::velocity(Real y) const {
  CHECK_GT(nu, 0);
  return kGravity * std::sin(slope) / nu * (depth * y - y * y / 2);
}

Real NusseltFilm::velocity(Real y, Real t) const { return PlanePoiseuille{kGravity * std::sin(slope), 2 * depth, nu}.velocity(y, t); }

Real NusseltFilm::surface_speed() const { return velocity(depth); }

Real NusseltFilm::mean_speed() const { return 2 * surface_speed() / 3; }

Real NusseltFilm::flux() const { return depth * mean_speed(); }

Real BinghamFilm::wall_stress() const { return density * kGravity * depth * std::sin(slope); }

Real BinghamFilm::strength_ratio() const {
  CHECK_GT(wall_stress(), 0);
  return yield / wall_stress();
}

Real BinghamFilm::sheared_depth() const { return depth * std::max<Real>(0, 1 - strength_ratio()); }

Real BinghamFilm::plug_speed() const {
  CHECK_GT(mu, 0);
  const Real Y = sheared_depth();
  return density * kGravity * std::sin(slope) * Y * Y / (2 * mu);
}

Real BinghamFilm::velocity(Real y) const {
  const Real Y = sheared_depth();
  if (y >= Y) return plug_speed();
  const Real below = (y - Y) / Y;
  return plug_speed() * (1 - below * below);
}

Real BinghamFilm::flux() const { return plug_speed() * (depth - sheared_depth() / 3); }

Real BinghamFilm::jeffreys_mean(Real n) const {
  CHECK_GT(mu, 0);
  CHECK_GT(n, 0);
  const Real r = strength_ratio();
  if (r >= 1) return 0;
  return wall_stress() * depth / (n * mu) * (1 - 1.5 * r + 0.5 * r * r * r);
}

}  // namespace effuse::flow::reference
