// effuse::geometry alone: a grid of heights becomes ground that answers questions.
// The ground here is a cone with a crater, and a pebble slides from its rim down to the plain.

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <vector>

#include "geometry/terrain/terrain.h"

using namespace effuse;

int main() {
  // Heights on posts 10 m apart, south row first: any DEM is such a list.
  const int n = 61;
  const Real post = 10;
  std::vector<Real> z;
  for (int j = 0; j < n; ++j)
    for (int i = 0; i < n; ++i) {
      const Real r = Vec2(i * post - 300, j * post - 300).norm();
      const Real outside = 150 - 0.6 * (r - 60), crater = 150 - 0.8 * (60 - r);
      z.push_back(std::max(20.0, std::min(outside, crater)));
    }
  const auto terrain = geometry::Terrain::from_height_field(geometry::HeightField(Vec2(0, 0), Vec2(post, post), n, n, z));

  // A contact says where the nearest ground is, how far, and which way is out.
  for (const Vec3& p : {Vec3(330, 310, 140), Vec3(420, 340, 130), Vec3(140, 160, 55)}) {
    const geometry::Contact c = terrain.contact(p);
    std::printf("(%3.0f %3.0f %3.0f)  %6.2f m from the ground, normal (%5.2f %5.2f %5.2f)\n", p.x(), p.y(), p.z(), c.distance, c.normal.x(),
                c.normal.y(), c.normal.z());
  }

  // Downhill, a metre at a time: the part of gravity that lies in the ground, then back onto it.
  Vec3 pebble(365, 310, *terrain.height(365, 310));
  const Real start = pebble.z();
  int steps = 0;
  for (; steps < 1000; ++steps) {
    const Vec3 normal = terrain.contact(pebble).normal;
    const Vec3 downhill = normal * normal.z() - Vec3::UnitZ();
    if (downhill.norm() < 1e-3) break;
    pebble += downhill.normalized();
    pebble.z() = *terrain.height(pebble.x(), pebble.y());
  }
  std::printf("the pebble slid %d m and %.1f m down, and lies at %.1f m\n", steps, start - pebble.z(), pebble.z());
  return std::abs(pebble.z() - 20) < 0.5 ? 0 : 1;
}
