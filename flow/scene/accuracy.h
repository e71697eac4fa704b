#pragma once

#include <optional>
#include <span>
#include <string>

#include "flow/scene/parameters.h"

namespace effuse::flow {

/// How right a scene wants its lava to be; what that takes is chosen by samples/budget.
struct AccuracyWish {
  Real front = 0;       ///< wanted error of the front over the film, a share
  std::string quality;  ///< "draft", "normal", "fine"; "": a number was given
  Place place;          ///< of the wish in the scene
};

/// Errors of the front that draft, normal and fine stand for.
std::span<const Real> quality_fronts();
/// The least that may be asked for: below it no spacing helps, for what sums over a fixed number of neighbours leave.
Real least_front_error();

/// The key quality and the table [accuracy] of a scene; nullopt where neither asks for anything. Faults stay in root.
///
///   quality = "draft"        # or "normal", "fine"; instead:
///   accuracy.front = "2 %"
std::optional<AccuracyWish> read_accuracy(Parameters& root);

}  // namespace effuse::flow
