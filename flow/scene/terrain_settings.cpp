#include "flow/scene/terrain_settings.h"

#include <algorithm>

namespace effuse::flow {

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
  s.crs = terrain.text("crs", "", "coordinate system to work in, in metres (EPSG:32616); absent: the file's, or the UTM zone of one in degrees");
  s.file_crs = terrain.text("file_crs", "", "coordinate system of the file, where it says none or a wrong one");
  s.crop = terrain.numbers("crop", "", 4, false, "west, south, east, north on the map; in degrees, too, of a file in degrees");
  if (s.crop.size() == 4 && !(s.crop[0] < s.crop[2] && s.crop[1] < s.crop[3])) terrain.fault("crop", "wanted west < east and south < north");
  s.spacing = terrain.number("spacing", "m", 0, Parameters::not_negative(), "between the grid's posts; 0: as the file has them");
  s.resample = static_cast<TerrainSettings::Resample>(terrain.choice("resample", {"auto", "nearest", "bilinear", "cubic", "average"}, 0, "how heights between the file's posts are found"));
  s.vertical_unit = terrain.text("vertical_unit", "", "of the file's heights: m, ft, us-ft, cm; absent: as the file says, or metres");
  s.holes = static_cast<TerrainSettings::Holes>(terrain.choice("holes", {"hole", "fill", "error"}, 0, "posts without data: no ground, where the flow leaves; or filled smoothly; or refused"));
  s.pits = static_cast<TerrainSettings::Pits>(terrain.choice("pits", {"keep", "fill", "breach"}, 0, "closed depressions: kept; filled to where they overflow; or drained by a notch"));
  s.pit_depth = terrain.number("pit_depth", "m", 1e5, Parameters::not_negative(), "deeper depressions are kept: craters");
  s.size = terrain.numbers("size", "m", 2, false, "of an image's ground, east-west and north-south");
  s.range = terrain.numbers("range", "m", 2, false, "heights of an image's darkest and brightest values");
  return s;
}

}  // namespace effuse::flow
