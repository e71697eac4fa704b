#pragma once

#include <cstdint>
#include <functional>
#include <span>
#include <vector>

#include "geometry/base/types.h"
#include "geometry/mesh/tri_mesh.h"

namespace effuse::flow::particles {

/// Where particles are born. Uniform over the shape's measure: area of a disk or mesh, length of a curve.
enum class EmitterShape { kPoint, kDisk, kMesh, kCurve, kPoints };

/// Lets particles out. Direction, speed, life, size and temperature of each are functions of (seed, its number).
///
///   rate        [1/s] while start <= t < stop; births are evenly spaced in time, each within the step at its own moment
///   direction   unit, axis of a cone of half angle spread [rad] over which directions are uniform; on a mesh turned so that the
///               triangle's normal takes the place of +z
///   x_spread    relative deviation of a normal distribution cut at three, value never below a tenth of the mean
struct EmitterOptions {
  EmitterShape shape = EmitterShape::kPoint;
  Vec3 at = Vec3::Zero();   ///< of the point, and the disk's middle [m]
  Real radius = 0;          ///< of the disk, across direction [m]
  geometry::TriMesh mesh;   ///< kMesh
  std::vector<Vec3> curve;  ///< kCurve: corners of a polyline [m], two at least

  Real rate = 100, start = 0, stop = 1e30;
  Vec3 direction = Vec3::UnitZ();
  Real spread = 0;
  Real speed = 1, speed_spread = 0;              ///< [m/s]
  Vec3 carried = Vec3::Zero();                   ///< the emitter's own velocity, added [m/s]
  Real lifetime = 1e30, lifetime_spread = 0;     ///< [s]
  Real size = 0.01, size_spread = 0;             ///< radius [m]
  Real temperature = 288, temperature_spread = 0;  ///< [K]
  std::uint64_t seed = 1;
};

struct Newborn {
  Vec3 x, v;
  Real born, lifetime, size, temperature;  ///< born: the moment [s]
};

/// The particles of one emitter, by number: pure functions of the options.
class Emitter {
 public:
  /// Throws InputError where the options cannot be: negative rate, an empty mesh or curve, a direction without length, ...
  explicit Emitter(const EmitterOptions& options);

  const EmitterOptions& options() const { return options_; }
  /// How many are born in [0, t).
  std::uint64_t born_by(Real t) const;
  /// Number k. kPoints: born at one of these, moving with it; any k only while there is a point.
  ///   points, velocities  of kPoints, of equal size; empty otherwise
  Newborn particle(std::uint64_t k, std::span<const Vec3> points = {}, std::span<const Vec3> velocities = {}) const;

 private:
  EmitterOptions options_;
  std::vector<Real> measure_;  // summed up over triangles or pieces of the curve
};

}  // namespace effuse::flow::particles
