#include "geometry/motion/curve.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "geometry/base/check.h"
#include "geometry/base/error.h"

namespace effuse::geometry {

namespace {

bool finite(Real v) { return std::isfinite(v); }
bool finite(const Vec2& v) { return v.allFinite(); }
bool finite(const Vec3& v) { return v.allFinite(); }

template <class Keys>
void check_times(const Keys& keys) {
  for (std::size_t k = 0; k < keys.size(); ++k) {
    if (!std::isfinite(keys[k].time)) throw InputError(Place{"curve"}, fmt::format("key {} has no time", k + 1));
    if (k > 0 && !(keys[k].time > keys[k - 1].time))
      throw InputError(Place{"curve"}, fmt::format("key {} at {:g} s does not come after key {} at {:g} s", k + 1, keys[k].time, k, keys[k - 1].time));
  }
}

/// Key of the stretch that a time lies in: the last one not after it.
template <class Keys>
std::size_t last_before(const Keys& keys, Real time) {
  const auto after = std::upper_bound(keys.begin(), keys.end(), time, [](Real t, const auto& key) { return t < key.time; });
  return after == keys.begin() ? 0 : static_cast<std::size_t>(after - keys.begin()) - 1;
}

}  // namespace

template <class T>
Curve<T>::Curve(std::vector<Key<T>> keys) : keys_(std::move(keys)) {
  check_times(keys_);
  for (std::size_t k = 0; k < keys_.size(); ++k)
    if (!finite(keys_[k].value) || !finite(keys_[k].in) || !finite(keys_[k].out)) throw InputError(Place{"curve"}, fmt::format("key {} has a value or slope that is no number", k + 1));
}

template <class T>
std::size_t Curve<T>::stretch(Real time) const {
  CHECK(!keys_.empty());
  return last_before(keys_, time);
}

template <class T>
T Curve<T>::slope_at_key(std::size_t k) const {
  const std::size_t before = k > 0 ? k - 1 : k, after = std::min(k + 1, keys_.size() - 1);
  if (before == after) return zero_value<T>();
  return (keys_[after].value - keys_[before].value) / (keys_[after].time - keys_[before].time);
}

template <class T>
T Curve<T>::at(Real time) const {
  const std::size_t k = stretch(time);
  const Key<T>& a = keys_[k];
  if (time <= a.time || k + 1 == keys_.size() || a.between == Between::kStep) return a.value;
  const Key<T>& b = keys_[k + 1];
  const Real span = b.time - a.time, u = (time - a.time) / span;
  if (a.between == Between::kLinear) return (1 - u) * a.value + u * b.value;
  // Hermite's cubic.
  const T m0 = a.between == Between::kBezier ? a.out : slope_at_key(k), m1 = a.between == Between::kBezier ? b.in : slope_at_key(k + 1);
  const Real u2 = u * u, u3 = u2 * u;
  return (2 * u3 - 3 * u2 + 1) * a.value + (u3 - 2 * u2 + u) * span * m0 + (3 * u2 - 2 * u3) * b.value + (u3 - u2) * span * m1;
}

template <class T>
T Curve<T>::slope(Real time) const {
  const std::size_t k = stretch(time);
  const Key<T>& a = keys_[k];
  if (time < a.time || k + 1 == keys_.size() || a.between == Between::kStep) return zero_value<T>();
  const Key<T>& b = keys_[k + 1];
  const Real span = b.time - a.time, u = (time - a.time) / span;
  if (a.between == Between::kLinear) return (b.value - a.value) / span;
  const T m0 = a.between == Between::kBezier ? a.out : slope_at_key(k), m1 = a.between == Between::kBezier ? b.in : slope_at_key(k + 1);
  const Real u2 = u * u;
  return (6 * u2 - 6 * u) / span * a.value + (3 * u2 - 4 * u + 1) * m0 + (6 * u - 6 * u2) / span * b.value + (3 * u2 - 2 * u) * m1;
}

template class Curve<Real>;
template class Curve<Vec2>;
template class Curve<Vec3>;

Real integral(const Curve<Real>& curve, Real from, Real to) {
  if (to < from) return -integral(curve, to, from);
  const std::span<const Key<Real>> keys = curve.keys();
  CHECK(!keys.empty());
  // Simpson's rule is exact for cubics; a step's jump lies at a stretch's end and is left out.
  Real sum = 0, a = from;
  for (std::size_t k = 0; k <= keys.size() && a < to; ++k) {
    const Real b = k < keys.size() ? std::min(keys[k].time, to) : to;
    if (b <= a) continue;
    const Real middle = curve.at((a + b) / 2);
    const bool flat = k == 0 || k == keys.size() || keys[k - 1].between == Between::kStep;
    sum += flat ? (b - a) * middle : (b - a) / 6 * (curve.at(a) + 4 * middle + curve.at(b));
    a = b;
  }
  return sum;
}

std::pair<Real, Real> extremes(const Curve<Real>& curve) {
  const std::span<const Key<Real>> keys = curve.keys();
  CHECK(!keys.empty());
  Real least = keys[0].value, most = least;
  const auto take = [&](Real v) {
    least = std::min(least, v);
    most = std::max(most, v);
  };
  for (std::size_t k = 0; k < keys.size(); ++k) {
    take(keys[k].value);
    if (k + 1 == keys.size() || keys[k].between == Between::kStep || keys[k].between == Between::kLinear) continue;
    // Where the slope, a parabola in u, is 0: from its values at the ends and in the middle.
    const Real span = keys[k + 1].time - keys[k].time, edge = 1e-12 * span;
    const Real s0 = curve.slope(keys[k].time), sm = curve.slope(keys[k].time + span / 2), s1 = curve.slope(keys[k + 1].time - edge);
    const Real a = 2 * s0 - 4 * sm + 2 * s1, b = -3 * s0 + 4 * sm - s1, c = s0;
    const auto at = [&](Real u) {
      if (u > 0 && u < 1) take(curve.at(keys[k].time + u * span));
    };
    if (std::abs(a) < 1e-14 * (std::abs(b) + std::abs(c))) {
      if (b != 0) at(-c / b);
    } else if (const Real d = b * b - 4 * a * c; d >= 0) {
      at((-b + std::sqrt(d)) / (2 * a));
      at((-b - std::sqrt(d)) / (2 * a));
    }
  }
  return {least, most};
}

std::vector<Key<Real>> without_overshoot(std::vector<Key<Real>> keys) {
  check_times(keys);
  const std::size_t n = keys.size();
  const auto rise = [&](std::size_t k) { return (keys[k + 1].value - keys[k].value) / (keys[k + 1].time - keys[k].time); };
  std::vector<Real> slope(n, 0);
  for (std::size_t k = 0; k < n && n > 1; ++k) {
    if (k == 0 || k + 1 == n) {
      slope[k] = rise(k == 0 ? 0 : n - 2);
      continue;
    }
    const Real before = rise(k - 1), after = rise(k), h0 = keys[k].time - keys[k - 1].time, h1 = keys[k + 1].time - keys[k].time;
    if (before * after <= 0) continue;
    const Real steepest = 3 * std::min(std::abs(before), std::abs(after)), parabola = (before * h1 + after * h0) / (h0 + h1);
    slope[k] = std::copysign(std::min(std::abs(parabola), steepest), parabola);
  }
  for (std::size_t k = 0; k < n; ++k) {
    if (keys[k].between != Between::kCatmullRom) continue;
    keys[k].between = Between::kBezier;
    keys[k].out = slope[k];
    if (k + 1 < n) keys[k + 1].in = slope[k + 1];
  }
  return keys;
}

TurnCurve::TurnCurve(std::vector<TurnKey> keys) : keys_(std::move(keys)) {
  check_times(keys_);
  for (TurnKey& key : keys_) {
    const Real length = key.value.norm();
    if (!(length > 1e-9) || !std::isfinite(length)) throw InputError(Place{"curve"}, fmt::format("the orientation at {:g} s is no quaternion", key.time));
    key.value.normalize();
  }
}

Quat TurnCurve::at(Real time) const {
  CHECK(!keys_.empty());
  const std::size_t k = last_before(keys_, time);
  const TurnKey& a = keys_[k];
  if (time <= a.time || k + 1 == keys_.size() || a.between == Between::kStep) return a.value;
  return a.value.slerp((time - a.time) / (keys_[k + 1].time - a.time), keys_[k + 1].value);
}

}  // namespace effuse::geometry
