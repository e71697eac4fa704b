#include "samples/study/skin/jpeg.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <initializer_list>

#include "geometry/base/check.h"
#include "geometry/base/types.h"

namespace effuse::study {

namespace {

using Block = std::array<Real, 64>;
using Table = std::array<int, 64>;

/// Places in a block by rising frequency (T.81 figure A.6).
std::array<std::size_t, 64> make_zigzag() {
  std::array<std::size_t, 64> order;
  std::size_t k = 0;
  for (int sum = 0; sum < 15; ++sum)
    for (int i = 0; i < 8; ++i) {
      const int along = sum % 2 ? i : sum - i, other = sum - along;  // row
      if (along >= 0 && along < 8 && other >= 0 && other < 8) order[k++] = static_cast<std::size_t>(8 * along + other);
    }
  return order;
}

// T.81 tables K.1 and K.2, row by row.
constexpr Table kLuminance = {16, 11, 10, 16, 24, 40, 51, 61, 12, 12, 14, 19, 26, 58, 60, 55, 14, 13, 16, 24, 40, 57,  69,  56,  14, 17, 22, 29, 51,  87,  80, 62,
                              18, 22, 37, 56, 68, 109, 103, 77, 24, 35, 55, 64, 81, 104, 113, 92, 49, 64, 78, 87, 103, 121, 120, 101, 72, 92, 95, 98, 112, 100, 103, 99};
constexpr Table kColour = {17, 18, 24, 47, 99, 99, 99, 99, 18, 21, 26, 66, 99, 99, 99, 99, 24, 26, 56, 99, 99, 99, 99, 99, 47, 66, 99, 99, 99, 99, 99, 99,
                           99, 99, 99, 99, 99, 99, 99, 99, 99, 99, 99, 99, 99, 99, 99, 99, 99, 99, 99, 99, 99, 99, 99, 99, 99, 99, 99, 99, 99, 99, 99, 99};

Table scaled(const Table& table, int quality) {
  const int scale = quality < 50 ? 5000 / quality : 200 - 2 * quality;
  Table out;
  std::transform(table.begin(), table.end(), out.begin(), [&](int q) { return std::clamp((q * scale + 50) / 100, 1, 255); });
  return out;
}

/// A Huffman table: how many codes of each length from 1 to 16, and their symbols (T.81 annex C).
struct Codes {
  std::array<std::uint8_t, 16> count;
  std::string symbols;
  std::array<std::uint32_t, 256> code{};
  std::array<int, 256> length{};
  Codes(const std::array<std::uint8_t, 16>& counts, std::string all) : count(counts), symbols(std::move(all)) {
    std::uint32_t next = 0;
    std::size_t at = 0;
    for (int bits = 1; bits <= 16; ++bits, next <<= 1)
      for (int k = 0; k < count[static_cast<std::size_t>(bits - 1)]; ++k) {
        const auto symbol = static_cast<std::uint8_t>(symbols[at++]);
        code[symbol] = next++;
        length[symbol] = bits;
      }
    CHECK_EQ(at, symbols.size());
  }
};

std::string bytes_of(std::initializer_list<int> values) {
  std::string s;
  for (const int v : values) s += static_cast<char>(v);
  return s;
}

/// One pair of tables serves both luminance and colour: T.81 tables K.3 and K.5. Tables of our own for colour would save a hundredth.
const Codes& levels() {
  static const Codes codes({0, 1, 5, 1, 1, 1, 1, 1, 1, 0, 0, 0, 0, 0, 0, 0}, bytes_of({0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11}));
  return codes;
}
const Codes& waves() {
  static const Codes codes(
      {0, 2, 1, 3, 3, 2, 4, 3, 5, 5, 4, 4, 0, 0, 1, 125},
      bytes_of({0x01, 0x02, 0x03, 0x00, 0x04, 0x11, 0x05, 0x12, 0x21, 0x31, 0x41, 0x06, 0x13, 0x51, 0x61, 0x07, 0x22, 0x71, 0x14, 0x32, 0x81, 0x91, 0xa1, 0x08,
                0x23, 0x42, 0xb1, 0xc1, 0x15, 0x52, 0xd1, 0xf0, 0x24, 0x33, 0x62, 0x72, 0x82, 0x09, 0x0a, 0x16, 0x17, 0x18, 0x19, 0x1a, 0x25, 0x26, 0x27, 0x28,
                0x29, 0x2a, 0x34, 0x35, 0x36, 0x37, 0x38, 0x39, 0x3a, 0x43, 0x44, 0x45, 0x46, 0x47, 0x48, 0x49, 0x4a, 0x53, 0x54, 0x55, 0x56, 0x57, 0x58, 0x59,
                0x5a, 0x63, 0x64, 0x65, 0x66, 0x67, 0x68, 0x69, 0x6a, 0x73, 0x74, 0x75, 0x76, 0x77, 0x78, 0x79, 0x7a, 0x83, 0x84, 0x85, 0x86, 0x87, 0x88, 0x89,
                0x8a, 0x92, 0x93, 0x94, 0x95, 0x96, 0x97, 0x98, 0x99, 0x9a, 0xa2, 0xa3, 0xa4, 0xa5, 0xa6, 0xa7, 0xa8, 0xa9, 0xaa, 0xb2, 0xb3, 0xb4, 0xb5, 0xb6,
                0xb7, 0xb8, 0xb9, 0xba, 0xc2, 0xc3, 0xc4, 0xc5, 0xc6, 0xc7, 0xc8, 0xc9, 0xca, 0xd2, 0xd3, 0xd4, 0xd5, 0xd6, 0xd7, 0xd8, 0xd9, 0xda, 0xe1, 0xe2,
                0xe3, 0xe4, 0xe5, 0xe6, 0xe7, 0xe8, 0xe9, 0xea, 0xf1, 0xf2, 0xf3, 0xf4, 0xf5, 0xf6, 0xf7, 0xf8, 0xf9, 0xfa}));
  return codes;
}

/// Bits, highest first, in bytes; a zero follows each 0xff, as the specification asks.
class Bits {
 public:
  void put(std::uint32_t value, int count) {
    while (count-- > 0) {
      byte_ = byte_ << 1 | (value >> count & 1);
      if (++filled_ < 8) continue;
      bytes_ += static_cast<char>(byte_);
      if (byte_ == 0xff) bytes_ += '\0';
      byte_ = 0;
      filled_ = 0;
    }
  }
  void put(const Codes& codes, int symbol) { put(codes.code[static_cast<std::size_t>(symbol)], codes.length[static_cast<std::size_t>(symbol)]); }
  std::string finish() {
    while (filled_ != 0) put(1, 1);
    return std::move(bytes_);
  }

