#pragma once

#include <cstdint>
#include <filesystem>
#include <string>
#include <string_view>

/// What every reader of files asks first, and how it quotes what it found.
namespace effuse::importers {

/// The bytes of a file somebody named. Throws InputError when it is missing, a folder, a device, not
/// readable, empty, or larger than limit bytes (what: "a scene", for that message).
std::string read_input(const std::filesystem::path& file, std::uint64_t limit, std::string_view what);

/// The same questions without reading: for files that a package opens itself. Throws as read_input does.
void check_input(const std::filesystem::path& file, std::uint64_t limit, std::string_view what);

/// Map coordinates and extents beyond this are no place on a planet, smaller extents no thing to see: a wrong byte order, a wrong unit,
/// noise that happens to be numbers [m].
inline constexpr double kFarthest = 1e9, kFinest = 1e-6;

/// "'12,5'": a piece of a file in quotes, cut to 40 characters, what cannot be printed as '?'.
std::string quote(std::string_view text);

/// The same without quotes and up to 200 characters: messages of packages, which may quote binary files.
std::string printable(std::string_view text, std::size_t limit = 200);

/// The text if it is UTF-8, else read as Latin-1 and turned into UTF-8: old files name places with accents.
std::string utf8(std::string_view text);

/// ASCII lower case.
std::string lower(std::string_view text);

/// ".asc" for "a/B.ASC".
std::string lower_extension(const std::filesystem::path& file);

/// The one number text holds, in C's notation: digits, point, exponent, sign; also nan and inf.
/// false when it is anything else, has something after it, or is too large for a double.
bool parse_number(std::string_view text, double& value);

}  // namespace effuse::importers
