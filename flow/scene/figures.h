#pragma once

#include <string>
#include <vector>

#include "flow/scene/obstacles.h"
#include "flow/scene/parameters.h"
#include "geometry/motion/skeleton_clip.h"

namespace effuse::flow {

/// Somebody who walks: a motion capture clip along a path, as its table [[figure]] describes it.
struct PlannedFigure {
  std::string name, file;
  Place file_place, place;
  Real scale = 0.01;          ///< [m] of the clip's numbers
  std::vector<Vec2> path;     ///< in the terrain file's coordinates [m]
  Real start = 0, pace = 1;   ///< [s]; times the clip's own
  Vec3 color = Vec3::Constant(-1);  ///< sRGB; negative: none given
};

/// The tables [[figure]] of a scene. Faults stay in root.
std::vector<PlannedFigure> read_figures(Parameters& root);

/// Its bones, capsules that move by keys, 60 a second: obstacles as others are, called NAME.JOINT. What does not fit (no ground under its path, a
/// clip that does not walk) is a fault at the plan's place; the figure is then left out. What it does is a note.
///   duration  of the scene [s]
void place_figure(const PlannedFigure& plan, const geometry::SkeletonClip& clip, const geometry::Terrain& terrain, Real duration, std::vector<PlacedObstacle>& placed,
                  std::vector<Fault>& faults, std::vector<std::string>& notes);

}  // namespace effuse::flow
