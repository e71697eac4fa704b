#pragma once

#include <cstdint>

namespace effuse {

/// Memory that this process can still get without pushing others out [bytes]: what the machine has available, and no more than its control
/// group leaves it (a container, a batch job). 0: not known.
std::uint64_t available_memory();

}  // namespace effuse
