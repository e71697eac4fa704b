#pragma once

#include "skin/preview/light.h"

namespace effuse::skin {

/// Sun and sky of one picture: colours go with the sun's height. A painter's sky, not an atmosphere's.
class Sky {
 public:
  Sky(const Vec3& sun_direction, Real sun, Real sky);

  const Vec3f& sun_direction() const { return sun_direction_; }
  /// Irradiance of a surface that faces the sun.
  const Vec3f& sun_light() const { return sun_light_; }
  /// Radiance from direction d (unit); below the horizon what hazy ground looks like.
  Vec3f radiance(const Vec3f& d) const;
  /// What distant things fade into, looking along d.
  Vec3f haze(const Vec3f& d) const;
  /// Radiance of a white surface with normal n that sees the whole sky (and the ground's bounce below it).
  Vec3f ambient(const Vec3f& n) const { return mix(bounce_, open_sky_, 0.5f + 0.5f * n.z()); }

 private:
  Vec3f sun_direction_, sun_light_, zenith_, horizon_, halo_, open_sky_, bounce_;
};

}  // namespace effuse::skin
