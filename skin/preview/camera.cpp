#include <algorithm>
#include <cmath>

#include "geometry/base/check.h"
#include "skin/preview/preview.h"

namespace effuse::skin {

Camera frame_camera(const Box3& box, Real azimuth, Real elevation, Real aspect, Real margin, Real field_of_view) {
  CHECK_GT(aspect, 0);
  CHECK(field_of_view > 0 && field_of_view < kPi);
  CHECK(margin >= 0 && margin < 0.5);
  const Box3 framed = box.isEmpty() ? Box3(Vec3::Constant(-0.5), Vec3::Constant(0.5)) : box;
  elevation = std::clamp(elevation, Real{-1.5}, Real{1.5});

  // Camera axes; the eye lies on the target's side of `back`.
  const Vec3 back(std::cos(azimuth) * std::cos(elevation), std::sin(azimuth) * std::cos(elevation), std::sin(elevation));
  const Vec3 right(-std::sin(azimuth), std::cos(azimuth), 0), up = back.cross(right);
  const Real tan_up = std::tan(field_of_view / 2) * (1 - 2 * margin), tan_right = tan_up * aspect;

  // A corner q (from the centre) is inside when |q.right - a| <= tan_right (d - q.back), and so for up: a and b move the
  // eye sideways. The least d of one direction: the two extreme corners touch opposite edges of the picture.
  Real d = 0, a = 0, b = 0;
  const auto fit = [&](const Vec3& axis, Real tangent, Real& shift) {
    Real high = -1e300, low = 1e300;  // of q.axis + tangent q.back, and of q.axis - tangent q.back
    for (int k = 0; k < 8; ++k) {
      const Vec3 q = framed.corner(static_cast<Box3::CornerType>(k)) - framed.center();
      high = std::max(high, q.dot(axis) + tangent * q.dot(back));
      low = std::min(low, q.dot(axis) - tangent * q.dot(back));
    }
    shift = (high + low) / 2;
    d = std::max(d, (high - low) / (2 * tangent));
  };
  fit(right, tan_right, a);
  fit(up, tan_up, b);
  d = std::max(d, Real{1e-3});

  Camera camera;
  camera.field_of_view = field_of_view;
  const Vec3 target = framed.center() + a * right + b * up;
  camera.eye = target + d * back;
  camera.target = target;
  return camera;
}

}  // namespace effuse::skin
