#include <fmt/format.h>

#include <bit>
#include <cstdint>

#include "geometry/base/error.h"
#include "importers/input_file.h"
#include "importers/points/columns_internal.h"

// Houdini's binary geometry, version 5 (Houdini 5 to 11; "bhclassic" of later ones). All big-endian:
//
//   char[4] "Bgeo", char 'V', int32 5
//   int32   points, primitives, point groups, primitive groups, point, vertex, primitive and detail attributes
//   for each point attribute
//     uint16 length, char[length] name, uint16 size, int32 type
//     type 0 float, 1 integer, 5 vector:  4 bytes x size, the default
//     type 4 indexed string:              int32 count, count x (uint16 length, char[length])
//   for each point
//     float x y z w, then size x 4 bytes of each attribute in turn
//   primitives, groups, detail attributes: not needed here
//
// Source: Houdini's documentation of the format (HDK, "GEO and BGEO File Format, version 5"); Partio writes the same.
namespace effuse::importers {

namespace {

class BigEndian {
 public:
  BigEndian(std::string_view bytes, const std::string& name) : bytes_(bytes), name_(name) {}

  std::size_t at() const { return at_; }
  std::size_t left() const { return bytes_.size() - at_; }

  std::string_view take(std::size_t size, const char* what) {
    if (left() < size) fail_at_byte(name_, at_, fmt::format("the file ends within {}: {} bytes wanted, {} left", what, size, left()));
    at_ += size;
    return bytes_.substr(at_ - size, size);
  }
  std::uint32_t u32(const char* what) { return load32(take(4, what).data()); }
  std::uint32_t u16(const char* what) {
    const std::string_view b = take(2, what);
    return static_cast<std::uint32_t>(byte(b[0]) << 8 | byte(b[1]));
  }
  /// A count: not negative.
  std::uint32_t count(const char* what) {
    const std::uint32_t value = u32(what);
    if (value > 0x7fffffffu) fail_at_byte(name_, at_ - 4, fmt::format("found {} as {}", static_cast<std::int32_t>(value), what));
    return value;
  }

  static std::uint32_t load32(const char* b) { return byte(b[0]) << 24 | byte(b[1]) << 16 | byte(b[2]) << 8 | byte(b[3]); }

 private:
  static std::uint32_t byte(char c) { return static_cast<unsigned char>(c); }
  std::string_view bytes_;
  const std::string& name_;
  std::size_t at_ = 0;
};

struct Attribute {
  std::size_t offset = 0;  // in a point's record [4 bytes]
  std::uint32_t type = 0;
};

constexpr std::uint32_t kFloat = 0, kInteger = 1, kIndexedString = 4, kVector = 5;

}  // namespace

PointCloud parse_bgeo(std::string_view bytes, const std::string& name, const PointImportOptions& options) {
  if (bytes.starts_with("\x7fNSJ") || bytes.starts_with('['))
    throw InputError({name}, "is a .bgeo of Houdini 12 or later (JSON), which is not read; write it as .bhclassic, .ply or .vtk");
  if (!bytes.starts_with("Bgeo")) throw InputError({name}, fmt::format("at byte 0: found {}, wanted 'Bgeo': not a BGEO file", quote(bytes.substr(0, 4))));
  BigEndian in(bytes, name);
  in.take(4, "the header");
  if (const std::string_view v = in.take(1, "the header"); v != "V") fail_at_byte(name, 4, fmt::format("found {}, wanted 'V'", quote(v)));
  if (const std::uint32_t version = in.u32("the header"); version != 5)
    fail_at_byte(name, 5, fmt::format("found version {}, wanted 5", version));
  const std::uint32_t n = in.count("the number of points");
  in.count("the number of primitives");
  in.count("the number of point groups");
  in.count("the number of primitive groups");
  const std::uint32_t attribute_count = in.count("the number of point attributes");
  in.count("the number of vertex attributes");
  in.count("the number of primitive attributes");
  in.count("the number of detail attributes");

  // What each point carries.
  std::vector<Column> columns;
  std::vector<Attribute> attributes;
  std::size_t record = 4;  // x y z w
  for (std::uint32_t a = 0; a < attribute_count; ++a) {
    const std::size_t start = in.at();
    const std::string_view title = in.take(in.u16("an attribute's name"), "an attribute's name");
    const std::uint32_t size = in.u16("an attribute's size"), type = in.u32("an attribute's type");
    if (type == kIndexedString) {
      for (std::uint32_t strings = in.count("the number of strings"); strings > 0; --strings) in.take(in.u16("a string"), "a string");
    } else if (type == kFloat || type == kInteger || type == kVector) {
      in.take(std::size_t{4} * size, "an attribute's default");
    } else {
      fail_at_byte(name, start, fmt::format("point attribute {} is of type {}, wanted 0 (float), 1 (integer), 4 (indexed string) or 5 (vector)", quote(title), type));
    }
    // No name of ours stands for strings.
    columns.push_back({std::string(title), type == kIndexedString ? 0 : static_cast<int>(size), type != kInteger, {}});
    attributes.push_back({record, type});
    record += size;
  }
  if (n > in.left() / (4 * record))
    fail_at_byte(name, in.at(), fmt::format("{} points of {} bytes are promised, {} bytes are left: truncated, or a wrong header", n, 4 * record, in.left()));
  require_countable(name, n);

  const std::string_view points = in.take(4 * record * n, "the points");
  const std::vector<bool> is_wanted = wanted(columns);
  const auto number = [&](std::size_t point, std::size_t word, std::uint32_t type) -> double {
    const std::uint32_t bits = BigEndian::load32(points.data() + 4 * (point * record + word));
    return type == kInteger ? static_cast<double>(static_cast<std::int32_t>(bits)) : static_cast<double>(std::bit_cast<float>(bits));
  };
  std::vector<Vec3> position(n);
  for (std::size_t p = 0; p < n; ++p) position[p] = Vec3(number(p, 0, kFloat), number(p, 1, kFloat), number(p, 2, kFloat));
  for (std::size_t c = 0; c < columns.size(); ++c) {
    if (!is_wanted[c]) continue;
    const std::size_t width = static_cast<std::size_t>(columns[c].width);
    columns[c].values.resize(n * width);
    for (std::size_t p = 0; p < n; ++p)
      for (std::size_t k = 0; k < width; ++k) columns[c].values[p * width + k] = number(p, attributes[c].offset + k, attributes[c].type);
  }
  return assemble(name, std::move(position), columns, options);
}

}  // namespace effuse::importers
