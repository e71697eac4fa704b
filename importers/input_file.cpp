#include "importers/input_file.h"

#include <fcntl.h>
#include <fmt/format.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <charconv>
#include <cmath>
#include <cstring>
#include <system_error>

#include "geometry/base/error.h"
#include "geometry/base/files.h"

namespace effuse::importers {

namespace fs = std::filesystem;

std::string read_input(const fs::path& file, std::uint64_t limit, std::string_view what) {
  check_input(file, limit, what);
  return read_file(file);
}

void check_input(const fs::path& file, std::uint64_t limit, std::string_view what) {
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
  // Packages say of a file that they may not open that it is none of theirs.
  const int opened = ::open(file.c_str(), O_RDONLY | O_CLOEXEC | O_NONBLOCK);
  if (opened < 0) throw InputError(place, fmt::format("cannot read: {}", std::strerror(errno)));
  ::close(opened);
}

std::string printable(std::string_view text, std::size_t limit) {
  std::string out;
  for (const char c : text.substr(0, limit)) out += (c >= ' ' && c <= '~') ? c : (c == '\n' || c == '\t') ? ' ' : '?';
  if (text.size() > limit) out += "...";
  return out;
}

std::string utf8(std::string_view text) {
  const auto byte = [&](std::size_t i) { return i < text.size() ? static_cast<unsigned char>(text[i]) : 0u; };
  std::string latin1;
  bool valid = true;
  for (std::size_t i = 0; i < text.size(); ++i) {
    const unsigned c = byte(i);
    if (c < 0x80) {
      latin1 += static_cast<char>(c);
    } else {
      latin1 += static_cast<char>(0xc0 | (c >> 6));
      latin1 += static_cast<char>(0x80 | (c & 0x3f));
    }
  }
  for (std::size_t i = 0; i < text.size() && valid;) {
    const unsigned c = byte(i), next = byte(i + 1);
    const std::size_t length = c < 0x80 ? 1 : c >= 0xc2 && c < 0xe0 ? 2 : c >= 0xe0 && c < 0xf0 ? 3 : c >= 0xf0 && c < 0xf5 ? 4 : 0;
    valid = length > 0;
    for (std::size_t k = 1; k < length; ++k) valid = valid && (byte(i + k) & 0xc0) == 0x80;
    // Longer than need be, halves of UTF-16 pairs, beyond the last code point.
    if ((c == 0xe0 && next < 0xa0) || (c == 0xed && next >= 0xa0) || (c == 0xf0 && next < 0x90) || (c == 0xf4 && next >= 0x90)) valid = false;
    i += std::max<std::size_t>(length, 1);
  }
  return valid ? std::string(text) : latin1;
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
