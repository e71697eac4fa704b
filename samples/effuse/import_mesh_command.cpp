#include "samples/effuse/import_report_internal.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <cmath>

#include "geometry/mesh/measure.h"
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

void refuse_what_does_not_go(const ImportCommand& command, bool to_grid) {
  const std::string file = command.files.front().string();
  if (command.files.size() > 1) throw InputError({file}, "is a mesh: several files make a mosaic of grids only");
  if (to_grid && command.cell.empty()) throw InputError({file}, "is a mesh: --cell says how far apart the posts of its grid shall be (--cell 5m)");
  if (!to_grid && !command.cell.empty()) throw InputError(Place{}, fmt::format("--cell is of a grid, and {} is a mesh", command.output.string()));
}

/// How far positions move at most that are written as floats, relative to the mesh's own origin: half a step each, 2^-24 of their size.
Real rounding_of_floats(const Box3& box) {
  const Vec3 farthest(box.sizes().x() + 1, box.sizes().y() + 1, std::max(std::abs(box.min().z()), std::abs(box.max().z())));
  return std::ldexp(farthest.norm(), -24);
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
  refuse_what_does_not_go(command, to_grid);
  importers::TerrainImportOptions options = import_options(command, false, limits);
  const fs::path& file = command.files.front();
  importers::MeshImport read = importers::import_mesh(file, options.mesh);
  report.lines = importers::guesses(read, options.mesh);
  // The promise is of what the file will hold.
  const Real rounding = command.on_map || format == ".off" || to_grid ? 0 : rounding_of_floats(geometry::bounds(read.mesh)), max_error = options.max_error;
  if (!command.max_error.empty()) {
    if (!(max_error > 2 * rounding)) throw InputError(Place{}, fmt::format("--max-error: {:g} m is less than this file's numbers hold, wanted more than {:.2g} m", max_error, 2 * rounding));
    options.max_error -= rounding;
  }
  const importers::TerrainImport import = importers::terrain_from_mesh(std::move(read), file.string(), options);
  const geometry::Georeference& geo = import.terrain.georeference();
  if (import.repairs) {
    report.facts["repair"] = repair_facts(*import.repairs);
    if (!import.repairs->changed()) report.lines.push_back("nothing to repair");
    if (import.repairs->open_holes > 0)
      report.lines.push_back(fmt::format("{} {} open, the largest {:.4g} m across", import.repairs->open_holes, import.repairs->open_holes == 1 ? "border is" : "borders are", import.repairs->largest_hole));
  }
  report.lines.insert(report.lines.end(), import.notes.begin(), import.notes.end());
  if (import.remeshed) {
    if (rounding > 0) report.lines.push_back(fmt::format("the file's floats add {:.2g} m to that at most", rounding));
    if (max_error > 0) report.facts["max_error_m"] = max_error;
    report.facts["measured_error_m"] = import.remeshed->largest + rounding;
  }
  TriMesh mesh = import.terrain.mesh();
  if (to_grid) return mesh_to_grid(command, format, std::move(mesh), geo, report);
  const geometry::MeshReport state = geometry::validate(mesh);
  write_import_mesh(command.output, format, mesh, geo, command.on_map);
  report.lines.push_back(fmt::format("{}: {}", command.output.string(), geometry::to_string(state)));
  report.facts["mesh"] = mesh_facts(mesh, state);
  report.facts["origin"] = {geo.origin.x(), geo.origin.y(), geo.origin.z()};
}

}  // namespace effuse
