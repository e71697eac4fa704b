#include "geometry/base/hash.h"

#include <fmt/format.h>

namespace effuse {

std::string StateHash::hex() const { return fmt::format("{:016x}", hash_); }

}  // namespace effuse
