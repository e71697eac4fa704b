#pragma once

#include <filesystem>

#include "geometry/mesh/volume.h"
#include "skin/write/write_mesh.h"

namespace effuse::skin {

/// What write_volume_vdb() wrote: density and temperature (no velocity) on the box of active voxels, and the file's metadata. An empty volume
/// for a file of empty grids. Throws InputError: no VDB, no grid "density" of floats on cubic voxels, more than 2^28 cells.
geometry::GridVolume read_volume_vdb(const std::filesystem::path& file, Metadata* metadata = nullptr);

}  // namespace effuse::skin