 private:
  std::string bytes_;
  std::uint32_t byte_ = 0;
  int filled_ = 0;
};

/// The cosine transform (T.81 A.3.3), quantised and in order of frequency.
class Transform {
 public:
  explicit Transform(const Table& quantiser) : quantiser_(quantiser), zigzag_(make_zigzag()) {
    for (std::size_t u = 0; u < 8; ++u)
      for (std::size_t x = 0; x < 8; ++x) cosine_[u][x] = 0.5 * (u == 0 ? std::sqrt(0.5) : 1) * std::cos((2 * static_cast<Real>(x) + 1) * static_cast<Real>(u) * kPi / 16);
  }
  std::array<int, 64> operator()(const Block& samples) const {
    Block rows, both;
    for (std::size_t y = 0; y < 8; ++y)
      for (std::size_t u = 0; u < 8; ++u) {
        Real sum = 0;
        for (std::size_t x = 0; x < 8; ++x) sum += cosine_[u][x] * samples[8 * y + x];
        rows[8 * y + u] = sum;
      }
    for (std::size_t v = 0; v < 8; ++v)
      for (std::size_t u = 0; u < 8; ++u) {
        Real sum = 0;
        for (std::size_t y = 0; y < 8; ++y) sum += cosine_[v][y] * rows[8 * y + u];
        both[8 * v + u] = sum;
      }
    std::array<int, 64> out;
    for (std::size_t k = 0; k < 64; ++k) out[k] = static_cast<int>(std::lround(both[zigzag_[k]] / quantiser_[zigzag_[k]]));
    return out;
  }

