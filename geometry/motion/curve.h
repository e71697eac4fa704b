#pragma once

#include <span>
#include <string_view>
#include <type_traits>
#include <utility>
#include <vector>

#include "geometry/base/types.h"

namespace effuse::geometry {

/// How a curve goes from one key to the next.
///   kStep        holds the value until the next key
///   kLinear      straight; quaternions along the shorter arc at a constant rate (slerp)
///   kCatmullRom  smooth through the keys: the slope at a key is that between its neighbours, (v2 - v0) / (t2 - t0), one-sided at the ends
///   kBezier      cubic with the key's own slopes `in` and `out`
enum class Between { kStep, kLinear, kCatmullRom, kBezier };
inline constexpr std::string_view kBetweenNames[] = {"step", "linear", "catmull_rom", "bezier"};

/// 0, or the vector of zeros (T{} leaves Eigen's vectors as they are).
template <class T>
T zero_value() {
  if constexpr (std::is_arithmetic_v<T>)
    return 0;
  else
    return T::Zero();
}

/// Value at a time [s]. `between` speaks of the stretch to the next key; in and out are slopes [1/s] of kBezier, arriving and leaving.
template <class T>
struct Key {
  Real time = 0;
  T value = zero_value<T>();
  Between between = Between::kLinear;
  T in = zero_value<T>(), out = zero_value<T>();
};

/// Anything that changes in time by keys: a number (a vent's rate, a lens) or a vector (a place, a colour). Before the first key and
/// after the last it holds. A function of time, no state.
template <class T>
class Curve {
 public:
  Curve() = default;
  /// Throws InputError when times do not rise from key to key or something is not finite.
  explicit Curve(std::vector<Key<T>> keys);
  /// The same value always.
  explicit Curve(const T& value) : Curve(std::vector<Key<T>>{Key<T>{0, value, Between::kStep}}) {}

  std::span<const Key<T>> keys() const { return keys_; }
  /// At least one key (checked).
  T at(Real time) const;
  /// Slope [1/s]; at a key that of the stretch after it, 0 where it holds.
  T slope(Real time) const;

 private:
  std::size_t stretch(Real time) const;  // index of its first key
  T slope_at_key(std::size_t k) const;
  std::vector<Key<T>> keys_;
};

extern template class Curve<Real>;
extern template class Curve<Vec2>;
extern template class Curve<Vec3>;

/// Area under the curve from one time to another [value s]; exact.
Real integral(const Curve<Real>& curve, Real from, Real to);

/// Least and largest value it ever has.
std::pair<Real, Real> extremes(const Curve<Real>& curve);

/// The keys whose `between` is kCatmullRom become kBezier with slopes that leave no value beyond those of the stretch's two keys: that of
/// the parabola through a key and its neighbours, no steeper than three times either stretch, 0 at a peak; straight stretches stay.
/// Source: Fritsch & Carlson 1980, SIAM J. Numer. Anal. 17, 238-246.
std::vector<Key<Real>> without_overshoot(std::vector<Key<Real>> keys);

/// Orientations by keys: kStep holds, everything else turns along the shorter arc.
class TurnCurve {
 public:
  struct TurnKey {
    Real time = 0;
    Quat value = Quat::Identity();
    Between between = Between::kLinear;
  };
  TurnCurve() = default;
  /// Throws InputError when times do not rise or a quaternion has no length; they are made unit.
  explicit TurnCurve(std::vector<TurnKey> keys);
  Quat at(Real time) const;

 private:
  std::vector<TurnKey> keys_;
};

}  // namespace effuse::geometry
