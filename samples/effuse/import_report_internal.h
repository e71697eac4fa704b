#pragma once

#include <filesystem>
#include <nlohmann/json.hpp>
#include <string>
#include <string_view>
#include <vector>

#include "geometry/mesh/tri_mesh.h"
#include "geometry/terrain/georeference.h"
#include "importers/read_apart.h"
#include "importers/terrain/dem_grid.h"
#include "importers/terrain/import_terrain.h"
#include "samples/effuse/commands.h"

/// What the two halves of `effuse import` share: grids and meshes.
namespace effuse {

inline constexpr std::string_view kGridFormats[] = {".tif", ".asc"};
inline constexpr std::string_view kMeshFormats[] = {".ply", ".obj", ".glb", ".stl", ".off"};
bool is_grid_format(std::string_view extension);
bool is_mesh_format(std::string_view extension);

/// What became of the file: lines for people and the same as JSON.
struct ImportReport {
  std::vector<std::string> lines;
  nlohmann::ordered_json facts = nlohmann::ordered_json::object();
};

/// A length >= 0 that an option was given. Throws InputError.
Real metres(const std::string& text, const char* option);

/// Positions as files hold them.
geometry::TriMesh as_floats(geometry::TriMesh mesh);

/// In the format of its ending; on_map: positions are map coordinates, in digits that hold them.
void write_import_mesh(const std::filesystem::path& file, const std::string& format, const geometry::TriMesh& mesh, const geometry::Georeference& geo, bool on_map);
void write_import_grid(const std::filesystem::path& file, const std::string& format, const importers::DemGrid& grid, ImportReport& report);

/// How the command's file is to be read. Throws InputError that names the options that are wrong, or go with the other kind of file.
importers::TerrainImportOptions import_options(const ImportCommand& command, bool is_grid, const importers::ReadLimits& limits);

/// A mesh, to a mesh or a grid.
void import_mesh_file(const ImportCommand& command, const std::string& format, const importers::ReadLimits& limits, ImportReport& report);

}  // namespace effuse
