#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <nlohmann/json.hpp>
#include <optional>
#include <stdexcept>
#include <utility>

#include "geometry/base/units.h"
#include "geometry/terrain/triangulate.h"
#include "importers/terrain/import_dem.h"
#include "importers/terrain/import_terrain.h"
#include "samples/effuse/commands.h"
#include "skin/write/raster.h"
#include "skin/write/write_mesh.h"

namespace effuse {

namespace fs = std::filesystem;

namespace {

using json = nlohmann::ordered_json;

constexpr std::array kGridFormats = {".tif", ".asc"};
constexpr std::array kMeshFormats = {".ply", ".obj", ".glb", ".stl"};

/// What became of the file: lines for people and the same as JSON.
struct Report {
  std::vector<std::string> lines;
  json facts = json::object();
};

Real metres(const std::string& text, const char* option) {
  try {
    const Real value = parse_quantity(text, "m");
    if (value >= 0 && std::isfinite(value)) return value;
  } catch (const std::invalid_argument& error) {
    throw InputError(Place{}, fmt::format("{}: {}", option, error.what()));
  }
  throw InputError(Place{}, fmt::format("{}: '{}' is less than 0", option, text));
}

/// The index of word among names, or a fault that names the nearest.
template <std::size_t n>
std::size_t one_of(const std::string& word, const std::array<const char*, n>& names, const std::string& option) {
  const auto found = std::find(names.begin(), names.end(), word);
  if (found != names.end()) return static_cast<std::size_t>(found - names.begin());
  const std::vector<std::string> all(names.begin(), names.end());
  const std::string nearest = nearest_name(word, all);
  throw InputError(Place{}, nearest.empty() ? fmt::format("{}: no such choice '{}', wanted one of {}", option, word, fmt::join(all, ", ")) : fmt::format("{}: no such choice '{}', did you mean '{}'?", option, word, nearest));
}

importers::TerrainImportOptions options_of(const ImportCommand& command) {
  importers::TerrainImportOptions options;
  importers::DemOptions& dem = options.dem;
  dem.crs = command.crs;
  dem.file_crs = command.file_crs;
  dem.crop = command.crop;
  dem.vertical_unit = command.vertical_unit;
  dem.size = command.size;
  dem.range = command.range;
  dem.max_posts = command.max_posts;
  dem.holes = static_cast<importers::HolePolicy>(one_of(command.holes, std::array{"hole", "fill", "error"}, "--holes"));
  const std::size_t colon = command.pits.find(':');
  dem.pits = static_cast<importers::PitPolicy>(one_of(command.pits.substr(0, colon), std::array{"keep", "fill", "breach"}, "--pits"));
  if (colon != std::string::npos) dem.pit_depth = metres(command.pits.substr(colon + 1), "--pits");
  for (std::size_t at = 0; at < command.resample.size();) {
    const std::size_t end = std::min(command.resample.find(',', at), command.resample.size());
    const std::string part = command.resample.substr(at, end - at);
    at = end + 1;
    if (part.find_first_of("0123456789") == 0 || part.starts_with('.')) dem.spacing = metres(part, "--resample");
    else dem.resampling = static_cast<importers::Resampling>(one_of(part, std::array{"auto", "nearest", "bilinear", "cubic", "average"}, "--resample"));
    if (dem.spacing == 0 && part.find_first_of("0123456789") == 0) throw InputError(Place{}, "--resample: posts 0 m apart, wanted more");
  }
  options.y_up = command.up == "y";
  return options;
}

skin::Metadata metadata_of(const geometry::Georeference& geo) {
  return {{"generator", "effuse"}, {"origin", fmt::format("{:.17g} {:.17g} {:.17g}", geo.origin.x(), geo.origin.y(), geo.origin.z())}, {"crs", geo.crs}, {"units", "metres"}};
}

void write_mesh(const fs::path& file, const std::string& format, const geometry::TriMesh& mesh, const geometry::Georeference& geo) {
  const skin::Metadata metadata = metadata_of(geo);
  if (format == ".ply") skin::write_ply(file, mesh, metadata);
  else if (format == ".obj") skin::write_obj(file, mesh, metadata);
  else if (format == ".glb") skin::write_glb(file, mesh, metadata);
  else skin::write_stl(file, mesh, metadata);
}

void write_grid(const fs::path& file, const std::string& format, const importers::DemGrid& grid, Report& report) {
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

/// Positions as files hold them.
geometry::TriMesh as_floats(geometry::TriMesh mesh) {
  for (Vec3& p : mesh.positions) p = p.cast<float>().cast<Real>();
  return mesh;
}

/// A grid of heights, to a grid or a mesh.
void import_grid(const ImportCommand& command, const std::string& format, Report& report) {
  const bool to_grid = std::find(kGridFormats.begin(), kGridFormats.end(), format) != kGridFormats.end();
  if (to_grid && !command.max_error.empty()) throw InputError(Place{}, fmt::format("--max-error is of a mesh, and {} is a grid", command.output.string()));
  const Real max_error = command.max_error.empty() ? 0 : metres(command.max_error, "--max-error");
  const importers::TerrainImportOptions options = options_of(command);
  importers::DemGrid grid = importers::import_dem(command.files, options.dem);
  report.lines = grid.notes;
  report.facts["grid"] = {{"nx", grid.nx}, {"ny", grid.ny}, {"spacing_m", {grid.spacing.x(), grid.spacing.y()}}, {"south_west_post", {grid.corner.x(), grid.corner.y()}}, {"holes", grid.nodata}, {"crs", grid.crs}};
  if (to_grid) return write_grid(command.output, format, grid, report);

  const geometry::Terrain terrain = importers::terrain_from_grid(std::move(grid), command.files.front().string(), options).terrain;
  const geometry::HeightField& field = *terrain.height_field();
  const geometry::Georeference& geo = terrain.georeference();
  if (command.max_error.empty()) {
    write_mesh(command.output, format, terrain.mesh(), geo);
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
  write_mesh(command.output, format, mesh, geo);
  report.lines.push_back(fmt::format("{}: {} vertices, {} triangles, of {} posts", command.output.string(), mesh.positions.size(), mesh.triangles.size(), field.posts().size()));
  report.lines.push_back(fmt::format("measured: at the posts {:.4g} m off at most (asked {:.4g} m), between them {:.4g} m (with every post {:.4g} m: cells are twisted); {} posts uncovered", error.at_posts, max_error,
                                     error.between, geometry::twist_error(field), error.uncovered));
  report.facts["mesh"] = {{"vertices", mesh.positions.size()}, {"triangles", mesh.triangles.size()}, {"max_error_m", max_error}, {"measured_error_m", error.at_posts}, {"measured_between_posts_m", error.between}, {"uncovered_posts", error.uncovered}};
}

/// A mesh, to a mesh: as it is, in a local frame, facing up.
void import_mesh_file(const ImportCommand& command, const std::string& format, Report& report) {
  if (command.files.size() > 1) throw InputError({command.files.front().string()}, "is a mesh: several files make a mosaic of grids only");
  if (std::find(kMeshFormats.begin(), kMeshFormats.end(), format) == kMeshFormats.end()) throw InputError({command.files.front().string()}, fmt::format("is a mesh, and {} is no format of meshes: wanted {}", command.output.string(), fmt::join(kMeshFormats, " ")));
  const std::array<std::pair<const char*, bool>, 6> of_grids = {{{"--max-error", !command.max_error.empty()}, {"--crop", !command.crop.empty()}, {"--resample", !command.resample.empty()}, {"--file-crs", !command.file_crs.empty()}, {"--holes", command.holes != "hole"}, {"--pits", command.pits != "keep"}}};
  for (const auto& [option, given] : of_grids)
    if (given) throw InputError({command.files.front().string()}, fmt::format("is a mesh, and {} is for grids", option));
  const importers::TerrainImport import = importers::import_terrain(command.files.front(), options_of(command));
  const geometry::TriMesh& mesh = import.terrain.mesh();
  write_mesh(command.output, format, mesh, import.terrain.georeference());
  report.lines = import.notes;
  report.lines.push_back(fmt::format("{}: {} vertices, {} triangles", command.output.string(), mesh.positions.size(), mesh.triangles.size()));
  report.facts["mesh"] = {{"vertices", mesh.positions.size()}, {"triangles", mesh.triangles.size()}};
}

}  // namespace

ExitCode import_terrain_file(const ImportCommand& command, const CommonOptions& common) {
  std::string format = command.output.extension().string();
  std::transform(format.begin(), format.end(), format.begin(), [](char c) { return c >= 'A' && c <= 'Z' ? static_cast<char>(c - 'A' + 'a') : c; });
  if (format == ".tiff") format = ".tif";
  if (std::find(kGridFormats.begin(), kGridFormats.end(), format) == kGridFormats.end() && std::find(kMeshFormats.begin(), kMeshFormats.end(), format) == kMeshFormats.end())
    throw InputError(Place{}, fmt::format("-o {}: wanted a grid ({}) or a mesh ({})", command.output.string(), fmt::join(kGridFormats, " "), fmt::join(kMeshFormats, " ")));
  std::error_code ignored;
  for (const fs::path& file : command.files)
    if (fs::equivalent(file, command.output, ignored)) throw InputError(Place{}, fmt::format("-o {}: is what is read, and would be lost", command.output.string()));

  Report report;
  if (importers::is_dem(command.files.front())) import_grid(command, format, report);
  else import_mesh_file(command, format, report);

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
