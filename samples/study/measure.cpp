#include "samples/study/measure.h"

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <limits>
#include <unordered_map>

#include "geometry/base/check.h"

namespace effuse::study {

namespace {

constexpr Real kNotANumber = std::numeric_limits<Real>::quiet_NaN();
constexpr Real kInfinity = std::numeric_limits<Real>::infinity();

/// Index k of the interval [x_k, x_{k+1}] that holds `at`, or x.size() when none does. x rises (checked).
std::size_t interval(std::span<const Real> x, Real at) {
  CHECK_GT(x.size(), 0u);
  for (std::size_t i = 1; i < x.size(); ++i) CHECK_LE(x[i - 1], x[i]);
  if (!(at >= x.front() && at <= x.back())) return x.size();
  const std::size_t above = static_cast<std::size_t>(std::upper_bound(x.begin(), x.end(), at) - x.begin());
  return std::min(above, x.size() - 1) - (x.size() > 1 ? 1 : 0);
}

}  // namespace

Real relative_error(Real measured, Real reference) {
  CHECK(reference != 0);
  return std::abs(measured - reference) / std::abs(reference);
}

Real relative_l2_error(std::span<const Real> measured, std::span<const Real> reference) {
  CHECK_EQ(measured.size(), reference.size());
  Real difference = 0, size = 0;
  for (std::size_t i = 0; i < measured.size(); ++i) {
    difference += (measured[i] - reference[i]) * (measured[i] - reference[i]);
    size += reference[i] * reference[i];
  }
  CHECK(size > 0);
  return std::sqrt(difference / size);
}

Real relative_l2_error(std::span<const Real> x, std::span<const Real> measured, const std::function<Real(Real)>& reference) {
  std::vector<Real> r(x.size());
  std::transform(x.begin(), x.end(), r.begin(), reference);
  return relative_l2_error(measured, r);
}

Real relative_max_error(std::span<const Real> measured, std::span<const Real> reference) {
  CHECK_EQ(measured.size(), reference.size());
  Real difference = 0, size = 0;
  for (std::size_t i = 0; i < measured.size(); ++i) {
    const Real here = std::abs(measured[i] - reference[i]);
    if (std::isnan(here)) return here;
    difference = std::max(difference, here);
    size = std::max(size, std::abs(reference[i]));
  }
  CHECK(size > 0);
  return difference / size;
}

Real nrmse(std::span<const Real> measured, std::span<const Real> reference) {
  CHECK_EQ(measured.size(), reference.size());
  CHECK_GT(reference.size(), 1u);
  Real sum = 0;
  for (std::size_t i = 0; i < measured.size(); ++i) sum += (measured[i] - reference[i]) * (measured[i] - reference[i]);
  const auto [low, high] = std::minmax_element(reference.begin(), reference.end());
  CHECK_GT(*high, *low);
  return std::sqrt(sum / static_cast<Real>(measured.size())) / (*high - *low);
}

Real PowerLaw::operator()(Real x) const { return prefactor * std::pow(x, exponent); }

PowerLaw fit_power_law(std::span<const Real> x, std::span<const Real> y) { return fit_power_law(x, y, 0, kInfinity); }

PowerLaw fit_power_law(std::span<const Real> x, std::span<const Real> y, Real x_min, Real x_max) {
  CHECK_EQ(x.size(), y.size());
  std::vector<Real> u, v;  // log x, log y
  for (std::size_t i = 0; i < x.size(); ++i) {
    if (x[i] < x_min || x[i] > x_max) continue;
    CHECK_GT(x[i], 0);
    if (!(y[i] > 0)) return {kNotANumber, kNotANumber, kNotANumber};  // a front that was lost is a failed measure, not a broken promise
    u.push_back(std::log(x[i]));
    v.push_back(std::log(y[i]));
  }
  CHECK_GE(u.size(), 2u);
  // About the means: no cancellation when all x are large.
  Real mean_u = 0, mean_v = 0;
  for (std::size_t i = 0; i < u.size(); ++i) {
    mean_u += u[i] / static_cast<Real>(u.size());
    mean_v += v[i] / static_cast<Real>(u.size());
  }
  Real uu = 0, uv = 0;
  for (std::size_t i = 0; i < u.size(); ++i) {
    uu += (u[i] - mean_u) * (u[i] - mean_u);
    uv += (u[i] - mean_u) * (v[i] - mean_v);
  }
  CHECK_GT(uu, 0);
  PowerLaw law;
  law.exponent = uv / uu;
  law.prefactor = std::exp(mean_v - law.exponent * mean_u);
  Real squares = 0;
  for (std::size_t i = 0; i < u.size(); ++i) squares += std::pow(v[i] - mean_v - law.exponent * (u[i] - mean_u), 2);
  law.scatter = std::sqrt(squares / static_cast<Real>(u.size()));
  return law;
}

Real fit_prefactor(std::span<const Real> x, std::span<const Real> y, Real exponent) {
  CHECK_EQ(x.size(), y.size());
  CHECK_GT(x.size(), 0u);
  Real sum = 0;
  for (std::size_t i = 0; i < x.size(); ++i) {
    CHECK_GT(x[i], 0);
    if (!(y[i] > 0)) return kNotANumber;
    sum += std::log(y[i]) - exponent * std::log(x[i]);
  }
  return std::exp(sum / static_cast<Real>(x.size()));
}

Real interpolate(std::span<const Real> x, std::span<const Real> y, Real at) {
  CHECK_EQ(x.size(), y.size());
  const std::size_t k = interval(x, at);
  if (k == x.size()) return kNotANumber;
  if (x.size() == 1 || x[k + 1] == x[k]) return y[k];
  const Real s = (at - x[k]) / (x[k + 1] - x[k]);
  return (1 - s) * y[k] + s * y[k + 1];
}

Real interpolate_log(std::span<const Real> x, std::span<const Real> y, Real at) {
  CHECK_EQ(x.size(), y.size());
  const std::size_t k = interval(x, at);
  if (k == x.size()) return kNotANumber;
  if (x.size() == 1 || x[k + 1] == x[k]) return y[k];
  CHECK_GT(x[k], 0);
  const Real s = std::log(at / x[k]) / std::log(x[k + 1] / x[k]);
  return std::exp((1 - s) * std::log(y[k]) + s * std::log(y[k + 1]));
}

std::vector<Real> spaced(Real first, Real last, std::size_t n) {
  CHECK_GE(n, 2u);
  std::vector<Real> values(n);
  for (std::size_t i = 0; i < n; ++i) {
    const Real s = static_cast<Real>(i) / static_cast<Real>(n - 1);
    values[i] = (1 - s) * first + s * last;
  }
  return values;
}

std::vector<Real> spaced_log(Real first, Real last, std::size_t n) {
  CHECK_GT(first, 0);
  CHECK_GT(last, 0);
  std::vector<Real> values = spaced(std::log(first), std::log(last), n);
  for (Real& value : values) value = std::exp(value);
  values.front() = first;
  values.back() = last;
  return values;
}

Profile profile(std::span<const Real> x, std::span<const Real> y, Real first, Real last, std::size_t bins) {
  CHECK_EQ(x.size(), y.size());
  CHECK_GT(bins, 0u);
  CHECK_GT(last, first);
  struct Bin {
    std::size_t n = 0;
    Real x = 0, y = 0, yy = 0;
  };
  std::vector<Bin> sums(bins);
  const auto bin_of = [&](Real at) { return std::min(static_cast<std::size_t>((at - first) / (last - first) * static_cast<Real>(bins)), bins - 1); };
  const auto inside = [&](Real at) { return at >= first && at < last; };
  for (std::size_t i = 0; i < x.size(); ++i) {
    if (!inside(x[i])) continue;
    Bin& bin = sums[bin_of(x[i])];
    ++bin.n;
    bin.x += x[i];
    bin.y += y[i];
  }
  for (std::size_t i = 0; i < x.size(); ++i) {  // about the mean: no cancellation
    if (!inside(x[i])) continue;
    Bin& bin = sums[bin_of(x[i])];
    bin.yy += std::pow(y[i] - bin.y / static_cast<Real>(bin.n), 2);
  }
  Profile result;
  for (const Bin& bin : sums) {
    if (bin.n == 0) continue;
    const Real n = static_cast<Real>(bin.n);
    result.x.push_back(bin.x / n);
    result.y.push_back(bin.y / n);
    result.spread.push_back(std::sqrt(bin.yy / n));
    result.count.push_back(bin.n);
  }
  return result;
}

Real front_position(std::span<const Vec3> x, const Vec3& along, Real spacing, Real min_depth) {
  CHECK_GT(spacing, 0);
  const auto column = [&](const Vec3& p) {
    const auto cell = [&](Real at) { return static_cast<std::uint32_t>(static_cast<std::int64_t>(std::clamp(std::floor(at / spacing), -1e9, 1e9))); };
    return static_cast<std::uint64_t>(cell(p.x())) << 32 | cell(p.y());
  };
  std::unordered_map<std::uint64_t, std::size_t> particles;  // only looked up: its order is never used
  for (const Vec3& p : x)
    if (p.allFinite()) ++particles[column(p)];
  Real front = -kInfinity;
  for (const Vec3& p : x) {
    if (!p.allFinite()) return kNotANumber;
    if (static_cast<Real>(particles[column(p)]) * spacing >= min_depth) front = std::max(front, p.dot(along) + spacing / 2);
  }
  return front;
}

Real front_radius(std::span<const Vec3> x, const Vec3& center, Real spacing, Real min_depth) {
  CHECK_GT(spacing, 0);
  std::unordered_map<std::uint64_t, std::size_t> particles;  // by ring; only looked up: its order is never used
  std::vector<Real> radius(x.size());
  const auto ring_of = [&](Real r) { return static_cast<std::uint64_t>(std::min(r / spacing, 1e15)); };
  for (std::size_t i = 0; i < x.size(); ++i) {
    radius[i] = (x[i] - center).head<2>().norm();
    if (!std::isfinite(radius[i])) return kNotANumber;
    ++particles[ring_of(radius[i])];
  }
  Real front = -kInfinity;
  for (const Real r : radius) {
    const Real inner = static_cast<Real>(ring_of(r)) * spacing, area = kPi * spacing * (2 * inner + spacing);
    const Real depth = static_cast<Real>(particles[ring_of(r)]) * spacing * spacing * spacing / area;
    if (depth >= min_depth) front = std::max(front, r + spacing / 2);
  }
  return front;
}

}  // namespace effuse::study
