#pragma once

#include <cstdint>
#include <span>

#include "geometry/base/types.h"

namespace effuse::geometry {

/// Particles as anyone may hold them: views, nothing owned. All the skin knows of a flow.
/// Every span has size() elements or none (position and radius always have them).
struct Points {
  std::span<const Vec3> position;        ///< [m]
  std::span<const Real> radius;          ///< [m], half the particle spacing
  std::span<const Vec3> velocity;        ///< [m/s]
  std::span<const Real> temperature;     ///< [K]
  std::span<const Real> crust;           ///< 0 molten .. 1 solid
  std::span<const Real> age;             ///< [s] since emission
  std::span<const Real> opacity;         ///< 0 not to be seen .. 1; of what flies, not of lava
  std::span<const std::uint64_t> id;     ///< never reused
  std::span<const std::uint8_t> surface; ///< 1: near the surface
  /// Material coordinates [m], two sets born anew in turn (at emission and then periodically set to the
  /// position of that moment), so that detail noise moves with the lava and never stretches for long.
  /// Detail is the blend (1 - rest_ratio) * f(rest) + rest_ratio * f(rest2).
  std::span<const Vec3> rest, rest2;
  Real rest_ratio = 0;
  std::size_t size() const { return position.size(); }
};

}  // namespace effuse::geometry
