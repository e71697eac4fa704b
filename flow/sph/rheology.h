#pragma once

#include <string_view>

#include "geometry/base/types.h"

/// How stiff lava is: melt, crystals, bubbles, yield strength and flow law, each a choice by name.
///
///   mu(T, g) = clamp( K(T) (g/g1)^(n-1) + tau_y(T) (1 - exp(-m g)) / g ,  mu_min, mu_max )
///   K(T)     = melt(T) * crystals(phi(T)) * bubbles,  never below mu_min
///
///   T temperature [K], g shear rate sqrt(2 D:D) [1/s], g1 = 1/s, n flow exponent, m time of regularisation [s],
///   phi volume fraction of crystals. All of these laws are fits to measurements.
/// Values for real lavas are in flow/sph/lava_presets.h.
namespace effuse::flow::sph {

/// Composition of a silicate melt [wt %]; any total, made 100 together with the water.
struct Oxides {
  Real sio2 = 0, tio2 = 0, al2o3 = 0, fe2o3 = 0, feo = 0, mno = 0, mgo = 0, cao = 0, na2o = 0, k2o = 0, p2o5 = 0;
  Real h2o = 0;    ///< taken as it is: the others share what is left of 100
  Real f2o_1 = 0;  ///< fluorine, as F2O-1
};

enum class MeltKind { kConstant, kExponential, kArrhenius, kVft, kGrd08, kDragoni };
inline constexpr std::string_view kMeltNames[] = {"constant", "exponential", "arrhenius", "vft", "grd08", "dragoni"};

/// Viscosity of the melt alone:  ln mu = p + q / (T - C)  above C, infinite below, or  ln mu = p - a T.
/// Made by the functions below, which check that it falls with T (q, a >= 0).
struct MeltLaw {
  MeltKind kind = MeltKind::kConstant;
  Real p = 6.907755278982137;  ///< 1000 Pa s
  Real q = 0;                  ///< [K]
  Real C = 0;                  ///< [K]
  Real a = 0;                  ///< [1/K]

  /// ln(mu / Pa s); infinite at and below the pole C.
  Real log_viscosity(Real T) const;
};

/// mu [Pa s] > 0 at any temperature.
MeltLaw constant_melt(Real mu);
/// Through (hot_T, hot_mu) and (cold_T, cold_mu), ln mu linear in T. cold_T < hot_T [K], 0 < hot_mu <= cold_mu [Pa s].
/// Real melts curve: their slope -d ln mu / dT doubles from 1150 to 900 degC.
MeltLaw exponential_melt(Real hot_T, Real hot_mu, Real cold_T, Real cold_mu);
/// mu = mu_ref exp(E / R (1/T - 1/T_ref)): mu_ref [Pa s] at T_ref [K], E activation energy [J/mol] >= 0.
MeltLaw arrhenius_melt(Real mu_ref, Real T_ref, Real E);
/// Vogel-Fulcher-Tammann: log10 mu = A + B / (T - C); mu [Pa s], B [K] >= 0, C [K] >= 0.
MeltLaw vft_melt(Real A, Real B, Real C);
/// Giordano, Russell & Dingwell 2008: VFT with A = -4.55 and B, C from the composition. Root mean square error of
/// the fit 0.40 in log10 mu; calibrated on melts of 41-79 wt % SiO2, dry ones at 535-1705 degC. Checked: oxides >= 0,
/// their sum > 0, water below 100, and that B and C come out positive, as they do for lavas.
/// Source: Earth Planet. Sci. Lett. 271, 123-134, table 1.
MeltLaw grd08_melt(const Oxides& wt);
/// mu = mu_ref exp(c (T_ref - T)).  Source: Dragoni 1989, Bull. Volcanol. 51, 88-95; c = 0.04/K for basalt.
MeltLaw dragoni_melt(Real mu_ref, Real T_ref, Real c);

/// The coefficients of grd08_melt: log10 mu = A + B / (T - C).
struct Vft {
  Real A = 0, B = 0, C = 0;                                   ///< log10(Pa s), K, K
  Real glass_transition() const { return B / (12 - A) + C; }  ///< T of 10^12 Pa s [K]
};
Vft grd08(const Oxides& wt);
/// Whether grd08 can be trusted to make sense of it: what grd08_melt checks.
bool grd08_accepts(const Oxides& wt);

enum class CrystalKind { kNone, kEinsteinRoscoe, kKriegerDougherty, kMaronPierce };
inline constexpr std::string_view kCrystalNames[] = {"none", "einstein_roscoe", "krieger_dougherty", "maron_pierce"};

/// Volume fraction of crystals, linear between two temperatures,
///   phi(T) = phi_erupted + phi_grown * clamp((T_start - T) / (T_start - T_end), 0, 1),
/// and the factor by which they stiffen, infinite from phi_max on:
///   einstein_roscoe    (1 - phi/phi_max)^-2.5              phi_max 1/1.51 (Pinkerton & Stevenson 1992)
///   krieger_dougherty  (1 - phi/phi_max)^(-B phi_max)      phi_max 0.641, B 3.27
///   maron_pierce       (1 - phi/phi_max)^-2                phi_max 0.633
/// Source: Chevrel et al. 2018, Comput. Geosci. 111, 167-180 (FLOWGO) and the papers it cites.
struct CrystalLaw {
  CrystalKind kind = CrystalKind::kNone;  ///< none: they do not stiffen; phi(T) still feeds yield and latent heat
  Real erupted = 0;                       ///< phi above T_start
  Real grown = 0;                         ///< more of it below T_end; erupted + grown <= 1
  Real T_start = 1360;                    ///< [K]: where growth begins on cooling, eruption temperature or liquidus
  Real T_end = 1143;                      ///< [K] < T_start: solidus
  Real max = 0.641;                       ///< maximum packing phi_max, 0 < phi_max <= 1
  Real intrinsic = 3.27;                  ///< intrinsic viscosity B of krieger_dougherty, > 0

