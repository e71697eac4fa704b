#pragma once

#include <Eigen/Core>
#include <algorithm>
#include <cmath>

#include "geometry/base/types.h"

/// Small change of the renderer. float: pictures are eight bits deep in the end, and Embree is float.
namespace effuse::skin {

using Vec3f = Eigen::Vector3f;

inline float saturate(float x) { return std::clamp(x, 0.0f, 1.0f); }
inline float smooth(float from, float to, float x) {
  const float t = saturate((x - from) / (to - from));
  return t * t * (3 - 2 * t);
}
inline float mix(float a, float b, float t) { return a + (b - a) * t; }
inline Vec3f mix(const Vec3f& a, const Vec3f& b, float t) { return a + (b - a) * t; }
inline float luminance(const Vec3f& c) { return 0.2126f * c.x() + 0.7152f * c.y() + 0.0722f * c.z(); }

}  // namespace effuse::skin
