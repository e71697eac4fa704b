#pragma once

#include <span>
#include <vector>

#include "flow/sph/column_grid.h"
#include "flow/sph/crust_column.h"
#include "flow/sph/enthalpy.h"
#include "flow/sph/guards.h"
#include "flow/sph/kernel.h"
#include "geometry/base/hash.h"
#include "geometry/base/state_io.h"
#include "geometry/base/types.h"

namespace effuse::flow::sph {

struct HeatOptions {
  bool on = true;                 ///< false: particles keep the temperature they are born with, nothing is computed
  EnthalpyCurve curve;            ///< a melting range below 0.1 K is widened to that, about its middle
  Real conductivity = 1.7;        ///< k of the melt [W/(m K)], vesicles included
  Real solid_conductivity = 0;    ///< of the solid; in between by solid fraction. 0: that of the melt
  SurfaceLaw air;                 ///< radiation and convection of what is exposed to the sky
  Real ground_effusivity = 2100;  ///< b = sqrt(k rho c) of the ground [J/(m^2 K s^0.5)]: a half-space that warms up under the lava. 0: insulates
  Real ground_conductance = 0;    ///< [W/(m^2 K)] instead of a half-space: a plate with its far side at the ground temperature. 0: half-space
  bool viscous_heating = true;    ///< use Surroundings::dissipation
  bool crust = true;              ///< a conductive column on each exposed particle; false: it glows with its mean temperature
  int crust_cells = kColumnCells; ///< of that column, 2 to 16
  Real crust_temperature = 1070 + kZeroCelsius;  ///< crust is what is colder [K]
  Real longest_interval = 60;     ///< [s] between two exchanges among particles, see Heat::conducts()
  Guards guards;             ///< all on, but for tests
};

/// Joules, of one step. Enthalpy gained = dissipated - radiated - convected - ground, to rounding.
struct HeatBudget {
  Real radiated = 0, convected = 0;  ///< through exposed faces
  Real ground = 0;                   ///< into the ground
  Real quenched = 0;                 ///< of radiated and convected: into water
  Real dissipated = 0;               ///< by viscous heating, gained
  int conduction_passes = 0;         ///< loops over all pairs
};

/// The thermal state of particles of one mass and size. Enthalpy is the state (EnthalpyCurve). Particles exchange heat
/// by conduction in the form of Cleary & Monaghan 1999, in watts from j to i,
///   Q_ij = V^2 4 k_i k_j / (k_i + k_j) (-W'(r) / r) (T_j - T_i),
/// which is the other's loss to the last bit of a product: energy is conserved by pairs, and a truncated sum is an
/// insulated boundary. Explicit: one pass where that is monotone (no new extremes of temperature), and for steps that are
/// longer s stages of the Runge-Kutta-Legendre scheme RKL1, which reach (s^2 + s) / 2 times as far and keep both
/// properties (Meyer, Balsara & Aslam 2014, J. Comput. Phys. 257, 594-626). Exchange and losses take turns, of 0.05
/// dx^2/kappa each, though not more than eight in a step unless the stages would grow beyond 51.
///
/// An exposed particle (sky_area > 0) holds, in place of its one value, a CrustColumn: crust_cells cells from the surface to the
/// particle's depth, whose sum IS its enthalpy. Losses leave by the first cell, implicitly in the surface temperature;
/// neighbours exchange with the last one, which stands nearer to them than a particle's centre. Such pairs (one has a
/// column, the other not) take their weight at 1.5 times their distance, so that the first layer below dominates, and
/// count alpha times:
///   alpha = sum_m m^2 c_m / sum_m (m - 2/3 + e + e^2/2) c'_m,   c_m, c'_m = sum of -W'/r over the m-th layer at 1 and 1.5 r,
/// e half the last cell's share. The bracket is the distance, in spacings, over which the parabola through that cell and
/// the mean of the particle below, level at that particle's far side, has the slope it has between them: the profile
/// under a growing crust is bent.
/// Accuracy: a half-space of lava on a lattice of 5, 10 or 50 cm keeps its surface within 1 % (in degC) of the 1-D
/// solution while the crust is thinner than a particle, within 4 % when it grows from one layer into the next, from a
/// minute to two days. The first cell is dx/200, at most 2 mm: until its diffusion time (4 s for 2 mm) has passed a few
/// times the heat lost is some 5 % short, the surface within 1 %.
///
/// A particle that is buried keeps its column, insulated, for half as long as that was exposed, or until its
/// temperatures are within 5 K: surface detection may flicker. Then it is one value again, the column's mean.
///
/// A particle on the ground loses, through its area A and after the contact time t,
///   A (T - T_ground) / (sqrt(pi t) / b_ground + dx/k (sqrt(pi tau) - 2 tau)) [W],  tau = min(kappa t / dx^2, pi/16),
/// b = sqrt(k rho c). With T its mean this is exact for two half-spaces brought together until the cold layer has grown
/// through the particle, and close to the truth thereafter. Out of contact the clock runs backwards. A particle with a
/// column loses by its last cell, and the same holds with that cell's thickness.
///
/// Steps may be of any length. Work is put off where nothing happens: pairs exchange once in conducts()'s interval
/// (0.02 dx^2/kappa, at most longest_interval), an old crust is advanced when its pending time reaches 2 % of its age
/// (at most 10 s). What is pending is lost from the sky and to the ground later, never forgotten: the budget of a step
/// is of what was booked in it.
///
/// The same bits on any number of threads. All temperatures in K, > 0 and finite (checked at birth).
class Heat {
 public:
  /// spacing dx [m]: the volume of a particle is dx^3; density [kg/m^3].
  Heat(const HeatOptions& options, Real spacing, Real density);

