#include "flow/scene/accuracy.h"

#include <fmt/format.h>

#include <iterator>
#include <vector>

namespace effuse::flow {

namespace {
constexpr Real kFronts[] = {0.08, 0.025, 0.02};
constexpr const char* kNames[] = {"none", "draft", "normal", "fine"};
constexpr Real kLeast = 0.015;
}  // namespace

std::span<const Real> quality_fronts() { return kFronts; }
Real least_front_error() { return kLeast; }

std::optional<AccuracyWish> read_accuracy(Parameters& root) {
  const std::vector<std::string> names(std::begin(kNames), std::end(kNames));
  const std::size_t quality = root.choice("quality", names, 0, "how right lava is to be, its front's error over the film: draft about 8 %, normal 2.5 %, fine 2 %; chooses the spacing, step, tolerances and voxels that the scene leaves open. none: nothing is chosen");
  Parameters table = root.table("accuracy", "how right lava is to be, by a number");
  const Real front = table.number("front", "", 0, {0, 0.5}, "wanted error of the lava's front, 1.5 % and more: of the distance from the nearest vent within which all but half a per cent of it lies, root mean square over the film; 0: nothing is chosen");
  if (quality > 0 && front > 0) table.fault("front", "the scene has a quality, too, wanted one of the two");
  if (front > 0 && front < kLeast) table.fault("front", fmt::format("{:.3g} % is less than any spacing gets to, wanted {:.3g} % or more", 100 * front, 100 * kLeast));
  if (quality > 0) return AccuracyWish{kFronts[quality - 1], names[quality], root.place("quality")};
  if (front > 0) return AccuracyWish{front, "", table.place("front")};
  return std::nullopt;
}

}  // namespace effuse::flow
