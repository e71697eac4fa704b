#pragma once

#include <string>
#include <string_view>

#include "importers/terrain/dem_grid.h"

namespace effuse::importers {

/// Whether text begins as an ESRI ASCII grid does: with one of its header's keys.
bool looks_like_esri_ascii(std::string_view text);

/// An ESRI ASCII grid. Keys in any case and order: ncols nrows, xllcorner yllcorner or xllcenter yllcenter,
/// cellsize or dx dy, nodata_value (nodata). Then nrows * ncols heights, north row first, broken into lines
/// anywhere; LF, CRLF or CR; a byte order mark is skipped. Numbers have decimal points, or all of them decimal commas (with a
/// note). A nodata_value may also stand after the last height.
///
/// NaN and the nodata value are holes; so are, with a note, -9999, -32768 and +-1e30 or more without having been
/// declared. Memory is bounded by the text's own length, whatever the header promises.
///
/// Throws InputError (place: name, line, column): a key unknown, twice or missing, not a number, points
/// and commas both, inf, heights beyond 100 km, too few or too many heights, fewer than 2 x 2, no cell with four heights.
DemGrid parse_esri_ascii(std::string_view text, const std::string& name);

}  // namespace effuse::importers
