#pragma once

#include <cstddef>
#include <filesystem>
#include <string>
#include <vector>

namespace effuse::skin {

/// Walks through an OpenVDB file's own table of contents without OpenVDB, which believes whatever lengths it reads: every
/// name and metadata entry must lie inside the file, every grid begin where the one before ended, the last end with the file.
/// Returns the grids' names in order. Format version 222 (2013) and later, with grid offsets; of others only the beginning
/// is looked at. Throws InputError: missing, not OpenVDB, truncated or damaged, with the byte.
std::vector<std::string> check_vdb_layout(const std::filesystem::path& file);

}  // namespace effuse::skin
