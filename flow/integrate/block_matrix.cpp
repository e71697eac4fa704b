#include "flow/integrate/block_matrix.h"

#include <Eigen/IterativeLinearSolvers>
#include <Eigen/SparseCholesky>
#include <algorithm>

#include "geometry/base/check.h"
#include "geometry/base/error.h"

namespace effuse::flow {

namespace {
using Matrix = Eigen::SparseMatrix<double>;
using Column = Eigen::Map<const Eigen::VectorXd>;

static_assert(sizeof(Vec3) == 3 * sizeof(double));
Column column(std::span<const Vec3> x) { return {reinterpret_cast<const double*>(x.data()), static_cast<Eigen::Index>(3 * x.size())}; }
Eigen::Map<Eigen::VectorXd> column(std::span<Vec3> x) { return {reinterpret_cast<double*>(x.data()), static_cast<Eigen::Index>(3 * x.size())}; }
}  // namespace

struct BlockMatrix::Impl {
  Matrix lower;
  Eigen::SimplicialLLT<Matrix> direct;
  Eigen::ConjugateGradient<Matrix, Eigen::Lower, Eigen::IncompleteCholesky<double, Eigen::Lower, Eigen::NaturalOrdering<int>>> iterate;
  bool analysed = false;  // direct knows the pattern

  /// True: the pattern stayed.
  bool take_pattern(const Matrix& from) {
    const auto same = [](const int* a, const int* b, Eigen::Index n) { return std::equal(a, a + n, b); };
    if (lower.rows() == from.rows() && lower.nonZeros() == from.nonZeros() && same(lower.outerIndexPtr(), from.outerIndexPtr(), from.rows() + 1) &&
        same(lower.innerIndexPtr(), from.innerIndexPtr(), from.nonZeros()))
      return true;
    analysed = false;
    lower = from;
    return false;
  }
};

BlockMatrix::BlockMatrix() : impl_(std::make_unique<Impl>()) {}
BlockMatrix::~BlockMatrix() = default;
BlockMatrix::BlockMatrix(BlockMatrix&&) noexcept = default;
BlockMatrix& BlockMatrix::operator=(BlockMatrix&&) noexcept = default;

void BlockMatrix::assign(const Matrix& lower, Real factor) {
  CHECK(lower.isCompressed() && lower.rows() == lower.cols() && lower.rows() % 3 == 0);
  impl_->take_pattern(lower);
  std::transform(lower.valuePtr(), lower.valuePtr() + lower.nonZeros(), impl_->lower.valuePtr(), [factor](double v) { return factor * v; });
}

void BlockMatrix::assign(const BlockMatrix& other, Real factor) { assign(other.impl_->lower, factor); }

void BlockMatrix::add_diagonal(Index point, const Mat3& block) {
  Matrix& m = impl_->lower;
  for (int c = 0; c < 3; ++c) {
    const int first = static_cast<int>(3 * point) + c;
    const int* begin = m.innerIndexPtr() + m.outerIndexPtr()[first];
    const int* end = m.innerIndexPtr() + m.outerIndexPtr()[first + 1];
    // A diagonal block's column is stored without a gap.
    double* value = m.valuePtr() + (std::lower_bound(begin, end, first) - m.innerIndexPtr());
    for (int r = c; r < 3; ++r) value[r - c] += block(r, c);
  }
}

void BlockMatrix::factor() {
  Impl& s = *impl_;
  if (points() > kMostDirect) {
    s.iterate.setTolerance(kResidual);
    s.iterate.compute(s.lower);
    if (s.iterate.info() != Eigen::Success) throw UnstableError("a solid's matrix is not positive definite");
    return;
  }
  if (!s.analysed) s.direct.analyzePattern(s.lower);
  s.analysed = true;
  s.direct.factorize(s.lower);
  if (s.direct.info() != Eigen::Success) throw UnstableError("a solid's matrix is not positive definite");
}

std::size_t BlockMatrix::points() const { return static_cast<std::size_t>(impl_->lower.rows()) / 3; }

void BlockMatrix::multiply(std::span<const Vec3> in, std::span<Vec3> out) const {
  CHECK_EQ(in.size(), points());
  CHECK_EQ(out.size(), points());
  column(out) = impl_->lower.selfadjointView<Eigen::Lower>() * column(in);
}

void BlockMatrix::solve(std::span<const Vec3> in, std::span<Vec3> out) const {
  CHECK_EQ(in.size(), points());
  CHECK_EQ(out.size(), points());
  if (points() <= kMostDirect) column(out) = impl_->direct.solve(column(in));
  else column(out) = impl_->iterate.solve(column(in));
}

std::size_t BlockMatrix::memory() const {
  std::size_t bytes = static_cast<std::size_t>(impl_->lower.nonZeros()) * 12;
  if (impl_->analysed) bytes += static_cast<std::size_t>(impl_->direct.matrixL().nestedExpression().nonZeros()) * 12;
  return bytes;
}

}  // namespace effuse::flow
