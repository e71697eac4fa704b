#pragma once

#include <Eigen/IterativeLinearSolvers>
#include <Eigen/SparseCholesky>
#include <array>
#include <vector>

#include "flow/springs/spring_system.h"

namespace effuse::flow::springs {

/// A spring as one of its ends sees it.
struct HalfSpring {
  Index other, material;
  Real rest;
};

/// The implicit step's Hessian, lower half, and where each block lies in it. Made at the first implicit step.
struct ImplicitSolve {
  using Matrix = Eigen::SparseMatrix<double>;
  Matrix hessian;
  Eigen::SimplicialLLT<Matrix> factor;  // of small networks; lattices fill in too much beyond
  Eigen::ConjugateGradient<Matrix, Eigen::Lower, Eigen::IncompleteCholesky<double, Eigen::Lower, Eigen::NaturalOrdering<int>>> iterate;
  bool direct = true;
  std::vector<std::array<int, 3>> point_slot;   // first stored value of each column of a diagonal block
  std::vector<std::array<int, 3>> spring_slot;  // of the block of a spring's two points
  Eigen::VectorXd gradient, move;
  std::vector<Vec3> start, target, trial;
  std::vector<Vec3> direction;  // of the springs, at the step's start
  ImplicitReport report;
};

struct SpringSystem::Impl {
  const SpringNetwork* network = nullptr;
  std::vector<std::size_t> first;  // of each point's half springs; one more
  std::vector<HalfSpring> half;
  std::unique_ptr<ImplicitSolve> implicit;
  Real mean_rest = 0;
};

}  // namespace effuse::flow::springs
