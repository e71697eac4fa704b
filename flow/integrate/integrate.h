#pragma once

#include <stdexcept>
#include <string_view>

#include "geometry/base/types.h"

/// Schemes for  dy/dt = f(t, y)  over any state.
///
/// A state falls into velocities (v, and whatever is not a position) and positions (x, and whatever
/// moves with the velocities: a density by the continuity equation, an angle). Only symplectic Euler
/// tells them apart. A state type S works when these are found beside it (argument-dependent lookup):
///   add_scaled_velocities(S& y, Real a, const S& k)    y.v += a k.v, ...
///   add_scaled_positions(S& y, Real a, const S& k)     y.x += a k.x, ...
/// Rates have the layout of states: k.x holds dx/dt and so on. The system gives them:
///   system.velocity_rates(t, y, k)    fills k.v, ...
///   system.position_rates(t, y, k)    fills k.x, ...
///   system.rates(t, y, k)             both, usually cheaper than one after the other
/// and, if it can be stepped implicitly, solves for its own next state:
///   system.implicit_euler(t, dt, y)   y with  y = y_old + dt f(t + dt, y)
namespace effuse::flow {

/// Global errors of order 1, 1, 2, 4, 1. On an undamped oscillator Euler gains energy at every step,
/// symplectic Euler keeps it bounded while omega dt < 2, the midpoint rule gains slowly, RK4 loses while
/// omega dt < 2.83, implicit Euler loses at any step.
enum class Scheme { kEuler, kSymplecticEuler, kMidpoint, kRk4, kImplicitEuler };

inline constexpr std::string_view kSchemeNames[] = {"euler", "symplectic_euler", "midpoint", "rk4", "implicit_euler"};
inline constexpr std::size_t kExplicitSchemes = 4;  ///< the first of them

/// Evaluations of the rates a step takes: its cost, but for implicit Euler, whose cost is its solve.
constexpr int evaluations(Scheme scheme) {
  switch (scheme) {
    case Scheme::kMidpoint: return 2;
    case Scheme::kRk4: return 4;
    default: return 1;
  }
}

/// Memory of a step, kept between steps so that nothing is allocated in them.
template <class State>
struct StepStorage {
  State stage, k1, k2, k3, k4;
};

template <class State>
void add_scaled(State& y, Real a, const State& k) {
  add_scaled_velocities(y, a, k);
  add_scaled_positions(y, a, k);
}

/// Advances y from t to t + dt.
template <class State, class System>
void integrate_step(Scheme scheme, System&& system, Real t, Real dt, State& y, StepStorage<State>& s) {
  switch (scheme) {
    case Scheme::kEuler:
      system.rates(t, y, s.k1);
      add_scaled(y, dt, s.k1);
      return;
    case Scheme::kSymplecticEuler:
      // Kick, then drift with the velocities just kicked. The state equation's density must drift:
      // kicked together with the velocities it makes the step Euler's for sound, which blows up.
      system.velocity_rates(t, y, s.k1);
      add_scaled_velocities(y, dt, s.k1);
      system.position_rates(t, y, s.k1);
      add_scaled_positions(y, dt, s.k1);
      return;
    case Scheme::kMidpoint:
      system.rates(t, y, s.k1);
      s.stage = y;
      add_scaled(s.stage, dt / 2, s.k1);
      system.rates(t + dt / 2, s.stage, s.k2);
      add_scaled(y, dt, s.k2);
      return;
    case Scheme::kRk4:
      system.rates(t, y, s.k1);
      s.stage = y;
      add_scaled(s.stage, dt / 2, s.k1);
      system.rates(t + dt / 2, s.stage, s.k2);
      s.stage = y;
      add_scaled(s.stage, dt / 2, s.k2);
      system.rates(t + dt / 2, s.stage, s.k3);
      s.stage = y;
      add_scaled(s.stage, dt, s.k3);
      system.rates(t + dt, s.stage, s.k4);
      add_scaled(y, dt / 6, s.k1);
      add_scaled(y, dt / 3, s.k2);
      add_scaled(y, dt / 3, s.k3);
      add_scaled(y, dt / 6, s.k4);
      return;
    case Scheme::kImplicitEuler:
      if constexpr (requires { system.implicit_euler(t, dt, y); }) {
        system.implicit_euler(t, dt, y);
        return;
      }
      break;
  }
  throw std::logic_error("integrate_step: this system has no such scheme");
}

}  // namespace effuse::flow
