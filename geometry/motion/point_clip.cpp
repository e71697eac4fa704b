#include "geometry/motion/point_clip.h"

#include <algorithm>

#include "geometry/base/check.h"

namespace effuse::geometry {

std::vector<Vec3> PointClip::at(Real time) const {
  CHECK(!frames.empty());
  const Real k = std::clamp(time / frame_time, 0.0, static_cast<Real>(frames.size() - 1));
  const auto first = static_cast<std::size_t>(k);
  if (first + 1 >= frames.size()) return frames.back();
  const Real u = k - static_cast<Real>(first);
  if (u == 0) return frames[first];
  std::vector<Vec3> points;
  for (std::size_t p = 0; p < names.size(); ++p) points.push_back((1 - u) * frames[first][p] + u * frames[first + 1][p]);
  return points;
}

std::size_t close_gaps(PointClip& clip, std::size_t longest) {
  std::size_t filled = 0;
  for (std::size_t p = 0; p < clip.names.size(); ++p) {
    std::size_t last = clip.frames.size();  // frame that had it; none yet
    for (std::size_t f = 0; f < clip.frames.size(); ++f) {
      if (!clip.frames[f][p].allFinite()) continue;
      if (last < f && f - last - 1 <= longest)
        for (std::size_t g = last + 1; g < f; ++g, ++filled) {
          const Real u = static_cast<Real>(g - last) / static_cast<Real>(f - last);
          clip.frames[g][p] = (1 - u) * clip.frames[last][p] + u * clip.frames[f][p];
        }
      last = f;
    }
  }
  return filled;
}

}  // namespace effuse::geometry
