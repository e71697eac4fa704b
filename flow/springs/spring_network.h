#pragma once

#include <cstdint>
#include <vector>

#include "geometry/base/types.h"

/// Mass points and springs: what a jello cube, a cloth and any soft lattice are made of.
namespace effuse::flow::springs {

/// Of what springs are. With l the vector from b to a:
///   F on a = -(stiffness (|l| - rest) + damping (v_a - v_b) . l / |l|) l / |l|,   F on b = -F on a
/// Hooke's law and a damper along the spring; no force where the ends coincide.
struct SpringMaterial {
  Real stiffness = 0;    ///< [N/m]
  Real damping = 0;      ///< [N s/m]
  Real tear_strain = 0;  ///< torn when longer than (1 + tear_strain) times its rest length; 0: never
};

struct Spring {
  Index a = 0, b = 0;  ///< its points
  Index material = 0;
  Real rest = 0;  ///< length without force [m]
};

/// What does not move. Fields vary freely; SpringSystem checks that they agree.
///
///   mass     of each point [kg], > 0
///   held     of each point: 1 moves with its own velocity, whatever pulls; 0 is free
///   springs  each between two points
struct SpringNetwork {
  std::vector<Real> mass;
  std::vector<std::uint8_t> held;
  std::vector<SpringMaterial> materials;
  std::vector<Spring> springs;

  std::size_t size() const { return mass.size(); }
};

/// What moves: position [m] and velocity [m/s] of each point. A state of flow/integrate.
struct SpringState {
  std::vector<Vec3> x, v;
};

inline void add_scaled_velocities(SpringState& y, Real a, const SpringState& k) {
  for (std::size_t i = 0; i < y.v.size(); ++i) y.v[i] += a * k.v[i];
}
inline void add_scaled_positions(SpringState& y, Real a, const SpringState& k) {
  for (std::size_t i = 0; i < y.x.size(); ++i) y.x[i] += a * k.x[i];
}

/// m v^2 / 2 over the free points, and k (l - rest)^2 / 2 over the springs [J].
Real kinetic_energy(const SpringNetwork& network, const SpringState& state);
Real spring_energy(const SpringNetwork& network, const SpringState& state);

}  // namespace effuse::flow::springs
