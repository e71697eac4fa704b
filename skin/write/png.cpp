#include "skin/write/png.h"

#include <fmt/format.h>
#include <png.h>

#include <limits>
#include <stdexcept>

#include "geometry/base/check.h"
#include "geometry/base/error.h"
#include "geometry/base/files.h"

namespace effuse::skin {

namespace {
/// libpng's simplified interface: no setjmp, errors are a message in the struct.
struct PngImage {
  png_image image{};
  PngImage() { image.version = PNG_IMAGE_VERSION; }
  ~PngImage() { png_image_free(&image); }
  PngImage(const PngImage&) = delete;
  PngImage& operator=(const PngImage&) = delete;
};
}  // namespace

std::string encode_png(const Rgb8Image& image) {
  CHECK_GT(image.width, 0);
  CHECK_GT(image.height, 0);
  CHECK_EQ(image.rgb.size(), std::size_t{3} * static_cast<std::size_t>(image.width) * static_cast<std::size_t>(image.height));
  PngImage png;
  png.image.width = static_cast<png_uint_32>(image.width);
  png.image.height = static_cast<png_uint_32>(image.height);
  png.image.format = PNG_FORMAT_RGB;
  png.image.flags = PNG_IMAGE_FLAG_FAST;

  // A first guess that always holds the file: the pixels, a filter byte a row, and zlib's worst case.
  png_alloc_size_t size = PNG_IMAGE_PNG_SIZE_MAX(png.image);
  std::string bytes(size, '\0');
  if (!png_image_write_to_memory(&png.image, bytes.data(), &size, 0, image.rgb.data(), 0, nullptr))
    throw std::runtime_error(fmt::format("libpng cannot write a picture of {} x {}: {}", image.width, image.height, png.image.message));
  bytes.resize(size);
  return bytes;
}

Rgb8Image decode_png(std::string_view bytes, const std::string& place) {
  PngImage png;
  const auto fail = [&] { throw InputError({place}, fmt::format("not a readable PNG picture: {}", png.image.message)); };
  if (bytes.empty()) throw InputError({place}, "is empty, wanted a PNG picture");
  if (!png_image_begin_read_from_memory(&png.image, bytes.data(), bytes.size())) fail();
  constexpr png_uint_32 kMost = 1 << 15;  // a side; what a damaged header may claim is not allocated
  if (png.image.width > kMost || png.image.height > kMost)
    throw InputError({place}, fmt::format("picture of {} x {}, at most {} a side will do", png.image.width, png.image.height, kMost));
  png.image.format = PNG_FORMAT_RGB;
  Rgb8Image image{static_cast<int>(png.image.width), static_cast<int>(png.image.height), {}};
  image.rgb.resize(std::size_t{3} * png.image.width * png.image.height);
  const png_color black{0, 0, 0};
  if (!png_image_finish_read(&png.image, &black, image.rgb.data(), 0, nullptr)) fail();
  return image;
}

Rgb8Image read_png(const std::filesystem::path& file) { return decode_png(read_file(file), file.string()); }

}  // namespace effuse::skin
