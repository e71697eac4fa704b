#pragma once

#include <filesystem>

#include "geometry/mesh/volume.h"
#include "skin/write/write_mesh.h"

namespace effuse::skin {

/// VDB with "density" (GRID_FOG_VOLUME), and where the volume has them "temperature" [K] and "velocity" [m/s], active where density is above a
/// thousandth of its largest value, or of 1e-4 where that is more; half floats.
/// Whole or absent. A number that is not finite is an InputError; a volume without cells a file of empty grids.
void write_volume_vdb(const std::filesystem::path& file, const geometry::GridVolume& volume, const Metadata& metadata = {});

}  // namespace effuse::skin
