#pragma once

#include <algorithm>
#include <limits>

#include "flow/sph/modern_lava.h"
#include "geometry/procedural/primitives.h"

/// What tests of lava beside obstacles begin with.
namespace effuse::flow::sph {

/// Thick lava of one temperature, mu [Pa s], on ground that stands.
inline ModernOptions thick_lava(Real spacing, Real mu, Real max_step) {
  ModernOptions o;
  o.spacing = spacing;
  o.rheology = Rheology::newtonian(mu);
  o.heat.on = false;
  o.rest_period = 0;
  o.ground_speed = 0;
  o.max_step = max_step;
  return o;
}

/// The plane at height z as far as x = end.
inline ContactSource ground_at(Real z, Real end = std::numeric_limits<Real>::infinity()) {
  return [=](std::span<const Vec3> x, Real reach, std::span<geometry::Contact> out) {
    for (std::size_t i = 0; i < x.size(); ++i) {
      out[i] = {};
      if (const Real d = x[i].z() - z; d < reach && x[i].x() < end) out[i] = {Vec3(x[i].x(), x[i].y(), z), Vec3::UnitZ(), d, Vec3::Zero(), 0, 0};
    }
  };
}

/// Five walls of a box that is open at the top: a sheet.
inline geometry::TriMesh tray(const Vec3& low, const Vec3& high) {
  geometry::TriMesh m = geometry::make_box(low, high);
  std::erase_if(m.triangles, [&](const geometry::Triangle& t) { return std::all_of(t.begin(), t.end(), [&](Index v) { return m.positions[v].z() == high.z(); }); });
  return m;
}

}  // namespace effuse::flow::sph
