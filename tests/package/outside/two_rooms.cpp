// A program that knows effuse only from its installation: ground, a mesh and a spoonful of lava.

#include <cmath>
#include <cstdio>
#include <string>

#include "flow/sph/classic_lava.h"
#include "geometry/base/error.h"
#include "geometry/mesh/measure.h"
#include "geometry/mesh/tri_mesh.h"
#include "geometry/mesh/validate.h"
#include "geometry/terrain/terrain.h"

namespace {

int failures = 0;

void expect(bool holds, const std::string& what) {
  std::printf("%s  %s\n", holds ? "ok    " : "FAILED", what.c_str());
  failures += !holds;
}

}  // namespace

int main() {
  using namespace effuse;

  // A plane that rises by 1 in 10 towards +x.
  std::vector<Real> z;
  for (int j = 0; j < 11; ++j)
    for (int i = 0; i < 11; ++i) z.push_back(0.1 * i);
  const auto terrain = geometry::Terrain::from_height_field(geometry::HeightField(Vec2(0, 0), Vec2(1, 1), 11, 11, z));
  const geometry::Contact contact = terrain.contact(Vec3(5, 5, 1.5));
  expect(contact.any() && std::abs(contact.distance - std::cos(std::atan(0.1))) < 1e-3, "distance to a plane");

  geometry::TriMesh mesh;
  mesh.positions = {Vec3(0, 0, 0), Vec3(1, 0, 0), Vec3(0, 1, 0), Vec3(0, 0, 1)};
  mesh.triangles = {{0, 2, 1}, {0, 1, 3}, {0, 3, 2}, {1, 2, 3}};
  expect(geometry::validate(mesh).solid() && std::abs(geometry::signed_volume(mesh) - 1.0 / 6) < 1e-12, "volume of a tetrahedron");

  mesh.triangles[0][0] = 7;
  try {
    geometry::validate(mesh);
    expect(false, "an index out of range is an InputError");
  } catch (const InputError& error) {
    expect(true, std::string("an index out of range is an InputError: ") + error.what());
  }

  flow::sph::ClassicOptions options;
  options.spacing = 0.1;
  flow::sph::ClassicLava lava(options, {}, {[&](std::span<const Vec3> x, Real reach, std::span<geometry::Contact> out) { terrain.contacts(x, reach, out); }});
  const Vec3 at(5, 5, 0.6), still = Vec3::Zero();
  const Real hot = 1473.15;
  lava.add({&at, 1}, {&still, 1}, {&hot, 1});
  for (int k = 0; k < 5; ++k) lava.step(0.01);
  expect(lava.size() == 1 && lava.time() > 0 && lava.state().x[0].z() < 0.6, "a drop falls");
  return failures;
}
