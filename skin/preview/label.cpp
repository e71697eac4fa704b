#include "skin/preview/label.h"

#include <algorithm>
#include <array>

#include "geometry/base/check.h"

namespace effuse::skin {

namespace {

constexpr int kWide = 5, kHigh = 7;

/// Rows from the top, the leftmost block in bit 4. By rising character.
struct Glyph {
  char character;
  std::array<std::uint8_t, kHigh> rows;
};
constexpr std::array<Glyph, 50> kGlyphs = {{
    {' ', {0, 0, 0, 0, 0, 0, 0}},        {'#', {10, 10, 31, 10, 31, 10, 10}}, {'%', {25, 25, 2, 4, 8, 19, 19}},
    {'(', {2, 4, 8, 8, 8, 4, 2}},        {')', {8, 4, 2, 2, 2, 4, 8}},        {'+', {0, 4, 4, 31, 4, 4, 0}},
    {',', {0, 0, 0, 0, 4, 4, 8}},        {'-', {0, 0, 0, 31, 0, 0, 0}},       {'.', {0, 0, 0, 0, 0, 12, 12}},
    {'/', {1, 1, 2, 4, 8, 16, 16}},      {'0', {14, 17, 19, 21, 25, 17, 14}}, {'1', {4, 12, 4, 4, 4, 4, 14}},
    {'2', {14, 17, 1, 6, 8, 16, 31}},    {'3', {14, 17, 1, 6, 1, 17, 14}},    {'4', {2, 6, 10, 18, 31, 2, 2}},
    {'5', {31, 16, 30, 1, 1, 17, 14}},   {'6', {6, 8, 16, 30, 17, 17, 14}},   {'7', {31, 1, 2, 4, 4, 8, 8}},
    {'8', {14, 17, 17, 14, 17, 17, 14}}, {'9', {14, 17, 17, 15, 1, 2, 12}},   {':', {0, 12, 12, 0, 12, 12, 0}},
    {'=', {0, 0, 31, 0, 31, 0, 0}},      {'?', {14, 17, 1, 6, 4, 0, 4}},      {'A', {14, 17, 17, 31, 17, 17, 17}},
    {'B', {30, 17, 17, 30, 17, 17, 30}}, {'C', {15, 16, 16, 16, 16, 16, 15}}, {'D', {30, 17, 17, 17, 17, 17, 30}},
    {'E', {31, 16, 16, 30, 16, 16, 31}}, {'F', {31, 16, 16, 30, 16, 16, 16}}, {'G', {15, 16, 16, 19, 17, 17, 15}},
    {'H', {17, 17, 17, 31, 17, 17, 17}}, {'I', {14, 4, 4, 4, 4, 4, 14}},      {'J', {7, 2, 2, 2, 2, 18, 12}},
    {'K', {17, 18, 20, 24, 20, 18, 17}}, {'L', {16, 16, 16, 16, 16, 16, 31}}, {'M', {17, 27, 21, 21, 17, 17, 17}},
    {'N', {17, 25, 25, 21, 19, 19, 17}}, {'O', {14, 17, 17, 17, 17, 17, 14}}, {'P', {30, 17, 17, 30, 16, 16, 16}},
    {'Q', {14, 17, 17, 17, 21, 18, 13}}, {'R', {30, 17, 17, 30, 20, 18, 17}}, {'S', {15, 16, 16, 14, 1, 1, 30}},
    {'T', {31, 4, 4, 4, 4, 4, 4}},       {'U', {17, 17, 17, 17, 17, 17, 14}}, {'V', {17, 17, 17, 17, 10, 10, 4}},
    {'W', {17, 17, 17, 21, 21, 27, 17}}, {'X', {17, 17, 10, 4, 10, 17, 17}},  {'Y', {17, 17, 10, 4, 4, 4, 4}},
    {'Z', {31, 1, 2, 4, 8, 16, 31}},     {'_', {0, 0, 0, 0, 0, 0, 31}},
}};

const Glyph& glyph_of(char c) {
  if (c >= 'a' && c <= 'z') c = static_cast<char>(c - 'a' + 'A');
  const auto find = [](char wanted) {
    return std::lower_bound(kGlyphs.begin(), kGlyphs.end(), wanted, [](const Glyph& g, char w) { return g.character < w; });
  };
  const auto found = find(c);
  return found != kGlyphs.end() && found->character == c ? *found : *find('?');
}

}  // namespace

void burn_label(Rgb8Image& image, int x, int y, int block, std::string_view text) {
  CHECK_GT(block, 0);
  if (text.empty()) return;
  const int columns = static_cast<int>(std::min<std::size_t>(text.size(), 4096)) * (kWide + 1) + 1, rows = kHigh + 2;
  for (int row = 0; row < rows * block; ++row)
    for (int column = 0; column < columns * block; ++column) {
      const int px = x + column, py = y + row;
      if (px < 0 || py < 0 || px >= image.width || py >= image.height) continue;
      // One block of margin all around; one between characters.
      const int bx = column / block - 1, by = row / block - 1, within = bx % (kWide + 1);
      bool ink = false;
      if (bx >= 0 && by >= 0 && by < kHigh && within < kWide)
        ink = glyph_of(text[static_cast<std::size_t>(bx / (kWide + 1))]).rows[static_cast<std::size_t>(by)] >> (kWide - 1 - within) & 1;
      std::uint8_t* pixel =
          image.rgb.data() + 3 * (static_cast<std::size_t>(py) * static_cast<std::size_t>(image.width) + static_cast<std::size_t>(px));
      for (int k = 0; k < 3; ++k) pixel[k] = static_cast<std::uint8_t>(ink ? 255 : pixel[k] / 3);
    }
}

}  // namespace effuse::skin
