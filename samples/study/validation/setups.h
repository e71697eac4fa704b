#pragma once

#include <array>
#include <functional>
#include <span>
#include <string>
#include <vector>

#include "flow/sph/modern_lava.h"
#include "samples/study/study.h"

/// What the flow cases are made of: planes, blocks of particles, a clock.
namespace effuse::study {

/// The half-space below the plane through `point` with unit normal `normal` out of the solid, sliding at `velocity` [m/s], its
/// surface at `temperature` [K] (0: none of its own).
flow::sph::ModernLava::ContactSource plane(const Vec3& normal, const Vec3& point, const Vec3& velocity = Vec3::Zero(), Real temperature = 0);

/// Particles on a cubic lattice that fills the box from `low`: the first is half a spacing inside. x fastest.
std::vector<Vec3> block(const Vec3& low, const std::array<int, 3>& counts, Real spacing);

/// Adds particles at rest, all of one temperature [K].
void add_at_rest(flow::sph::ModernLava& lava, const std::vector<Vec3>& x, Real temperature = 1400);

/// What a run cost and how well its solves went.
struct RunStatistics {
  int steps = 0, retries = 0;
  long pressure_iterations = 0, viscosity_iterations = 0, density_iterations = 0;
  Real largest_step = 0;           ///< [s]
  Real largest_density_error = 0;  ///< rms, share

  void add(const flow::sph::ModernReport& report);
  /// "431 steps of at most 0.03 s, 12 pressure, 34 viscosity and 2 density iterations a step"
  std::string text() const;
};

/// Steps until time t [s], of at most max_step [s]; after each step calls `watch`, if given.
void run_until(flow::sph::ModernLava& lava, Real t, Real max_step, RunStatistics& statistics,
               const std::function<void(const flow::sph::ModernReport&)>& watch = {});

/// A fluid without heat, gravity down, lava's density; mu [Pa s].
flow::sph::ModernOptions isothermal(Real spacing, Real mu);

/// Mean over 48 directions of the farthest particle about the vertical through 0, and half a spacing [m].
Real mean_radius(std::span<const Vec3> x, Real spacing);

/// error = |measured - reference| / |reference|.
Measure compared(std::string what, std::string unit, Real measured, Real reference, Real hold);
/// A figure that should be 0: error is the figure itself, in the unit given ("": a share).
Measure bounded(std::string what, Real error, Real hold, std::string unit_of_error = "");

}  // namespace effuse::study
