#pragma once

#include <functional>
#include <string>

#include "samples/budget/machine.h"

namespace effuse {

/// Measures this machine, some ten seconds: three small flows run as `effuse run` would, on a slope (one particle thick), in a heap (many)
/// and of the classic model, with their skins, files and pictures in a folder of the system's for temporary files. What its parts
/// take is scaled from the usual machine's; processor time, but for the speedup of threads, which is the clock's: the best of three.
///   progress  told what is being measured
budget::Machine calibrate(const std::function<void(const std::string& what)>& progress);

}  // namespace effuse
