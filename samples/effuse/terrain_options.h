#pragma once

#include "flow/scene/terrain_settings.h"
#include "importers/terrain/import_terrain.h"

namespace effuse {

/// How the importers are to read ground as settings say: those of a scene, or of `effuse import`.
inline importers::TerrainImportOptions terrain_options(const flow::TerrainSettings& s, const importers::ReadLimits& limits = {}) {
  importers::TerrainImportOptions options;
  options.temperature = s.temperature;
  options.mesh.limits = options.dem.limits = limits;
  importers::DemOptions& dem = options.dem;
  dem.crs = s.crs;
  dem.file_crs = s.file_crs;
  dem.crop = s.crop;
  dem.spacing = s.spacing;
  // Lists of choices have the same names in the same order.
  dem.resampling = static_cast<importers::Resampling>(s.resample);
  dem.holes = static_cast<importers::HolePolicy>(s.holes);
  dem.pits = static_cast<importers::PitPolicy>(s.pits);
  dem.vertical_unit = s.vertical_unit;
  dem.pit_depth = s.pit_depth;
  dem.size = s.size;
  dem.range = s.range;
  options.mesh.up = static_cast<importers::UpAxis>(s.up);
  options.mesh.metres_per_unit = s.metres_per_unit;
  options.repair = s.repair;
  if (s.stitch > 0) options.repairs.stitch = s.stitch;
  options.repairs.fill_holes = s.fill_holes;
  options.max_error = s.max_error;
  options.edge = s.edge;
  return options;
}

}  // namespace effuse
