// effuse::flow_sph alone: lava without a scene, without a terrain file. A vent pours on a slope of 15 degrees that is
// one line of code; any function that makes contacts can be the ground.

#include <algorithm>
#include <cmath>
#include <cstdio>

#include "flow/sph/classic_lava.h"

using namespace effuse;

int main() {
  const Vec3 up = Vec3(std::sin(15 * kPi / 180), 0, std::cos(15 * kPi / 180));  // downhill is +x
  const auto slope = [up](std::span<const Vec3> x, Real reach, std::span<geometry::Contact> out) {
    for (std::size_t i = 0; i < x.size(); ++i) {
      const Real distance = x[i].dot(up);
      out[i] = {};
      if (distance > reach) continue;
      out[i].point = x[i] - distance * up;
      out[i].normal = up;
      out[i].distance = distance;
    }
  };

  flow::sph::Vent vent;
  vent.width = 4;             // [m]
  vent.rate = 10;             // [m3/s]
  vent.temperature = 1473.15;  // [K]
  flow::sph::ClassicOptions options;  // basalt; every option has a default
  options.spacing = 0.5;      // [m] between particles
  flow::sph::ClassicLava lava(options, {vent}, {slope});

  while (lava.time() < 4) lava.step(4 - lava.time());

  Real front = 0, coolest = vent.temperature, lowest = 0;
  for (std::size_t i = 0; i < lava.size(); ++i) {
    front = std::max(front, lava.state().x[i].x());
    coolest = std::min(coolest, lava.state().T[i]);
    lowest = std::min(lowest, lava.state().x[i].dot(up));
  }
  std::printf("after %.1f s: %zu particles, %.1f m3 of lava, front %.1f m down the slope, coolest %.2f K\n", lava.time(), lava.size(), lava.volume(),
              front, coolest);

  // What came out is what the vent let out, to one particle a site; it ran downhill, cooled, and is above the ground.
  const Real asked = vent.volume(lava.time());
  const bool well = std::abs(lava.volume() - asked) < 0.1 * asked && front > vent.width / 2 + 1 && coolest < vent.temperature && lowest >= 0;
  return well ? 0 : 1;
}
