#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <limits>
#include <nlohmann/json.hpp>
#include <utility>

#include "geometry/terrain/triangulate.h"
#include "importers/input_file.h"
#include "importers/terrain/import_dem.h"
#include "importers/terrain/import_terrain.h"
#include "samples/effuse/commands.h"
#include "samples/effuse/import_report_internal.h"
#include "samples/effuse/load_scene.h"
#include "skin/write/raster.h"
#include "skin/write/write_mesh.h"

namespace effuse {

namespace fs = std::filesystem;

using json = nlohmann::ordered_json;

void write_import_grid(const fs::path& file, const std::string& format, const importers::DemGrid& grid, ImportReport& report) {
  skin::Raster raster;
  raster.cell = grid.spacing;
  raster.corner = grid.corner - grid.spacing / 2;
  raster.nx = grid.nx;
  raster.ny = grid.ny;
  raster.values.assign(grid.z.begin(), grid.z.end());
  raster.crs = grid.crs;
  raster.unit = "m";
  raster.description = "height";
  if (format == ".tif") skin::write_geotiff(file, raster);
  else skin::write_esri_ascii(file, raster);
  report.lines.push_back(fmt::format("{}: {} x {} posts, {:.6g} x {:.6g} m apart", file.string(), grid.nx, grid.ny, grid.spacing.x(), grid.spacing.y()));
}

namespace {

/// A grid of heights, to a grid or a mesh.
void import_grid(const ImportCommand& command, const std::string& format, const importers::ReadLimits& limits, ImportReport& report) {
  const importers::TerrainImportOptions options = import_options(command, true, limits);
  if (!command.cell.empty()) throw InputError(Place{}, fmt::format("--cell: is for meshes, and '{}' is a grid of heights: --resample says how far apart posts are", command.files.front().string()));
  const bool to_grid = is_grid_format(format);
  if (to_grid && !command.max_error.empty()) throw InputError(Place{}, fmt::format("--max-error is of a mesh, and {} is a grid", command.output.string()));
  const Real max_error = command.max_error.empty() ? 0 : metres(command.max_error, "--max-error");
  importers::DemGrid grid = importers::import_dem(command.files, options.dem);
  report.lines = grid.notes;
  report.facts["grid"] = {{"nx", grid.nx}, {"ny", grid.ny}, {"spacing_m", {grid.spacing.x(), grid.spacing.y()}}, {"south_west_post", {grid.corner.x(), grid.corner.y()}}, {"holes", grid.nodata}, {"crs", grid.crs}};
  if (to_grid) return write_import_grid(command.output, format, grid, report);

  const geometry::Terrain terrain = importers::terrain_from_grid(std::move(grid), command.files.front().string(), options).terrain;
  const geometry::HeightField& field = *terrain.height_field();
  const geometry::Georeference& geo = terrain.georeference();
  if (command.max_error.empty()) {
    write_import_mesh(command.output, format, terrain.mesh(), geo, command.on_map);
    report.lines.push_back(fmt::format("{}: {} vertices, {} triangles: every post", command.output.string(), terrain.mesh().positions.size(), terrain.mesh().triangles.size()));
    report.facts["mesh"] = {{"vertices", terrain.mesh().positions.size()}, {"triangles", terrain.mesh().triangles.size()}};
    return;
  }
  // Files hold floats: measured is what stands in them, and where rounding has spent the error, it is asked for again.
  geometry::TriMesh mesh = geometry::triangulate(field, max_error);
  geometry::VerticalError error = geometry::vertical_error(field, as_floats(mesh));
  if (error.at_posts > max_error && max_error > 0) {
    const Real rounding = 1e-7 * std::max(std::abs(field.bounds().min().z()), std::abs(field.bounds().max().z())) + (error.at_posts - max_error);
    mesh = geometry::triangulate(field, std::max(max_error - rounding, Real{0}));
    error = geometry::vertical_error(field, as_floats(mesh));
  }
  write_import_mesh(command.output, format, mesh, geo, command.on_map);
  report.lines.push_back(fmt::format("{}: {} vertices, {} triangles, of {} posts", command.output.string(), mesh.positions.size(), mesh.triangles.size(), field.posts().size()));
  report.lines.push_back(fmt::format("measured: at the posts {:.4g} m off at most (asked {:.4g} m), between them {:.4g} m (with every post {:.4g} m: cells are twisted); {} posts uncovered", error.at_posts, max_error,
                                     error.between, geometry::twist_error(field), error.uncovered));
  report.facts["mesh"] = {{"vertices", mesh.positions.size()}, {"triangles", mesh.triangles.size()}, {"max_error_m", max_error}, {"measured_error_m", error.at_posts}, {"measured_between_posts_m", error.between}, {"uncovered_posts", error.uncovered}};
}

}  // namespace

ExitCode import_terrain_file(const ImportCommand& command, const CommonOptions& common) {
  std::string format = command.output.extension().string();
  std::transform(format.begin(), format.end(), format.begin(), [](char c) { return c >= 'A' && c <= 'Z' ? static_cast<char>(c - 'A' + 'a') : c; });
  if (format == ".tiff") format = ".tif";
  if (!is_grid_format(format) && !is_mesh_format(format))
    throw InputError(Place{}, fmt::format("-o {}: wanted a grid ({}) or a mesh ({})", command.output.string(), fmt::join(kGridFormats, " "), fmt::join(kMeshFormats, " ")));
  std::error_code ignored;
  for (const fs::path& file : command.files)
    if (fs::equivalent(file, command.output, ignored)) throw InputError(Place{}, fmt::format("-o {}: is what is read, and would be lost", command.output.string()));

  for (const fs::path& file : command.files) importers::check_input(file, std::numeric_limits<std::uint64_t>::max(), "terrain");

  if (command.files.size() > 1)
    for (const fs::path& file : command.files)
      if (!importers::is_dem(file)) throw InputError({file.string()}, "is no grid of heights: only those make a mosaic");

  ImportReport report;
  const importers::ReadLimits limits = read_limits(common);
  if (command.on_map && (format == ".glb" || format == ".stl" || is_grid_format(format))) throw InputError(Place{}, fmt::format("--on-map: {} has no room for map coordinates, .ply, .obj and .off have", format));
  if (importers::is_dem(command.files.front())) import_grid(command, format, limits, report);
  else import_mesh_file(command, format, limits, report);

  if (common.json) {
    json j;
    j["ok"] = true;
    for (const fs::path& file : command.files) j["files"].push_back(file.string());
    j["output"] = command.output.string();
    for (const auto& [key, value] : report.facts.items()) j[key] = value;
    j["report"] = report.lines;
    print_document(j.dump(1, ' ', false, json::error_handler_t::replace));
  } else if (!common.quiet) {
    for (const std::string& line : report.lines) fmt::print("{}\n", line);
  }
  return ExitCode::kDone;
}

}  // namespace effuse
