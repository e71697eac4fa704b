// effuse::skin alone: points become a surface. Any program's particles will do; these are a ball of them, hot inside.

#include <cmath>
#include <cstdio>
#include <vector>

#include "geometry/mesh/measure.h"
#include "geometry/mesh/validate.h"
#include "skin/color/lava_color.h"
#include "skin/surface/level_set.h"
#include "skin/write/write_mesh.h"

using namespace effuse;

int main() {
  // A ball of radius 5 m on a lattice of half metres: position, radius and temperature of every particle.
  const Real spacing = 0.5, ball = 5;
  std::vector<Vec3> position;
  std::vector<Real> radius, temperature;
  for (int k = -10; k <= 10; ++k)
    for (int j = -10; j <= 10; ++j)
      for (int i = -10; i <= 10; ++i) {
        const Vec3 p = spacing * Vec3(i, j, k);
        if (p.norm() >= ball) continue;
        position.push_back(p);
        radius.push_back(spacing / 2);
        temperature.push_back(1500 - 80 * p.norm());
      }
  geometry::Points points;
  points.position = position;
  points.radius = radius;
  points.temperature = temperature;

  skin::LevelSetOptions options;
  options.spacing = spacing;
  const Real volume = static_cast<Real>(position.size()) * std::pow(spacing, 3);
  const skin::LevelSet surface = skin::build_level_set(points, volume, nullptr, options);
  geometry::TriMesh mesh = skin::mesh_level_set(surface);
  skin::color_lava(mesh);
  skin::write_ply("hello_skin.ply", mesh);

  const geometry::MeshReport report = geometry::validate(mesh);
  std::printf("%zu particles of %.1f m3 -> %s\n", position.size(), volume, to_string(report).c_str());
  std::printf("enclosed: %.1f m3; written: hello_skin.ply\n", geometry::signed_volume(mesh));
  return report.solid() && std::abs(geometry::signed_volume(mesh) / volume - 1) < 0.05 ? 0 : 1;
}
