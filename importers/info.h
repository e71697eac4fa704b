#pragma once

#include <filesystem>
#include <string>
#include <vector>

namespace effuse::importers {

/// What a file holds.
struct FileFacts {
  std::vector<std::string> lines;  ///< for people
  std::string values;              ///< the same for programs: a JSON object; empty: of this kind of file only the lines
};

/// The facts of a file:
///   terrain grids  format, size, spacing, area on the map, heights, holes, coordinate system, origin, closed depressions
///   meshes         validate()'s report, box, area, volume when it encloses one, attributes
///   scenes (TOML)  name, effects, tables
///   clips          joints or markers, frames, travel (.bvh, .trc)
/// and what its reader noted. Throws InputError as the readers do; for a file none of them reads, it
/// names those that there are.
FileFacts file_facts(const std::filesystem::path& file);
/// Its lines.
std::vector<std::string> describe_file(const std::filesystem::path& file);

}  // namespace effuse::importers
