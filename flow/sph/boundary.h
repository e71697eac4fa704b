#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <span>
#include <vector>

#include "flow/sph/movable.h"
#include "geometry/base/types.h"

/// Solid ground in the sums of a particle: the kernel and its moments over the half-space beyond the
/// plane at a contact's distance. One table serves height fields, meshes and obstacles alike.
namespace effuse::flow::sph {

inline constexpr Real kNothingAcross = 1e9;  ///< [m]

/// One surface that a particle feels.
struct Wall {
  Vec3 normal = Vec3::UnitZ();     ///< out of the solid
  Real distance = 0;               ///< from the particle [m], negative inside; as the sums take it: bend_walls()
  Real reach = 0;                  ///< the distance itself [m]
  Index surface = 0;               ///< which solid
  Index triangle = kNotMovable;    ///< of a solid that deforms, its triangle; then `movable` is the place in ParticleSystem::pressed
  Real curvature = 0;              ///< sum of both principal curvatures [1/m]; positive: convex ground
  Vec3 velocity = Vec3::Zero();    ///< of the surface [m/s]
  Real temperature = 0;            ///< [K]; 0: none of its own
  Real effusivity = 0;             ///< sqrt(k rho c) of the solid [J/(m^2 K s^0.5)]; 0: the ground's
  Real friction = 1;               ///< factor of the drag along it: FilmFriction
  Real across = kNothingAcross;    ///< to a wall face to face with it [m]: FilmFriction::channel(); only obstacles' walls know
  bool mirrors = false;            ///< the pressure goes on along it beyond it, as in a mirror: pressure.h
  Index movable = kNotMovable;     ///< place in ParticleSystem::movable; then `velocity` is not looked at
  Vec3 arm = Vec3::Zero();         ///< from its centre to the wall's place [m]; on a triangle: barycentric coordinates of that
  Real part = 1, share = 1;        ///< of its gamma and of its other values that are its own, where walls meet: trim_walls()
};

/// Whether it belongs to a body that lava moves, or to a solid that it deforms.
inline bool gives_way(const Wall& wall) { return wall.movable != kNotMovable; }
inline bool deforms(const Wall& wall) { return wall.triangle != kNotMovable; }

/// The walls of every particle, one list after another.
struct Walls {
  std::vector<Index> first;  ///< n + 1
  std::vector<Wall> walls;
  std::span<const Wall> operator[](std::size_t i) const { return {walls.data() + first[i], first[i + 1] - first[i]}; }
};

/// Weight of a pair in the viscous sum (viscosity.h) [1/m^7]:  w = C (1 - r^2/s^2)^2,  C = 10395 / (16 pi s^7), s the
/// support. Even and smooth in x, so that sums of w x x x x over a lattice are isotropic to 2 % at s = 3 spacings,
/// where F / r^2 of a kernel leaves 4-20 %; and no root, no division.
struct ViscousWeight {
  explicit ViscousWeight(Real support) : per_s2(1 / (support * support)), factor(10395 / (16 * kPi * std::pow(support, 7))) {}
  Real per_s2, factor;
  /// r2 = |x|^2 < s^2 [m^2].
  Real operator()(Real r2) const {
    const Real p = 1 - r2 * per_s2;
    return factor * p * p;
  }
};

/// What the half-space z > d adds to a particle's sums; z measured from the particle along -normal, r = |x|, t one
/// direction along the plane, F = (dW/dr)/r <= 0:
///
///   gamma      to rho / rho0: layers of a cubic lattice beyond the plane, the first half a spacing behind it, so that
///              lava on a lattice has density 1 up to the wall (in the limit of small spacing: int W dV)
///   slope      d gamma / d d < 0; grad gamma = slope normal
///   bend       int W (x^2 + y^2)/4 dA over the plane; on ground of curvature c (a paraboloid, first order in c)
///              gamma is gamma(d) - c bend(d)
///   drag_t     int w z t^2 dV  [1/m]   friction of flow along the plane, w the weight of viscosity (ViscousWeight):
///   drag_n     int w z^3 dV    [1/m]   velocities beyond the plane go on linearly, through zero at the wall
///              (Morris 1997, in the continuum):  a = -nu / d * (drag_t v_t + drag_n v_n)
///   moment_n   -int F z^2 dV, moment_t  -int F t^2 dV   for the gradient of the velocity and its renormalisation
///
/// gamma and slope hold for negative d too; the others stay at their value at 0. Linear between 512 nodes to a side: 1e-5
/// of the largest value (spiky kernel: 5e-4 where a layer passes the particle, for its cusp).
class BoundaryTable {
 public:
  struct Row {
    Real gamma = 0, slope = 0, bend = 0, drag_t = 0, drag_n = 0, moment_n = 0, moment_t = 0;
  };

