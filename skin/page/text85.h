#pragma once

#include <string>
#include <string_view>

/// Bytes small, and as text that survives editors, mail and web servers.
namespace effuse::skin {

/// Raw deflate (RFC 1951), as a browser's DecompressionStream("deflate-raw") reads it. The same bytes for the same zlib.
std::string deflate_raw(std::string_view bytes);

/// Four bytes, highest first, as five digits to the base of 85, highest first; the last four are filled up with zeros. Digit d is the character 35 + d, but
/// x, y, z for those that HTML and strings give a meaning: < & and the backslash. A quarter longer than the bytes; base64 is a third.
std::string text85(std::string_view bytes);

}  // namespace effuse::skin