 private:
  Table quantiser_;
  std::array<std::size_t, 64> zigzag_;
  std::array<std::array<Real, 8>, 8> cosine_;
};

/// A number's size class, and its bits: as it is, or one less for negative ones (T.81 F.1.2.1).
void put_number(Bits& bits, const Codes& codes, int zeros, int value) {
  int size = 0;
  while (std::abs(value) >> size) ++size;
  bits.put(codes, 16 * zeros + size);
  const int code = value < 0 ? value - 1 : value;
  bits.put(static_cast<std::uint32_t>(code) & ((1u << size) - 1), size);
}

void put_block(Bits& bits, const std::array<int, 64>& values, int& level) {
  put_number(bits, levels(), 0, values[0] - level);
  level = values[0];
  int zeros = 0;
  for (std::size_t k = 1; k < 64; ++k) {
    if (values[k] == 0) {
      ++zeros;
      continue;
    }
    for (; zeros > 15; zeros -= 16) bits.put(waves(), 0xf0);
    put_number(bits, waves(), zeros, values[k]);
    zeros = 0;
  }
  if (zeros > 0) bits.put(waves(), 0);
}

std::string segment(int marker, const std::string& body) {
  const std::size_t length = body.size() + 2;
  return bytes_of({0xff, marker, static_cast<int>(length >> 8), static_cast<int>(length & 255)}) + body;
}

std::string quantiser_segment(int number, const Table& table) {
  std::string body = bytes_of({number});
  for (const std::size_t k : make_zigzag()) body += static_cast<char>(table[k]);
  return segment(0xdb, body);
}

std::string codes_segment(int number, const Codes& codes) {
  std::string body = bytes_of({number});
  for (const std::uint8_t count : codes.count) body += static_cast<char>(count);
  return segment(0xc4, body + codes.symbols);
}

}  // namespace

std::string encode_jpeg(const skin::Rgb8Image& image, int quality) {
  CHECK(quality >= 1 && quality <= 100);
  CHECK(image.width >= 1 && image.height >= 1 && image.width <= 65535 && image.height <= 65535);
  CHECK_EQ(image.rgb.size(), std::size_t{3} * static_cast<std::size_t>(image.width) * static_cast<std::size_t>(image.height));
  const Table luminance = scaled(kLuminance, quality), colour = scaled(kColour, quality);
  const Transform of_luminance(luminance), of_colour(colour);

  // Y, Cb, Cr about zero; beyond the border its last pixels go on.
  const auto ycc = [&](int x, int y) {
    const std::uint8_t* p = image.rgb.data() + 3 * (static_cast<std::size_t>(std::min(y, image.height - 1)) * static_cast<std::size_t>(image.width) +
                                                    static_cast<std::size_t>(std::min(x, image.width - 1)));
    const Real r = p[0], g = p[1], b = p[2];
    return Vec3(0.299 * r + 0.587 * g + 0.114 * b - 128, -0.168736 * r - 0.331264 * g + 0.5 * b, 0.5 * r - 0.418688 * g - 0.081312 * b);
  };

  Bits bits;
  int level[3] = {0, 0, 0};
  for (int y0 = 0; y0 < image.height; y0 += 16)
    for (int x0 = 0; x0 < image.width; x0 += 16) {
      // Four blocks of luminance, one of each colour at half the resolution.
      std::array<Block, 4> light{};
      Block blue{}, red{};
      for (int y = 0; y < 16; ++y)
        for (int x = 0; x < 16; ++x) {
          const Vec3 c = ycc(x0 + x, y0 + y);
          light[static_cast<std::size_t>(2 * (y / 8) + x / 8)][static_cast<std::size_t>(8 * (y % 8) + x % 8)] = c.x();
          const auto half = static_cast<std::size_t>(8 * (y / 2) + x / 2);
          blue[half] += c.y() / 4;
          red[half] += c.z() / 4;
        }
      for (const Block& block : light) put_block(bits, of_luminance(block), level[0]);
      put_block(bits, of_colour(blue), level[1]);
      put_block(bits, of_colour(red), level[2]);
    }

  const auto high = [](int v) { return v >> 8; };
  const auto low = [](int v) { return v & 255; };
  std::string file = bytes_of({0xff, 0xd8});
  file += segment(0xe0, bytes_of({'J', 'F', 'I', 'F', 0, 1, 1, 0, 0, 1, 0, 1, 0, 0}));
  file += quantiser_segment(0, luminance) + quantiser_segment(1, colour);
  file += segment(0xc0, bytes_of({8, high(image.height), low(image.height), high(image.width), low(image.width), 3, 1, 0x22, 0, 2, 0x11, 1, 3, 0x11, 1}));
  file += codes_segment(0x00, levels()) + codes_segment(0x10, waves());
  file += segment(0xda, bytes_of({3, 1, 0, 2, 0, 3, 0, 0, 63, 0}));
  return file + bits.finish() + bytes_of({0xff, 0xd9});
}

}  // namespace effuse::study
