#include "flow/sph/crust_column.h"

#include <algorithm>
#include <cmath>

#include "geometry/base/check.h"

namespace effuse::flow::sph {

namespace {
constexpr int N = kColumnCells;
using Cells = std::array<Real, N>;
constexpr int kNewtonSteps = 10;
constexpr Real kShortestHalf = 1;  // [s]
constexpr int kAllSteps = 100;
constexpr Real kTemperatureTolerance = 1e-3;  // [K]: what the last linear solve may have been off
constexpr Real kFluxTolerance = 1e-6;         // of the flux at the surface

constexpr Real kThompsonRamsey0 = 1.0463, kThompsonRamsey1 = 1.48144e-4;  // [-], [1/K]
}  // namespace

Real SurfaceLaw::emissivity_at(Real T) const {
  return thompson_ramsey ? std::clamp(kThompsonRamsey0 - kThompsonRamsey1 * T, 0.0, 1.0) : emissivity;
}

Real SurfaceLaw::slope(Real T) const {
  const Real a = air_temperature, eps = emissivity_at(T);
  const Real slope = 4 * eps * kStefanBoltzmann * T * T * T + convection;
  if (!thompson_ramsey || eps <= 0 || eps >= 1) return slope;
  return slope - kThompsonRamsey1 * kStefanBoltzmann * (T * T + a * a) * (T + a) * (T - a);
}

Real SurfaceLaw::face_temperature(Real T, Real G, Real share) const {
  if (share <= 0) return T;
  // The flux is convex: from the hot side Newton's method descends to the root and cannot pass it.
  const Real low = std::min(T, air_temperature), high = std::max(T, air_temperature);
  Real Ts = high;
  for (int k = 0; k < 50; ++k) {
    const Real off = (share * flux(Ts) - G * (T - Ts)) / (share * slope(Ts) + G);
    Ts = std::clamp(Ts - off, low, high);
    if (std::abs(off) < 1e-10 * high) break;
  }
  return Ts;
}

ColumnShape::ColumnShape(Real finest, int count) : cells(count) {
  CHECK_GE(cells, 2);
  CHECK_LE(cells, N);
  CHECK_GT(finest, 0.0);
  CHECK_LE(finest, 1.0);
  finest = std::min(finest, 1.0 / cells);
  // finest (ratio^cells - 1) / (ratio - 1) = 1, by bisection.
  Real low = 1, high = std::max(100.0, 1 / finest);
  for (int k = 0; k < 200; ++k) {
    const Real ratio = (low + high) / 2;
    Real sum = 0;
    for (int j = 0; j < cells; ++j) sum = sum * ratio + finest;
    (sum < 1 ? low : high) = ratio;
  }
  Real sum = 0;
  share.fill(0);
  centre.fill(1);
  share[0] = finest;
  for (int j = 1; j < cells; ++j) share[j] = share[j - 1] * low;
  for (int j = 0; j < cells; ++j) sum += share[j];
  Real top = 0;
  for (int j = 0; j < cells; ++j) {
    share[j] /= sum;
    centre[j] = top + share[j] / 2;
    top += share[j];
  }
}

namespace {

/// kFixed: the number of cells, where the compiler may know it (an eighth less time); 0: cells.
/// The equations of one step, in joules per square metre:  R_j = mass_j (H_j - start_j) + dt (what conduction takes from T_j) = 0.
/// R is the slope of a convex function of T, for H(T) rises: the sum of mass int H dT, of the conductances' squares, and
/// of int flux dT at the face.
template <int kFixed>
struct StepEquations {
  int cells;
  const EnthalpyCurve& curve;
  const SurfaceLaw& air;
  const ColumnEnds& ends;
  Real dt;
  std::array<Real, N> mass, start;  // [kg/m^2], [J/kg]
  std::array<Real, N + 1> G;        // dt times the conductance between cells j - 1 and j
  Real top, bottom;                 // conductance of the upper half cell; dt times that to the ground