  /// Appends a particle.
  void born(Real temperature);
  /// Reorders and drops: new particle k was which[k].
  void keep(std::span<const Index> which);

  /// All per particle, or empty where said so.
  struct Surroundings {
    std::span<const Vec3> x;             ///< [m]
    const Neighbors& neighbors;          ///< every j != i within `support`; read only when conducts(dt)
    KernelKind kernel = KernelKind::kWendlandC2;
    Real support = 0;                    ///< [m]
    Vec2 period = Vec2::Zero();          ///< [m]; 0: none. Separations are the nearest image's; positions at most a period apart
    std::span<const Real> sky_area;      ///< exposed to the air [m^2], 0: none. Sums to the true area. Empty: none anywhere
    std::span<const Real> ground_area;   ///< in touch with the ground [m^2]. Empty: none anywhere
    std::span<const Real> ground_temperature;  ///< of the undisturbed ground [K]; read where ground_area > 0
    std::span<const Real> dissipation;   ///< [W/m^3], >= 0; or empty
    std::span<const Real> ground_effusivity = {};  ///< b of what it touches there [J/(m^2 K s^0.5)]; 0, or empty: the options' ground
    std::span<const std::uint8_t> wet = {};    ///< 1: its exposed face is under water, whose law holds in place of the air's; or empty. What an old crust
                                               ///< has pending as it gets wet is lost by water's law, too
    SurfaceLaw water = {};                     ///< air_temperature: the water's
  };
  /// Whether step(dt) will loop over the pairs. If not, neighbors may be of any size and age.
  bool conducts(Real dt) const { return options_.on && pair_time_ + dt >= interval_; }
  /// Advances by dt [s] >= 0.
  HeatBudget step(Real dt, const Surroundings& surroundings);

