#pragma once

#include <span>
#include <vector>

#include "geometry/base/types.h"

/// Spreading flows that have no closed form, solved on grids fine enough to serve as references.
/// The equation, its letters and what it leaves out: gravity_current.h.
namespace effuse::flow::reference {

/// Fluid of depth H behind a dam that goes at t = 0, on level ground, a wall at x = 0.
struct DamBreak {
  Real length = 6.6;  ///< L of the reservoir [m]
  Real depth = 1;     ///< H [m]
  Real nu = 1e4 / 2700;  ///< [m^2/s]; the defaults are benchmark BM1
};

/// A dam break at one moment.
struct DamBreakState {
  Real time = 0;        ///< [s]
  Real front = 0;       ///< where the depth falls to 0 [m]
  Real wall_depth = 0;  ///< at x = 0 [m]
  std::vector<Real> x, h;  ///< cell centres and their depths [m]
};

struct DamBreakOptions {
  Real cell = 0.05;          ///< [m]
  Real domain = 24;          ///< [m]; the front stays inside (checked)
  Real step_growth = 0.005;  ///< dt = max(first_step, step_growth t)
  Real first_step = 1e-3;    ///< [s]
  Real wet = 1e-3;           ///< shallower cells hold no fluid [m]
};

/// The states at the times given [s], which rise (checked). Finite volumes, flux K (h_l^4 - h_r^4) / (4 dx), backward Euler with Newton's
/// iteration: volume is kept to rounding. BM1 with the defaults: front within 0.01 m of cells a quarter as wide, in 0.1 s.
/// Source of BM1's set-up: Cordonnier, Lev & Garel 2015, Geol. Soc. Spec. Publ. 426, 425-445, as in the IMEX_SfloW2D example ViscousDamBreak1D.
std::vector<DamBreakState> solve_dam_break(const DamBreak& dam, std::span<const Real> times, const DamBreakOptions& options = {});

/// A steady point source on a slope; half of the plane is solved, y = 0 is the line of symmetry, x runs down the slope, the source at 0.
struct InclineSource {
  Real flux = 1.48e-6;             ///< Q [m^3/s]
  Real slope = 2.5 * kPi / 180;    ///< theta [rad]
  Real nu = 1.13e-3;               ///< [m^2/s]; the defaults are benchmark BM2: Lister's silicone oil
  Real source_radius = 6e-3;       ///< [m]
};

/// The flow at one moment.
struct InclineState {
  Real time = 0;            ///< [s]
  Real front = 0;           ///< x_N: farthest down the line of symmetry [m]
  Real back = 0;            ///< farthest up it, negative [m]
  Real half_width = 0;      ///< y_N: widest [m]
  Real volume = 0;          ///< of both halves [m^3]
  std::vector<Vec2> outline;  ///< from the back to the front [m]
};

struct InclineOptions {
  Real cell = 5e-3;          ///< [m]
  Real wet = 1e-4;           ///< shallower cells hold no fluid [m]
};

/// The states at the times given [s], which rise (checked). Finite volumes, explicit, the flux in conservative form so that a level surface
/// stays level; the mobility between two cells is that of a linear depth, never more than four times that of the cell the fluid comes from.
/// The grid grows with the flow. BM2 to 122 s with the default cell: front and width within 1 % of cells half as wide, in 0.4 s; to 727 s: 15 s.
std::vector<InclineState> solve_incline_source(const InclineSource& source, std::span<const Real> times, const InclineOptions& options = {});

}  // namespace effuse::flow::reference
