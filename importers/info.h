#pragma once

#include <filesystem>
#include <string>
#include <vector>

namespace effuse::importers {

/// What a file holds, in lines for people:
///   terrain grids  size, spacing, heights, holes, coordinate system, origin, closed depressions
///   meshes         validate()'s report, box, area, volume when it encloses one, attributes
///   scenes (TOML)  name, effects, tables
/// and what its reader noted. Throws InputError as the readers do; for a file none of them reads, it
/// names those that there are.
std::vector<std::string> describe_file(const std::filesystem::path& file);

}  // namespace effuse::importers
