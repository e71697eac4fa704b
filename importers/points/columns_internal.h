#pragma once

#include <cstdint>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "importers/points/import_points.h"

/// What the readers of particle files share.
namespace effuse::importers {

/// One array of a file: so many numbers a particle, particle after particle.
struct Column {
  std::string name;
  int width = 1;
  bool coarse = false;         ///< came as float32: whole numbers beyond 2^24 are not told apart
  std::vector<double> values;  ///< width * particles; empty for those that nobody wants
};

/// Which of the arrays that a file announces (name and width are set) become something, so that the others can be skipped.
std::vector<bool> wanted(std::span<const Column> columns);

/// The same of one array, before the others are known: also a scalar that may turn out to be a vector's component.
bool may_be_wanted(const Column& column);

/// Gives each column that is wanted its place; the others are named in a note. Throws InputError for values that are not
/// finite and radii <= 0. Sizes must agree (checked).
PointCloud assemble(const std::string& name, std::vector<Vec3> position, std::span<const Column> columns, const PointImportOptions& options);

/// Throws InputError, the place being a byte of a binary file.
[[noreturn]] void fail_at_byte(const std::string& name, std::size_t byte, const std::string& message);

/// Throws unless that many particles can be numbered by an Index.
void require_countable(const std::string& name, double count);

/// One reader a kind of file (import_points.h).
PointCloud parse_ply_points(std::string_view bytes, const std::string& name, const PointImportOptions& options);
PointCloud parse_legacy_vtk(std::string_view bytes, const std::string& name, const PointImportOptions& options);
PointCloud parse_xml_vtk(std::string_view bytes, const std::string& name, const PointImportOptions& options);
PointCloud parse_bgeo(std::string_view bytes, const std::string& name, const PointImportOptions& options);
PointCloud parse_xyz(std::string_view bytes, const std::string& name, const PointImportOptions& options);

/// Inflates a zlib or gzip stream (all members of one). Throws InputError when it is damaged, cut short, or longer than
/// limit bytes.
std::string inflate_bytes(std::string_view bytes, const std::string& name, std::size_t limit);

}  // namespace effuse::importers
