#include <algorithm>

#include "geometry/base/parallel.h"
#include "geometry/base/zones.h"
#include "skin/surface/iso_mesh.h"
#include "skin/surface/level_set_impl.h"
#include "skin/surface/surface_cache.h"

namespace effuse::skin {

namespace {

/// mesh: its positions still in voxels.
void carry_attributes(const LevelSet::Impl& s, geometry::TriMesh& mesh) {
  const ParticleGrid::Carried& carried = s.particles.carried();
  if (carried.width == 0) return;
  const std::vector<float> values = carried_at(s, mesh.positions);
  const std::size_t n = mesh.positions.size(), stride = static_cast<std::size_t>(carried.width);
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

geometry::TriMesh mesh_level_set(const LevelSet& surface, SurfaceCache* last) {
  ZONE("skin.mesh");
  const LevelSet::Impl& s = surface.impl();
  geometry::TriMesh mesh;
  if (last && s.frame > 0) {
    SurfaceCache::Impl& c = last->impl();
    const bool next = c.mesh_frame + 1 == s.frame;
    if (next) mesh = iso_mesh(s.blocks, s.outside, s.phi, &c.mesh, s.unchanged, s.changed);
    else mesh = iso_mesh(s.blocks, s.outside, s.phi, &c.mesh);
    c.mesh_frame = s.frame;
  } else {
    mesh = iso_mesh(s.blocks, s.outside, s.phi);
  }
  carry_attributes(s, mesh);
  parallel_for(
      mesh.positions.size(), [&](std::size_t v) { mesh.positions[v] = s.world(mesh.positions[v]); }, 4096);
  return mesh;
}

}  // namespace effuse::skin
