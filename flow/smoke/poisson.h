#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "geometry/base/types.h"

/// Smoke on a grid.
namespace effuse::flow::smoke {

/// The pressure of an incompressible flow on cubic cells, some of them solid:
///   sum over the open faces of a cell of (p - p beyond) = b,   p = 0 beyond the sides of the grid that are open,
/// in cells' own units (spacing 1). Cell (i, j, k) is number (k ny + j) nx + i. Conjugate gradients, preconditioned with one V-cycle of
/// multigrid: one symmetric red-black Gauss-Seidel sweep a level and side, cells in eights, faces of a coarse cell open by the mean
/// of their four. Its iterations do not grow with the grid: about ten to 1e-4. Where nothing is open b must sum to 0 in each
/// closed room, and p is then right but for a constant in each. The same bits on any number of threads.
/// Sources: Trottenberg, Oosterlee & Schueller 2001, Multigrid; McAdams, Sifakis & Teran 2010, Symp. Computer Animation, 65-74.
class Poisson {
 public:
  /// Sides that are open: low and high x, y, z.
  using Open = std::array<bool, 6>;

  /// solid: one a cell, 1: solid; n: cells along x, y, z, each >= 1 (checked).
  Poisson(const std::array<int, 3>& n, std::span<const std::uint8_t> solid, const Open& open);

  struct Report {
    int iterations = 0;
    Real residual = 0;  ///< of b - A p over b, root of the sum of squares
    bool converged = true;
  };
  /// Improves p until the residual is at most tolerance, or as many iterations are done. p of solid cells stays 0.
  Report solve(std::span<const Real> b, std::span<Real> p, Real tolerance, int most_iterations = 200);

  /// out = A p.
  void apply(std::span<const Real> p, std::span<Real> out) const;
  std::size_t size() const { return levels_.front().diagonal.size(); }
  std::size_t memory() const;

 private:
  struct Level {
    std::array<int, 3> n;
    std::size_t pad = 0;               // zeros before and behind x
    std::vector<Real> diagonal;        // 0: solid
    std::vector<float> to_x, to_y, to_z;  // openness of the face towards the next cell; quarters of quarters, exact in float
    std::vector<float> beyond;         // to open sides
    std::vector<Real> x, b;            // padded x; of the V-cycle
  };
  static Level coarsened(const Level& fine);
  static void finish(Level& level);
  static void sweep(Level& level, int color);
  template <bool kEdge>
  static Real row(const Level& level, std::size_t c);
  void cycle(std::size_t l);

  std::vector<Level> levels_;
  std::vector<Real> r_, z_, d_, q_;
};

}  // namespace effuse::flow::smoke
