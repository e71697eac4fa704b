#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <bit>
#include <cstdint>
#include <optional>

#include "geometry/base/error.h"
#include "importers/input_file.h"
#include "importers/points/columns_internal.h"

namespace effuse::importers {

namespace {

/// Whether the beginning of a file could have been typed.
bool looks_like_text(std::string_view bytes) {
  const std::string_view head = bytes.substr(0, 4096);
  return std::all_of(head.begin(), head.end(), [](char c) {
    const unsigned char u = static_cast<unsigned char>(c);
    return u >= 0x20 ? u != 0x7f : (c == '\n' || c == '\r' || c == '\t' || c == '\f');
  });
}

/// x y z as float32, little-endian, nothing else.
PointCloud parse_raw(std::string_view bytes, const std::string& name, const PointImportOptions& options) {
  if (bytes.size() % 12 != 0)
    throw InputError({name}, fmt::format("is neither text nor x y z as float32: its {} bytes are no multiple of 12", bytes.size()));
  require_countable(name, static_cast<double>(bytes.size() / 12));
  std::vector<Vec3> position(bytes.size() / 12);
  const auto number = [&](std::size_t at) {
    std::uint32_t bits = 0;
    for (std::size_t b = 0; b < 4; ++b) bits |= static_cast<std::uint32_t>(static_cast<unsigned char>(bytes[at + b])) << (8 * b);
    return static_cast<double>(std::bit_cast<float>(bits));
  };
  for (std::size_t i = 0; i < position.size(); ++i) position[i] = Vec3(number(12 * i), number(12 * i + 4), number(12 * i + 8));
  PointCloud cloud = assemble(name, std::move(position), {}, options);
  cloud.notes.push_back("read as x y z in little-endian float32");
  return cloud;
}

bool is_separator(char c) { return c == ' ' || c == '\t' || c == ',' || c == ';' || c == '\r' || c == '\f'; }

/// The words of a line, quotes around them taken off. words is reused: millions of lines.
void split(std::string_view line, std::vector<std::string_view>& words) {
  words.clear();
  std::size_t i = 0;
  while (i < line.size()) {
    while (i < line.size() && is_separator(line[i])) ++i;
    const std::size_t start = i;
    while (i < line.size() && !is_separator(line[i])) ++i;
    std::string_view word = line.substr(start, i - start);
    if (word.size() >= 2 && word.front() == '"' && word.back() == '"') word = word.substr(1, word.size() - 2);
    if (!word.empty()) words.push_back(word);
  }
}

/// Where x, y and z stand among the columns' names.
std::optional<std::array<std::size_t, 3>> find_position(const std::vector<std::string>& names) {
  static constexpr std::array<std::array<const char*, 3>, 5> kNames = {
      {{"x", "y", "z"}, {"position_x", "position_y", "position_z"}, {"points:0", "points:1", "points:2"}, {"px", "py", "pz"}, {"pos_x", "pos_y", "pos_z"}}};
  for (const auto& triple : kNames) {
    std::array<std::size_t, 3> found{};
    bool all = true;
    for (std::size_t k = 0; k < 3; ++k) {
      found[k] = static_cast<std::size_t>(std::find_if(names.begin(), names.end(), [&](const std::string& n) { return lower(n) == triple[k]; }) - names.begin());
      all = all && found[k] < names.size();
    }
    if (all) return found;
  }
  return std::nullopt;
}

}  // namespace

PointCloud parse_xyz(std::string_view bytes, const std::string& name, const PointImportOptions& options) {
  if (bytes.starts_with("\xef\xbb\xbf")) bytes.remove_prefix(3);
  if (!looks_like_text(bytes)) return parse_raw(bytes, name, options);

  std::vector<std::string_view> words;
  std::vector<std::string> names, comment;
  std::array<std::size_t, 3> xyz{0, 1, 2};
  std::vector<Column> columns;
  std::vector<std::ptrdiff_t> column_of;  // of each word: -1 part of the position or not wanted
  std::vector<Vec3> position;
  std::size_t width = 0;  // words a line; 0: none has come
  int line = 0;
  for (std::size_t at = 0; at < bytes.size();) {
    ++line;
    const std::size_t end = std::min(bytes.find('\n', at), bytes.size());
    std::string_view text = bytes.substr(at, end - at);
    at = end + 1;
    const Place place{name, line};
    if (const std::size_t hash = text.find('#'); hash != std::string_view::npos) {
      split(text.substr(hash + 1), words);
      if (width == 0 && names.empty()) comment.assign(words.begin(), words.end());
      text = text.substr(0, hash);
    }
    split(text, words);
    if (words.empty()) continue;

    // The first line with something on it: names, or numbers whose names a comment may have told.
    double value = 0;
    if (width == 0 && names.empty() && !parse_number(words[0], value)) {
      names.assign(words.begin(), words.end());
      const auto found = find_position(names);
      if (!found) throw InputError(place, fmt::format("found {}, wanted numbers, or the columns' names with x, y and z among them", quote(text)));
      xyz = *found;
      continue;
    }
    if (width == 0) {
      width = words.size();
      if (names.empty() && comment.size() == width && find_position(comment)) {
        names = comment;
        xyz = *find_position(comment);
      }
      if (width < 3) throw InputError(place, fmt::format("found {} on this line, wanted x y z at least", quote(text)));
      if (!names.empty() && names.size() != width) throw InputError(place, fmt::format("found {} numbers, the columns' names are {}", width, names.size()));
      column_of.assign(width, -1);
      for (std::size_t k = 0; k < width; ++k) {
        if (k == xyz[0] || k == xyz[1] || k == xyz[2]) continue;
        column_of[k] = static_cast<std::ptrdiff_t>(columns.size());
        columns.push_back({names.empty() ? fmt::format("column {}", k + 1) : names[k], 1, false, {}});
      }
      const std::vector<bool> is_wanted = wanted(columns);
      for (std::ptrdiff_t& c : column_of)
        if (c >= 0 && !is_wanted[static_cast<std::size_t>(c)]) c = -1;
    }
    if (words.size() != width) throw InputError(place, fmt::format("found {} numbers, on the lines before {}", words.size(), width));
    const auto number = [&](std::size_t k) {
      if (!parse_number(words[k], value)) throw InputError(place, fmt::format("found {}, wanted a number", quote(words[k])));
      return value;
    };
    position.emplace_back(number(xyz[0]), number(xyz[1]), number(xyz[2]));
    for (std::size_t k = 0; k < width; ++k)
      if (column_of[k] >= 0) columns[static_cast<std::size_t>(column_of[k])].values.push_back(number(k));
  }
  require_countable(name, static_cast<double>(position.size()));
  return assemble(name, std::move(position), columns, options);
}

}  // namespace effuse::importers
