#pragma once

#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "geometry/motion/force_grid.h"

namespace effuse::importers {

/// A world of the classic jello cube assignment: 8 x 8 x 8 points of one mass in the box [-2, 2]^3.
///
///   line 1   Euler or RK4
///   line 2   dt [s], n: every n-th step is shown
///   line 3   kElastic dElastic kCollision dCollision [N/m], [N s/m]
///   line 4   mass of a point [kg]
///   line 5   0, or 1 and on the next line the plane a b c d:  a x + b y + c z + d = 0
///   then     resolution r of the force field and r^3 forces [N]; 512 positions [m]; 512 velocities [m/s];
///            value (i, j, k) with k fastest
struct JelloWorld {
  static constexpr int kSide = 8;      ///< points
  static constexpr double kRoom = 2;   ///< [m] half the box's side

  std::string integrator;
  double dt = 0;
  int steps_a_frame = 1;
  double elastic = 0, elastic_damping = 0, collision = 0, collision_damping = 0;
  double mass = 0;
  std::optional<Eigen::Vector4d> plane;
  geometry::ForceGrid field;
  std::vector<Vec3> positions, velocities;
};

/// Throws InputError with file, line, what was found and what was wanted: another integrator, a step or mass not > 0, too few
/// numbers, words among them, values that are not finite, anything after the last velocity.
JelloWorld read_jello_world(const std::filesystem::path& file);

}  // namespace effuse::importers
