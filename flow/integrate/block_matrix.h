#pragma once

#include <Eigen/SparseCore>
#include <memory>
#include <span>

#include "geometry/base/types.h"

namespace effuse::flow {

/// A symmetric positive definite matrix of 3 x 3 blocks on n points, and its inverse: what a solid's points answer to impulses.
///
/// Solved directly (Cholesky) for up to kMostDirect points, and beyond by conjugate gradients with an incomplete factor, to kResidual: still a
/// linear map to single precision. Of a cube of 1000 points factoring takes 14 ms and solving 0.34 ms, of 2744 146 and 1.9 ms, of 4096 17 and 36 ms
/// (BlockAnswers in tests/flow/sph/pressed_bench.cpp). Eigen. The same bits on any number of threads. One thread at
/// a time.
class BlockMatrix {
 public:
  static constexpr std::size_t kMostDirect = 3000;
  static constexpr Real kResidual = 1e-9;  ///< relative

  BlockMatrix();
  ~BlockMatrix();
  BlockMatrix(BlockMatrix&&) noexcept;
  BlockMatrix& operator=(BlockMatrix&&) noexcept;

  /// factor times a matrix whose lower half is given; all of the diagonal stored. To be factored before it is solved.
  void assign(const Eigen::SparseMatrix<double>& lower, Real factor);
  /// As another times factor, its pattern too.
  void assign(const BlockMatrix& other, Real factor);
  void add_diagonal(Index point, const Mat3& block);
  /// Throws UnstableError where it is not positive definite.
  void factor();

  std::size_t points() const;
  /// out = A in; n each, may not overlap.
  void multiply(std::span<const Vec3> in, std::span<Vec3> out) const;
  /// out = A^-1 in.
  void solve(std::span<const Vec3> in, std::span<Vec3> out) const;
  std::size_t memory() const;

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace effuse::flow
