#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "flow/sph/particle_system.h"
#include "flow/sph/simd.h"

namespace effuse::flow::sph {

/// PairKernels' products for pressure in single precision, eight neighbours at once, 16 bytes a neighbour:
///
///   gradient      V sum (q_i + q_j) F d             of the q that set() put beside the positions
///   divergence    V sum F (v_ij . d)
///   compliance    V sum F d,  sum q_j (V F r)^2
///
/// Positions are whole numbers of 2^-22 supports, modulo 2^32 (of a periodic axis: 2^-32 periods), so separations are
/// exact wherever the particles are, take the nearest image by themselves, and change sign to the last bit. Error of a
/// sum: 1e-6 of its terms' sizes, from positions and rounding alike. What is to be kept to the last bit of a double,
/// momentum above all, is PairKernels' work.
///
/// The same bits with every Simd, and on any number of threads. Thread-safe after build, but for set() of one particle.
class FloatPairs {
 public:
  struct alignas(16) Packed {
    std::int32_t x, y, z;
    float q;
  };
  struct alignas(16) Vector {
    float x, y, z, unused;
  };

  /// Packs the system's positions, q = 0, and keeps its lists, which must not change while this is used. Periods of at
  /// least two supports.
  void build(const ParticleSystem& system, Simd simd = best_simd());
  void set(std::size_t i, float q) { packed_.data()[i].q = q; }

  /// Each call does the particles [begin, end); arrays of n.
  void gradient(std::size_t begin, std::size_t end, std::span<Vector> out) const;
  void divergence(std::size_t begin, std::size_t end, std::span<const Vector> v, std::span<float> out) const;
  void compliance(std::size_t begin, std::size_t end, std::span<Vector> slope, std::span<float> squares) const;

  std::size_t size() const { return packed_.size(); }
  std::size_t memory() const { return packed_.capacity() * sizeof(Packed); }

  /// What a loop over lanes needs to know, in plain types.
  struct View {
    const Packed* packed;
    const Neighbors* neighbors;
    float scale_x, scale_y, scale_z;  // supports in a unit
    float factor;
    KernelKind kernel;
  };
  struct Lanes;

 private:
  std::vector<Packed> packed_;
  View view_{};
  const Lanes* lanes_ = nullptr;
};

}  // namespace effuse::flow::sph
