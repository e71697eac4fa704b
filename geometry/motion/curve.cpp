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