  template <class Kernel>
  BoundaryTable(const Kernel& kernel, Real spacing) : support_(kernel.support), row_(2 * kNodes + 2) {
    // Moments over discs from r = z to the support, then over z from the far end: midpoint rule on a fine grid.
    constexpr int kFine = 8, kRings = 512;
    const Real dz = support_ / (kNodes * kFine);
    const ViscousWeight weight(support_);
    Row sum;
    for (std::size_t k = kNodes * kFine; k-- > 0;) {
      const Real z = (static_cast<Real>(k) + 0.5) * dz, dr = (support_ - z) / kRings;
      Real f = 0, ft = 0, v = 0, vt = 0;
      for (int m = 0; m < kRings; ++m) {
        const Real r = z + (m + 0.5) * dr, area = 2 * kPi * r * dr, F = -kernel.dW(r) / r, t2 = (r * r - z * z) / 2;
        f += area * F;
        ft += area * F * t2;
        v += area * weight(r * r);
        vt += area * weight(r * r) * t2;
      }
      sum.drag_t += z * vt * dz;
      sum.drag_n += z * z * z * v * dz;
      sum.moment_n += z * z * f * dz;
      sum.moment_t += ft * dz;
      if (k % kFine == 0) {
        Real bend = 0;
        const Real d = static_cast<Real>(k) * dz, step = (support_ - d) / kRings;
        for (int m = 0; m < kRings; ++m) {
          const Real r = d + (m + 0.5) * step;
          bend += 2 * kPi * r * step * kernel.W(r) * (r * r - d * d) / 4;
        }
        sum.bend = bend;
        row_[kNodes + k / kFine] = sum;
      }
    }
    const int reach = static_cast<int>(support_ / spacing) + 1;
    const Real volume = spacing * spacing * spacing;
    for (std::size_t k = 0; k < row_.size(); ++k) {
      const Real d = (static_cast<Real>(k) - kNodes) * support_ / kNodes;
      if (k < kNodes) row_[k] = row_[kNodes];
      row_[k].gamma = row_[k].slope = 0;
      for (Real z = d + spacing / 2; z < support_; z += spacing) {
        for (int a = -reach; a <= reach; ++a) {
          for (int b = -reach; b <= reach; ++b) {
            const Real r = std::sqrt((a * a + b * b) * spacing * spacing + z * z);
            row_[k].gamma += volume * kernel.W(r);
            if (r > 0) row_[k].slope += volume * kernel.dW(r) * z / r;
          }
        }
      }
    }
    row_.back() = {};
  }

  Real support() const { return support_; }
  /// All values at d; zeros from the support on.
  Row at(Real d) const {
    const Real s = std::max(d / support_ + 1, 0.0) * kNodes;
    if (!(s < 2 * kNodes)) return {};
    const auto k = static_cast<std::size_t>(s);
    const Real t = s - static_cast<Real>(k);
    const Row &a = row_[k], &b = row_[k + 1];
    const auto mix = [t](Real x, Real y) { return x + t * (y - x); };
    return {mix(a.gamma, b.gamma), mix(a.slope, b.slope), mix(a.bend, b.bend), mix(a.drag_t, b.drag_t), mix(a.drag_n, b.drag_n), mix(a.moment_n, b.moment_n), mix(a.moment_t, b.moment_t)};
  }
  /// A wall's own.
  Row at(const Wall& wall) const {
    Row row = at(wall.distance);
    row.gamma *= wall.part;
    for (Real* value : {&row.slope, &row.bend, &row.drag_t, &row.drag_n, &row.moment_n, &row.moment_t}) *value *= wall.share;
    return row;
  }
  /// The distance in [0, support] at which -slope is `value`: how far off a plane free surface is when the gradient of
  /// the kernel's sum is that large. 0 for values above -slope(0); the support for 0 (the last layer is out of sight from
  /// half a spacing nearer on).
  Real distance_of_slope(Real value) const {
    if (!(value < -row_[kNodes].slope)) return 0;
    if (value <= 0) return support_;
    std::size_t low = kNodes, high = 2 * kNodes;
    while (high - low > 1) {
      const std::size_t mid = (low + high) / 2;
      (-row_[mid].slope >= value ? low : high) = mid;
    }
    const Real a = -row_[low].slope, b = -row_[high].slope;
    return support_ / kNodes * (static_cast<Real>(low - kNodes) + (a > b ? (a - value) / (a - b) : 0));
  }

 private:
  static constexpr std::size_t kNodes = 512;
  Real support_;
  std::vector<Row> row_;  // d from -support to support
};

/// What thin lava lacks of friction. A wall's drag is spread over the layers within the support, and goes on linearly beyond the wall
/// where the profile is a parabola; a film of few layers gets less of it, and flows too fast (one layer: twice), as does lava between two
/// walls face to face. The factors that give, particles on a cubic lattice, exactly
///
///   film(H)     on a plane, the surface free: the flux g sin(theta) H^3 / (3 nu) of Nusselt
///   channel(W)  between two walls, pushed along them: F W^3 / (12 nu) of Poiseuille
///
/// solved layer by layer for N = 1..12 and 1..16 layers, linear in H / spacing between, constant outside.
class FilmFriction {
 public:
  FilmFriction(const BoundaryTable& table, Real spacing);
  Real film(Real depth) const { return at(film_, depth / spacing_); }
  Real channel(Real width) const { return at(channel_, width / spacing_); }
  /// Wider channels need no factor [m].
  Real widest() const { return kChannelLayers * spacing_; }

 private:
  static constexpr std::size_t kFilmLayers = 12, kChannelLayers = 16;
  template <std::size_t N>
  static Real at(const std::array<Real, N>& factors, Real layers) {
    const Real s = std::clamp(layers - 1, 0.0, static_cast<Real>(N - 1));
    const auto k = std::min(static_cast<std::size_t>(s), N - 2);
    return factors[k] + (s - static_cast<Real>(k)) * (factors[k + 1] - factors[k]);
  }
  Real spacing_;
  std::array<Real, kFilmLayers> film_{};
  std::array<Real, kChannelLayers> channel_{};
};

}  // namespace effuse::flow::sph
