#include "flow/scene/terrain_settings.h"

#include <fmt/format.h>

#include <algorithm>
#include <span>
#include <stdexcept>

#include "geometry/base/length_unit.h"

namespace effuse::flow {

namespace {
/// Metres in the unit that a key names; 0: none, or none there is, which is a fault.
Real read_unit(Parameters& terrain, const char* key, const std::string& name) {
  try {
    if (!name.empty()) return parse_length_unit(name);
  } catch (const std::invalid_argument& error) {
    terrain.fault(key, error.what());
  }
  return 0;
}

/// Keys of the other kind of ground.
std::span<const char* const> other_keys(bool is_grid) {
  if (is_grid) return kMeshKeys;
  return kGridKeys;
}
}  // namespace

TerrainSettings read_terrain_settings(Parameters& root) {
  TerrainSettings s;
  Parameters terrain = root.table("terrain", "the ground");
  Parameters plane = terrain.table("plane", "flat ground about the origin, instead of a file");
  if (terrain.has("plane")) {
    const std::vector<Real> size = plane.numbers("size", "m", 2, true, "along x and y");
    s.plane.emplace();
    if (size.size() == 2) s.plane->size = Vec2(size[0], size[1]);
    if (size.size() == 2 && !(s.plane->size.minCoeff() >= 1e-2 && s.plane->size.maxCoeff() <= 1e6)) plane.fault("size", "must be from 0.01 to 1e6 m");
    s.plane->slope = plane.number("slope", "rad", 0, {0, 1.5}, "of the ground");
    s.plane->downhill = plane.number("downhill", "rad", 0, {}, "the way it falls, counter-clockwise from east");
    s.plane->height = plane.number("height", "m", 0, {}, "at the origin");
    s.temperature = terrain.number("temperature", "K", s.temperature, {0, 5000, true}, "of the ground");
    if (terrain.has("file")) {
      terrain.text("file", "", "");
      terrain.fault("file", "found with plane, wanted one or the other");
    }
    return s;
  }
  s.files = terrain.texts("file", "DEM grid or mesh, relative to the scene file; several grids make a mosaic; or [terrain.plane]");
  s.place = terrain.place("file");
  if (std::any_of(s.files.begin(), s.files.end(), [](const std::string& file) { return file.find('\0') != std::string::npos; })) {
    terrain.fault("file", "is not the name of a file");
    s.files.clear();
  }
  s.temperature = terrain.number("temperature", "K", 288.15, {0, 5000, true}, "of the ground");
  read_terrain_keys(terrain, s);
  return s;
}

void read_terrain_keys(Parameters& terrain, TerrainSettings& s) {
  s.crs = terrain.text("crs", "", "coordinate system to work in, in metres (EPSG:32616); absent: the file's, or the UTM zone of one in degrees");
  s.file_crs = terrain.text("file_crs", "", "coordinate system of the file, where it says none or a wrong one");
  s.crop = terrain.numbers("crop", "", 4, false, "west, south, east, north on the map; in degrees, too, of a file in degrees");
  if (s.crop.size() == 4 && !(s.crop[0] < s.crop[2] && s.crop[1] < s.crop[3])) terrain.fault("crop", "wanted west < east and south < north");
  s.spacing = terrain.number("spacing", "m", 0, Parameters::not_negative(), "between the grid's posts; 0: as the file has them");
  s.resample = static_cast<TerrainSettings::Resample>(terrain.choice("resample", {"auto", "nearest", "bilinear", "cubic", "average"}, 0, "how heights between the file's posts are found"));
  s.vertical_unit = terrain.text("vertical_unit", "", "of a grid's heights: m, ft, us-ft, cm; absent: as the file says, or metres");
  read_unit(terrain, "vertical_unit", s.vertical_unit);
  s.holes = static_cast<TerrainSettings::Holes>(terrain.choice("holes", {"hole", "fill", "error"}, 0, "posts without data: no ground, where the flow leaves; or filled smoothly; or refused"));
  s.pits = static_cast<TerrainSettings::Pits>(terrain.choice("pits", {"keep", "fill", "breach"}, 0, "closed depressions: kept; filled to where they overflow; or drained by a notch"));
  s.pit_depth = terrain.number("pit_depth", "m", 1e5, Parameters::not_negative(), "deeper depressions are kept: craters");
  s.size = terrain.numbers("size", "m", 2, false, "of an image's ground, east-west and north-south");
  s.range = terrain.numbers("range", "m", 2, false, "heights of an image's darkest and brightest values");

  s.up = static_cast<TerrainSettings::Up>(terrain.choice("up", {"auto", "x", "y", "z"}, 0, "a mesh's axis that points up; auto: as the file says, or z"));
  s.metres_per_unit = read_unit(terrain, "unit", terrain.text("unit", "", "of a mesh's lengths: mm, cm, m, km, in, ft, us-ft, or metres of one (\"0.01\"); absent: as the file says, or metres"));
  s.repair = terrain.flag("repair", true, "a mesh is welded, wound one way, parted where it is not manifold, rid of degenerate and duplicate triangles; false: left as it is");
  s.stitch = terrain.number("stitch", "m", 0, Parameters::not_negative(), "a mesh's borders no farther apart become one; 0: a millionth of its size");
  s.fill_holes = terrain.number("fill_holes", "m", 0, Parameters::not_negative(), "a mesh's holes up to this diagonal are filled");
  s.max_error = terrain.number("max_error", "m", 0, Parameters::not_negative(), "a mesh has fewer triangles, nowhere farther from where it was; 0: all");
  s.edge = terrain.number("edge", "m", 0, Parameters::not_negative(), "a mesh has new triangles of about this size; 0: the file's");
  if (!s.repair && s.stitch > 0) terrain.fault("stitch", "is a repair, and the mesh is to be left as it is");
  if (!s.repair && s.fill_holes > 0) terrain.fault("fill_holes", "is a repair, and the mesh is to be left as it is");
  if (s.max_error > 0 && s.edge > 0) terrain.fault("edge", "makes triangles of one size, and max_error few: wanted one of them");
}

std::vector<Fault> misfits(const Node& terrain, const std::string& path, bool is_grid, const std::string& file) {
  std::vector<Fault> faults;
  for (const char* key : other_keys(is_grid))
    if (const Node* node = terrain.find(key))
      faults.push_back({node->place, fmt::format("{}{}{}: is for {}, and '{}' is a {}", path, path.empty() ? "" : ".", key, is_grid ? "meshes" : "grids", file, is_grid ? "grid of heights" : "mesh")});
  return faults;
}

void drop_misfits(Node& terrain, bool is_grid) {
  for (const char* key : other_keys(is_grid))
    for (std::size_t k = terrain.entries.size(); k-- > 0;) {
      if (terrain.entries[k].first != key) continue;
      terrain.entries.erase(terrain.entries.begin() + static_cast<std::ptrdiff_t>(k));
      terrain.key_places.erase(terrain.key_places.begin() + static_cast<std::ptrdiff_t>(k));
    }
}

}  // namespace effuse::flow
