#pragma once

#include <functional>
#include <span>
#include <vector>

#include "geometry/base/types.h"

/// What the cases of the study share: how far a curve is from its reference, and what is read off particles.
/// Sizes must agree and are checked; a value that is not finite makes a result that is not finite, hence no measure pass.
namespace effuse::study {

/// |measured - reference| / |reference|; reference != 0 (checked).
Real relative_error(Real measured, Real reference);

/// Relative L2 error of a profile:  sqrt(sum_i (m_i - r_i)^2 / sum_i r_i^2).  Not all of reference is 0 (checked).
Real relative_l2_error(std::span<const Real> measured, std::span<const Real> reference);
Real relative_l2_error(std::span<const Real> x, std::span<const Real> measured, const std::function<Real(Real)>& reference);

/// Largest |m_i - r_i| over the largest |r_i|.
Real relative_max_error(std::span<const Real> measured, std::span<const Real> reference);

/// Root mean square error over the range of the reference:  sqrt(mean (m_i - r_i)^2) / (max r - min r).
/// As the lava benchmarks report it; below 0.1 counts as good there. Reference not constant (checked).
Real nrmse(std::span<const Real> measured, std::span<const Real> reference);

/// y = prefactor x^exponent by least squares in log-log:  minimises sum (log y_i - log prefactor - exponent log x_i)^2.
struct PowerLaw {
  Real prefactor = 0, exponent = 0;
  Real scatter = 0;  ///< rms of log(y_i / fit): 0.01 is one percent
  Real operator()(Real x) const;
};
/// x, y > 0, at least two different x (checked). Points outside [x_min, x_max] are left out.
PowerLaw fit_power_law(std::span<const Real> x, std::span<const Real> y);
PowerLaw fit_power_law(std::span<const Real> x, std::span<const Real> y, Real x_min, Real x_max);
/// The prefactor when the exponent is known: the geometric mean of y_i / x_i^exponent.
Real fit_prefactor(std::span<const Real> x, std::span<const Real> y, Real exponent);

/// y at one x by straight lines between points with rising x (checked, equal neighbours allowed); not a number outside.
Real interpolate(std::span<const Real> x, std::span<const Real> y, Real at);
/// The same with a straight line between the logarithms of x and y, all > 0: exact for a power law.
Real interpolate_log(std::span<const Real> x, std::span<const Real> y, Real at);

/// n values from first to last, equally spaced; n >= 2 (checked). spaced_log: equal ratios, first and last > 0.
std::vector<Real> spaced(Real first, Real last, std::size_t n);
std::vector<Real> spaced_log(Real first, Real last, std::size_t n);

/// Mean of y in equal bins of x over [first, last): a profile from particles. Empty bins are left out of the result.
struct Profile {
  std::vector<Real> x;  ///< mean x of the bin's points
  std::vector<Real> y;  ///< mean y
  std::vector<Real> spread;  ///< standard deviation of y
  std::vector<std::size_t> count;
};
Profile profile(std::span<const Real> x, std::span<const Real> y, Real first, Real last, std::size_t bins);

/// Where a flow's front is, from its particles, on plane ground at height 0 with z up:
/// largest distance along the unit vector `along` of a particle whose own column (of one spacing square) is at least
/// min_depth deep, plus half a spacing; a column's depth is its number of particles times the spacing.
/// A particle of spray thus is no front. -infinity when no column is that deep.
///   x          positions [m]
///   spacing    dx [m] > 0: a particle's volume is dx^3
///   min_depth  [m]; 0: every particle counts
Real front_position(std::span<const Vec3> x, const Vec3& along, Real spacing, Real min_depth = 0);
/// The same of an axisymmetric flow about the vertical axis through center, in rings a spacing wide: the depth of a ring
/// is the volume of its particles over its area. Ring, since one particle may run ahead in one direction.
Real front_radius(std::span<const Vec3> x, const Vec3& center, Real spacing, Real min_depth = 0);

}  // namespace effuse::study
