#pragma once

#include <array>
#include <optional>
#include <string>
#include <vector>

#include "flow/scene/parameters.h"

namespace effuse::flow {

/// Flat ground, the table [terrain.plane]: geometry::make_plane.
struct PlannedPlane {
  Vec2 size = Vec2::Zero();      ///< [m]
  Real slope = 0, downhill = 0;  ///< [rad]
  Real height = 0;               ///< at the origin [m]
};

/// What a scene says of its ground, as written: the importers know what to do with it.
struct TerrainSettings {
  std::vector<std::string> files;  ///< relative to the scene file; several: a mosaic of grids; none: plane
  std::optional<PlannedPlane> plane;
  Place place;                     ///< of them in the scene
  Real temperature = 288.15;       ///< [K]
  std::string crs, file_crs;       ///< to work in, and of the files; "": as the files say
  std::vector<Real> crop;          ///< west, south, east, north on the map; empty: all
  Real spacing = 0;                ///< of the posts [m]; 0: as the files have them
  enum class Resample { kAuto, kNearest, kBilinear, kCubic, kAverage } resample = Resample::kAuto;
  std::string vertical_unit;       ///< "": as the files say
  enum class Holes { kHole, kFill, kError } holes = Holes::kHole;
  enum class Pits { kKeep, kFill, kBreach } pits = Pits::kKeep;
  Real pit_depth = 0;              ///< [m]
  std::vector<Real> size, range;   ///< of images [m]; empty: none

  // Of meshes:
  enum class Up { kAuto, kX, kY, kZ } up = Up::kAuto;  ///< the file's axis that points up; kAuto: as it says, or z
  Real metres_per_unit = 0;        ///< of the file's lengths; 0: as it says, or 1
  bool repair = true;              ///< made sound; else left as it is
  Real stitch = 0;                 ///< borders no farther apart become one [m]; 0: a millionth of the mesh's size
  Real fill_holes = 0;             ///< holes up to this diagonal are filled [m]
  Real max_error = 0;              ///< simplified, no farther from itself than this [m]; 0: not
  Real edge = 0;                   ///< remeshed to triangles of such edges [m]; 0: not
};

/// Keys of [terrain] that say something of one kind of ground only. The others go with both.
inline constexpr std::array kGridKeys = {"file_crs", "spacing", "resample", "vertical_unit", "holes", "pits", "pit_depth", "size", "range"};
inline constexpr std::array kMeshKeys = {"up", "unit", "repair", "stitch", "fill_holes", "max_error", "edge"};

/// Reads [terrain]. Faults stay in root.
TerrainSettings read_terrain_settings(Parameters& root);

/// What [terrain] says of its file, into s: all but file, plane and temperature. `effuse import` reads its options so, too.
void read_terrain_keys(Parameters& terrain, TerrainSettings& s);

/// A fault for each key in the table that is of grids where the file holds a mesh, or the other way round, at the key's place.
///   path  of the table, for the messages: "terrain"; or ""
///   file  its name, for the messages
std::vector<Fault> misfits(const Node& terrain, const std::string& path, bool is_grid, const std::string& file);

/// Takes those keys out of a resolved table, where their defaults stand.
void drop_misfits(Node& terrain, bool is_grid);

}  // namespace effuse::flow
