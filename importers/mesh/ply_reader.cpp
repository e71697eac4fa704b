#include "importers/mesh/ply_reader.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <bit>
#include <charconv>
#include <cmath>
#include <cstdint>
#include <cstring>
#include <limits>
#include <optional>

#include "geometry/base/error.h"
#include "importers/input_file.h"

namespace effuse::importers {

namespace {

enum class Type { kInt8, kUint8, kInt16, kUint16, kInt32, kUint32, kFloat, kDouble };

std::size_t size_of(Type type) {
  switch (type) {
    case Type::kInt8:
    case Type::kUint8:
      return 1;
    case Type::kInt16:
    case Type::kUint16:
      return 2;
    case Type::kInt32:
    case Type::kUint32:
    case Type::kFloat:
      return 4;
    case Type::kDouble:
      break;
  }
  return 8;
}

bool is_integer(Type type) { return type != Type::kFloat && type != Type::kDouble; }

/// The largest value of an integer type: what stands for 1 in a colour.
float full_scale(Type type) {
  switch (type) {
    case Type::kInt8:
      return 127;
    case Type::kUint8:
      return 255;
    case Type::kInt16:
      return 32767;
    case Type::kUint16:
      return 65535;
    case Type::kInt32:
      return 2147483647.f;
    case Type::kUint32:
      return 4294967295.f;
    default:
      return 1;
  }
}

std::optional<Type> type_named(std::string_view name) {
  static constexpr std::array<std::pair<std::string_view, Type>, 16> kTypes = {{{"char", Type::kInt8},
                                                                                {"int8", Type::kInt8},
                                                                                {"uchar", Type::kUint8},
                                                                                {"uint8", Type::kUint8},
                                                                                {"short", Type::kInt16},
                                                                                {"int16", Type::kInt16},
                                                                                {"ushort", Type::kUint16},
                                                                                {"uint16", Type::kUint16},
                                                                                {"int", Type::kInt32},
                                                                                {"int32", Type::kInt32},
                                                                                {"uint", Type::kUint32},
                                                                                {"uint32", Type::kUint32},
                                                                                {"float", Type::kFloat},
                                                                                {"float32", Type::kFloat},
                                                                                {"double", Type::kDouble},
                                                                                {"float64", Type::kDouble}}};
  for (const auto& [known, type] : kTypes)
    if (known == name) return type;
  return std::nullopt;
}

struct Property {
  std::string name;
  Type type = Type::kFloat;
  bool list = false;
  Type count_type = Type::kUint8;
};

struct Element {
  std::string name;
  std::uint64_t count = 0;
  std::vector<Property> properties;
  Place place;
};

enum class Format { kAscii, kLittleEndian, kBigEndian };

struct Header {
  Format format = Format::kAscii;
  std::vector<Element> elements;
  std::size_t end = 0;  // where the data begin
  int lines = 0;
};

std::vector<std::string_view> words_of(std::string_view line) {
  std::vector<std::string_view> words;
  std::size_t i = 0;
  while (i < line.size()) {
    while (i < line.size() && (line[i] == ' ' || line[i] == '\t')) ++i;
    const std::size_t start = i;
    while (i < line.size() && line[i] != ' ' && line[i] != '\t') ++i;
    if (i > start) words.push_back(line.substr(start, i - start));
  }
  return words;
}

Header parse_header(std::string_view bytes, const std::string& name) {
  if (!bytes.starts_with("ply\n") && !bytes.starts_with("ply\r"))
    throw InputError({name, 1, 1}, "is not a PLY file: it does not begin with 'ply'");
  // Lines end as the first one does: in binary files the first byte of the data may look like a line's end.
  const std::string_view line_end = bytes[3] == '\n' ? "\n" : bytes.substr(4).starts_with('\n') ? "\r\n" : "\r";
  Header header;
  bool has_format = false;
  std::size_t at = 3 + line_end.size();
  int line = 1;
  for (;;) {
    ++line;
    const Place place{name, line, 1};
    const std::size_t end = bytes.find(line_end, at);
    if (end == std::string_view::npos) throw InputError(place, "the header does not end: no 'end_header'");
    std::string_view text = bytes.substr(at, end - at);
    at = end + line_end.size();
    if (text.ends_with('\r')) text.remove_suffix(1);
    const std::vector<std::string_view> words = words_of(text);
    if (words.empty() || words[0] == "comment" || words[0] == "obj_info") continue;
    if (words[0] == "end_header") break;
    if (words[0] == "format") {
      if (words.size() < 2) throw InputError(place, "the format is missing");
      if (words[1] == "ascii") {
        header.format = Format::kAscii;
      } else if (words[1] == "binary_little_endian") {
        header.format = Format::kLittleEndian;
      } else if (words[1] == "binary_big_endian") {
        header.format = Format::kBigEndian;
      } else {
        throw InputError(place, fmt::format("unknown format {}, wanted ascii, binary_little_endian or binary_big_endian", quote(words[1])));
      }
      has_format = true;
    } else if (words[0] == "element") {
      Element element;
      element.place = place;
      if (words.size() != 3) throw InputError(place, "wanted 'element NAME COUNT'");
      element.name = std::string(words[1]);
      const auto [stopped, error] = std::from_chars(words[2].data(), words[2].data() + words[2].size(), element.count);
      if (error != std::errc{} || stopped != words[2].data() + words[2].size())
        throw InputError(place, fmt::format("found {}, wanted how many there are of '{}'", quote(words[2]), printable(words[1], 40)));
      for (const Element& other : header.elements)
        if (other.name == element.name) throw InputError(place, fmt::format("element {} is declared twice", quote(words[1])));
      header.elements.push_back(std::move(element));
    } else if (words[0] == "property") {
      if (header.elements.empty()) throw InputError(place, "a property before the first element");
      Property property;
      property.list = words.size() == 5 && words[1] == "list";
      if (!property.list && words.size() != 3) throw InputError(place, "wanted 'property TYPE NAME' or 'property list TYPE TYPE NAME'");
      const auto known = [&](std::string_view word) {
        const std::optional<Type> type = type_named(word);
        if (!type) throw InputError(place, fmt::format("unknown type {}", quote(word)));
        return *type;
      };
      property.type = known(words[property.list ? 3 : 1]);
      if (property.list) property.count_type = known(words[2]);
      property.name = std::string(words.back());
      for (const Property& other : header.elements.back().properties)
        if (other.name == property.name) throw InputError(place, fmt::format("property {} is declared twice", quote(property.name)));
      header.elements.back().properties.push_back(std::move(property));
    } else {
      throw InputError(place, fmt::format("found {}, wanted format, element, property, comment or end_header", quote(words[0])));
    }
  }
  if (!has_format) throw InputError({name, 2, 1}, "the header has no 'format' line");
  header.end = at;
  header.lines = line;
  return header;
}

/// Values of the data, one after the other, in any of the three formats.
class Data {
 public:
  Data(std::string_view bytes, const Header& header, const std::string& name)
      : bytes_(bytes), at_(header.end), format_(header.format), name_(name), line_(header.lines + 1) {}

