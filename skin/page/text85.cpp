#include "skin/page/text85.h"

#include <zlib.h>

#include <array>
#include <cstdint>
#include <stdexcept>

#include "geometry/base/zones.h"

namespace effuse::skin {

std::string deflate_raw(std::string_view bytes) {
  ZONE("page.deflate");
  z_stream stream{};
  constexpr int kRawWindow = -15, kMemory = 9;
  if (deflateInit2(&stream, Z_BEST_COMPRESSION, Z_DEFLATED, kRawWindow, kMemory, Z_DEFAULT_STRATEGY) != Z_OK) throw std::runtime_error("zlib cannot start");
  std::string out(deflateBound(&stream, static_cast<uLong>(bytes.size())), '\0');
  stream.next_in = reinterpret_cast<Bytef*>(const_cast<char*>(bytes.data()));  // zlib only reads it
  stream.avail_in = static_cast<uInt>(bytes.size());
  stream.next_out = reinterpret_cast<Bytef*>(out.data());
  stream.avail_out = static_cast<uInt>(out.size());
  const int outcome = deflate(&stream, Z_FINISH);
  out.resize(stream.total_out);
  deflateEnd(&stream);
  if (outcome != Z_STREAM_END) throw std::runtime_error("zlib cannot deflate");
  return out;
}

namespace {
constexpr std::array<char, 85> digits_of_85() {
  std::array<char, 85> digits{};
  for (std::size_t d = 0; d < digits.size(); ++d) {
    const char c = static_cast<char>(35 + d);
    digits[d] = c == '<' ? 'x' : c == '&' ? 'y' : c == '\\' ? 'z' : c;
  }
  return digits;
}
constexpr std::array<char, 85> kDigits = digits_of_85();
}  // namespace

std::string text85(std::string_view bytes) {
  std::string text((bytes.size() + 3) / 4 * 5, '\0');
  for (std::size_t word = 0; 4 * word < bytes.size(); ++word) {
    std::uint32_t value = 0;
    for (std::size_t k = 4 * word; k < 4 * word + 4; ++k) value = value << 8 | (k < bytes.size() ? static_cast<std::uint8_t>(bytes[k]) : 0u);
    for (std::size_t k = 5; k-- > 0; value /= 85) text[5 * word + k] = kDigits[value % 85];
  }
  return text;
}

}  // namespace effuse::skin
