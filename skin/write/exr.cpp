#include "skin/write/exr.h"

#include <ImfIO.h>
#include <ImfRgba.h>
#include <ImfRgbaFile.h>

#include <algorithm>
#include <cstring>
#include <vector>

#include "geometry/base/check.h"
#include "geometry/base/files.h"
#include "geometry/base/zones.h"

namespace effuse::skin {

namespace {

class Bytes : public Imf::OStream {
 public:
  Bytes() : Imf::OStream("memory") {}
  void write(const char* from, int n) override {
    bytes_.resize(std::max(bytes_.size(), at_ + static_cast<std::size_t>(n)));
    std::memcpy(bytes_.data() + at_, from, static_cast<std::size_t>(n));
    at_ += static_cast<std::size_t>(n);
  }
  std::uint64_t tellp() override { return at_; }
  void seekp(std::uint64_t at) override { at_ = at; }
  const std::string& text() const { return bytes_; }

 private:
  std::string bytes_;
  std::size_t at_ = 0;
};

}  // namespace

void write_exr(const std::filesystem::path& file, const Image& image) {
  ZONE("write.exr");
  CHECK(image.width > 0 && image.height > 0);
  const std::size_t n = static_cast<std::size_t>(image.width) * static_cast<std::size_t>(image.height);
  CHECK_EQ(image.rgb.size(), 3 * n);
  std::vector<Imf::Rgba> pixels(n);
  const auto half_of = [](float light) { return half(std::min(light, 65504.0f)); };
  for (std::size_t i = 0; i < n; ++i) pixels[i] = Imf::Rgba(half_of(image.rgb[3 * i]), half_of(image.rgb[3 * i + 1]), half_of(image.rgb[3 * i + 2]), half(1.0f));
  Bytes out;
  {
    Imf::RgbaOutputFile exr(out, Imf::Header(image.width, image.height, 1, Imath::V2f(0, 0), 1, Imf::INCREASING_Y, Imf::ZIP_COMPRESSION), Imf::WRITE_RGB, 0);
    exr.setFrameBuffer(pixels.data(), 1, static_cast<std::size_t>(image.width));
    exr.writePixels(image.height);
  }
  write_file(file, out.text());
}

}  // namespace effuse::skin
