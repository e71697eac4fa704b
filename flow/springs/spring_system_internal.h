#pragma once

#include <vector>

#include "flow/integrate/block_newton.h"
#include "flow/springs/spring_system.h"

namespace effuse::flow::springs {

/// A spring as one of its ends sees it.
struct HalfSpring {
  Index other, material;
  Real rest;
};

/// What the implicit step keeps between steps. Made at the first.
struct ImplicitSolve {
  BlockNewton newton;
  std::vector<Vec3> start, target;
  std::vector<Vec3> direction;  // of the springs, at the step's start
  BlockNewton::Report report;
};

struct SpringSystem::Impl {
  const SpringNetwork* network = nullptr;
  std::vector<std::size_t> first;  // of each point's half springs; one more
  std::vector<HalfSpring> half;
  std::unique_ptr<ImplicitSolve> implicit;
  Real mean_rest = 0;

  /// Where the implicit step begins, and would end without springs.
  ImplicitSolve& begin(const Surroundings& around, Real dt, const SpringState& y);
};

}  // namespace effuse::flow::springs
