#include <algorithm>
#include <array>

#include "geometry/base/check.h"
#include "geometry/base/error.h"
#include "geometry/base/files.h"
#include "geometry/base/parallel.h"
#include "geometry/base/zones.h"
#include "skin/color/srgb.h"
#include "skin/preview/label.h"
#include "skin/preview/preview.h"
#include "skin/write/png.h"

namespace effuse::skin {

namespace {

constexpr int kWidest = 480, kGap = 6, kLabelBlock = 2;

/// Linear light of each of the 256 steps: pixels are averaged as light, not as codes.
std::array<float, 256> linear_table() {
  std::array<float, 256> table;
  for (std::size_t k = 0; k < table.size(); ++k) table[k] = static_cast<float>(linear_from_srgb(static_cast<Real>(k) / 255));
  return table;
}

/// Smaller by a box filter whose boxes need not be whole pixels. width <= image.width, height <= image.height, both > 0.
Rgb8Image shrink(const Rgb8Image& image, int width, int height) {
  const std::array<float, 256> linear = linear_table();
  const SrgbEncoder srgb;
  Rgb8Image out{width, height,
                std::vector<std::uint8_t>(std::size_t{3} * static_cast<std::size_t>(width) * static_cast<std::size_t>(height))};
  const Real step_x = static_cast<Real>(image.width) / width, step_y = static_cast<Real>(image.height) / height;
  parallel_for(
      static_cast<std::size_t>(height),
      [&](std::size_t row) {
        const Real y0 = static_cast<Real>(row) * step_y, y1 = std::min(y0 + step_y, static_cast<Real>(image.height));
        for (int column = 0; column < width; ++column) {
          const Real x0 = column * step_x, x1 = std::min(x0 + step_x, static_cast<Real>(image.width));
          Real sum[3] = {0, 0, 0}, area = 0;
          for (int j = static_cast<int>(y0); j < image.height && j < y1; ++j)
            for (int i = static_cast<int>(x0); i < image.width && i < x1; ++i) {
              const Real share = (std::min(x1, i + 1.0) - std::max(x0, static_cast<Real>(i))) *
                                 (std::min(y1, j + 1.0) - std::max(y0, static_cast<Real>(j)));
              const std::uint8_t* p = image.rgb.data() + 3 * (static_cast<std::size_t>(j) * static_cast<std::size_t>(image.width) +
                                                              static_cast<std::size_t>(i));
              for (int k = 0; k < 3; ++k) sum[k] += share * static_cast<Real>(linear[p[k]]);
              area += share;
            }
          std::uint8_t* to = out.rgb.data() + 3 * (row * static_cast<std::size_t>(width) + static_cast<std::size_t>(column));
          for (int k = 0; k < 3; ++k) to[k] = srgb(static_cast<float>(sum[k] / area));
        }
      },
      8);
  return out;
}

}  // namespace

void write_contact_sheet(const std::filesystem::path& file, const std::vector<std::filesystem::path>& pictures,
                         const std::vector<std::string>& labels, int columns) {
  ZONE("write.contact_sheet");
  CHECK_EQ(labels.size(), pictures.size());
  CHECK_GT(columns, 0);
  if (pictures.empty()) throw InputError({file.string()}, "a contact sheet of no pictures, wanted one at least");
  columns = std::min(columns, static_cast<int>(pictures.size()));
  const int rows = (static_cast<int>(pictures.size()) + columns - 1) / columns;

  // Cells as wide as the narrowest picture allows, as high as the tallest then is.
  std::vector<Rgb8Image> images;
  int width = kWidest, height = 1;
  for (const std::filesystem::path& picture : pictures) {
    images.push_back(read_png(picture));
    width = std::min(width, images.back().width);
  }
  for (std::size_t k = 0; k < images.size(); ++k) {
    Rgb8Image& image = images[k];
    if (image.width > width)
      image = shrink(image, width, std::max(1, static_cast<int>(static_cast<Real>(image.height) * width / image.width + 0.5)));
    burn_label(image, 0, 0, kLabelBlock, labels[k]);
    height = std::max(height, image.height);
  }

  Rgb8Image sheet{columns * (width + kGap) + kGap, rows * (height + kGap) + kGap, {}};
  sheet.rgb.assign(std::size_t{3} * static_cast<std::size_t>(sheet.width) * static_cast<std::size_t>(sheet.height), 18);
  for (std::size_t k = 0; k < images.size(); ++k) {
    const Rgb8Image& image = images[k];
    const int x = kGap + static_cast<int>(k) % columns * (width + kGap), y = kGap + static_cast<int>(k) / columns * (height + kGap);
    for (int row = 0; row < image.height; ++row)
      std::copy_n(
          image.rgb.data() + std::size_t{3} * static_cast<std::size_t>(row) * static_cast<std::size_t>(image.width), 3 * image.width,
          sheet.rgb.data() + 3 * (static_cast<std::size_t>(y + row) * static_cast<std::size_t>(sheet.width) + static_cast<std::size_t>(x)));
  }
  write_file(file, encode_png(sheet));
}

}  // namespace effuse::skin
