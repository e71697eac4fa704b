#include "flow/reference/solidification.h"

#include <algorithm>
#include <cmath>

#include "geometry/base/check.h"

namespace effuse::flow::reference {

Real ContactOfHalfSpaces::temperature(Real x, Real t) const {
  const Real Ti = interface_temperature();
  const Real kappa = x < 0 ? kappa_left : kappa_right, far = x < 0 ? T_left : T_right;
  return Ti + (far - Ti) * std::erf(std::abs(x) / (2 * std::sqrt(kappa * t)));
}

Real ContactOfHalfSpaces::flux(Real t) const { return b_left * b_right / (b_left + b_right) * (T_right - T_left) / std::sqrt(kPi * t); }

FreezingFront::FreezingFront(Real T_wall, Real T_melt, Real T_far, Real latent_heat, Real heat_capacity, Real kappa)
    : T_wall_(T_wall), T_melt_(T_melt), T_far_(T_far), kappa_(kappa), lambda_(0) {
  CHECK_LT(T_wall, T_melt);
  CHECK_LE(T_melt, T_far);
  CHECK_GT(latent_heat, 0.0);
  CHECK_GT(heat_capacity, 0.0);
  CHECK_GT(kappa, 0.0);
  // The left side of the equation falls with l, the right one rises: bisection.
  const Real stefan = heat_capacity * (T_melt - T_wall) / latent_heat, superheat = (T_far - T_melt) / (T_melt - T_wall);
  Real low = 0, high = 5;
  for (int k = 0; k < 200; ++k) {
    const Real l = (low + high) / 2, e = std::exp(-l * l);
    (e / std::erf(l) - superheat * e / std::erfc(l) > l * std::sqrt(kPi) / stefan ? low : high) = l;
  }
  lambda_ = low;
}

Real FreezingFront::front(Real t) const { return 2 * lambda_ * std::sqrt(kappa_ * t); }

Real FreezingFront::temperature(Real x, Real t) const {
  const Real eta = x / (2 * std::sqrt(kappa_ * t));
  if (eta < lambda_) return T_wall_ + (T_melt_ - T_wall_) * std::erf(eta) / std::erf(lambda_);
  return T_far_ - (T_far_ - T_melt_) * std::erfc(eta) / std::erfc(lambda_);
}

Real radiative_cooling(Real T0, Real emissivity, Real density, Real heat_capacity, Real d, Real t) {
  return T0 / std::cbrt(1 + 3 * emissivity * kStefanBoltzmann * T0 * T0 * T0 * t / (density * heat_capacity * d));
}

namespace {

/// The half-space's cells. The unknowns are the temperatures: latent heat enters as the secant heat capacity
/// (H(T) - H(T_old)) / (T - T_old), found by iteration, so that none of it is skipped.
class HalfSpaceSolver {
 public:
  explicit HalfSpaceSolver(const CoolingHalfSpace& lava) : a_(lava) {
    const Real finest = 0.1e-3 / a_.refinement, growth = 1 + 0.04 / a_.refinement;
    Real z = 0;
    for (Real dz = finest; z < a_.depth; dz *= growth) {
      width_.push_back(dz);
      centre_.push_back(z + dz / 2);
      z += dz;
    }
    T_.assign(width_.size(), a_.T0);
    H_.assign(width_.size(), enthalpy(a_.T0));
    face_ = a_.T0;
  }

  /// BDF2-like in effect: implicit Euler by two halves and one whole, extrapolated.
  void step(Real dt) {
    const std::vector<Real> T = T_, H = H_;
    const Real face = face_, lost = lost_;
    euler(dt);
    const std::vector<Real> whole = H_;
    const Real whole_lost = lost_;
    T_ = T;
    H_ = H;
    face_ = face;
    lost_ = lost;
    euler(dt / 2);
    euler(dt / 2);
    for (std::size_t j = 0; j < H_.size(); ++j) {
      H_[j] = 2 * H_[j] - whole[j];
      T_[j] = temperature(H_[j]);
    }
    lost_ = 2 * lost_ - whole_lost;
    face_ = face_temperature(T_[0]);
  }

  Real face() const { return face_; }
  Real lost() const { return lost_; }
  Real flux() const { return loss(face_); }
  Real depth_of(Real isotherm) const {
    if (face_ >= isotherm) return 0;
    Real z = 0, T = face_;
    for (std::size_t j = 0; j < T_.size(); ++j) {
      if (T_[j] >= isotherm) return z + (centre_[j] - z) * (isotherm - T) / (T_[j] - T);
      z = centre_[j];
      T = T_[j];
    }
    return a_.depth;
  }

