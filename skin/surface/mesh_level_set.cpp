#include <algorithm>
#include <cmath>

#include "geometry/base/parallel.h"
#include "geometry/base/zones.h"
#include "geometry/mesh/measure.h"
#include "skin/surface/iso_mesh.h"
#include "skin/surface/level_set_impl.h"
#include "skin/surface/manifold.h"

namespace effuse::skin {

namespace {

/// From the field's gradient; where it and the triangles disagree (edges of the cut, places thinner than a voxel), the
/// triangles' angle-weighted normal.
void gradient_normals(const LevelSet::Impl& s, const std::vector<Vec3>& at, geometry::TriMesh& mesh) {
  ZONE("skin.normals");
  geometry::compute_normals(mesh);
  parallel_for(mesh.positions.size(), [&](std::size_t i) {
    const Vec3 gradient = s.blocks.gradient(s.phi, s.outside, s.blocks.block_at(at[i]), at[i]);
    const Real length = gradient.norm();
    if (length > 1e-3 && gradient.dot(mesh.normals[i]) > 0.7 * length) mesh.normals[i] = gradient / length;
  });
}

void carry_attributes(const LevelSet::Impl& s, const std::vector<Vec3>& at, geometry::TriMesh& mesh) {
  const ParticleGrid::Carried& carried = s.particles.carried();
  if (carried.width == 0) return;
  const std::vector<float> values = carried_at(s, at);
  const std::size_t n = at.size(), stride = static_cast<std::size_t>(carried.width);
  const auto take = [&](const char* name, int offset, int width) {
    if (offset < 0) return;
    geometry::VertexAttribute& attribute = mesh.attributes[name];
    attribute.width = width;
    attribute.values.resize(n * static_cast<std::size_t>(width));
    for (std::size_t i = 0; i < n; ++i)
      std::copy_n(&values[i * stride + static_cast<std::size_t>(offset)], width, &attribute.values[i * static_cast<std::size_t>(width)]);
  };
  take("temperature", carried.temperature, 1);
  take("velocity", carried.velocity, 3);
  take("crust", carried.crust, 1);
  take("age", carried.age, 1);
  take("rest", carried.rest, 3);
  take("rest2", carried.rest2, 3);
}

}  // namespace

geometry::TriMesh mesh_level_set(const LevelSet& surface) {
  ZONE("skin.mesh");
  const LevelSet::Impl& s = surface.impl();
  geometry::TriMesh mesh = iso_mesh(s.blocks, s.outside, s.phi);
  make_manifold(mesh);
  const std::vector<Vec3> at = mesh.positions;
  for (Vec3& p : mesh.positions) p = s.world(p);
  gradient_normals(s, at, mesh);
  carry_attributes(s, at, mesh);
  return mesh;
}

}  // namespace effuse::skin
