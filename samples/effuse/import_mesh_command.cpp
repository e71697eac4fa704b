#include "samples/effuse/import_report_internal.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <stdexcept>

#include "geometry/base/units.h"
#include "geometry/mesh/clip.h"
#include "geometry/mesh/measure.h"
#include "geometry/remesh/remesh.h"
#include "geometry/terrain/sample_heights.h"
#include "importers/terrain/import_terrain.h"
#include "skin/write/write_exact.h"
#include "skin/write/write_mesh.h"

namespace effuse {

namespace fs = std::filesystem;

using geometry::TriMesh;
using json = nlohmann::ordered_json;

bool is_grid_format(std::string_view extension) { return std::find(std::begin(kGridFormats), std::end(kGridFormats), extension) != std::end(kGridFormats); }
bool is_mesh_format(std::string_view extension) { return std::find(std::begin(kMeshFormats), std::end(kMeshFormats), extension) != std::end(kMeshFormats); }

Real metres(const std::string& text, const char* option) {
  try {
    const Real value = parse_quantity(text, "m");
    if (value >= 0 && std::isfinite(value)) return value;
  } catch (const std::invalid_argument& error) {
    throw InputError(Place{}, fmt::format("{}: {}", option, error.what()));
  }
  throw InputError(Place{}, fmt::format("{}: '{}' is less than 0", option, text));
}

geometry::TriMesh as_floats(geometry::TriMesh mesh) {
  for (Vec3& p : mesh.positions) p = p.cast<float>().cast<Real>();
  return mesh;
}

void write_import_mesh(const fs::path& file, const std::string& format, const TriMesh& mesh, const geometry::Georeference& geo, bool on_map) {
  skin::Metadata metadata = {{"generator", "effuse"}, {"origin", fmt::format("{:.17g} {:.17g} {:.17g}", geo.origin.x(), geo.origin.y(), geo.origin.z())}, {"crs", geo.crs}, {"units", "metres"}};
  if (on_map) {
    metadata[1].second = "0 0 0";
    TriMesh moved = mesh;
    for (Vec3& p : moved.positions) p += geo.origin;
    if (format == ".ply") return skin::write_exact_ply(file, moved, metadata);
    return format == ".obj" ? skin::write_exact_obj(file, moved, metadata) : skin::write_off(file, moved, metadata);
  }
  if (format == ".ply") skin::write_ply(file, mesh, metadata);
  else if (format == ".obj") skin::write_obj(file, mesh, metadata);
  else if (format == ".glb") skin::write_glb(file, mesh, metadata);
  else if (format == ".off") skin::write_off(file, mesh, metadata);
  else skin::write_stl(file, mesh, metadata);
}

namespace {

/// The report of a repair as JSON.
json repair_facts(const geometry::RepairReport& r) {
  return {{"welded_vertices", r.welded_vertices}, {"stitched_vertices", r.stitched_vertices}, {"unused_vertices", r.unused_vertices}, {"collapsed_triangles", r.collapsed_triangles},
          {"flat_triangles", r.flat_triangles}, {"duplicate_triangles", r.duplicate_triangles}, {"inner_walls", r.inner_walls}, {"parted_edges", r.parted_edges},
          {"split_vertices", r.split_vertices}, {"midpoint_vertices", r.midpoint_vertices}, {"cut_edges", r.cut_edges}, {"turned_triangles", r.turned_triangles},
          {"inward_shells", r.inward_shells}, {"filled_holes", r.filled_holes}, {"hole_triangles", r.hole_triangles}, {"open_holes", r.open_holes}, {"largest_hole_m", r.largest_hole}};
}

json mesh_facts(const TriMesh& mesh, const geometry::MeshReport& r) {
  const Box3 box = geometry::bounds(mesh);
  const auto list = [](const Vec3& v) { return json::array({v.x(), v.y(), v.z()}); };
  return {{"vertices", r.vertices}, {"triangles", r.triangles}, {"components", r.components}, {"closed", r.closed()}, {"manifold", r.manifold()}, {"oriented", r.oriented()}, {"low", list(box.min())}, {"high", list(box.max())}};
}

importers::TerrainImportOptions mesh_options(const ImportCommand& command, const importers::ReadLimits& limits) {
  importers::TerrainImportOptions options;
  options.dem.crs = command.crs;
  options.mesh.limits = limits;
  options.mesh.up = command.up == "x" ? importers::UpAxis::kX : command.up == "y" ? importers::UpAxis::kY : command.up == "z" ? importers::UpAxis::kZ : importers::UpAxis::kUnknown;
  if (!command.units.empty()) {
    try {
      options.mesh.metres_per_unit = importers::metres_of_unit(command.units);
    } catch (const InputError& error) {
      throw InputError(Place{}, fmt::format("--units: {}", error.what()));
    }
  }
  options.repair = !command.keep;
  if (!command.fill_holes.empty()) options.repairs.fill_holes = command.fill_holes == "all" ? std::numeric_limits<Real>::infinity() : metres(command.fill_holes, "--fill-holes");
  return options;
}

void refuse_what_is_of_grids(const ImportCommand& command, bool to_grid) {
  const std::string file = command.files.front().string();
  if (command.files.size() > 1) throw InputError({file}, "is a mesh: several files make a mosaic of grids only");
  const std::array<std::pair<const char*, bool>, 7> of_grids = {{{"--resample", !command.resample.empty()}, {"--file-crs", !command.file_crs.empty()}, {"--holes", command.holes != "hole"}, {"--pits", command.pits != "keep"},
                                                                 {"--vertical-unit", !command.vertical_unit.empty()}, {"--size", !command.size.empty()}, {"--range", !command.range.empty()}}};
  for (const auto& [option, given] : of_grids)
    if (given) throw InputError({file}, fmt::format("is a mesh, and {} is for grids", option));
  if (to_grid && command.cell.empty()) throw InputError({file}, "is a mesh: --cell says how far apart the posts of its grid shall be (--cell 5m)");
  if (!to_grid && !command.cell.empty()) throw InputError(Place{}, fmt::format("--cell is of a grid, and {} is a mesh", command.output.string()));
  if (command.keep && !command.fill_holes.empty()) throw InputError(Place{}, "--keep leaves the mesh as it is, and --fill-holes does not");
  if (!command.edge.empty() && !command.max_error.empty()) throw InputError(Place{}, "--edge makes triangles of one size, --max-error few: wanted one of them");
}

/// What the file leaves to be guessed, and how to say it.
void note_guesses(const importers::MeshFrame& frame, const ImportCommand& command, const Box3& box, ImportReport& report) {
  const Real size = box.sizes().maxCoeff();
  if (frame.metres_per_unit == 0 && command.units.empty())
    report.lines.push_back(fmt::format("warning: the file names no unit: metres are assumed, {:.4g} m across; millimetres would be {:.4g} m (--units mm), feet {:.4g} m (--units ft)", size, size / 1000, size * 0.3048));
  if (frame.up == importers::UpAxis::kUnknown && command.up.empty()) report.lines.push_back("warning: the file does not say which axis is up: z is assumed (--up)");
}

/// Fewer or other triangles, as asked; the promise is of what the file will hold.
void change_triangles(const ImportCommand& command, bool exact, TriMesh& mesh, ImportReport& report) {
  if (command.edge.empty() && command.max_error.empty()) return;
  const std::string file = command.files.front().string();
  geometry::Remeshed made;
  try {
    if (!command.edge.empty()) {
      const Real edge = metres(command.edge, "--edge");
      if (edge == 0) throw InputError(Place{}, "--edge: edges of 0 m, wanted more");
      made = geometry::remesh(mesh, edge);
      report.lines.push_back(fmt::format("remeshed to edges of about {:g} m: {} triangles of {}", edge, made.mesh.triangles.size(), mesh.triangles.size()));
    } else {
      const Real max_error = metres(command.max_error, "--max-error");
      const Real rounding = exact ? 0 : 1e-7 * geometry::bounds(mesh).diagonal().norm();
      if (!(max_error > 2 * rounding)) throw InputError(Place{}, fmt::format("--max-error: {:g} m is less than this file's numbers hold, wanted more than {:.2g} m", max_error, 2 * rounding));
      made = geometry::simplify(mesh, max_error - rounding);
      report.lines.push_back(fmt::format("simplified to {:g} m: {} triangles of {}", max_error, made.mesh.triangles.size(), mesh.triangles.size()));
      if (!exact) made.error = geometry::hausdorff_distance(mesh, as_floats(made.mesh));
      report.facts["max_error_m"] = max_error;
    }
  } catch (const InputError& error) {
    throw InputError({file}, error.faults().front().message);
  }
  report.lines.push_back(fmt::format("measured: {:.4g} m from the mesh before at most, both ways, at {} points no farther than {:.3g} m apart", made.error.largest, made.error.samples, made.error.spacing));
  report.facts["measured_error_m"] = made.error.largest;
  mesh = std::move(made.mesh);
}

void crop_to(const ImportCommand& command, const geometry::Georeference& geo, TriMesh& mesh, ImportReport& report) {
  if (command.crop.empty()) return;
  const Vec2 low = Vec2(command.crop[0], command.crop[1]) - geo.origin.head<2>(), high = Vec2(command.crop[2], command.crop[3]) - geo.origin.head<2>();
  const Box3 box = geometry::bounds(mesh);
  if (!(low.x() < high.x() && low.y() < high.y())) throw InputError(Place{}, "--crop: wanted west < east and south < north");
  mesh = geometry::crop(std::move(mesh), low, high);
  if (mesh.triangles.empty())
    throw InputError({command.files.front().string()}, fmt::format("nothing of it is in the crop: it lies from {:.10g}, {:.10g} to {:.10g}, {:.10g}", box.min().x() + geo.origin.x(), box.min().y() + geo.origin.y(),
                                                                   box.max().x() + geo.origin.x(), box.max().y() + geo.origin.y()));
  report.lines.push_back(fmt::format("cropped: {} triangles are left", mesh.triangles.size()));
}

void mesh_to_grid(const ImportCommand& command, const std::string& format, TriMesh mesh, const geometry::Georeference& geo, ImportReport& report) {
  const Real cell = metres(command.cell, "--cell");
  if (cell == 0) throw InputError(Place{}, "--cell: posts 0 m apart, wanted more");
  const geometry::Terrain terrain = geometry::Terrain::from_mesh(std::move(mesh), geo);
  geometry::SampledHeights heights;
  try {
    heights = geometry::sample_heights(terrain, cell, geo.origin.head<2>(), command.max_posts);
  } catch (const InputError& error) {
    throw InputError({command.files.front().string()}, error.faults().front().message);
  }
  if (heights.holes == heights.z.size()) throw InputError({command.files.front().string()}, "has no ground that faces up: a grid of it would be empty");
  importers::DemGrid grid;
  grid.corner = heights.corner + geo.origin.head<2>();
  grid.spacing = Vec2(cell, cell);
  grid.nx = heights.nx;
  grid.ny = heights.ny;
  grid.z = std::move(heights.z);
  for (Real& z : grid.z) z += geo.origin.z();
  grid.nodata = heights.holes;
  grid.crs = geo.crs;
  if (heights.roofed > 0)
    report.lines.push_back(fmt::format("warning: {} posts ({:.1f} %) have ground under ground: caves, overhangs or sheets, of which a grid holds the highest only", heights.roofed,
                                       100.0 * static_cast<Real>(heights.roofed) / static_cast<Real>(grid.z.size())));
  if (heights.holes > 0) report.lines.push_back(fmt::format("{} posts have no ground: holes", heights.holes));
  report.facts["grid"] = {{"nx", grid.nx}, {"ny", grid.ny}, {"spacing_m", {cell, cell}}, {"south_west_post", {grid.corner.x(), grid.corner.y()}}, {"holes", heights.holes}, {"roofed", heights.roofed}, {"crs", grid.crs}};
  write_import_grid(command.output, format, grid, report);
}

}  // namespace

void import_mesh_file(const ImportCommand& command, const std::string& format, const importers::ReadLimits& limits, ImportReport& report) {
  const bool to_grid = is_grid_format(format);
  refuse_what_is_of_grids(command, to_grid);
  const importers::TerrainImportOptions options = mesh_options(command, limits);
  const fs::path& file = command.files.front();
  importers::MeshImport read = importers::import_mesh(file, options.mesh);
  note_guesses(read.frame, command, geometry::bounds(read.mesh), report);
  const importers::TerrainImport import = importers::terrain_from_mesh(std::move(read), file.string(), options);
  const geometry::Georeference& geo = import.terrain.georeference();
  report.lines.insert(report.lines.end(), import.notes.begin(), import.notes.end());
  if (import.repairs) {
    report.facts["repair"] = repair_facts(*import.repairs);
    if (!import.repairs->changed()) report.lines.push_back("nothing to repair");
    if (import.repairs->open_holes > 0)
      report.lines.push_back(fmt::format("{} {} open, the largest {:.4g} m across", import.repairs->open_holes, import.repairs->open_holes == 1 ? "border is" : "borders are", import.repairs->largest_hole));
  }
  TriMesh mesh = import.terrain.mesh();
  crop_to(command, geo, mesh, report);
  const bool exact = command.on_map || format == ".off" || to_grid;
  change_triangles(command, exact, mesh, report);
  if (to_grid) return mesh_to_grid(command, format, std::move(mesh), geo, report);
  const geometry::MeshReport state = geometry::validate(mesh);
  write_import_mesh(command.output, format, mesh, geo, command.on_map);
  report.lines.push_back(fmt::format("{}: {}", command.output.string(), geometry::to_string(state)));
  report.facts["mesh"] = mesh_facts(mesh, state);
  report.facts["origin"] = {geo.origin.x(), geo.origin.y(), geo.origin.z()};
}

}  // namespace effuse