  std::size_t left() const { return bytes_.size() - at_; }

  /// Bytes that a value takes at least.
  std::size_t least(Type type) const { return format_ == Format::kAscii ? 2 : size_of(type); }

  double next(Type type) { return format_ == Format::kAscii ? next_word() : next_binary(type); }

  Place place() const { return format_ == Format::kAscii ? Place{name_, line_} : Place{name_}; }

  [[noreturn]] void fail(const std::string& message) const { throw InputError(place(), message); }

 private:
  double next_word() {
    const auto blank = [](char c) { return c == ' ' || c == '\n' || c == '\r' || c == '\t'; };
    for (; at_ < bytes_.size() && blank(bytes_[at_]); ++at_)
      if (bytes_[at_] == '\n' || (bytes_[at_] == '\r' && (at_ + 1 == bytes_.size() || bytes_[at_ + 1] != '\n'))) ++line_;
    const std::size_t start = at_;
    while (at_ < bytes_.size() && !blank(bytes_[at_])) ++at_;
    if (at_ == start) fail("the file ends in the middle of its data: truncated, or a wrong header");
    double value = 0;
    const std::string_view word = bytes_.substr(start, at_ - start);
    if (!parse_number(word, value)) fail(fmt::format("found {}, wanted a number", quote(word)));
    return value;
  }

  template <class T>
  double as() {
    std::array<char, sizeof(T)> raw;
    std::memcpy(raw.data(), bytes_.data() + at_, sizeof(T));
    at_ += sizeof(T);
    const bool little = format_ == Format::kLittleEndian;
    if (little != (std::endian::native == std::endian::little)) std::reverse(raw.begin(), raw.end());
    T value;
    std::memcpy(&value, raw.data(), sizeof(T));
    return static_cast<double>(value);
  }

  double next_binary(Type type) {
    if (left() < size_of(type)) fail("the file ends in the middle of its data: truncated, or a wrong header");
    switch (type) {
      case Type::kInt8:
        return as<std::int8_t>();
      case Type::kUint8:
        return as<std::uint8_t>();
      case Type::kInt16:
        return as<std::int16_t>();
      case Type::kUint16:
        return as<std::uint16_t>();
      case Type::kInt32:
        return as<std::int32_t>();
      case Type::kUint32:
        return as<std::uint32_t>();
      case Type::kFloat:
        return as<float>();
      case Type::kDouble:
        break;
    }
    return as<double>();
  }

