#pragma once

#include <string>

#include "geometry/base/error.h"
#include "geometry/base/types.h"

namespace effuse {

/// An UnstableError that knows where, in the run's local frame [m].
class UnstableAt : public UnstableError {
 public:
  UnstableAt(const std::string& message, const Vec3& where) : UnstableError(message), where_(where) {}
  const Vec3& where() const { return where_; }

 private:
  Vec3 where_;
};

}  // namespace effuse
