#include "skin/color/srgb.h"

#include <algorithm>
#include <cmath>

namespace effuse::skin {

Real srgb_from_linear(Real linear) {
  if (!(linear > 0)) return 0;
  if (linear >= 1) return 1;
  return linear <= 0.0031308 ? 12.92 * linear : 1.055 * std::pow(linear, 1 / 2.4) - 0.055;
}

Real linear_from_srgb(Real encoded) {
  if (!(encoded > 0)) return 0;
  if (encoded >= 1) return 1;
  return encoded <= 0.04045 ? encoded / 12.92 : std::pow((encoded + 0.055) / 1.055, 2.4);
}

SrgbEncoder::SrgbEncoder() {
  for (std::size_t k = 0; k < border_.size(); ++k) border_[k] = static_cast<float>(linear_from_srgb((static_cast<Real>(k) + 0.5) / 255));
}

std::uint8_t SrgbEncoder::operator()(float linear) const {
  if (!(linear > 0)) return 0;
  return static_cast<std::uint8_t>(std::upper_bound(border_.begin(), border_.end(), linear) - border_.begin());
}

}  // namespace effuse::skin
