#include "samples/budget/front_error.h"

#include <algorithm>
#include <cmath>

#include "geometry/base/check.h"

namespace effuse::budget {

namespace {

constexpr Real kSums = 0.004, kSumsByX = 0.025, kStep = 0.010;
constexpr Real kOneLayer = 0.018, kFrom = 0.8, kTo = 1;
constexpr Real kAlone = 0.0364, kAloneAt = 2, kAloneOrder = 5;

Real law(Real x, Real courant) {
  return kSums + kSumsByX * x + kStep * courant / kUsualCourant + kOneLayer * std::clamp((x - kFrom) / (kTo - kFrom), 0.0, 1.0) + kAlone * std::pow(x / kAloneAt, kAloneOrder);
}

}  // namespace

Real FrontLaw::error(Real dx, Real courant) const {
  CHECK(dx > 0 && courant > 0 && depth > 0);
  return law(dx / depth, courant);
}

Real FrontLaw::spacing_for(Real wanted, Real courant) const {
  CHECK_GT(wanted, law(0, courant));
  // It rises with x: halve the interval until it is narrower than anybody asks for.
  Real low = 0, high = 1;
  while (law(high, courant) < wanted) high *= 2;
  for (int k = 0; k < 60; ++k) {
    const Real middle = (low + high) / 2;
    (law(middle, courant) <= wanted ? low : high) = middle;
  }
  return low * depth;
}

Real flow_depth(Real spacing, Real layers, Real difference) {
  CHECK(spacing > 0 && layers > 0 && difference >= 0);
  constexpr Real kTold = 1.05;                  // layers: below, particles lie alone
  constexpr Real kThick = 1.27, kSlope = 2;     // beside one another they lack some depth
  if (layers >= kThick) return layers * spacing;
  if (layers >= kTold) return (kThick - kSlope * (kThick - layers)) * spacing;
  constexpr Real kLeast = 1.2, kLeastDifference = 0.1, kPower = 0.35;
  return spacing / std::max(kLeast, kLeast * std::pow(difference / kLeastDifference, kPower));
}

Real refined_error(const FrontDifferences& differences, Real courant) {
  CHECK(courant > 0);
  constexpr Real kFiner = 1.46, kCoarser = -0.21, kAround = 0.76;
  return std::hypot(kFiner * differences.finer + kCoarser * differences.coarser, kAround * differences.finer_rms, kStep * courant / kUsualCourant);
}

Real courant_for(Real wanted) { return kUsualCourant * std::min(1.0, wanted / 3 / kStep); }

Real tolerance_for(Real wanted) { return std::clamp(wanted / 30, 1e-4, 1e-3); }

}  // namespace effuse::budget