  Real face(Real T) const { return air.face_temperature(T, top, ends.sky_share); }
  /// Through the face [J/m^2] and its slope by the first cell's temperature.
  Real sky(Real T, Real face) const { return dt * top * (T - face); }
  Real sky_slope(Real face) const {
    const Real slope = ends.sky_share * air.slope(face);
    return ends.sky_share > 0 ? dt * top * slope / (top + slope) : 0;
  }
  void residual(const Cells& H, const Cells& T, Real sky, Cells& R) const {
    const int n = kFixed > 0 ? kFixed : cells;
    for (int j = 0; j < n; ++j)
      R[j] = mass[j] * (H[j] - start[j]) + (j > 0 ? G[j] * (T[j] - T[j - 1]) : sky) +
             (j + 1 < n ? G[j + 1] * (T[j] - T[j + 1]) : bottom * (T[j] - ends.ground_temperature));
  }
  /// Newton's step d [K] from R and the slopes dH/dT: a symmetric tridiagonal system.
  void newton_step(const Cells& R, const Cells& slope, Real sky_slope, Cells& d) const {
    const int n = kFixed > 0 ? kFixed : cells;
    Cells diagonal;
    for (int j = 0; j < n; ++j) {
      diagonal[j] = mass[j] * slope[j] + (j > 0 ? G[j] : sky_slope) + (j + 1 < n ? G[j + 1] : bottom);
      d[j] = -R[j];
    }
    for (int j = 1; j < n; ++j) {
      const Real factor = G[j] / diagonal[j - 1];
      diagonal[j] -= factor * G[j];
      d[j] += factor * d[j - 1];
    }
    d[n - 1] /= diagonal[n - 1];
    for (int j = n - 2; j >= 0; --j) d[j] = (d[j] + G[j + 1] * d[j + 1]) / diagonal[j];
  }
};

template <int kFixed>
ColumnLoss step_cells(Cells& H, Real dt, Real depth, Real density, const ColumnShape& shape, const EnthalpyCurve& curve, Real k_melt, Real k_solid,
                       const SurfaceLaw& air, const ColumnEnds& ends, Real& surface_temperature) {
  DCHECK(curve.liquidus > curve.solidus);
  const int n = kFixed > 0 ? kFixed : shape.cells;
  StepEquations<kFixed> step{n, curve, air, ends, dt, {}, H, {}, 0, dt * ends.ground_conductance};
  Cells half{};
  for (int j = 0; j < n; ++j) {
    const Real k = k_melt + (k_solid - k_melt) * curve.solid_fraction(H[j]);
    half[j] = shape.share[j] * depth / (2 * k);
    step.mass[j] = density * shape.share[j] * depth;
  }
  for (int j = 1; j < n; ++j) step.G[j] = dt / (half[j - 1] + half[j]);
  step.top = 1 / half[0];

  Cells T{}, slope{}, R{}, d{};
  const auto begin = [&] {
    H = step.start;
    for (int j = 0; j < n; ++j) T[j] = curve.temperature(H[j]);
  };
  begin();
  Real face = step.face(T[0]), left = 0;
  for (int k = 0; k < kAllSteps; ++k) {
    const Real sky = step.sky(T[0], face), sky_slope = step.sky_slope(face);
    for (int j = 0; j < n; ++j) slope[j] = 1 / curve.slope(H[j]);
    step.residual(H, T, sky, R);
    step.newton_step(R, slope, sky_slope, d);

    // Where the linear solution agrees with the curve it ends, and H is what its fluxes made of it: no energy is lost.
    Cells next;
    Real off = 0;
    for (int j = 0; j < n; ++j) {
      next[j] = H[j] + slope[j] * d[j];
      off = std::max(off, std::abs(curve.temperature(next[j]) - (T[j] + d[j])));
    }
    const Real next_T = curve.temperature(next[0]), next_face = step.face(next_T);
    left = sky + sky_slope * d[0];
    const bool surface_agrees = std::abs(step.sky(next_T, next_face) - left) <= kFluxTolerance * std::abs(left) + dt * step.top * kTemperatureTolerance;
    const bool agrees = off <= kTemperatureTolerance && surface_agrees;
    if (!agrees && k + 1 == kAllSteps && dt > kShortestHalf) {
      // Circles even so, in very long steps through a narrow melting range: two of half the length.
      H = step.start;
      ColumnLoss loss;
      for (int part = 0; part < 2; ++part) {
        const ColumnLoss more = step_cells<kFixed>(H, dt / 2, depth, density, shape, curve, k_melt, k_solid, air, ends, surface_temperature);
        loss.radiated += more.radiated;
        loss.convected += more.convected;
        loss.ground += more.ground;
      }
      return loss;
    }
    if (agrees || k + 1 == kAllSteps) {
      H = next;
      for (int j = 0; j < n; ++j) T[j] += d[j];
      face = next_face;
      break;
    }
    if (k + 1 < kNewtonSteps) {
      // Along H: quick, and as good as always enough.
      H = next;
      for (int j = 0; j < n; ++j) T[j] = curve.temperature(H[j]);
      face = step.face(T[0]);
      continue;
    }
    if (k + 1 == kNewtonSteps) {
      begin();
      face = step.face(T[0]);
      continue;
    }
    // It went in circles: along T, to where the convex function is least on the way. Sure to converge.
    const auto go = [&](Real share, const Cells& from) {
      for (int j = 0; j < n; ++j) {
        T[j] = from[j] + share * d[j];
        H[j] = curve.enthalpy(T[j]);
      }
      face = step.face(T[0]);
      step.residual(H, T, step.sky(T[0], face), R);
      Real descent = 0;
      for (int j = 0; j < n; ++j) descent += R[j] * d[j];
      return descent;
    };
    const Cells from = T;
    if (go(1, from) > 0) {
      Real low = 0, high = 1;
      for (int bisection = 0; bisection < 12; ++bisection) (go((low + high) / 2, from) > 0 ? high : low) = (low + high) / 2;
      go(low > 0 ? low : high, from);
    }
  }

  // What the cells lost is what left. In steps so long that they exchange their content many times over, the fluxes are
  // rounded to some 1e-8 of it: the larger of the two takes that.
  surface_temperature = face;
  ColumnLoss loss;
  Real lost = 0;
  for (int j = 0; j < n; ++j) lost += step.mass[j] * (step.start[j] - H[j]);
  loss.ground = step.bottom * (T[n - 1] - ends.ground_temperature);
  (std::abs(left) > std::abs(loss.ground) ? left : loss.ground) += lost - (left + loss.ground);
  const Real radiated = air.radiated(face), convected = air.convected(face), sum = radiated + convected;
  loss.radiated = sum != 0 ? left * (radiated / sum) : left;
  loss.convected = left - loss.radiated;
  return loss;
}

}  // namespace

ColumnLoss step_column(Cells& H, Real dt, Real depth, Real density, const ColumnShape& shape, const EnthalpyCurve& curve, Real k_melt, Real k_solid,
                       const SurfaceLaw& air, const ColumnEnds& ends, Real& surface_temperature) {
  const auto step = shape.cells == N ? step_cells<N> : step_cells<0>;
  return step(H, dt, depth, density, shape, curve, k_melt, k_solid, air, ends, surface_temperature);
}

Real crust_depth(const CrustColumn& column, const ColumnShape& shape, const EnthalpyCurve& curve, Real isotherm) {
  const int n = shape.cells;
  Real above_T = column.surface_temperature, above = 0;
  if (above_T >= isotherm) return 0;
  for (int j = 0; j < n; ++j) {
    const Real T = curve.temperature(column.H[j]), z = shape.centre[j] * column.depth;
    if (T >= isotherm) return above + (z - above) * (isotherm - above_T) / (T - above_T);
    above_T = T;
    above = z;
  }
  return column.depth;
}

}  // namespace effuse::flow::sph
