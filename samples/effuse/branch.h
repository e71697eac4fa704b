#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "flow/scene/node.h"

namespace effuse {

/// A run that is told to go on differently from one of its frames; those before it stay as they are.

/// What differs between two resolved scenes, a line each: "lava.rheology.a: -4.55 -> -3".
/// Throws InputError with every difference that cannot come in the midst of a run, since the state of the frame before was made
/// for it: only [skin], [output], [preview], film.frames and, but for the keys that say what a particle is, [lava] may change.
std::vector<std::string> changes_between(const flow::Node& before, const flow::Node& now);

/// The checkpoint after the frame. Throws InputError that says which frames there are.
std::filesystem::path checkpoint_after(const std::filesystem::path& folder, int frame);

}  // namespace effuse
