#include "samples/effuse/first_positions.h"

#include <algorithm>
#include <vector>

namespace effuse {

bool FirstPositions::carry(importers::PointCloud& cloud) {
  if (cloud.size() == 0 || cloud.id.size() != cloud.size()) return false;
  std::vector<std::uint64_t> ids = cloud.id;
  std::sort(ids.begin(), ids.end());
  if (std::adjacent_find(ids.begin(), ids.end()) != ids.end()) return false;
  cloud.rest.resize(cloud.size());
  for (std::size_t i = 0; i < cloud.size(); ++i) cloud.rest[i] = first_.emplace(cloud.id[i], cloud.position[i]).first->second;
  return true;
}

}  // namespace effuse
