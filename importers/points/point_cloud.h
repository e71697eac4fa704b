#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "geometry/mesh/points.h"

namespace effuse::importers {

/// Particles that a file held: one array per quantity, each of position.size() elements or empty (position always has them).
struct PointCloud {
  std::vector<Vec3> position;     ///< as in the file: its unit, its axes
  std::vector<Real> radius;       ///< > 0
  std::vector<Vec3> velocity;     ///< [m/s]
  std::vector<Real> temperature;  ///< [K], as the file has it
  std::vector<Real> crust, age, opacity;
  std::vector<std::uint64_t> id;
  std::vector<Vec3> rest, rest2;
  std::vector<std::string> notes;  ///< what was left out, one sentence each

  std::size_t size() const { return position.size(); }

  /// Views of the above, valid while this lives and does not change. radius is needed (geometry::Points): fill it first
  /// where the file had none.
  geometry::Points points() const {
    geometry::Points p;
    p.position = position;
    p.radius = radius;
    p.velocity = velocity;
    p.temperature = temperature;
    p.crust = crust;
    p.age = age;
    p.opacity = opacity;
    p.id = id;
    p.rest = rest;
    p.rest2 = rest2;
    return p;
  }
};

}  // namespace effuse::importers
