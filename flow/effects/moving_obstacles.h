#pragma once

#include <vector>

#include "flow/scene/obstacles.h"
#include "flow/sph/solids.h"

namespace effuse::flow {

/// The obstacles of a scene as one effect steps among them, each on its track. Surfaces are numbered from 1 in the scene's order.
class MovingObstacles {
 public:
  explicit MovingObstacles(const std::vector<PlacedObstacle>& placed);

  /// Their ways from one moment to another [s].
  void move(Real from, Real to);
  /// For ModernLava; refers to this object, which must stay where it is.
  sph::SolidOptions solids();

 private:
  std::vector<geometry::PoseTrack> tracks_;
  std::vector<Real> friction_;
  geometry::Obstacles obstacles_;
};

}  // namespace effuse::flow
