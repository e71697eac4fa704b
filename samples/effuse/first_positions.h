#pragma once

#include <cstdint>
#include <unordered_map>

#include "importers/points/point_cloud.h"

namespace effuse {

/// Material coordinates for a sequence whose particles have ids and no `rest`: where each id was first seen. Detail that hangs on
/// them moves with the particles; it stretches with them, too, for nothing renews it.
class FirstPositions {
 public:
  /// Fills cloud.rest with the first position of each particle's id, in this frame or one before it.
  ///   cloud  positions as all frames have them: before they are cropped or moved
  /// False, and nothing changed, when there are no ids or two particles share one.
  bool carry(importers::PointCloud& cloud);

 private:
  std::unordered_map<std::uint64_t, Vec3> first_;  // asked by id, never walked through
};

}  // namespace effuse
