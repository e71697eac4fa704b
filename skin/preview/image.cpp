#include "geometry/base/check.h"
#include "geometry/base/files.h"
#include "geometry/base/parallel.h"
#include "geometry/base/zones.h"
#include "skin/color/srgb.h"
#include "skin/preview/bloom.h"
#include "skin/preview/preview.h"
#include "skin/write/png.h"

namespace effuse::skin {

void write_png(const std::filesystem::path& file, const Image& image) {
  ZONE("write.png");
  CHECK_GT(image.width, 0);
  CHECK_GT(image.height, 0);
  CHECK_EQ(image.rgb.size(), std::size_t{3} * static_cast<std::size_t>(image.width) * static_cast<std::size_t>(image.height));
  Rgb8Image out{image.width, image.height, std::vector<std::uint8_t>(image.rgb.size())};
  const SrgbEncoder srgb;
  parallel_for(image.rgb.size() / 3, [&](std::size_t i) {
    float rgb[3] = {image.rgb[3 * i], image.rgb[3 * i + 1], image.rgb[3 * i + 2]};
    tone_map(rgb);
    for (std::size_t c = 0; c < 3; ++c) out.rgb[3 * i + c] = srgb(rgb[c]);
  });
  write_file(file, encode_png(out));
}

}  // namespace effuse::skin
