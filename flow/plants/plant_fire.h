#pragma once

#include <span>
#include <vector>

#include "geometry/base/hash.h"
#include "geometry/base/state_io.h"
#include "geometry/base/types.h"

/// Plants that heat up, catch fire and burn down.
namespace effuse::flow::plants {

/// What burns: leaves and twigs, flat and thin, lit from one side and cooling on both.
struct Fuel {
  Real ignition = 320 + kZeroCelsius;  ///< [K]; wood and leaves with a flame near: about 320 degC
  Real moisture = 0.6;                 ///< kg of water a kg of dry fuel; what dries up must be heated, too
  Real density = 600;                  ///< [kg/m^3]
  Real thickness = 4e-4;               ///< [m]
  Real burn_time = 15;                 ///< [s] from ignition until all that burns has burnt
  Real convection = 15;                ///< [W/(m^2 K)] to the air
  Real air = 288.15;                   ///< [K]
  Real flame_flux = 100e3;             ///< [W/m^2] that a full flame gives to what stands in it, and that it radiates
};

/// Something hot: a patch of lava of that area [m^2] and temperature [K].
struct HotPatch {
  Vec3 at;
  Real area, temperature;
};

/// Plants in bands of height, each band of one temperature and one share burnt.
///   heat     rho c delta dT/dt = q - 2 h (T - T_air) - 2 e s (T^4 - T_air^4),  c (T_ignition - T_air) = 581 kJ/kg + moisture 2594 kJ/kg
///   q        of patches e s T^4 F with F = A / (A + pi r^2), a disk's over its middle, all F together at most 1; of the flame a band below
///            (whole), a band above (a quarter), and of other plants' flames by their F, as disks of the plant's radius and a band's height
///   burning  from ignition on, for burn_time; the flame is full from a tenth of it to seven tenths, then dies down
/// Explicit steps of at most kStep; bands that have burnt are left alone. The same bits on any number of threads.
/// Source of the heat of ignition: Rothermel 1972, USDA Forest Service INT-115.
class PlantFire {
 public:
  static constexpr int kBands = 8;
  static constexpr Real kStep = 0.25;  ///< [s]

  /// feet [m], heights [m] and radii of crowns [m] of the plants (sizes checked).
  PlantFire(std::vector<Vec3> feet, std::vector<Real> heights, std::vector<Real> radii, const Fuel& fuel);

  std::size_t size() const { return feet_.size(); }
  /// dt in (0, kStep] (checked). patches: where the lava is. True when anything is warmer than air, or burns: when it may look different.
  bool step(Real dt, std::span<const HotPatch> patches);

  Real temperature(std::size_t plant, int band) const { return temperature_[plant * kBands + static_cast<std::size_t>(band)]; }
  Real burnt(std::size_t plant, int band) const { return burnt_[plant * kBands + static_cast<std::size_t>(band)]; }  ///< 0..1; above 0: it has caught fire
  /// 0: none, 1: full.
  Real flame(std::size_t plant, int band) const;
  bool any_flame(std::size_t plant) const;
  Vec3 middle(std::size_t plant, int band) const { return feet_[plant] + Vec3(0, 0, (band + 0.5) / kBands * heights_[plant]); }
  Real height(std::size_t plant) const { return heights_[plant]; }
  Real radius(std::size_t plant) const { return radii_[plant]; }

  std::size_t burning() const;     ///< plants with a flame
  std::size_t burnt_down() const;  ///< plants without anything left to burn
  std::size_t memory() const;
  void add_to(StateHash& hash) const;
  void save(StateWriter& out) const;
  /// Throws InputError when the numbers are those of other plants.
  void load(StateReader& in);

 private:
  std::vector<Vec3> feet_;
  std::vector<Real> heights_, radii_;
  Fuel fuel_;
  Real capacity_;  // [J/(m^2 K)]
  std::vector<Real> temperature_, burnt_, flux_;  // kBands a plant
};

/// Patches of particles' surface: those of the same cell of a grid, `cell` [m] wide, together, at their mean place and the temperature of their
/// mean T^4. surface: 1 where a particle lies near the surface; empty: all do. Each is worth spacing^2.
std::vector<HotPatch> hot_patches(std::span<const Vec3> x, std::span<const Real> temperature, std::span<const std::uint8_t> surface, Real spacing, Real cell, Real coldest);

}  // namespace effuse::flow::plants
