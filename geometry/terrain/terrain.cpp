#include "geometry/terrain/terrain.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <memory>
#include <mutex>

#include "geometry/base/check.h"
#include "geometry/base/parallel.h"
#include "geometry/base/zones.h"
#include "geometry/mesh/measure.h"
#include "geometry/query/mesh_surface.h"
#include "geometry/terrain/height_field_search.h"

namespace effuse::geometry {

struct Terrain::Impl {
  Georeference georeference;
  Real temperature = 0;
  // Either a field and its search tree, or a mesh and its surface.
  std::optional<HeightField> field;
  std::optional<HeightFieldSearch> search;
  std::optional<MeshSurface> surface;
  Box3 box;
  // The field's triangles are made when somebody asks.
  mutable std::once_flag mesh_made;
  mutable TriMesh mesh;
  // The mesh's cache is made when many points ask with a reach that it does not have yet. It changes no answer.
  mutable std::mutex cache_guard;
  mutable std::shared_ptr<const NearTriangles> cache;
  mutable Real no_cache_from = std::numeric_limits<Real>::infinity();  // reaches that the tree answers better
  std::shared_ptr<const NearTriangles> cache_for(std::size_t points, Real reach) const;

  Contact field_contact(const Vec3& p, Real reach) const;
  Contact contact(const Vec3& p, Real reach) const {
    Contact contact = field ? field_contact(p, reach) : surface->contact(p, reach);
    contact.surface_temperature = temperature;
    return contact;
  }
};

std::shared_ptr<const NearTriangles> Terrain::Impl::cache_for(std::size_t points, Real reach) const {
  // Fewer points are answered before a cache is made.
  constexpr std::size_t kMany = 256;
  if (field || points < kMany || !(reach > 0) || !std::isfinite(reach)) return nullptr;
  const std::lock_guard lock(cache_guard);
  if (cache && cache->reach() >= reach) return cache;
  if (reach >= no_cache_from) return nullptr;
  // A reach that grows with the flow's speed need not have one made each time.
  for (const Real wanted : {cache ? 1.5 * reach : reach, reach})
    if (wanted < no_cache_from)
      if (std::optional<NearTriangles> made = surface->make_cache(wanted)) return cache = std::make_shared<const NearTriangles>(std::move(*made));
  no_cache_from = reach;
  return nullptr;
}

Contact Terrain::Impl::field_contact(const Vec3& p, Real reach) const {
  Contact contact;
  const auto cell = field->cell(p.x(), p.y());
  if (!cell) return contact;
  const Real dz = p.z() - field->height(*cell, p.x(), p.y());
  if (!std::isfinite(dz)) return contact;

  // Most particles are out of reach: known by the height difference and the steepest slope alone.
  const bool below = dz < 0;
  if (!below && search->distance_bound(*cell, dz, reach) > reach) return contact;
  const auto nearest = search->nearest(p, below ? std::numeric_limits<Real>::infinity() : reach, cell);
  if (!nearest) return contact;
  contact.point = nearest->point;
  contact.distance = below ? -nearest->distance : nearest->distance;

  // The slopes' field where p projects to along the field's own normal. The nearest point would do on a smooth
  // surface, but it jumps over the creases between cells as p moves; this foot does not. Beyond a cell's width
  // the field tells nothing more.
  const Real width = field->spacing().minCoeff();
  const Real down = std::clamp(contact.distance, -width, width);
  const Vec3 above = field->extended_normal(p.x(), p.y());
  contact.normal = field->extended_normal(p.x() - down * above.x(), p.y() - down * above.y());
  return contact;
}

Terrain::Terrain(std::shared_ptr<const Impl> impl) : impl_(std::move(impl)) {}

Terrain Terrain::from_height_field(HeightField field, Georeference georeference, Real temperature) {
  const auto impl = std::make_shared<Impl>();
  impl->georeference = std::move(georeference);
  impl->temperature = temperature;
  impl->box = field.bounds();
  impl->field.emplace(std::move(field));
  impl->search.emplace(*impl->field);
  return Terrain(impl);
}

Terrain Terrain::from_mesh(TriMesh mesh, Georeference georeference, Real temperature) {
  const auto impl = std::make_shared<Impl>();
  impl->georeference = std::move(georeference);
  impl->temperature = temperature;
  impl->surface.emplace(mesh);
  for (const Triangle& triangle : mesh.triangles)
    for (Index i : triangle) impl->box.extend(mesh.positions[i]);
  impl->mesh = std::move(mesh);
  return Terrain(impl);
}

Contact Terrain::contact(const Vec3& p, Real reach) const { return impl_->contact(p, reach); }

void Terrain::contacts(std::span<const Vec3> points, Real reach, std::span<Contact> out) const {
  ZONE("terrain.contacts");
  CHECK_EQ(points.size(), out.size());
  if (const auto cache = impl_->cache_for(points.size(), reach)) {
    parallel_for(points.size(), [&](std::size_t i) {
      out[i] = impl_->surface->contact(points[i], reach, *cache);
      out[i].surface_temperature = impl_->temperature;
    });
    return;
  }
  parallel_for(points.size(), [&](std::size_t i) { out[i] = impl_->contact(points[i], reach); });
}

Real Terrain::signed_distance(const Vec3& p) const { return impl_->contact(p, std::numeric_limits<Real>::infinity()).distance; }

std::optional<Real> Terrain::height(Real x, Real y) const {
  return height_below(x, y, std::numeric_limits<Real>::infinity());
}

std::optional<Real> Terrain::height_below(Real x, Real y, Real z0) const {
  if (impl_->field) {
    const Real h = impl_->field->height(x, y);
    return h <= z0 ? std::optional(h) : std::nullopt;  // NaN where not covered
  }
  for (const Real z : impl_->surface->tops(x, y))
    if (z <= z0) return z;
  return std::nullopt;
}

std::optional<Real> Terrain::ray(const Vec3& p, const Vec3& d, Real t_max) const {
  if (impl_->field) return impl_->search->ray(p, d, t_max);
  const auto crossing = impl_->surface->tree().ray(p, d, t_max);
  return crossing ? std::optional(crossing->t) : std::nullopt;
}

bool Terrain::is_height_field() const { return impl_->field.has_value(); }
const HeightField* Terrain::height_field() const { return impl_->field ? &*impl_->field : nullptr; }

const TriMesh& Terrain::mesh() const {
  if (impl_->field) std::call_once(impl_->mesh_made, [&] { impl_->mesh = impl_->field->mesh(); });
  return impl_->mesh;
}

Box3 Terrain::bounds() const { return impl_->box; }
const Georeference& Terrain::georeference() const { return impl_->georeference; }

}  // namespace effuse::geometry