  Real crystallinity(Real T) const;
  Real factor(Real phi) const;  ///< >= 1; infinite from max on
};
/// A law with its usual phi_max and B, as listed above, and no crystals yet.
CrystalLaw crystal_law(CrystalKind kind);

enum class BubbleKind { kNone, kRigid, kSoft };
inline constexpr std::string_view kBubbleNames[] = {"none", "rigid", "soft"};

/// Bubbles of volume fraction phi_b stiffen slow lava and soften fast one: with the capillary number
/// Ca = mu g r / surface tension, rigid ones (Ca < 1) by (1 - phi_b)^-1, soft ones (Ca > 1) by (1 - phi_b)^(5/3).
/// Source: Llewellin & Manga 2005, J. Volcanol. Geotherm. Res. 143, 205-217, as used by FLOWGO.
struct BubbleLaw {
  BubbleKind kind = BubbleKind::kNone;  ///< none: they change neither viscosity nor, by themselves, density
  Real fraction = 0;                    ///< phi_b, 0 <= phi_b < 1

  Real factor() const;
};
/// rho_dense (1 - phi_b) [kg/m^3]: of lava with bubbles, whose mass is neglected.
Real bulk_density(Real dense_density, Real bubble_fraction);

enum class YieldKind { kNone, kConstant, kDragoniRyerson, kThreePhase };
inline constexpr std::string_view kYieldNames[] = {"none", "constant", "dragoni_ryerson", "three_phase"};

/// Stress below which lava does not flow [Pa], never above kStrongest:
///   constant         tau
///   dragoni_ryerson  cold (exp(rate (T_start - T)) - 1), 0 above T_start, + 6500 phi^2.85
///                    Dragoni 1989 (rate 0.08/K, cold 0.01 Pa); Ryerson et al. 1988, J. Geophys. Res. 93, 3421-3436.
///                    FLOWGO's published code has exp(rate (T_start - T) - 1), smaller by e: not what its paper says.
///   three_phase      10^(80 (phi - 0.35)) + 10^(1.98 (phi + phi_b - 0.35))
///                    Birnbaum, Lev & Llewellin 2021, Proc. R. Soc. A 477. 0.2 Pa without crystals or bubbles.
struct YieldLaw {
  YieldKind kind = YieldKind::kNone;
  Real tau = 0;            ///< of constant [Pa]
  Real cold = 0.01;        ///< of dragoni_ryerson [Pa]
  Real rate = 0.08;        ///< [1/K]
  Real T_start = 1410.15;  ///< [K]

  static constexpr Real kStrongest = 1e9;  ///< [Pa]: ten times solid basalt; the formulas run on to 10^52
  Real strength(Real T, Real phi, Real bubble_fraction) const;
};

/// All of it, ready to be evaluated for each particle in each step. A plain value; check() once it is filled in.
struct Rheology {
  MeltLaw melt;
  CrystalLaw crystals;
  BubbleLaw bubbles;
  YieldLaw yield;
  Real exponent = 1;           ///< n > 0: 1 Newtonian or Bingham, below it thins when sheared (Herschel-Bulkley)
  Real regularisation = 1000;  ///< m [s] > 0 of Papanastasiou 1987, J. Rheol. 31, 385-404. From g = 4.6/m on the yield
                               ///< strength is there but for 1 %; lava that stands creeps with viscosity m tau_y
  Real mu_min = 1e-3;          ///< [Pa s]
  Real mu_max = 1e10;          ///< [Pa s]: what the flow law, jammed crystals and melt below its VFT pole are cut to

  /// Apparent dynamic viscosity [Pa s] at T [K] > 0 and strain_rate sqrt(2 D:D) [1/s] >= 0: finite, in
  /// [mu_min, mu_max], never rising with T. Not a number if an argument is none. 10 to 80 ns.
  Real viscosity(Real temperature, Real strain_rate) const;
  /// [Pa] >= 0, never rising with T.
  Real yield_strength(Real temperature) const;
  /// Volume fraction of crystals, 0 .. 1, never rising with T.
  Real crystallinity(Real temperature) const;
  /// Of viscosity(): whether strain_rate matters. False: Newtonian, pass 0.
  bool needs_strain_rate() const { return yield.kind != YieldKind::kNone || exponent != 1; }

  /// CHECKs what the fields' comments ask.
  void check() const;

  /// mu [Pa s] > 0 always, not clamped: for comparison with exact solutions.
  static Rheology newtonian(Real mu);
};

}  // namespace effuse::flow::sph
