#pragma once

#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "geometry/base/types.h"
#include "importers/read_apart.h"

namespace effuse::importers {

/// What a file holds.
struct FileFacts {
  std::vector<std::string> lines;  ///< for people
  std::string values;              ///< the same for programs: a JSON object; empty: of this kind of file only the lines
};

/// The facts of a file:
///   terrain grids  format, size, spacing, area on the map, heights and the highest place, holes, coordinate system, origin, closed
///                  depressions; and at a place, when one is asked for, what ground_place() says of it
///   meshes         validate()'s report, pairs of triangles that cut through one another (of up to kMostTested triangles),
///                  box, area, volume when it encloses one, attributes, what the file says of up axis, unit and place, or a guess
///   scenes (TOML)  name, effects, tables
///   clips          joints or markers, frames, travel (.bvh, .trc, .tsv)
/// and what its reader noted. Throws InputError as the readers do; for a file none of them reads, it
/// names those that there are, and for a place that has no ground, or is asked of anything but a grid. limits: of the readers of
/// meshes and grids; at: a place of a terrain grid, in its map coordinates or in degrees, east first.
FileFacts file_facts(const std::filesystem::path& file, const ReadLimits& limits = {}, const std::optional<Vec2>& at = {});
/// Its lines.
std::vector<std::string> describe_file(const std::filesystem::path& file);

inline constexpr std::size_t kMostTested = 2'000'000;  ///< a few seconds
inline constexpr std::size_t kMostCrossings = 1'000'000;  ///< of n triangles in one place there are n^2 / 2: counted no further

}  // namespace effuse::importers
