#pragma once

#include <span>
#include <string>
#include <vector>

#include "geometry/base/error.h"

namespace effuse {

/// Faults of a scene, each mistake told once. A required key that is misspelt makes two of them, one for the key that nobody knows, with the
/// nearest name, one for the name that is missing, or several when it is a table: of these the first stays.
///   effects  names of tables that a scene may have without anybody having read them: a key like one of them is taken for it
std::vector<Fault> told_once(std::vector<Fault> faults, std::span<const std::string> effects);

}  // namespace effuse
