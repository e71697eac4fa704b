#pragma once

#include "geometry/base/types.h"

/// What the front's error is made of, and what spacing it asks for.
namespace effuse::budget {

/// Error of a lava's front over a film: root mean square over the frames of its distance from the converged one, over that one's root mean
/// square. A function of the spacing over the flow's own depth, x = dx / H, and of the step's share of its limit:
///
///   e(x) = 0.004 + 0.025 x  +  0.010 courant / 0.4  +  0.018 ramp(x; 0.8, 1)  +  0.0364 (x / 2)^5
///
/// The sums' own error and the step's (BM1 with three layers: 2.7 % with the default steps, 1.2 % with half of them, slowing down from the
/// start, to which flows from vents are half as sensitive). Where particles are as large as the flow is deep the one layer is slower
/// than the film it stands for; where they are larger each slides as a film of its own thickness would, with the square of it, and leaves
/// the others behind. Constants by runs of gully-modern.toml, of the first minute's lava of maunga-whau-modern.toml, of a stiff heap
/// (0.58, 4.1 %) and of oil on a steep plane (0.83, 3.2 %), against their finest, to a factor of two:
///
///   x              0.8   1.0   1.1   1.45  1.6   2.05  2.2   2.9
///   measured [%]   0.4   7.4   5.6   5.9   4.1   10.6  7.9   67
///   e(x)     [%]   3.4   5.7   6.1   7.6   8.2   12    15    34
///
/// but for the first: below, these runs have in common what they lack of the truth. On steep planes the last term sets in at once: the
/// oil's front is off by 36 % at 1.2, by 120 % at 1.7. Of the sixty scenes of refined_error it tells 0.75 of what is measured, in the geometric mean,
/// and scatters by exp(0.77).
struct FrontLaw {
  Real depth = 1;  ///< H [m] > 0

  /// spacing dx [m] > 0, courant > 0.
  Real error(Real dx, Real courant) const;
  /// The largest spacing whose error is at most `wanted`, which is above what is left at spacing 0 (checked).
  Real spacing_for(Real wanted, Real courant) const;
};

inline constexpr Real kUsualCourant = 0.4;

/// What the fronts of three runs differ by, of spacings sqrt(2) h, h and h / sqrt(2), over the last one's. Positive: the larger particles run ahead.
struct FrontDifferences {
  Real coarser = 0;    ///< of the first and the second: sum of products with the last one's front, over the frames
  Real finer = 0;      ///< of the second and the last
  Real finer_rms = 0;  ///< of these two: root mean square, over that of the last
};

/// Error of the second run's front, by these differences:
///
///   e^2 = (1.46 finer - 0.21 coarser)^2 + (0.76 finer_rms)^2 + (0.010 courant / 0.4)^2
///
/// The first is Richardson's extrapolation for an error of two powers of h, one that slows the flow (the sums', about the first power) and one that
/// makes it run ahead (particles that lie alone, about the fourth): those would give 1.96 and -0.18. They have opposite signs, and where they cancel, at
/// spacings about the depth, two runs may agree and both be off by a tenth: so the third run. Factors by sixty scenes drawn at random (planes,
/// Maunga Whau, a gully, levees, a ledge, heaps; 300 to 15000 Pa s; spacings of 0.3 to 3 depths), each against half its spacing: told over measured
/// scatters by exp(0.30); each scene left out in turn, 58 of 60 are within a factor of two. FrontLaw tells 38 of them so.
Real refined_error(const FrontDifferences& differences, Real courant);

/// Depth of a flow that was run with two sizes of particles, sqrt(2) apart [m].
///   spacing     the smaller one [m] > 0
///   layers      volume over covered area and spacing, of the smaller ones: 1 and more
///   difference  of their fronts, relative (difference_of_fronts)
/// Where particles lie on one another the layers say it, less what particles beside one another lack; where they lie alone the
/// difference does, by how fast it grows with x: 10, 17 and 50 % were measured at 1.2, 1.45 and 2.1.
Real flow_depth(Real spacing, Real layers, Real difference);

/// Share of the step's limit at which its error is a third of what is wanted, at most the usual one.
Real courant_for(Real wanted);
/// Of the solves: their error is a hundredth of what is wanted (BM1: 3e-4 at 1e-3).
Real tolerance_for(Real wanted);

}  // namespace effuse::budget