 private:
  Real enthalpy(Real T) const { return a_.heat_capacity * T + a_.latent_heat * std::clamp((T - a_.solidus) / (a_.liquidus - a_.solidus), 0.0, 1.0); }
  Real temperature(Real H) const {
    if (H <= enthalpy(a_.solidus)) return H / a_.heat_capacity;
    if (H >= enthalpy(a_.liquidus)) return (H - a_.latent_heat) / a_.heat_capacity;
    return a_.solidus + (H - enthalpy(a_.solidus)) / (a_.heat_capacity + a_.latent_heat / (a_.liquidus - a_.solidus));
  }
  Real loss(Real T) const {
    const Real a = a_.air_temperature;
    return a_.emissivity * kStefanBoltzmann * (T * T * T * T - a * a * a * a) + a_.convection * (T - a);
  }
  /// Where conduction from the first centre meets the loss; bisection.
  Real face_temperature(Real T) const {
    const Real G = 2 * a_.conductivity / width_[0];
    Real low = std::min(T, a_.air_temperature), high = std::max(T, a_.air_temperature);
    for (int k = 0; k < 60; ++k) {
      const Real mid = (low + high) / 2;
      (G * (T - mid) > loss(mid) ? low : high) = mid;
    }
    return (low + high) / 2;
  }

  void euler(Real dt) {
    const std::size_t n = T_.size();
    const std::vector<Real> T_old = T_, H_old = H_;
    std::vector<Real> diagonal(n), right(n), link(n);
    for (std::size_t j = 1; j < n; ++j) link[j] = 2 * a_.conductivity / (width_[j - 1] + width_[j]) * dt;
    Real out = 0;
    for (int iteration = 0; iteration < 100; ++iteration) {
      // The loss as a conductance to the air about the last iterate.
      face_ = face_temperature(T_[0]);
      const Real h = face_ == a_.air_temperature ? a_.convection : loss(face_) / (face_ - a_.air_temperature);
      const Real top = dt / (width_[0] / (2 * a_.conductivity) + 1 / h);
      for (std::size_t j = 0; j < n; ++j) {
        const Real dT = T_[j] - T_old[j];
        const Real c = std::abs(dT) > 1e-6 ? (enthalpy(T_[j]) - H_old[j]) / dT : (enthalpy(T_[j] - 1e-3) - enthalpy(T_[j])) / -1e-3;
        const Real mass = a_.density * width_[j] * c;
        diagonal[j] = mass + (j > 0 ? link[j] : top) + (j + 1 < n ? link[j + 1] : 0);
        right[j] = mass * T_old[j] + (j > 0 ? 0 : top * a_.air_temperature);
      }
      for (std::size_t j = 1; j < n; ++j) {
        const Real factor = link[j] / diagonal[j - 1];
        diagonal[j] -= factor * link[j];
        right[j] += factor * right[j - 1];
      }
      Real worst = 0;
      for (std::size_t j = n; j-- > 0;) {
        const Real T = (right[j] + (j + 1 < n ? link[j + 1] * T_[j + 1] : 0)) / diagonal[j];
        worst = std::max(worst, std::abs(T - T_[j]));
        T_[j] = T;
      }
      out = top * (T_[0] - a_.air_temperature);
      if (worst < 1e-8) break;
    }
    for (std::size_t j = 0; j < n; ++j) H_[j] = enthalpy(T_[j]);
    face_ = face_temperature(T_[0]);
    lost_ += out;
  }

  CoolingHalfSpace a_;
  std::vector<Real> width_, centre_, T_, H_;
  Real face_ = 0, lost_ = 0;
};

}  // namespace

std::vector<CoolingMoment> cool(const CoolingHalfSpace& lava, std::span<const Real> times, Real isotherm) {
  CHECK_LT(lava.solidus, lava.liquidus);
  CHECK_GT(lava.refinement, 0.0);
  HalfSpaceSolver solver(lava);
  std::vector<CoolingMoment> moments;
  Real t = 0;
  for (const Real end : times) {
    CHECK_GT(end, t);
    while (t < end) {
      Real dt = (1e-3 + 0.05 * t) / lava.refinement;
      if (t + 1.001 * dt > end) dt = end - t;
      solver.step(dt);
      t = t + 1.001 * dt > end ? end : t + dt;
    }
    moments.push_back({t, solver.face(), solver.flux(), solver.lost(), solver.depth_of(isotherm)});
  }
  return moments;
}

}  // namespace effuse::flow::reference
