#pragma once

#include <cstddef>
#include <span>
#include <vector>

#include "geometry/base/hash.h"
#include "geometry/base/state_io.h"
#include "geometry/base/types.h"

/// Waves on water seen from above: the wave equation on a grid.
namespace effuse::flow::waves {

enum class Border { kPeriodic, kMirror, kAbsorbing };

/// kExplicit: kick and drift, as the lecture's leapfrog; stable while its Courant number is at most 1.
/// kImplicit: the mean of both ends (Newmark 1/4, 1/2): stable at any step, keeps the energy to the solver's tolerance, and
/// slows waves that a step outruns.
enum class WaveScheme { kExplicit, kImplicit };

struct WaveOptions {
  int nx = 0, ny = 0;            ///< cells, each >= 1
  Real cell = 1;                 ///< side [m]
  Vec2 corner = Vec2::Zero();    ///< of the grid [m]
  Real damping = 0;              ///< [1/s]
  Border border = Border::kMirror;
  WaveScheme scheme = WaveScheme::kExplicit;
  Real tolerance = 1e-8;         ///< of the implicit solve, relative
  bool guarded = true;           ///< false, for tests alone: explicit steps of any length are taken
};

/// h_tt + damping h_t = div(c^2 grad h) on nx x ny square cells, five-point differences, second order in space and time.
/// c^2 may differ from cell to cell (g depth in shallow water: Green's law); 0 is land, at whose shore waves turn back.
/// Between two cells c^2 is their mean, between water and land 0. Borders:
///   periodic   the far side's cells are neighbours
///   mirror     no slope across the border
///   absorbing  c dh/dn = -dh/dt: swallows what arrives head on, 97 % of the energy at 45 degrees
/// In float a million steps would tilt the level by rounding alone. Same bits on any number of threads.
/// Source: Courant, Friedrichs & Lewy 1928; Newmark 1959; Engquist & Majda 1977 (the first of their borders).
class WaveGrid {
 public:
  /// speed_squared: c^2 [m^2/s^2] of each cell, row after row along x, or one for all; >= 0 and finite (checked).
  WaveGrid(const WaveOptions& options, std::vector<Real> speed_squared);

  const WaveOptions& options() const { return options_; }
  std::size_t size() const { return height_.size(); }
  /// Height above the level of rest [m] and its rate [m/s]; cell (i, j) is number j nx + i. Land stays at 0.
  std::span<const Real> height() const { return height_; }
  std::span<const Real> rate() const { return rate_; }
  std::span<Real> height() { return height_; }
  std::span<Real> rate() { return rate_; }
  bool water(std::size_t cell) const { return uniform_ || speed_squared_[cell] > 0; }
  Vec2 centre(std::size_t cell) const;

  /// c dt sqrt(2) / cell with the fastest c: explicit steps of more than 1 blow up.
  Real courant(Real dt) const;
  Real longest_step() const;  ///< [s] of Courant number 1; infinite without water

  /// Advances by dt > 0. Throws UnstableError, the state as it was, when an explicit step's Courant number is above 1;
  /// returns false, the state as it was, when the implicit solve does not converge.
  bool step(Real dt);

  /// Adds a round bump of this volume [m^3] and radius [m] (Gaussian, cut at three radii, on water only; the same volume after the
  /// cut). Nothing where it meets no water: returns the volume added.
  Real add_volume(const Vec2& at, Real radius, Real volume);

  /// Height at a point, bilinear between centres; 0 outside.
  Real height_at(const Vec2& p) const;
  /// sum of h cell^2 [m^3]; kept by mirror and periodic borders.
  Real volume() const;
  /// sum of (rate^2 + c^2 |grad h|^2) / 2 cell^2 [m^4/s^2]: energy over density and g / c^2.
  Real energy() const;

  std::size_t memory() const;
  void add_to(StateHash& hash) const;
  void save(StateWriter& out) const;
  void load(StateReader& in);

 private:
  void explicit_rows(std::size_t begin, std::size_t end, Real dt, const Real* below, const Real* above);
  bool implicit_step(Real dt);
  void apply(std::span<const Real> v, std::span<Real> out) const;

  WaveOptions options_;
  std::vector<Real> speed_squared_;   // one, or one a cell
  bool uniform_ = true;
  Real fastest_squared_ = 0;
  std::vector<Real> face_x_, face_y_; // c^2 between a cell and the next along x, y; the last ones wrap. Empty: uniform
  std::vector<Real> height_, rate_;
};

}  // namespace effuse::flow::waves
