#pragma once

#include <filesystem>
#include <string>
#include <vector>

namespace effuse::importers {

/// The coordinate system in the .prj file beside a grid: its WKT, "" when there is no such file or it is not
/// WKT (with a note). Throws InputError when it says that coordinates are not metres: degrees, feet.
std::string read_projection(const std::filesystem::path& grid_file, std::vector<std::string>& notes);

/// The same from WKT; name stands for the file.
std::string check_projection(const std::string& wkt, const std::string& name, std::vector<std::string>& notes);

/// "GD_1949_New_Zealand_Map_Grid" of a WKT; what is no WKT comes back as it is.
std::string projection_title(const std::string& crs);

}  // namespace effuse::importers
