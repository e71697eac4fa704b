#include "importers/mesh/text_meshes.h"

#include <fmt/format.h>

#include <algorithm>
#include <charconv>
#include <cmath>
#include <cstdint>
#include <cstring>

#include "geometry/base/error.h"
#include "importers/input_file.h"
#include "importers/mesh/ply_reader.h"

namespace effuse::importers {

namespace {

// Beyond this a float's step passes half a millimetre.
constexpr Real kFarOut = 8192;  // [m]

/// One line of a text file, its end left out.
struct Line {
  std::string_view text;
  int number = 0;
};

/// Lines of a text, ended by LF, CRLF or CR.
class Lines {
 public:
  explicit Lines(std::string_view text) : text_(text) {}
  bool next(Line& line) {
    if (at_ >= text_.size()) return false;
    const std::size_t end = std::min(text_.find_first_of("\r\n", at_), text_.size());
    line = {text_.substr(at_, end - at_), ++number_};
    at_ = end + (text_.substr(end).starts_with("\r\n") ? 2 : 1);
    return true;
  }
  int number() const { return number_; }

 private:
  std::string_view text_;
  std::size_t at_ = 0;
  int number_ = 0;
};

bool blank(char c) { return c == ' ' || c == '\t' || c == '\v' || c == '\f'; }

/// The next word of line, which loses it; "" at its end.
std::string_view take_word(std::string_view& line) {
  while (!line.empty() && blank(line.front())) line.remove_prefix(1);
  std::size_t length = 0;
  while (length < line.size() && !blank(line[length])) ++length;
  const std::string_view word = line.substr(0, length);
  line.remove_prefix(length);
  return word;
}

/// Three finite coordinates from the front of line, which loses them.
Vec3 take_position(std::string_view& line, const Place& place) {
  Vec3 position;
  for (int c = 0; c < 3; ++c) {
    const std::string_view word = take_word(line);
    if (word.empty()) throw InputError(place, fmt::format("a vertex with {} coordinates, wanted 3", c));
    if (!parse_number(word, position[c])) {
      const char* advice = word.find(',') != std::string_view::npos ? "; decimals want a point, not a comma" : "";
      throw InputError(place, fmt::format("found {}, wanted a coordinate{}", quote(word), advice));
    }
    if (!std::isfinite(position[c])) throw InputError(place, fmt::format("a vertex at {}: not a finite position", quote(word)));
  }
  return position;
}

bool far_out(const Box3& box) {
  return !box.isEmpty() && std::max(box.min().cwiseAbs().maxCoeff(), box.max().cwiseAbs().maxCoeff()) > kFarOut;
}

/// Whole metres near the middle.
Vec3 near_origin(const Box3& box) { return box.center().array().round(); }

std::string position_text(const Vec3& position) { return fmt::format("{} {} {}", position.x(), position.y(), position.z()); }

void check_corners(std::size_t corners, const Place& place) {
  if (corners < 3) throw InputError(place, fmt::format("a face with {} corners, wanted at least 3", corners));
  if (corners > kMaxCorners) throw InputError(place, fmt::format("a face with {} corners, at most {} are read", corners, kMaxCorners));
}

/// A logical line of an OBJ file: one that ends in '\' goes on in the next.
bool next_logical(Lines& lines, Line& line, std::string& joined) {
  if (!lines.next(line)) return false;
  if (!line.text.ends_with('\\') || line.text.starts_with('#')) return true;
  joined.assign(line.text);
  Line more;
  while (joined.ends_with('\\')) {
    joined.back() = ' ';
    if (!lines.next(more)) break;
    joined += more.text;
  }
  line.text = joined;
  return true;
}

void check_obj_face(std::string_view rest, const Place& place, std::int64_t vertices, std::int64_t& highest, Place& highest_place) {
  std::size_t corners = 0;
  for (std::string_view word = take_word(rest); !word.empty() && word.front() != '#'; word = take_word(rest), ++corners) {
    std::int64_t index = 0;
    const std::string_view digits = word.substr(0, word.find('/'));
    const auto [stopped, error] = std::from_chars(digits.data(), digits.data() + digits.size(), index);
    if (error != std::errc{} || stopped != digits.data() + digits.size())
      throw InputError(place, fmt::format("found {}, wanted a corner of a face, as 1, 1/2, 1//3 or 1/2/3", quote(word)));
    if (index == 0 || -index > vertices)
      throw InputError(place, fmt::format("a face names vertex {}, there are {} so far (from 1, or from -1 backwards)", index, vertices));
    if (index > highest) {
      highest = index;
      highest_place = place;
    }
  }
  check_corners(corners, place);
}

}  // namespace

MeshCheck check_obj(std::string_view bytes, const std::string& name) {
  std::int64_t vertices = 0, highest = 0;
  Place highest_place;
  Box3 box;
  std::string joined;
  Line line;
  std::size_t faces = 0;
  for (Lines lines(bytes); next_logical(lines, line, joined);) {
    std::string_view rest = line.text;
    const std::string_view keyword = take_word(rest);
    if (keyword == "v") {
      box.extend(take_position(rest, {name, line.number}));
      ++vertices;
    } else if (keyword == "f") {
      check_obj_face(rest, {name, line.number}, vertices, highest, highest_place);
      ++faces;
    }
  }
  if (highest > vertices) throw InputError(highest_place, fmt::format("a face names vertex {}, there are {}", highest, vertices));
  if (faces == 0) throw InputError({name}, fmt::format("holds no triangles ({} vertices, no faces)", vertices));

  MeshCheck check;
  check.faces = faces;
  if (!far_out(box)) return check;
  check.origin = near_origin(box);
  std::string& out = check.rewritten.emplace();
  out.reserve(bytes.size());
  for (Lines lines(bytes); next_logical(lines, line, joined);) {
    std::string_view rest = line.text;
    if (take_word(rest) == "v") {
      const Vec3 position = take_position(rest, {name, line.number}) - check.origin;
      out += "v " + position_text(position);
      out += rest;
    } else {
      out += line.text;
    }
    out += '\n';
  }
  return check;
}

namespace {

/// The count in a binary STL file's header.
std::uint64_t binary_facets(std::string_view bytes) {
  std::uint64_t facets = 0;
  for (std::size_t b = 4; b-- > 0;) facets = (facets << 8) | static_cast<unsigned char>(bytes[80 + b]);
  return facets;
}

MeshCheck check_binary_stl(std::string_view bytes, const std::string& name) {
  if (bytes.size() < 84) throw InputError({name}, fmt::format("is not an STL file: {} bytes, the shortest has 84", bytes.size()));
  const std::uint64_t facets = binary_facets(bytes), wanted = 84 + 50 * facets;
  if (wanted > bytes.size())
    throw InputError({name}, fmt::format("{} facets are promised, the file has room for {}: it is truncated, or not an STL file", facets,
                                         (bytes.size() - 84) / 50));
  if (facets == 0) throw InputError({name}, "holds no triangles");
  MeshCheck check;
  check.faces = facets;
  if (wanted < bytes.size()) check.notes.push_back(fmt::format("{} bytes after the last facet were ignored", bytes.size() - wanted));
  return check;
}

}  // namespace

MeshCheck check_stl(std::string_view bytes, const std::string& name) {
  // Binary files may begin with "solid", too: the length tells.
  std::string_view start = bytes.substr(0, 256);
  while (!start.empty() && (blank(start.front()) || start.front() == '\r' || start.front() == '\n')) start.remove_prefix(1);
  bool binary = !start.starts_with("solid");
  if (!binary && bytes.size() >= 84) {
    binary = 84 + 50 * binary_facets(bytes) == bytes.size() || bytes.substr(0, 512).find('\0') != std::string_view::npos;
  }
  if (binary) return check_binary_stl(bytes, name);

  Box3 box;
  Line line;
  std::size_t facets = 0, in_solid = 0, corners = 0;
  int solid_line = 0;
  bool in_facet = false;
  const auto end_solid = [&] {
    if (solid_line > 0 && in_solid == 0) throw InputError({name, solid_line}, "a solid without facets");
    solid_line = 0;
    in_solid = 0;
  };
  for (Lines lines(bytes); lines.next(line);) {
    std::string_view rest = line.text;
    const std::string_view keyword = take_word(rest);
    const Place place{name, line.number};
    if (keyword == "solid") {
      end_solid();
      solid_line = line.number;
    } else if (keyword == "endsolid") {
      if (in_facet) throw InputError(place, "a facet without 'endfacet'");
      end_solid();
    } else if (keyword == "facet") {
      if (in_facet) throw InputError(place, "a facet inside a facet");
      in_facet = true;
      corners = 0;
    } else if (keyword == "vertex") {
      if (!in_facet) throw InputError(place, "a vertex outside of a facet");
      box.extend(take_position(rest, place));
      ++corners;
    } else if (keyword == "endfacet") {
      if (!in_facet || corners != 3) throw InputError(place, fmt::format("a facet with {} vertices, wanted 3", corners));
      in_facet = false;
      ++in_solid;
      ++facets;
    }
  }
  if (in_facet) throw InputError({name, line.number}, "the file ends inside a facet: truncated");
  MeshCheck check;
  if (solid_line > 0) check.notes.push_back("there is no 'endsolid' at the end: the file may be truncated");
  end_solid();
  if (facets == 0) throw InputError({name}, "holds no triangles");
  check.faces = facets;

  if (!far_out(box)) return check;
  check.origin = near_origin(box);
  std::string& out = check.rewritten.emplace();
  out.reserve(bytes.size());
  for (Lines lines(bytes); lines.next(line);) {
    std::string_view rest = line.text;
    if (take_word(rest) == "vertex") {
      const Vec3 position = take_position(rest, {name, line.number}) - check.origin;
      out += "vertex " + position_text(position);
    } else {
      out += line.text;
    }
    out += '\n';
  }
  return check;
}

MeshCheck check_off(std::string_view bytes, const std::string& name) {
  Lines lines(bytes);
  Line line;
  // A line with something on it.
  const auto next = [&](std::string_view wanted) {
    for (;;) {
      if (!lines.next(line)) throw InputError({name, lines.number()}, fmt::format("the file ends where {} should stand", wanted));
      line.text = line.text.substr(0, line.text.find('#'));
      std::string_view rest = line.text;
      if (!take_word(rest).empty()) return;
    }
  };
  next("'OFF'");
  std::string_view rest = line.text;
  const std::string_view keyword = take_word(rest);
  if (!keyword.ends_with("OFF") || keyword.size() > 8)
    throw InputError({name, line.number}, "is not an OFF file: it does not begin with 'OFF'");
  if (keyword.find_first_of("4n") != std::string_view::npos)
    throw InputError({name, line.number}, "OFF files in four or n dimensions are not read");
  std::string_view first = rest;
  std::string_view word = take_word(first);
  if (word == "BINARY") throw InputError({name, line.number}, "binary OFF files are not read");
  if (word.empty()) {
    next("the numbers of vertices, faces and edges");
    rest = line.text;
  }
  std::uint64_t counts[2] = {0, 0};
  for (int c = 0; c < 2; ++c) {
    word = take_word(rest);
    const auto [stopped, error] = std::from_chars(word.data(), word.data() + word.size(), counts[c]);
    if (word.empty() || error != std::errc{} || stopped != word.data() + word.size())
      throw InputError({name, line.number}, fmt::format("found {}, wanted the number of {}", quote(word), c == 0 ? "vertices" : "faces"));
  }
  const auto [vertices, faces] = counts;
  // A vertex takes at least "0 0 0" and a line's end, a face "3 0 0 0".
  if (vertices > bytes.size() / 6 + 1 || faces > bytes.size() / 8 + 1)
    throw InputError({name, line.number}, fmt::format("{} vertices and {} faces are promised, a file of {} bytes cannot hold them",
                                                      vertices, faces, bytes.size()));
  if (faces == 0) throw InputError({name}, fmt::format("holds no triangles ({} vertices, no faces)", vertices));

  MeshCheck check;
  check.faces = faces;
  std::vector<Vec3> positions(vertices);
  Box3 box;
  for (std::uint64_t v = 0; v < vertices; ++v) {
    next(fmt::format("vertex {} of {}", v, vertices));
    rest = line.text;
    positions[v] = take_position(rest, {name, line.number});
    box.extend(positions[v]);
  }
  if (far_out(box)) check.origin = near_origin(box);
  std::string& out = check.rewritten.emplace();
  out.reserve(bytes.size());
  out += fmt::format("OFF\n{} {} 0\n", vertices, faces);
  for (const Vec3& position : positions) out += position_text(position - check.origin) + "\n";
  for (std::uint64_t f = 0; f < faces; ++f) {
    next(fmt::format("face {} of {}", f, faces));
    rest = line.text;
    const Place place{name, line.number};
    const auto whole = [&](std::string_view what) {
      std::uint64_t value = 0;
      word = take_word(rest);
      const auto [stopped, error] = std::from_chars(word.data(), word.data() + word.size(), value);
      if (word.empty() || error != std::errc{} || stopped != word.data() + word.size())
        throw InputError(place, fmt::format("found {}, wanted {}", quote(word), what));
      return value;
    };
    const std::uint64_t corners = whole("how many corners the face has");
    check_corners(corners, place);
    out += fmt::format("{}", corners);
    for (std::uint64_t c = 0; c < corners; ++c) {
      const std::uint64_t index = whole("a vertex of the face");
      if (index >= vertices) throw InputError(place, fmt::format("a face names vertex {}, there are {} (from 0)", index, vertices));
      out += fmt::format(" {}", index);
    }
    out += '\n';
  }
  return check;
}

}  // namespace effuse::importers
