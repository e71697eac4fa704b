#pragma once

#include <cmath>
#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "geometry/remesh/surface_distance.h"
#include "geometry/repair/repair.h"
#include "geometry/terrain/terrain.h"
#include "importers/mesh/import_mesh.h"
#include "importers/terrain/dem_grid.h"
#include "importers/terrain/dem_options.h"

namespace effuse::importers {

struct TerrainImportOptions {
  Real temperature = 288.15;  ///< of the ground [K]
  DemOptions dem;             ///< of grids; of a mesh only crs, its name, and crop count
  // Of meshes:
  MeshOptions mesh;           ///< up axis, unit, and the limits of their parsers; those of grids are in dem
  bool repair = true;         ///< made sound (repair.h), every change noted
  geometry::RepairOptions repairs;
  Real max_error = 0;         ///< simplified, no farther from itself than this [m] (remesh.h); 0: not
  Real edge = 0;              ///< remeshed to edges about so long [m]; 0: not. One of the two
};

/// What was done to the file on the way in, for people: one line each ("3 nodata cells left as holes").
struct TerrainImport {
  geometry::Terrain terrain;
  std::vector<std::string> notes;
  std::optional<geometry::RepairReport> repairs;        ///< of meshes that were to be repaired
  std::optional<geometry::SurfaceDistance> remeshed;    ///< of meshes simplified or remeshed: how far from what they were
};

/// Reads a DEM grid of any format and place (import_dem.h) or a mesh of any format assimp reads as ground.
///
/// Both go through assimp: grids by an importer of ours registered with it (dem_importer.h). The local frame's
/// origin is, in x and y, the south-west corner of the covered area rounded down to whole metres, in z 0;
/// it is subtracted in double and kept in the terrain's Georeference, with the CRS.
///
/// A mesh is repaired first, unless it is to stay as it is, then cropped, then simplified or remeshed. An open one whose surface
/// faces down on the whole is turned over, with a note. One that effuse wrote lies on the map where its metadata says. What it
/// does not say of unit and up axis is guessed, with a warning among the notes.
///
/// Throws InputError naming the file, and the line where there is one: missing, empty, truncated, not
/// a number, wrong counts, fewer than 2x2 posts, nothing but nodata.
TerrainImport import_terrain(const std::filesystem::path& file, const TerrainImportOptions& options = {});
/// Several grids as a mosaic; one file may be a mesh.
TerrainImport import_terrain(const std::vector<std::filesystem::path>& files, const TerrainImportOptions& options = {});

/// The ground that a mesh is: repaired, facing up, cropped, in its local frame.
TerrainImport terrain_from_mesh(MeshImport import, const std::string& name, const TerrainImportOptions& options = {});

/// The origin of the local frame of ground whose covered area has this corner: whole metres below it, so that it is exact in any text.
inline Vec3 local_origin(const Vec2& south_west) { return Vec3(std::floor(south_west.x()), std::floor(south_west.y()), 0); }

/// The height field of a grid, in its local frame.
TerrainImport terrain_from_grid(DemGrid grid, const std::string& name, const TerrainImportOptions& options = {});

}  // namespace effuse::importers
