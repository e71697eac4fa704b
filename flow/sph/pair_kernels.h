#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "flow/sph/particle_system.h"
#include "flow/sph/simd.h"

namespace effuse::flow::sph {

/// The products over pairs that the implicit solvers repeat, on positions packed for that: eight neighbours at once.
/// With  d = x_i - x_j,  r = |d|,  F = (dW/dr)/r,  V the particles' volume, w ViscousWeight, j over i's neighbours:
///
///   density       V sum W,  V sum F d        (W(0) of i itself is not in it)  [1], [1/m]; slopes: as divergence's out
///   viscous       V sum mu_ij w (v_ij . d) d,   mu_ij = 2 mu_i mu_j / (mu_i + mu_j)
///   viscous_block V sum mu_ij w d d^T                                         its diagonal blocks; out: of [begin, end) only
///   friction_power V sum mu_ij w (v_ij . d)^2                                 [W/m^3], twice what i has of it
///   velocity_gradient  V sum F (v_j - v_i) d^T,  -V sum F d d^T               [1/s], [1]; out: of [begin, end) only
///   divergence    V sum F (v_ij . d)                                          [1/s] of v [m/s]; out: of all, or of [begin, end) only
///   gradient      V sum (q_i + q_j) F d                                       [.../m] of q; the same
///   compliance    V sum F d,  sum weight_j (V F r)^2                          the pressure matrix's diagonal
///
/// Double throughout. What i takes from j is to the last bit what j takes from i, with the sign turned: the operators
/// are symmetric and momentum is kept to the rounding of the sums.
///
/// Each call does the particles [begin, end): loops over ranges are the caller's, who has more to do with each. The
/// same bits with every Simd: sums are over eight lanes, then ((0+4)+(2+6))+((1+5)+(3+7)), nothing is fused.
/// Arrays of n, where nothing else is said. Thread-safe after build and set_viscosity.
class PairKernels {
 public:
  /// Packs the system's positions and keeps its lists, which must not change while this is used. simd: one that the
  /// processor has (checked). Periods of at least two supports. Any positions that ColumnGrid takes.
  void build(const ParticleSystem& system, Simd simd = best_simd());
  /// mu [Pa s] n, each > 0, none below 1e-30 of the largest (checked).
  void set_viscosity(std::span<const Real> mu);

  void density(std::size_t begin, std::size_t end, std::span<Real> sum, std::span<Vec3> slope) const;
  void viscous(std::size_t begin, std::size_t end, std::span<const Vec3> v, std::span<Vec3> out) const;
  void viscous_block(std::size_t begin, std::size_t end, std::span<Mat3> out) const;
  void friction_power(std::size_t begin, std::size_t end, std::span<const Vec3> v, std::span<Real> out) const;
  void velocity_gradient(std::size_t begin, std::size_t end, std::span<const Vec3> v, std::span<Mat3> gradient, std::span<Mat3> moment) const;
  void divergence(std::size_t begin, std::size_t end, std::span<const Vec3> v, std::span<Real> out) const;
  void gradient(std::size_t begin, std::size_t end, std::span<const Real> q, std::span<Vec3> out) const;

  void compliance(std::size_t begin, std::size_t end, std::span<const Real> weight, std::span<Vec3> slope, std::span<Real> squares) const;

  std::size_t size() const { return packed_.size(); }
  std::size_t memory() const;

  /// A particle as the lanes read it.
  struct alignas(32) Packed {
    double x, y, z;    // over the support
    double stiffness;  // largest mu over its own
  };
  /// What a loop over lanes needs to know, in plain types.
  struct View {
    const Packed* packed;
    const Neighbors* neighbors;
    double period_x, period_y;  // over the support
    KernelKind kernel;
  };
  struct Lanes;

 private:
  void check(std::size_t begin, std::size_t end, std::size_t in, std::size_t out) const;

  std::vector<Packed> packed_;
  View view_{};
  const Lanes* lanes_ = nullptr;
  Real volume_ = 0, support_ = 0, height_ = 0, slope_ = 0, stiffness_ = 0;
};

/// The system's own kernels, or ones built here.
class PairsOf {
 public:
  explicit PairsOf(const ParticleSystem& system) : pairs_(system.pairs != nullptr ? system.pairs : &own_) {
    if (system.pairs == nullptr) own_.build(system);
  }
  PairsOf(const PairsOf&) = delete;
  PairsOf& operator=(const PairsOf&) = delete;
  PairKernels* operator->() const { return pairs_; }
  PairKernels* get() const { return pairs_; }

 private:
  PairKernels own_;
  PairKernels* pairs_;
};

}  // namespace effuse::flow::sph
