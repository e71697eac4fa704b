#pragma once

#include <memory>
#include <span>
#include <utility>
#include <vector>

#include "flow/integrate/block_matrix.h"
#include "geometry/base/types.h"

namespace effuse::flow {

/// Newton's method for an energy of n points in space, with a Hessian of 3 x 3 blocks whose pattern does not change. What implicit
/// Euler of springs and of finite elements comes down to (each step minimises an energy of its own: Martin et al. 2011).
///
/// Each move is shortened until the energy falls (Armijo), so that a step ends no higher than it began, however long. Moves are
/// solved for directly (Cholesky) for up to kMostDirect points and by conjugate gradients with an incomplete Cholesky factor beyond,
/// there only as far as the nearness of the minimum deserves. Eigen. The same bits on any number of threads.
class BlockNewton {
 public:
  static constexpr std::size_t kMostDirect = 600;  ///< there both ways of solving take as long

  /// couplings: pairs of different points whose block is not 0; each block (a, b) with a < b once or more.
  BlockNewton(std::size_t points, std::span<const std::pair<Index, Index>> couplings);
  ~BlockNewton();
  BlockNewton(BlockNewton&&) noexcept;

  /// Gradient and lower half of the Hessian, added up block by block.
  class Sink {
   public:
    void gradient(Index point, const Vec3& g);
    void diagonal(Index point, const Mat3& h);
    /// Block (a, b) of the c-th coupling, row a, column b, as given to the constructor.
    void coupling(std::size_t c, const Mat3& h);

   private:
    friend class BlockNewton;
    explicit Sink(BlockNewton& owner) : owner_(owner) {}
    BlockNewton& owner_;
  };

  struct Options {
    int max_iterations = 50;
    Real tolerance = 1e-10;  ///< [m] of the last move's largest component
  };
  struct Report {
    int iterations = 0;
    bool converged = true;  ///< or the energy's own rounding was reached
  };
  /// Moves x to the minimum. value(x) gives the energy, derivatives(x, sink) fills the sink, which comes empty; the Hessian must
  /// be positive definite (points that are held: identity and no gradient).
  template <class Value, class Derivatives>
  Report minimise(std::vector<Vec3>& x, Value&& value, Derivatives&& derivatives, const Options& options) {
    Report report{0, false};
    Real now = value(x), first_steepness = 0;
    for (; report.iterations < options.max_iterations && !report.converged; ++report.iterations) {
      clear();
      Sink sink(*this);
      derivatives(x, sink);
      const Move move = solve(first_steepness);
      if (!move.usable) break;
      // Below its own rounding the energy cannot tell a better point: the last move is taken as it is.
      report.converged = move.largest <= options.tolerance || -move.slope <= kRounding * std::abs(now);
      Real share = 1, tried = now;
      int halving = 0;
      for (; halving < kHalvings; ++halving, share /= 2) {
        tried = value(moved(x, share));
        if (report.converged || tried <= now + kSufficient * share * move.slope) break;
      }
      if (halving == kHalvings) break;
      take(x);
      now = tried;
    }
    return report;
  }

  /// Gradient and Hessian at x alone: Hessian into `hessian`, times factor and factored.
  template <class Derivatives>
  std::vector<Vec3> linearise(const std::vector<Vec3>& x, Derivatives&& derivatives, Real factor, BlockMatrix& hessian) {
    clear();
    Sink sink(*this);
    derivatives(x, sink);
    return hand_over(factor, hessian);
  }

  std::size_t memory() const;

 private:
  static constexpr Real kSufficient = 1e-4;  // share of the decrease the slope promises
  static constexpr Real kRounding = 1e-14;   // of the energy, relative
  static constexpr int kHalvings = 40;
  struct Move {
    bool usable;
    Real largest, slope;
  };
  void clear();
  Move solve(Real& first_steepness);
  const std::vector<Vec3>& moved(const std::vector<Vec3>& x, Real share);
  void take(std::vector<Vec3>& x);
  std::vector<Vec3> hand_over(Real factor, BlockMatrix& hessian) const;

  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace effuse::flow
