#include <fmt/format.h>

#include <utility>

#include "geometry/base/error.h"
#include "geometry/mesh/clip.h"
#include "geometry/mesh/measure.h"
#include "geometry/mesh/validate.h"
#include "geometry/remesh/remesh.h"
#include "importers/terrain/import_terrain.h"

namespace effuse::importers {

using geometry::TriMesh;

namespace {

/// An open surface that faces down on the whole is ground wound the wrong way.
void face_up(TriMesh& mesh, std::vector<std::string>& notes) {
  Real up = 0;
  for (const auto& [a, b, c] : mesh.triangles) up += (mesh.positions[b] - mesh.positions[a]).cross(mesh.positions[c] - mesh.positions[a]).z();
  if (up >= 0) return;
  for (geometry::Triangle& triangle : mesh.triangles) std::swap(triangle[1], triangle[2]);
  for (Vec3& normal : mesh.normals) normal = -normal;
  notes.push_back("the surface faced down: every triangle was turned over");
}

/// To west, south, east, north on the map, where the mesh's origin lies.
void crop_to(const std::vector<Real>& crop, const Vec3& origin, TriMesh& mesh, std::vector<std::string>& notes) {
  if (crop.empty()) return;
  const Vec2 low(crop[0], crop[1]), high(crop[2], crop[3]);
  if (!(low.x() < high.x() && low.y() < high.y())) throw InputError(Place{}, "crop: wanted west < east and south < north");
  const Box3 box = geometry::bounds(mesh);
  mesh = geometry::crop(std::move(mesh), low - origin.head<2>(), high - origin.head<2>());
  if (mesh.triangles.empty())
    throw InputError(Place{}, fmt::format("nothing of it is in the crop: it lies from {:.10g}, {:.10g} to {:.10g}, {:.10g}", box.min().x() + origin.x(), box.min().y() + origin.y(), box.max().x() + origin.x(),
                                          box.max().y() + origin.y()));
  notes.push_back(fmt::format("cropped: {} triangles are left", mesh.triangles.size()));
}

/// Fewer or other triangles, as asked.
std::optional<geometry::SurfaceDistance> change_triangles(const TerrainImportOptions& options, TriMesh& mesh, std::vector<std::string>& notes) {
  if (options.max_error == 0 && options.edge == 0) return std::nullopt;
  const bool few = options.max_error > 0;
  geometry::Remeshed made = few ? geometry::simplify(mesh, options.max_error) : geometry::remesh(mesh, options.edge);
  notes.push_back(fmt::format("{} {:.4g} m: {} triangles of {}", few ? "simplified to" : "remeshed to edges of about", few ? options.max_error : options.edge, made.mesh.triangles.size(), mesh.triangles.size()));
  notes.push_back(fmt::format("measured: {:.4g} m from the mesh before at most, both ways, at {} points no farther than {:.3g} m apart{}", made.error.largest, made.error.samples, made.error.spacing,
                              few ? fmt::format("; proven: nowhere more than {:.4g} m", made.bound) : ""));
  mesh = std::move(made.mesh);
  return made.error;
}

TerrainImport ground(MeshImport import, const TerrainImportOptions& options) {
  TriMesh& mesh = import.mesh;
  std::vector<std::string>& notes = import.notes;
  std::optional<geometry::RepairReport> repairs;
  if (options.repair) {
    repairs = geometry::repair(mesh, options.repairs);
    for (std::string& line : geometry::to_lines(*repairs)) notes.push_back(std::move(line));
    if (mesh.triangles.empty()) throw InputError(Place{}, "holds no triangle with an area");
  }
  if (const UpAxis up = guess_up(mesh); (up == UpAxis::kX || up == UpAxis::kY) && options.mesh.up == UpAxis::kUnknown)
    notes.push_back(fmt::format("the surface stands upright: {} may be up in this file ({}); up = \"{}\" would turn it", name_of(up),
                                import.frame.source.empty() ? "which does not say" : "though " + import.frame.source + " says otherwise", name_of(up)));
  if (!(repairs ? repairs->after : geometry::validate(mesh)).closed()) face_up(mesh, notes);
  const Vec3& origin = import.frame.origin;
  if (origin != Vec3::Zero()) notes.push_back(fmt::format("placed on the map at {:.10g}, {:.10g}, {:.10g} by {}", origin.x(), origin.y(), origin.z(), import.frame.source));
  crop_to(options.dem.crop, origin, mesh, notes);
  // Before triangles change: rims may move by a hair, over a whole metre.
  const Vec3 local = local_origin(geometry::bounds(mesh).min().head<2>());
  const auto remeshed = change_triangles(options, mesh, notes);
  for (Vec3& position : mesh.positions) position -= local;
  const geometry::Georeference place{local + origin, options.dem.crs.empty() ? import.frame.crs : options.dem.crs};
  return {geometry::Terrain::from_mesh(std::move(mesh), place, options.temperature), std::move(notes), std::move(repairs), remeshed};
}

}  // namespace

TerrainImport terrain_from_mesh(MeshImport import, const std::string& name, const TerrainImportOptions& options) {
  try {
    return ground(std::move(import), options);
  } catch (const InputError& error) {
    throw InputError({name}, error.faults().front().message);
  }
}

}  // namespace effuse::importers
