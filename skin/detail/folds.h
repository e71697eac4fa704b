#pragma once

#include <cstdint>

#include "skin/detail/material.h"

namespace effuse::skin {

/// Which way a surface is squeezed along itself.
struct Squeeze {
  Vec3 direction = Vec3::UnitX();  ///< unit, tangential: the surface is shortened most along it; its sign means nothing
  /// 0: not squeezed, or alike in all directions .. 1: fully folded. Fades quadratically: the direction may turn where it is 0.
  Real amount = 0;
};

struct SqueezeOptions {
  Real time = 10;    ///< [s] in which the strain rate of the moment folds the surface
  Real slope = 0.2;  ///< squeeze that a slope stands for: lava that stopped was folded across the way down. On a wall; sin^2 on less steep
  Real full = 0.5;   ///< difference of the squeeze along and across from which on folds are fully grown
};

/// Squeeze of the surface at a material sample, out of its plane's tensor
///
///   K = -time E + (C - 1)(C + 1)^-1 + slope g g^T,   all tangential to `outward`
///
/// E: strain rate; C = blend of slope^T slope of the two frames, from which the second term is the squeeze since the frames were
/// born (tanh of Hencky's strain); g: the way down. direction: K's larger eigenvector; amount: of its eigenvalues
/// k1 >= k2, smoothstep(0, full, k1 - k2) smoothstep(-full / 2, full / 2, k1). A function of the moment alone, and of where down is:
/// turned about z with the particles.
Squeeze squeeze_at(const Material::Sample& sample, Real rest_ratio, const SqueezeOptions& options = {});

/// One value of fold noise.
struct FoldSample {
  Real phase = 0;     ///< [rad] 0 on crests, +-pi in valleys; even profiles of it do not know the direction's sign
  Real strength = 0;  ///< 0 where rows of folds end against one another, about 1 elsewhere
};

/// Noise in rows: packets of plane waves at the jittered nodes of a lattice 1.5 wavelengths wide in material coordinates,
///
///   G = sum_k w(|p - p_k|) exp(2 pi i  kappa . (p - p_k)),   w(r) = (1 - r^2 / R^2)^3,  R = 1.5
///
/// so that folds are anchored in the material: waves of a packet are counted from its node, and turning the direction moves them by no
/// more than the turn times R. Phase is arg G, strength grows with |G|.
///   p          material coordinates in wavelengths
///   direction  kappa, unit or shorter, in material coordinates
/// Source: sums of packets with a common phase: Tricard, Efremov, Zanni, Neyret, Martinez & Lefebvre 2019, Procedural phasor noise.
FoldSample fold_noise(const Vec3& p, const Vec3& direction, std::uint64_t seed);

/// Height over the mean of a rope, -1 .. 1, by phase: round tops and narrow valleys. Mean over phase 0; C1, even.
Real rope_profile(Real phase);

}  // namespace effuse::skin
