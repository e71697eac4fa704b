#pragma once

#include <cmath>

#include "geometry/base/types.h"

namespace effuse::flow {

/// One mass on a spring, or a thousand: the state most exact answers are written in.
struct OscillatorState {
  Real x = 0, v = 0;
};

inline void add_scaled_velocities(OscillatorState& y, Real a, const OscillatorState& k) { y.v += a * k.v; }
inline void add_scaled_positions(OscillatorState& y, Real a, const OscillatorState& k) { y.x += a * k.x; }

/// m x'' = -k x with omega = sqrt(k/m) [1/s]: x = x0 cos(omega t) + v0/omega sin(omega t).
struct Oscillator {
  Real omega = 1, x0 = 1, v0 = 0;

  OscillatorState at(Real t) const {
    const Real c = std::cos(omega * t), s = std::sin(omega * t);
    return {x0 * c + v0 / omega * s, v0 * c - x0 * omega * s};
  }
  void velocity_rates(Real, const OscillatorState& y, OscillatorState& k) const { k.v = -omega * omega * y.x; }
  void position_rates(Real, const OscillatorState& y, OscillatorState& k) const { k.x = y.v; }
  void rates(Real t, const OscillatorState& y, OscillatorState& k) const {
    velocity_rates(t, y, k);
    position_rates(t, y, k);
  }
  void implicit_euler(Real, Real dt, OscillatorState& y) const {
    y.v = (y.v - dt * omega * omega * y.x) / (1 + omega * omega * dt * dt);
    y.x += dt * y.v;
  }
};

}  // namespace effuse::flow
