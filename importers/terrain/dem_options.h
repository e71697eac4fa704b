#pragma once

#include <cstdint>
#include <limits>
#include <string>
#include <vector>

#include "geometry/base/types.h"
#include "importers/read_apart.h"

namespace effuse::importers {

/// How heights between posts are found when a raster's posts cannot stay where they are.
enum class Resampling {
  kAuto,      ///< bilinear; average where the new posts are more than one and a half times as far apart as the old
  kNearest,   ///< of the nearest post
  kBilinear,  ///< of the four around
  kCubic,     ///< Catmull-Rom through the sixteen around: smoother, may overshoot
  kAverage,   ///< mean of the bilinear surface over a square of the new spacing
};

/// What becomes of posts without data.
enum class HolePolicy {
  kHole,   ///< left as holes: no ground, flows that reach them leave the domain
  kFill,   ///< a smooth surface spanned over them from their rims (fill_holes.h)
  kError,  ///< refused
};

/// What becomes of closed depressions.
enum class PitPolicy {
  kKeep,
  kFill,    ///< filled up to where they overflow
  kBreach,  ///< drained by a notch along the lowest way out
};

/// How a DEM becomes ground. Everything empty: as the files say, in metres.
struct DemOptions {
  std::string crs;       ///< system to work in, in metres; empty: the file's, or the UTM zone when that is in degrees
  std::string file_crs;  ///< what the files' coordinates are in, where they do not say or say it wrong
  std::vector<Real> crop;  ///< west, south, east, north in the system worked in; of a file in degrees, degrees do too; empty: all
  Real spacing = 0;        ///< of the posts [m]; 0: the file's
  Resampling resampling = Resampling::kAuto;
  std::string vertical_unit;  ///< of the files' heights: "m", "ft", "us-ft", "cm", ...; empty: as the files say, or metres
  HolePolicy holes = HolePolicy::kHole;
  PitPolicy pits = PitPolicy::kKeep;
  Real pit_depth = std::numeric_limits<Real>::infinity();  ///< deeper depressions are kept [m]: craters
  std::vector<Real> size;   ///< of an image's ground, first post to last, east-west and north-south [m]; empty: as the file says
  std::vector<Real> range;  ///< heights of an image's darkest and brightest value [m]; empty: values are heights
  std::uint64_t max_posts = 50'000'000;  ///< more are refused: a header may promise anything
  ReadLimits limits;       ///< of reading and placing; where no bytes are given, room for max_posts is added
};

}  // namespace effuse::importers
