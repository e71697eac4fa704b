#pragma once

#include <array>
#include <cstdint>

#include "geometry/base/types.h"

/// Between linear light and the 8 bits of files and screens (IEC 61966-2-1).
namespace effuse::skin {

/// Exact transfer functions on 0..1; values outside are clamped, NaN is 0.
Real srgb_from_linear(Real linear);
Real linear_from_srgb(Real encoded);

/// linear -> nearest of 256 sRGB steps, as round(255 * srgb_from_linear(x)) but without its pow: a binary search in
/// the 255 borders between steps. Make one and use it for a whole file.
class SrgbEncoder {
 public:
  SrgbEncoder();
  std::uint8_t operator()(float linear) const;

 private:
  std::array<float, 255> border_;  ///< border_[k]: the smallest value that is step k + 1
};

}  // namespace effuse::skin
