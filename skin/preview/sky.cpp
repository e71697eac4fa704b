#include "skin/preview/sky.h"

#include "skin/preview/preview.h"

namespace effuse::skin {

Sky::Sky(const Vec3& sun_direction, Real sun, Real sky) : sun_direction_(sun_direction.normalized().cast<float>()) {
  const float height = sun_direction_.z(), day = smooth(0.08f, 0.55f, height), up = smooth(-0.12f, 0.16f, height);
  const float s = static_cast<float>(sun), k = static_cast<float>(sky) * mix(0.25f, 1.0f, up);
  sun_light_ = s * mix(1.9f, 1.0f, day) * smooth(-0.03f, 0.12f, height) *
               mix(Vec3f(1.0f, 0.56f, 0.27f), Vec3f(1.0f, 0.92f, 0.80f), smooth(0.02f, 0.5f, height));
  zenith_ = k * mix(Vec3f(0.022f, 0.040f, 0.098f), Vec3f(0.075f, 0.16f, 0.40f), day);
  horizon_ = k * mix(Vec3f(0.135f, 0.108f, 0.112f), Vec3f(0.36f, 0.43f, 0.52f), day);
  halo_ = k * (1 - 0.8f * day) * Vec3f(0.85f, 0.36f, 0.12f);
  open_sky_ = 1.15f * mix(zenith_, horizon_, 0.55f);
  bounce_ = 0.12f * open_sky_ + 0.02f * sun_light_;
}

Vec3f Sky::radiance(const Vec3f& d) const {
  if (d.z() <= 0) return haze(d);
  // sqrt: most of the gradient lies low, as in the real sky. The halo hugs the horizon.
  const float toward = saturate(0.5f + 0.5f * d.dot(sun_direction_)), t2 = toward * toward, t8 = t2 * t2 * t2 * t2;
  return mix(horizon_, zenith_, std::sqrt(std::min(1.0f, 1.6f * d.z()))) + (0.55f * t8 * (1 - smooth(0.0f, 0.5f, d.z()))) * halo_;
}

Vec3f Sky::haze(const Vec3f& d) const {
  const float flat = std::hypot(d.x(), d.y()), sun_flat = std::hypot(sun_direction_.x(), sun_direction_.y());
  const float along = flat * sun_flat > 1e-6f ? (d.x() * sun_direction_.x() + d.y() * sun_direction_.y()) / (flat * sun_flat) : 0;
  const float toward = saturate(0.5f + 0.5f * along), t2 = toward * toward;
  return 0.97f * horizon_ + (0.5f * t2 * t2 * t2 * t2) * halo_;
}

Daylight daylight(const PreviewOptions& options) {
  const Sky sky(options.sun_direction, options.sun, options.sky);
  return {sky.sun_light().cast<Real>(), sky.ambient(Vec3f::UnitZ()).cast<Real>()};
}

}  // namespace effuse::skin
