#pragma once

#include <openvdb/openvdb.h>

#include <filesystem>
#include <string>
#include <utility>
#include <vector>

namespace effuse::skin {

/// Grids into a VDB file: blosc, metadata as strings of the file, the same bytes for the same grids (OpenVDB would give each file a
/// random name of its own). Whole or absent: its table of contents is walked before it gets its name; ResourceError where it is not whole.
void write_vdb_file(const std::filesystem::path& file, const openvdb::GridPtrVec& grids, const std::vector<std::pair<std::string, std::string>>& metadata);

/// What a package said, fit for a line: OpenVDB's words on a broken file can be hundreds of megabytes of its bytes.
std::string brief_words(const char* words);

}  // namespace effuse::skin
