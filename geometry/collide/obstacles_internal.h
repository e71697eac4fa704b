#pragma once

#include <optional>
#include <vector>

#include "geometry/collide/box_tree.h"
#include "geometry/collide/obstacles.h"

/// What Obstacles hold. For geometry/collide only.
namespace effuse::geometry {

struct Obstacles::Impl {
  struct Place {
    Box3 now, swept;  ///< at the step's end, and on all of its way
    bool there = false;
  };
  std::vector<std::optional<Obstacle>> all;  ///< none: removed
  std::vector<Place> place;
  MovingBoxes boxes;
  BoxTree tree;  ///< over the swept boxes
  Box3 now, swept;
  std::vector<Index> changed;
  std::size_t left = 0;

  bool up_to_date() const { return changed.empty(); }
};

}  // namespace effuse::geometry
