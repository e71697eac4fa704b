#include "skin/write/exr.h"

#include <ImfRgbaFile.h>
#include <gtest/gtest.h>
#include <unistd.h>

#include <filesystem>
#include <limits>

#include "geometry/base/error.h"

namespace effuse::skin {
namespace {

TEST(WriteExr, HoldsLinearLightToAHalfsDigits) {
  const auto file = std::filesystem::temp_directory_path() / ("effuse.exr." + std::to_string(::getpid()) + ".exr");
  Image image{5, 3, {}};
  for (int i = 0; i < 45; ++i) image.rgb.push_back(0.001f * static_cast<float>(i * i * i));
  image.rgb[7] = 1e9f;  // the sun
  write_exr(file, image);
  {
    Imf::RgbaInputFile in(file.string().c_str());
    const Imath::Box2i window = in.dataWindow();
    ASSERT_EQ(window.max.x - window.min.x + 1, 5);
    ASSERT_EQ(window.max.y - window.min.y + 1, 3);
    std::vector<Imf::Rgba> pixels(15);
    in.setFrameBuffer(pixels.data(), 1, 5);
    in.readPixels(0, 2);
    for (int i = 0; i < 15; ++i) {
      const float found[3] = {pixels[i].r, pixels[i].g, pixels[i].b};
      for (int c = 0; c < 3; ++c) {
        const float wanted = std::min(image.rgb[3 * i + c], 65504.0f);
        EXPECT_NEAR(found[c], wanted, 5e-4f * wanted) << i << " " << c;
      }
    }
  }
  std::filesystem::remove(file);
  EXPECT_THROW(write_exr("/proc/none/a.exr", image), std::exception);
}

}  // namespace
}  // namespace effuse::skin