  std::size_t size() const { return enthalpy_.size(); }
  const HeatOptions& options() const { return options_; }
  /// Views, valid until the next change.
  std::span<const Real> temperature() const { return temperature_; }                  ///< of the particle as a whole [K]
  std::span<const Real> surface_temperature() const { return surface_temperature_; }  ///< what glows [K]; inside: temperature()
  /// [m] of an exposed particle: depth of the isotherm crust_temperature, at most the particle's own depth (dx, less
  /// where more than dx^2 is exposed). A crust that is thicker goes on in the solid fraction of the particles below.
  /// 0 for particles that are not exposed.
  std::span<const Real> crust_thickness() const { return crust_thickness_; }
  /// Of the particle's volume, 0 to 1: that depth over its column's. Kept while the column is, lava over it or not.
  std::span<const Real> crust_share() const { return crust_share_; }
  std::span<const Real> solid_fraction() const { return solid_fraction_; }            ///< by mass, 0 to 1
  std::span<const Real> enthalpy() const { return enthalpy_; }                        ///< mean of the particle [J/kg]
  /// Of the last step, by particle: what was booked as given to the ground, or whatever ground_area is in touch with [J]; and how hot that is
  /// where they touch [K], 0 where they do not. From the step's beginning: of two half-spaces brought together
  /// (b T + b_ground T_ground) / (b + b_ground).
  std::span<const Real> given() const { return given_; }
  std::span<const Real> touched_temperature() const { return touched_temperature_; }
  Real total_enthalpy() const;                                                        ///< [J]
  Real particle_mass() const { return mass_; }

  /// Temperature [K] by depth below the surface [m] of an exposed particle: the surface, then the cells' centres. Empty
  /// without a column.
  struct Level {
    Real depth, temperature;
  };
  std::vector<Level> profile(std::size_t i) const;
  std::size_t columns() const { return columns_.size(); }

  std::size_t memory() const;
  void add_to(StateHash& hash) const;
  void save(StateWriter& out) const;
  /// Throws InputError where what was saved does not fit together; this is then unchanged.
  void load(StateReader& in);

 private:
  static constexpr Index kNone = ~Index{0};
  template <class Self, class Archive>
  static void archive(Self& self, Archive& io);

  void raise_columns(const Surroundings& s);
  void drop_columns();
  void load_nodes();
  void store_nodes();
  void run_stages(Real dt, int stages, const Surroundings& s);
  Real exchange(const Surroundings& s);
  template <class Kernel>
  Real exchange(const Surroundings& s, const Kernel& W);
  void lose(Real dt, const Surroundings& s, bool flush, HeatBudget& budget);
  HeatBudget lose_column(std::size_t c, Real dt, const Surroundings& s, bool flush);
  HeatBudget lose_lump(std::size_t i, Real dt, const Surroundings& s);
  Real ground_conductance(std::size_t i, Real dt, Real area, Real thickness, Real layer_enthalpy, Real ground_temperature, Real effusivity);
  void refresh();
  void refresh_particle(std::size_t i);
  Real conductivity(Real enthalpy) const;
  std::size_t last_cell() const { return static_cast<std::size_t>(shape_.cells - 1); }
  const SurfaceLaw& law_of(std::size_t i, const Surroundings& s) const { return !s.wet.empty() && s.wet[i] ? s.water : options_.air; }

  HeatOptions options_;
  Real spacing_, density_, mass_, interval_, diffusion_time_;
  ColumnShape shape_;

  std::vector<Real> enthalpy_;      // [J/kg]; of a particle with a column: its mean
  std::vector<Real> contact_time_;  // with the ground [s]
  std::vector<Index> column_of_;    // or kNone
  std::vector<CrustColumn> columns_;
  std::vector<Index> owner_;        // of each column
  Real pair_time_ = 0;              // since pairs last exchanged [s]

  std::vector<Real> temperature_, surface_temperature_, crust_thickness_, crust_share_, solid_fraction_;

  struct Packed {
    Real x, y, z, T, k, column;
  };
  // Scratch of an exchange. A node is what pairs exchange with: a particle, or its column's last cell.
  std::vector<Packed> packed_;
  std::vector<Real> node_, node_before_, gain_, rate_;  // [J/kg], [J/kg], [W/kg], [1/s]
  std::vector<Real> given_, touched_temperature_;       // of the last step
};

}  // namespace effuse::flow::sph
