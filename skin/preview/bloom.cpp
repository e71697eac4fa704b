#include "skin/preview/bloom.h"

#include <cmath>

#include "geometry/base/parallel.h"
#include "geometry/base/zones.h"
#include "skin/preview/light.h"

namespace effuse::skin {

namespace {

struct Plane {
  int width, height;
  std::vector<Vec3f> pixels;
  Vec3f& at(int x, int y) { return pixels[static_cast<std::size_t>(y) * static_cast<std::size_t>(width) + static_cast<std::size_t>(x)]; }
  const Vec3f& at(int x, int y) const { return const_cast<Plane*>(this)->at(x, y); }
};

constexpr int kShrink = 4;
constexpr float kHueKept = 0.25f;

/// What exceeds white, a quarter of the size, by the mean of 4 x 4.
Plane bright_part(const Image& image) {
  Plane plane{(image.width + kShrink - 1) / kShrink, (image.height + kShrink - 1) / kShrink, {}};
  plane.pixels.assign(static_cast<std::size_t>(plane.width) * static_cast<std::size_t>(plane.height), Vec3f::Zero());
  parallel_for(
      static_cast<std::size_t>(plane.height),
      [&](std::size_t row) {
        const int top = static_cast<int>(row) * kShrink;
        for (int x = 0; x < plane.width; ++x) {
          Vec3f sum = Vec3f::Zero();
          for (int j = top; j < std::min(top + kShrink, image.height); ++j)
            for (int i = x * kShrink; i < std::min((x + 1) * kShrink, image.width); ++i) {
              const float* p = image.rgb.data() +
                               3 * (static_cast<std::size_t>(j) * static_cast<std::size_t>(image.width) + static_cast<std::size_t>(i));
              const Vec3f c(p[0], p[1], p[2]);
              const float peak = c.maxCoeff();
              if (peak > 0.8f) sum += c * ((std::min(peak, 12.0f) - 0.8f) / peak);
            }
          plane.at(x, static_cast<int>(row)) = sum / (kShrink * kShrink);
        }
      },
      4);
  return plane;
}

/// Gaussian along x of every row, written transposed: twice is both axes.
Plane blur_transposed(const Plane& in, float sigma) {
  const int radius = std::max(1, static_cast<int>(std::ceil(2.5f * sigma)));
  std::vector<float> weight(static_cast<std::size_t>(radius) + 1);
  float sum = 0;
  for (int k = 0; k <= radius; ++k) {
    weight[static_cast<std::size_t>(k)] = std::exp(-0.5f * static_cast<float>(k * k) / (sigma * sigma));
    sum += (k == 0 ? 1 : 2) * weight[static_cast<std::size_t>(k)];
  }
  for (float& w : weight) w /= sum;
  Plane out{in.height, in.width, std::vector<Vec3f>(in.pixels.size())};
  parallel_for(
      static_cast<std::size_t>(in.height),
      [&](std::size_t row) {
        const int y = static_cast<int>(row);
        for (int x = 0; x < in.width; ++x) {
          Vec3f total = weight[0] * in.at(x, y);
          for (int k = 1; k <= radius; ++k)
            total += weight[static_cast<std::size_t>(k)] * (in.at(std::max(x - k, 0), y) + in.at(std::min(x + k, in.width - 1), y));
          out.at(y, x) = total;
        }
      },
      4);
  return out;
}

}  // namespace

void add_bloom(Image& image, float amount) {
  if (!(amount > 0)) return;
  ZONE("preview.bloom");
  const Plane bright = bright_part(image);
  Plane spill{bright.width, bright.height, std::vector<Vec3f>(bright.pixels.size(), Vec3f::Zero())};
  const float height = static_cast<float>(image.height) / kShrink;
  for (const auto& [size, share] : {std::pair{0.008f, 0.16f}, {0.025f, 0.09f}, {0.07f, 0.06f}}) {
    const Plane blurred = blur_transposed(blur_transposed(bright, std::max(0.5f, size * height)), std::max(0.5f, size * height));
    for (std::size_t k = 0; k < spill.pixels.size(); ++k) spill.pixels[k] += amount * share * blurred.pixels[k];
  }
  // Back to full size, bilinear.
  parallel_for(
      static_cast<std::size_t>(image.height),
      [&](std::size_t row) {
        const float v = std::clamp((static_cast<float>(row) + 0.5f) / kShrink - 0.5f, 0.0f, static_cast<float>(spill.height - 1));
        const int j = std::min(static_cast<int>(v), std::max(spill.height - 2, 0)), j1 = std::min(j + 1, spill.height - 1);
        const float t = v - static_cast<float>(j);
        for (int x = 0; x < image.width; ++x) {
          const float u = std::clamp((static_cast<float>(x) + 0.5f) / kShrink - 0.5f, 0.0f, static_cast<float>(spill.width - 1));
          const int i = std::min(static_cast<int>(u), std::max(spill.width - 2, 0)), i1 = std::min(i + 1, spill.width - 1);
          const float s = u - static_cast<float>(i);
          const Vec3f light = mix(mix(spill.at(i, j), spill.at(i1, j), s), mix(spill.at(i, j1), spill.at(i1, j1), s), t);
          float* p = image.rgb.data() + 3 * (row * static_cast<std::size_t>(image.width) + static_cast<std::size_t>(x));
          for (int c = 0; c < 3; ++c) p[c] += light[c];
        }
      },
      8);
}

void tone_map(float (&rgb)[3]) {
  for (float& x : rgb) x = std::max(0.0f, x);
  // Film's dyes are not pure: green leaks into blue, so that yellow pales as it brightens.
  rgb[2] += 0.05f * std::max(0.0f, rgb[1] - rgb[2] - 0.1f);
  // Rational fit of a film's response (K. Narkowicz 2015, "ACES filmic tone mapping curve").
  const auto film = [](float x) { return std::min(1.0f, x * (2.51f * x + 0.03f) / (x * (2.43f * x + 0.59f) + 0.14f)); };
  // Channel by channel hot rock, which is almost pure red, turns yellow long before it is; with its hue kept it stays red
  // however bright. Photographs lie between.
  const float peak = std::max({rgb[0], rgb[1], rgb[2]});
  if (!(peak > 0)) return;
  const float brightest = film(peak);
  for (float& x : rgb) x = mix(film(x), brightest * (x / peak), kHueKept);
}

}  // namespace effuse::skin
