#pragma once

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
};

/// Reads [terrain]. Faults stay in root.
TerrainSettings read_terrain_settings(Parameters& root);

}  // namespace effuse::flow
