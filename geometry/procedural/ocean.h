#pragma once

#include <cstdint>
#include <vector>

#include "geometry/mesh/tri_mesh.h"

namespace effuse::geometry {

/// One long-crested wave on water:  with k = 2 pi / wavelength along direction and phase p = k . x - omega t + phase,
/// a point of the surface at rest at x stands at
///   x + (- steepness amplitude sin p direction, amplitude cos p)
/// Gerstner's wave at steepness 1: crests sharpen; 0: a sine. omega^2 = g k tanh(k depth).
struct OceanWave {
  Real amplitude = 0;   ///< [m]
  Real wavelength = 1;  ///< [m]
  Real direction = 0;   ///< it runs towards [rad], from +x to +y
  Real phase = 0;       ///< [rad]
};

struct OceanOptions {
  Real level = 0;       ///< height of the water at rest [m]
  Real depth = 1e30;    ///< [m]
  Real steepness = 0.8; ///< 0 .. 1 of all waves; made less where their sum would fold over itself (sum of k a steepness <= 0.9)
};

/// A sea as the sum of waves: a function of place and time, no state.
class Ocean {
 public:
  /// Throws InputError where a wavelength or the depth is not > 0, or a number is not finite.
  Ocean(const OceanOptions& options, std::vector<OceanWave> waves);

  struct Sample {
    Vec3 position, velocity, normal;  ///< [m], [m/s], unit
  };
  /// Where the point at rest at (x, y) stands at time t [s], how it moves, and the surface's normal there.
  Sample at_rest_point(const Vec2& rest, Real t) const;
  /// Height of the surface above the place (x, y): the rest point is found by Newton's method to 1e-9 of the shortest wavelength.
  Real height(const Vec2& place, Real t) const;

  /// [1/s] of the k-th wave.
  Real frequency(std::size_t k) const { return omega_[k]; }
  const std::vector<OceanWave>& waves() const { return waves_; }
  Real steepness() const { return options_.steepness; }  ///< after the limit
  Real level() const { return options_.level; }

 private:
  OceanOptions options_;
  std::vector<OceanWave> waves_;
  std::vector<Vec2> k_;
  std::vector<Real> omega_;
};

/// Waves of a sea that the wind has raised: Pierson & Moskowitz's spectrum
///   S(omega) = 8.1e-3 g^2 omega^-5 exp(-0.74 (g / (omega U))^4),   U the wind's speed at 19.5 m [m/s]
/// cut into count bands of equal energy about directions spread as cos^2 of the angle to the wind. The significant height of the
/// sum is the spectrum's, 4 sqrt(m0) = 0.21 U^2 / g. Phases and directions are functions of (seed, k).
/// Source: Pierson & Moskowitz 1964, J. Geophys. Res. 69, 5181-5190.
std::vector<OceanWave> wind_sea(Real wind_speed, Real wind_direction, int count, std::uint64_t seed);

/// The sea over a rectangle as nx by ny quads, with normals and "velocity".
TriMesh ocean_mesh(const Ocean& ocean, const Vec2& low, const Vec2& high, int nx, int ny, Real t);

}  // namespace effuse::geometry
