#pragma once

#include <string>
#include <vector>

#include "geometry/base/types.h"

namespace effuse::geometry {

/// Marked points in motion, as cameras saw them: frames of equal distance, the first at 0.
///   frames  by frame, then by point [m]; NaN where a point was not seen
struct PointClip {
  std::vector<std::string> names;
  Real frame_time = 0.01;  ///< [s]
  std::vector<std::vector<Vec3>> frames;

  Real length() const { return frames.empty() ? 0 : frame_time * static_cast<Real>(frames.size() - 1); }
  /// Points at a time [s], straight between frames, held at the ends; NaN where one of the two frames has none.
  std::vector<Vec3> at(Real time) const;
};

/// Gaps of no more frames than `longest` closed by straight lines between the frames that have the point; the number of places filled is returned.
std::size_t close_gaps(PointClip& clip, std::size_t longest);

}  // namespace effuse::geometry
