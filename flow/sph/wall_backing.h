#pragma once

#include <optional>
#include <span>
#include <vector>

#include "flow/sph/boundary.h"
#include "geometry/collide/obstacles.h"

namespace effuse::flow::sph {

/// What stands behind an obstacle's wall as a particle feels it, and across from it. One a thread: it keeps what it last looked among.
class WallBacking {
 public:
  /// reach: of the particle's sums [m].
  WallBacking(const geometry::Obstacles& obstacles, Real reach) : obstacles_(obstacles), reach_(reach) {}

  /// Share of a wall's half-space that is hidden from x by obstacles, or lies in the ground: 1 but beside convex edges.
  Real share(const Vec3& x, const geometry::Contact& wall, std::span<const Wall> ground);

  /// The wall face to face with this one: how wide the channel between them is [m], at most `widest`.
  struct Opposite {
    Real width;
    Index surface;
  };
  std::optional<Opposite> opposite(const Vec3& x, const geometry::Contact& wall, Real widest);

 private:
  bool hidden(const Vec3& x, const Vec3& ray, std::span<const Wall> ground, bool deep) const;

  const geometry::Obstacles& obstacles_;
  Real reach_;
  std::vector<Index> near_;
};

}  // namespace effuse::flow::sph
