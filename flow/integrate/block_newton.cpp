#include "flow/integrate/block_newton.h"

#include <Eigen/IterativeLinearSolvers>
#include <Eigen/SparseCholesky>
#include <algorithm>
#include <array>
#include <cmath>

#include "geometry/base/check.h"

namespace effuse::flow {

namespace {
constexpr Real kLeastForcing = 1e-9;  // of conjugate gradients: relative residual
using Matrix = Eigen::SparseMatrix<double>;
}  // namespace

struct BlockNewton::Impl {
  std::size_t points = 0;
  Matrix hessian;  // lower half
  Eigen::SimplicialLLT<Matrix> factor;
  Eigen::ConjugateGradient<Matrix, Eigen::Lower, Eigen::IncompleteCholesky<double, Eigen::Lower, Eigen::NaturalOrdering<int>>> iterate;
  std::vector<std::array<int, 3>> point_slot;     // first stored value of each column of a diagonal block
  std::vector<std::array<int, 3>> coupling_slot;  // of a block below the diagonal
  std::vector<std::uint8_t> turned;               // the coupling's block lies above the diagonal: its transpose is stored
  Eigen::VectorXd gradient, move;
  std::vector<Vec3> trial;
};

BlockNewton::BlockNewton(std::size_t points, std::span<const std::pair<Index, Index>> couplings) : impl_(std::make_unique<Impl>()) {
  Impl& s = *impl_;
  s.points = points;
  const auto size = static_cast<Eigen::Index>(3 * points);
  std::vector<Eigen::Triplet<double>> entries;
  entries.reserve(6 * points + 9 * couplings.size());
  const auto block = [&](Index row, Index column) {
    for (int c = 0; c < 3; ++c)
      for (int r = row == column ? c : 0; r < 3; ++r) entries.emplace_back(static_cast<int>(3 * row) + r, static_cast<int>(3 * column) + c, 0.0);
  };
  for (std::size_t i = 0; i < points; ++i) block(static_cast<Index>(i), static_cast<Index>(i));
  for (const auto& [a, b] : couplings) {
    CHECK_NE(a, b);
    block(std::max(a, b), std::min(a, b));
  }
  s.hessian.resize(size, size);
  s.hessian.setFromTriplets(entries.begin(), entries.end());
  s.hessian.makeCompressed();
  const auto slot = [&](std::size_t row, std::size_t column) {
    const int* begin = s.hessian.innerIndexPtr() + s.hessian.outerIndexPtr()[column];
    const int* end = s.hessian.innerIndexPtr() + s.hessian.outerIndexPtr()[column + 1];
    return static_cast<int>(std::lower_bound(begin, end, static_cast<int>(row)) - s.hessian.innerIndexPtr());
  };
  s.point_slot.resize(points);
  for (std::size_t i = 0; i < points; ++i)
    for (std::size_t c = 0; c < 3; ++c) s.point_slot[i][c] = slot(3 * i + c, 3 * i + c);
  s.coupling_slot.resize(couplings.size());
  s.turned.resize(couplings.size());
  for (std::size_t k = 0; k < couplings.size(); ++k) {
    const std::size_t row = std::max(couplings[k].first, couplings[k].second), column = std::min(couplings[k].first, couplings[k].second);
    s.turned[k] = couplings[k].first < couplings[k].second;
    for (std::size_t c = 0; c < 3; ++c) s.coupling_slot[k][c] = slot(3 * row, 3 * column + c);
  }
  if (points <= kMostDirect) s.factor.analyzePattern(s.hessian);
  s.gradient.resize(size);
}

BlockNewton::~BlockNewton() = default;
BlockNewton::BlockNewton(BlockNewton&&) noexcept = default;

void BlockNewton::Sink::gradient(Index point, const Vec3& g) { owner_.impl_->gradient.segment<3>(static_cast<Eigen::Index>(3 * std::size_t{point})) += g; }

void BlockNewton::Sink::diagonal(Index point, const Mat3& h) {
  double* values = owner_.impl_->hessian.valuePtr();
  for (int c = 0; c < 3; ++c)
    for (int r = c; r < 3; ++r) values[owner_.impl_->point_slot[point][static_cast<std::size_t>(c)] + r - c] += h(r, c);
}

void BlockNewton::Sink::coupling(std::size_t k, const Mat3& h) {
  double* values = owner_.impl_->hessian.valuePtr();
  const bool turned = owner_.impl_->turned[k];
  for (int c = 0; c < 3; ++c)
    for (int r = 0; r < 3; ++r) values[owner_.impl_->coupling_slot[k][static_cast<std::size_t>(c)] + r] += turned ? h(c, r) : h(r, c);
}

void BlockNewton::clear() {
  std::fill(impl_->hessian.valuePtr(), impl_->hessian.valuePtr() + impl_->hessian.nonZeros(), 0.0);
  impl_->gradient.setZero();
}

BlockNewton::Move BlockNewton::solve(Real& first_steepness) {
  Impl& s = *impl_;
  const Real steepness = s.gradient.norm();
  if (first_steepness == 0) first_steepness = steepness;
  if (steepness == 0) {
    s.move.setZero(s.gradient.size());
    return {true, 0, 0};
  }
  if (s.points <= kMostDirect) {
    s.factor.factorize(s.hessian);
    if (s.factor.info() != Eigen::Success) return {false, 0, 0};
    s.move = s.factor.solve(-s.gradient);
  } else {
    s.iterate.setTolerance(std::clamp(steepness / first_steepness / 10, kLeastForcing, 0.1));
    s.iterate.compute(s.hessian);
    if (s.iterate.info() != Eigen::Success) return {false, 0, 0};
    s.move = s.iterate.solve(-s.gradient);  // cut off early, it is a way down all the same
  }
  const Real largest = s.move.lpNorm<Eigen::Infinity>();
  return {std::isfinite(largest), largest, s.gradient.dot(s.move)};
}

const std::vector<Vec3>& BlockNewton::moved(const std::vector<Vec3>& x, Real share) {
  impl_->trial.resize(x.size());
  for (std::size_t i = 0; i < x.size(); ++i) impl_->trial[i] = x[i] + share * impl_->move.segment<3>(static_cast<Eigen::Index>(3 * i));
  return impl_->trial;
}

void BlockNewton::take(std::vector<Vec3>& x) { x.swap(impl_->trial); }

std::vector<Vec3> BlockNewton::hand_over(Real factor, BlockMatrix& hessian) const {
  hessian.assign(impl_->hessian, factor);
  hessian.factor();
  std::vector<Vec3> gradient(impl_->points);
  for (std::size_t i = 0; i < gradient.size(); ++i) gradient[i] = impl_->gradient.segment<3>(static_cast<Eigen::Index>(3 * i));
  return gradient;
}

std::size_t BlockNewton::memory() const {
  std::size_t bytes = static_cast<std::size_t>(impl_->hessian.nonZeros()) * 12 + (impl_->point_slot.capacity() + impl_->coupling_slot.capacity()) * 12 + impl_->points * 72;
  if (impl_->points <= kMostDirect) bytes += static_cast<std::size_t>(impl_->factor.matrixL().nestedExpression().nonZeros()) * 12;
  return bytes;
}

}  // namespace effuse::flow
