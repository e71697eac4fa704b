#include "flow/reference/cooling_current.h"

#include <cmath>

#include "flow/reference/gravity_current.h"
#include "geometry/base/check.h"

namespace effuse::flow::reference {

Real CoolingCurrent::supply() const { return density * heat_capacity * rate * excess; }

Real CoolingCurrent::loss(Real t) const {
  CHECK_GT(t, 0);
  CHECK_GT(density * heat_capacity, 0);
  const GravityCurrent current(Spread::kAxisymmetric, 1, rate, nu);
  // With alpha = 1 the depth at a share of the radius does not change in time.
  const auto depth = [&](Real share) { return current.depth(current.place(share) * current.front(t), t); };
  constexpr int kElements = 200, kSteps = 200;
  Real loss = 0;
  for (int k = 0; k < kElements; ++k) {
    // Elements crowd where they have just come out and where they are thin, at the rim.
    const auto spread = [](Real s) { return s * s * (3 - 2 * s); };
    const Real begin = t * spread(static_cast<Real>(k) / kElements), end = t * spread((k + 1.0) / kElements), born = (begin + end) / 2;
    Real exponent = 0;
    for (int i = 0; i < kSteps; ++i) {
      // Small steps first: young fluid moves outwards fast.
      const auto age = [&](int j) { return (t - born) * std::pow(static_cast<Real>(j) / kSteps, 2); };
      const Real from = age(i), to = age(i + 1), middle = (from + to) / 2;
      exponent += exchange / (density * heat_capacity * depth(middle / (born + middle))) * (to - from);
    }
    const Real area = rate * (end - begin) / depth((t - born) / t);
    loss += exchange * excess * std::exp(-exponent) * area;
  }
  return loss;
}

}  // namespace effuse::flow::reference
