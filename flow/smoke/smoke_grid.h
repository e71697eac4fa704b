#pragma once

#include <array>
#include <cstdint>
#include <span>
#include <vector>

#include "flow/smoke/poisson.h"
#include "geometry/base/hash.h"
#include "geometry/base/state_io.h"
#include "geometry/base/types.h"

namespace effuse::flow::smoke {

struct SmokeOptions {
  std::array<int, 3> n = {1, 1, 1};  ///< cells along x, y, z
  Real cell = 1;                     ///< side [m]
  Vec3 corner = Vec3::Zero();        ///< lowest of the grid [m]
  Poisson::Open open = {true, true, true, true, false, true};  ///< sides air passes: low and high x, y, z; others are walls
  Real air_temperature = 288.15;     ///< [K]
  Real gravity = kGravity;
  Real weight = 0;                   ///< [m/s^2] that smoke of density 1 pulls down
  Vec3 wind = Vec3::Zero();          ///< comes in through the open sides it blows from; z is not read
  Real swirl = 0;                    ///< epsilon of vorticity confinement; 0: none
  Real cooling = 0;                  ///< [s] in which the excess temperature falls to 1/e; 0: it stays
  Real thinning = 0;                 ///< [s] in which density falls to 1/e; 0: it stays
  bool sharp = true;                 ///< MacCormack's correction; false: semi-Lagrangian alone, duller, half the time
  Real tolerance = 1e-4;             ///< of the projection: rms divergence it leaves, of that it found
};

/// What flows in: within radius of a point, fading towards its rim.
struct SmokeSource {
  Vec3 at = Vec3::Zero();
  Real radius = 1;           ///< [m], at least 0.75 cells count
  Real density = 1;          ///< [1/s] in its middle
  Real temperature = 0;      ///< [K] what is there is warmed to, within a fifth of a second; 0: not
  Vec3 velocity = Vec3::Zero();  ///< [m/s] what is there is brought to, likewise; 0: not
};

/// Air that carries smoke and heat, on faces of cubic cells (a staggered grid):
///   u_t + (u . grad) u = -grad p + g (T - T_air) / T_air z - weight s z + confinement,   div u = 0
///   s_t + u . grad s = -s / thinning,   T_t + u . grad T = -(T - T_air) / cooling
/// A step: everything is carried along the flow's paths back from where it is (semi-Lagrangian, paths by midpoint), with MacCormack's
/// correction held within the values that it came from; then forces; then projection. Stable at any dt; paths longer than
/// some cells are dull. What comes in through open sides is clear, and as cool as the air. Cells may be solid: nothing flows through their
/// faces. What paths back lose or make of smoke and heat (a sixth in a hundred steps of a closed room that heat stirs) is made good over the
/// whole grid, within the values that each cell's came from: a closed room keeps both to rounding; through open sides goes what the cells beside
/// them carry out, to first order. The same bits on any number of threads.
/// Sources: Stam 1999, SIGGRAPH, 121-128; Fedkiw, Stam & Jensen 2001, SIGGRAPH, 15-22; Selle, Fedkiw, Kim, Liu & Rossignac 2008, J. Sci. Comput. 35, 350-371.
class SmokeGrid {
 public:
  /// solid: one a cell, 1: solid, or empty: none is. Sizes are checked.
  explicit SmokeGrid(const SmokeOptions& options, std::vector<std::uint8_t> solid = {});

  const SmokeOptions& options() const { return options_; }
  std::size_t size() const { return density_.size(); }
  std::size_t index(int i, int j, int k) const { return (static_cast<std::size_t>(k) * ny_ + static_cast<std::size_t>(j)) * nx_ + static_cast<std::size_t>(i); }
  Vec3 centre(std::size_t cell) const;
  bool solid(std::size_t cell) const { return solid_[cell]; }

  /// Of dt, before a step.
  void add(const SmokeSource& source, Real dt);
  /// More density, and temperature [K], in the cell of a point; where it is solid, in the next one above that is not, up to three. False: nowhere.
  bool add_at(const Vec3& at, Real density, Real temperature);

  struct Report {
    Poisson::Report pressure;
    Real fastest = 0;     ///< [m/s]
    Real divergence = 0;  ///< rms left [1/s]
  };
  /// dt > 0 [s].
  Report step(Real dt);

  std::span<const Real> density() const { return density_; }
  std::span<Real> density() { return density_; }
  std::span<const Real> excess() const { return excess_; }  ///< T - T_air [K]
  std::span<Real> excess() { return excess_; }
  /// Faces across x, y, z; face (i, j, k) of x, i in 0..nx, is number (k ny + j) (nx + 1) + i, the others likewise.
  std::span<const Real> velocity(int axis) const { return u_[static_cast<std::size_t>(axis)]; }
  std::span<Real> velocity(int axis) { return u_[static_cast<std::size_t>(axis)]; }
  Vec3 velocity_at(std::size_t cell) const;  ///< [m/s] in its middle
  /// rms over cells of the net outflow [1/s].
  Real divergence() const;
  Real mass() const;  ///< sum of density cell^3

  bool finite() const;
  std::size_t memory() const;
  void add_to(StateHash& hash) const;
  void save(StateWriter& out) const;
  void load(StateReader& in);

 private:
  struct Field;
  Field field(std::span<const Real> values, int stagger) const;
  Vec3 air_at(const Vec3& g) const;
  Vec3 origin_of(const Vec3& g, Real dt) const;
  void carry(std::vector<Real>& values, int stagger, Real dt);
  Real staying(std::size_t cell, Real dt) const;
  void put_back(std::span<const Real> before, Real dt);
  void push(Real dt);
  void swirl(Real dt);
  void close_faces();
  void fill_solids();

  SmokeOptions options_;
  std::size_t nx_, ny_, nz_;
  std::vector<std::uint8_t> solid_;
  std::array<std::vector<Real>, 3> u_;
  std::vector<Real> density_, excess_, pressure_;
  Poisson poisson_;
  std::vector<std::pair<std::size_t, std::array<std::size_t, 6>>> shores_;  // solid cells beside air, and those
  std::vector<Real> ahead_, back_, result_, outflow_;
  std::array<std::vector<Real>, 3> old_;
};

}  // namespace effuse::flow::smoke
