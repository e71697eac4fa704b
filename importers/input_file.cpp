#include "importers/input_file.h"

#include <fmt/format.h>

#include <algorithm>
#include <charconv>
#include <cmath>
#include <system_error>

#include "geometry/base/error.h"
#include "geometry/base/files.h"

namespace effuse::importers {

namespace fs = std::filesystem;

std::string read_input(const fs::path& file, std::uint64_t limit, std::string_view what) {
  const Place place{file.string()};
  std::error_code error;
  const fs::file_status status = fs::status(file, error);
  if (status.type() == fs::file_type::not_found) throw InputError(place, "no such file");
  if (error) throw InputError(place, "cannot read: " + error.message());
  if (fs::is_directory(status)) throw InputError(place, "is a folder, wanted a file");
  // A pipe or a device may never end.
  if (!fs::is_regular_file(status)) throw InputError(place, "is not a regular file");
  const std::uintmax_t size = fs::file_size(file, error);
  if (error) throw InputError(place, "cannot read: " + error.message());
  if (size == 0) throw InputError(place, "the file is empty");
  if (size > limit) throw InputError(place, fmt::format("is too large for {}: {} bytes, at most {}", what, size, limit));
  return read_file(file);
}

std::string printable(std::string_view text, std::size_t limit) {
  std::string out;
  for (const char c : text.substr(0, limit)) out += (c >= ' ' && c <= '~') ? c : (c == '\n' || c == '\t') ? ' ' : '?';
  if (text.size() > limit) out += "...";
  return out;
}

std::string quote(std::string_view text) { return fmt::format("'{}'", printable(text, 40)); }

std::string lower(std::string_view text) {
  std::string out(text);
  std::transform(out.begin(), out.end(), out.begin(), [](char c) { return c >= 'A' && c <= 'Z' ? static_cast<char>(c - 'A' + 'a') : c; });
  return out;
}

std::string lower_extension(const fs::path& file) { return lower(file.extension().string()); }

bool parse_number(std::string_view text, double& value) {
  if (text.starts_with('+')) {
    text.remove_prefix(1);
    if (text.starts_with('-') || text.starts_with('+')) return false;
  }
  const char* end = text.data() + text.size();
  const auto [stopped, error] = std::from_chars(text.data(), end, value);
  if (error == std::errc::result_out_of_range && stopped == end) {
    // Too small is zero, too large is not a number we can hold.
    const std::size_t exponent = text.find_first_of("eE");
    if (exponent == std::string_view::npos || exponent + 1 >= text.size() || text[exponent + 1] != '-') return false;
    value = 0;
    return true;
  }
  return error == std::errc{} && stopped == end;
}

}  // namespace effuse::importers
