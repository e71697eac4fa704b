#pragma once

#include <array>
#include <optional>
#include <span>

#include "geometry/base/types.h"

namespace effuse::geometry {

/// A half-space of velocities:  (w - velocity) . normal >= 0.
struct HalfSpace {
  Vec3 normal = Vec3::UnitZ();
  Vec3 velocity = Vec3::Zero();
};

/// The velocity nearest to `wish` that lies in all of them (at most a dozen); nullopt: there is none, or none slower than
/// `fastest`. Found by trying every set of up to three bounds: exact, and they are few.
std::optional<Vec3> least_change(const Vec3& wish, std::span<const HalfSpace> bounds, Real fastest);

}  // namespace effuse::geometry