  std::string_view bytes_;
  std::size_t at_;
  Format format_;
  std::string name_;
  int line_;
};

/// Length of the list that comes next; throws unless its items can stand in what is left.
std::size_t list_length(Data& data, const Property& property) {
  const double count = data.next(property.count_type);
  if (!(count >= 0) || std::trunc(count) != count) data.fail(fmt::format("a list of {} items", count));
  if (count > static_cast<double>((data.left() + 1) / data.least(property.type)))
    data.fail(
        fmt::format("a list of {} items cannot stand in the {} bytes that are left: truncated, or a wrong header", count, data.left()));
  return static_cast<std::size_t>(count);
}

void skip_list(Data& data, const Property& property) {
  for (std::size_t n = list_length(data, property); n > 0; --n) data.next(property.type);
}

/// Where each scalar of a vertex goes.
struct Target {
  enum class Kind { kSkip, kPosition, kNormal, kAttribute } kind = Kind::kSkip;
  int component = 0;
  geometry::VertexAttribute* attribute = nullptr;
  float divisor = 1;
  bool srgb = false;
};

std::vector<Target> assign_targets(const Element& vertex, PlyMesh& mesh) {
  std::vector<Target> targets(vertex.properties.size());
  const auto scalar = [&](const std::string& name) -> std::ptrdiff_t {
    for (std::size_t p = 0; p < vertex.properties.size(); ++p)
      if (vertex.properties[p].name == name && !vertex.properties[p].list) return static_cast<std::ptrdiff_t>(p);
    return -1;
  };
  // Three scalars that belong together; false unless all are there and free.
  const auto triple = [&](const std::array<std::string, 3>& names, const auto& give) {
    std::array<std::ptrdiff_t, 3> p{};
    for (std::size_t c = 0; c < 3; ++c) {
      p[c] = scalar(names[c]);
      if (p[c] < 0 || targets[static_cast<std::size_t>(p[c])].kind != Target::Kind::kSkip) return false;
    }
    for (std::size_t c = 0; c < 3; ++c)
      give(targets[static_cast<std::size_t>(p[c])], static_cast<int>(c), vertex.properties[static_cast<std::size_t>(p[c])].type);
    return true;
  };

  if (!triple({"x", "y", "z"}, [](Target& t, int c, Type) { t = {Target::Kind::kPosition, c}; }))
    throw InputError(vertex.place, "the vertices have no x, y and z");
  if (triple({"nx", "ny", "nz"}, [](Target& t, int c, Type) { t = {Target::Kind::kNormal, c}; })) mesh.normals.resize(vertex.count);
  const auto new_attribute = [&](const std::string& name, int width) {
    geometry::VertexAttribute& attribute = mesh.attributes[name];
    attribute.width = width;
    attribute.values.resize(vertex.count * static_cast<std::size_t>(width));
    return &attribute;
  };
  for (const std::string prefix : {"", "diffuse_"}) {
    if (mesh.attributes.count("color")) break;
    geometry::VertexAttribute* color = nullptr;
    triple({prefix + "red", prefix + "green", prefix + "blue"}, [&](Target& t, int c, Type type) {
      if (!color) color = new_attribute("color", 3);
      t = {Target::Kind::kAttribute, c, color, full_scale(type), is_integer(type)};
    });
  }
  // Vectors before scalars: velocity_y may stand before velocity_x.
  for (const Property& property : vertex.properties) {
    if (property.list || property.name.size() <= 2 || !property.name.ends_with("_x")) continue;
    const std::string stem = property.name.substr(0, property.name.size() - 2);
    if (mesh.attributes.count(stem) || scalar(stem) >= 0) continue;  // that name is taken
    geometry::VertexAttribute* vector = nullptr;
    triple({stem + "_x", stem + "_y", stem + "_z"}, [&](Target& t, int c, Type) {
      if (!vector) vector = new_attribute(stem, 3);
      t = {Target::Kind::kAttribute, c, vector};
    });
  }
  for (std::size_t p = 0; p < vertex.properties.size(); ++p) {
    const Property& property = vertex.properties[p];
    if (property.list || targets[p].kind != Target::Kind::kSkip || mesh.attributes.count(property.name)) continue;
    const bool alpha = property.name == "alpha" && is_integer(property.type);
    targets[p] = {Target::Kind::kAttribute, 0, new_attribute(property.name, 1), alpha ? full_scale(property.type) : 1.f};
  }
  return targets;
}

void read_vertices(Data& data, const Element& vertex, PlyMesh& mesh) {
  mesh.positions.resize(vertex.count);
  const std::vector<Target> targets = assign_targets(vertex, mesh);
  for (std::size_t v = 0; v < vertex.count; ++v) {
    for (std::size_t p = 0; p < targets.size(); ++p) {
      const Property& property = vertex.properties[p];
      if (property.list) {
        skip_list(data, property);
        continue;
      }
      const double value = data.next(property.type);
      const Target& target = targets[p];
      switch (target.kind) {
        case Target::Kind::kSkip:
          break;
        case Target::Kind::kPosition:
          if (!std::isfinite(value)) data.fail(fmt::format("vertex {} has a position that is not finite", v));
          mesh.positions[v][target.component] = value;
          break;
        case Target::Kind::kNormal:
          mesh.normals[v][target.component] = value;
          break;
        case Target::Kind::kAttribute: {
          const float scaled = static_cast<float>(value) / target.divisor;
          target.attribute->values[v * static_cast<std::size_t>(target.attribute->width) + static_cast<std::size_t>(target.component)] =
              target.srgb ? linear_from_srgb(scaled) : scaled;
          break;
        }
      }
    }
  }
}

void read_faces(Data& data, const Element& face, std::size_t vertices, PlyMesh& mesh) {
  std::size_t indices = face.properties.size();
  for (std::size_t p = 0; p < face.properties.size(); ++p)
    if (face.properties[p].list && (face.properties[p].name == "vertex_indices" || face.properties[p].name == "vertex_index")) indices = p;
  if (face.count > 0 && indices == face.properties.size()) throw InputError(face.place, "the faces have no list 'vertex_indices'");
  std::size_t too_short = 0;
  for (std::size_t f = 0; f < face.count; ++f) {
    for (std::size_t p = 0; p < face.properties.size(); ++p) {
      const Property& property = face.properties[p];
      if (p != indices) {
        if (property.list) {
          skip_list(data, property);
        } else {
          data.next(property.type);
        }
        continue;
      }
      const std::size_t count = list_length(data, property);
      if (count > kMaxCorners) data.fail(fmt::format("face {} has {} corners, at most {} are read", f, count, kMaxCorners));
      for (std::size_t c = 0; c < count; ++c) {
        const double index = data.next(property.type);
        if (!(index >= 0 && index < static_cast<double>(vertices)) || std::trunc(index) != index)
          data.fail(fmt::format("face {} names vertex {}, there are {} (from 0)", f, index, vertices));
        if (count >= 3) mesh.corners.push_back(static_cast<Index>(index));
      }
      if (count >= 3) {
        mesh.face_start.push_back(mesh.corners.size());
      } else {
        ++too_short;
      }
    }
  }
  if (too_short > 0) mesh.notes.push_back(fmt::format("{} faces with fewer than three corners were left out", too_short));
}

}  // namespace

float linear_from_srgb(float value) { return value <= 0.04045f ? value / 12.92f : std::pow((value + 0.055f) / 1.055f, 2.4f); }

PlyMesh parse_ply(std::string_view bytes, const std::string& name) {
  const Header header = parse_header(bytes, name);
  Data data(bytes, header, name);
  PlyMesh mesh;
  mesh.face_start = {0};

  std::size_t vertices = 0;
  for (const Element& element : header.elements)
    if (element.name == "vertex") vertices = element.count;
  if (vertices >= std::numeric_limits<Index>::max()) throw InputError({name}, fmt::format("{} vertices are too many", vertices));

  for (const Element& element : header.elements) {
    if (element.properties.empty() || element.count == 0) continue;
    // What the header promises has to fit before memory is asked for.
    std::size_t least = 0;
    for (const Property& property : element.properties) least += data.least(property.list ? property.count_type : property.type);
    if (element.count > (data.left() + 1) / least)
      throw InputError(element.place, fmt::format("{} of '{}' are promised, the rest of the file has room for {} at most: "
                                                  "it is truncated, or its header is wrong",
                                                  element.count, printable(element.name, 40), (data.left() + 1) / least));
    if (element.name == "vertex") {
      read_vertices(data, element, mesh);
    } else if (element.name == "face") {
      read_faces(data, element, vertices, mesh);
    } else {
      for (std::uint64_t n = 0; n < element.count; ++n)
        for (const Property& property : element.properties) {
          if (property.list) {
            skip_list(data, property);
          } else {
            data.next(property.type);
          }
        }
      mesh.notes.push_back(fmt::format("{} of '{}' were skipped", element.count, printable(element.name, 40)));
    }
  }
  if (!mesh.corners.empty() && mesh.positions.empty()) throw InputError({name}, "has faces but no vertices");
  return mesh;
}

}  // namespace effuse::importers
