#include "geometry/procedural/noise.h"

#include <cmath>

#include "geometry/base/check.h"
#include "geometry/base/random.h"

namespace effuse::geometry {

namespace {

Vec3 lattice_gradient(std::int64_t i, std::int64_t j, std::int64_t k, std::uint64_t seed) {
  const int* d = kLatticeDirections[lattice_direction(i, j, k, seed)];
  return {static_cast<Real>(d[0]), static_cast<Real>(d[1]), static_cast<Real>(d[2])};
}

Real fade(Real t) { return t * t * t * (t * (t * 6 - 15) + 10); }
Real fade_slope(Real t) { return 30 * t * t * (t * (t - 2) + 1); }

}  // namespace

NoiseSample gradient_noise_sample(const Vec3& p, std::uint64_t seed) {
  constexpr Real kNoFraction = 0x1.0p52;
  if (!(p.cwiseAbs().maxCoeff() < kNoFraction)) return {};
  const Vec3 base(std::floor(p.x()), std::floor(p.y()), std::floor(p.z()));
  const Vec3 f = p - base;
  const auto i = static_cast<std::int64_t>(base.x()), j = static_cast<std::int64_t>(base.y()), k = static_cast<std::int64_t>(base.z());
  const Real weight[3][2] = {{1 - fade(f.x()), fade(f.x())}, {1 - fade(f.y()), fade(f.y())}, {1 - fade(f.z()), fade(f.z())}};
  const Vec3 slope(fade_slope(f.x()), fade_slope(f.y()), fade_slope(f.z()));

  // sum over corners of weight * ramp, and its derivative by the product rule.
  NoiseSample sample;
  for (int c = 0; c < 8; ++c) {
    const int a = c & 1, b = c >> 1 & 1, d = c >> 2;
    const Vec3 g = lattice_gradient(i + a, j + b, k + d, seed);
    const Real ramp = g.dot(f - Vec3(a, b, d));
    const Real wx = weight[0][a], wy = weight[1][b], wz = weight[2][d];
    sample.value += wx * wy * wz * ramp;
    sample.gradient += wx * wy * wz * g;
    sample.gradient += ramp * Vec3((a ? 1 : -1) * slope.x() * wy * wz, (b ? 1 : -1) * slope.y() * wx * wz, (d ? 1 : -1) * slope.z() * wx * wy);
  }
  return sample;
}

Real gradient_noise(const Vec3& p, std::uint64_t seed) { return gradient_noise_sample(p, seed).value; }

NoiseSample fractal_noise(const Vec3& p, std::uint64_t seed, const FractalOptions& options) {
  CHECK_GE(options.octaves, 1);
  CHECK_GT(options.lacunarity, 0);
  CHECK_GT(options.gain, 0);
  CHECK_GT(options.wavelength, 0);
  NoiseSample sum;
  Real amplitude = 1, total = 0, frequency = 1 / options.wavelength;
  for (int octave = 0; octave < options.octaves; ++octave) {
    const auto stream = static_cast<std::uint64_t>(octave);
    const Vec3 shift(random_uniform(seed, stream, 0), random_uniform(seed, stream, 1), random_uniform(seed, stream, 2));
    const NoiseSample part = gradient_noise_sample(frequency * p + shift, random_bits(seed, stream, 3));
    sum.value += amplitude * part.value;
    sum.gradient += amplitude * frequency * part.gradient;
    total += amplitude;
    amplitude *= options.gain;
    frequency *= options.lacunarity;
  }
  sum.value /= total;
  sum.gradient /= total;
  return sum;
}

}  // namespace effuse::geometry
