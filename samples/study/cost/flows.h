#pragma once

#include <cstdint>
#include <functional>
#include <vector>

#include "flow/sph/modern_lava.h"
#include "geometry/base/types.h"

/// Flows whose answer is known, run by either solver for what they cost.
namespace effuse::study {

inline constexpr Real kFilmViscosity = 2000;  ///< [Pa s]
inline constexpr Real kFilmSeconds = 8;  ///< [s]: the film is steady to 1e-3 by half of that, sheared by 9, so that nothing is left of the lattice

/// A film of 1 m on a slope of 5 degrees, from rest, Re 0.5: errors are means over the second half of its time.
struct FilmWork {
  Real seconds = 0;           ///< of processor time, for a film as wide and long as deep
  Real l2 = 0;                ///< of the profile, relative
  Real surface_and_flux = 0;  ///< the larger error of the mean surface speed and the mean flux
  Real density = 0;           ///< classic: the largest rms of rho / rho0 - 1
  std::uint64_t steps = 0;
  std::size_t memory = 0;
  std::uint64_t hash = 0;
};
/// change: what of the default options is to be otherwise, if given.
FilmWork modern_film(int layers, const std::function<void(flow::sph::ModernOptions&)>& change = {});
/// stiffness: k over g H.
FilmWork classic_film(int layers, Real stiffness);

/// BM1's dam break, both halves, periodic across, at 10, 25, 50 and 100 s.
struct FrontWork {
  Real seconds = 0;  ///< of processor time, for a metre of width
  Real error = 0;    ///< of the front, relative, root mean square
  std::vector<Real> fronts;  ///< [m]
  std::uint64_t steps = 0;
  std::size_t memory = 0;
  std::uint64_t hash = 0;
};
FrontWork modern_front(int layers, const std::function<void(flow::sph::ModernOptions&)>& change = {});
FrontWork classic_front(int layers, Real relaxation);

}  // namespace effuse::study
