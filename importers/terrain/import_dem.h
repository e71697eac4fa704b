#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "importers/terrain/dem_grid.h"
#include "importers/terrain/dem_options.h"
#include "importers/terrain/raster_source.h"

namespace effuse::importers {

/// Turns rasters into one grid of heights in metres, posts along east and north.
///
/// A raster that stands so already keeps its posts and heights to the bit (feet are turned into metres, rows into our
/// order); only what the crop holds is read. Degrees, another crs, another spacing and rotated grids are resampled: posts
/// then stand at whole multiples of the spacing, as far apart as the cells are at the raster's middle, to three digits
/// (or on every n-th of the file's own, where the spacing is a multiple of theirs). Several files are a mosaic: where
/// they overlap the first one's heights count; files that lie on one lattice are joined before they are resampled, so no
/// seam shows.
///
/// read_text hands out the bytes of text files. notes of the grid say what was found, assumed and changed, for people.
/// Throws InputError naming the file: what its reader refuses, nothing in the crop, no heights, holes under
/// HolePolicy::kError, more posts than max_posts.
DemGrid place_dem(const std::vector<std::filesystem::path>& files, const DemOptions& options, const ReadText& read_text);

/// The same through assimp, by an importer of ours registered with it (dem_importer.h).
DemGrid import_dem(const std::vector<std::filesystem::path>& files, const DemOptions& options = {});

}  // namespace effuse::importers
