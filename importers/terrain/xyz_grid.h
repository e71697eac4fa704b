#pragma once

#include <string>
#include <string_view>

#include "importers/terrain/dem_grid.h"

namespace effuse::importers {

/// Whether text is lines of three numbers or more, after a line of titles or comments (#) at most.
bool looks_like_xyz(std::string_view text);

/// A grid of heights told place by place: a line each with x, y and height, separated by blanks, tabs, semicolons or
/// commas, in any order, with gaps; further numbers on the line are ignored. A first line of words is a header, # begins
/// a comment. With semicolons or blanks between them, numbers may have decimal commas.
///
/// The grid is found from the places: its spacing is their smallest distance along x and along y. Places left out are
/// holes, as are heights that mark missing data (raster.h); of a place told twice the last height counts, with a note.
///
/// Throws InputError (place: name, line): fewer than three numbers, not a number, places more than 2 % of a cell beside
/// the grid (a point cloud is no grid), or a grid less than a fiftieth of which is told.
DemGrid parse_xyz(std::string_view text, const std::string& name);

}  // namespace effuse::importers
