#pragma once

#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "flow/integrate/deformable.h"
#include "flow/scene/material.h"
#include "geometry/base/error.h"
#include "geometry/base/types.h"

/// What effects of one scene know of one another: little, and by capability, never by name of a class.
namespace effuse::flow {

/// A flow of particles as others meet it: views, valid until its next step.
///   temperature  of the surface where there is one [K]
///   surface      1: near the flow's surface; empty: nobody knows
struct FlowView {
  std::span<const Vec3> x, v;
  std::span<const Real> temperature;
  std::span<const std::uint8_t> surface;
  Real spacing = 0;  ///< [m]; 0: no flow
};

/// Where a flow comes out.
struct Opening {
  Vec3 from = Vec3::Zero(), to = Vec3::Zero();  ///< its centre line [m]; the same of a round one
  Real width = 0;                               ///< [m]
  Real start = 0, stop = 0;                     ///< [s]
};

/// Water that lava may enter. As it stood at the end of the last frame.
class Water {
 public:
  virtual ~Water() = default;
  /// Height of its surface over (x, y) [m]; none where there is no water.
  virtual std::optional<Real> surface(const Vec2& p) const = 0;
  /// out[i] = 1 where x[i] is under it; others are left as they are. In parallel.
  virtual void wet(std::span<const Vec3> x, std::span<std::uint8_t> out) const = 0;
  virtual Real temperature() const = 0;  ///< [K]
  /// [W/(m^2 K)] of what boils on lava under it; 0: it does not cool lava.
  virtual Real boiling() const = 0;
};

/// A solid of an effect's that a flow may press on. A flow that does steps it with itself, and says so (Effect::led_by).
///   solid        of the effect's; null: it has none
///   friction     of lava on it: 1 no slip, 0 free slip
///   temperature  of its surface [K]; 0: the ground's
///   volume       [m^3]
///   place        of the table that asks for it
struct SoftSolid {
  Deformable* solid = nullptr;
  Real friction = 1;
  Real temperature = 0, volume = 0;
  Material material;
  Place place;
};

/// Another effect that a table names, or needs: looked for when all are read.
struct Partner {
  Place place;                     ///< of what names it
  std::string path;                ///< "particles[0].emitter[0].water"
  std::string name;                ///< "": any of those kinds
  std::vector<std::string> kinds;  ///< names of tables: "waves", "ocean"
  std::string what;                ///< "steam comes off water": for a fault where there is none
};

}  // namespace effuse::flow
