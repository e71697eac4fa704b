#include "skin/detail/folds.h"

#include <algorithm>
#include <cmath>

#include "geometry/base/random.h"
#include "skin/detail/blend.h"

namespace effuse::skin {

Squeeze squeeze_at(const Material::Sample& sample, Real rest_ratio, const SqueezeOptions& o) {
  Squeeze squeeze;
  const Real length = sample.outward.norm();
  if (!sample.any || !(length > 0)) return squeeze;
  const Vec3 n = sample.outward / length;
  // A basis of the tangent plane; which one does not matter.
  const Vec3 a = n.unitOrthogonal();
  Eigen::Matrix<Real, 3, 2> tangent;
  tangent << a, n.cross(a);
  using Mat2 = Eigen::Matrix<Real, 2, 2>;

  Mat2 C = Mat2::Zero();
  for (int f = 0; f < 2; ++f) {
    const Real share = f == 0 ? 1 - rest_ratio : rest_ratio;
    const Eigen::Matrix<Real, 3, 2> A = sample.slope[f] * tangent;
    C += share * A.transpose() * A;
  }
  const Mat2 one = Mat2::Identity();
  const Mat2 since = (C - one) * (C + one).inverse();  // C commutes with itself: symmetric
  const Eigen::Matrix<Real, 2, 1> down = -tangent.row(2).transpose();
  const Mat2 K = -o.time * (tangent.transpose() * sample.strain_rate * tangent) + since + o.slope * down * down.transpose();

  const Real mean = (K(0, 0) + K(1, 1)) / 2, p = (K(0, 0) - K(1, 1)) / 2, q = (K(0, 1) + K(1, 0)) / 2;
  const Real half = std::hypot(p, q);
  if (half > 0) {
    const Real angle = std::atan2(q, p) / 2;
    squeeze.direction = tangent.col(0) * std::cos(angle) + tangent.col(1) * std::sin(angle);
  }
  squeeze.amount = smoothstep(0, o.full, 2 * half) * smoothstep(-o.full / 2, o.full / 2, mean + half);
  return squeeze;
}

FoldSample fold_noise(const Vec3& p, const Vec3& direction, std::uint64_t seed) {
  constexpr Real kCell = 1.5;  // [wavelengths]; the packets' radius too, so that 27 nodes serve
  if (!(p.cwiseAbs().maxCoeff() < 0x1.0p50)) return {};
  const Vec3 base(std::floor(p.x() / kCell), std::floor(p.y() / kCell), std::floor(p.z() / kCell));
  Real re = 0, im = 0;
  for (int i = -1; i <= 1; ++i)
    for (int j = -1; j <= 1; ++j)
      for (int k = -1; k <= 1; ++k) {
        const Vec3 cell = base + Vec3(i, j, k);
        const std::uint64_t row = static_cast<std::uint64_t>(static_cast<std::int64_t>(cell.y())) * 0x9e3779b97f4a7c15ULL +
                                  static_cast<std::uint64_t>(static_cast<std::int64_t>(cell.z()));
        const std::uint64_t bits = random_bits(seed, row, static_cast<std::uint64_t>(static_cast<std::int64_t>(cell.x())));
        const auto part = [&](int shift) { return static_cast<Real>(bits >> shift & 0x1fffff) * 0x1.0p-21; };
        const Vec3 d = p - kCell * (cell + Vec3(part(0), part(21), part(42)));
        const Real t = 1 - d.squaredNorm() / (kCell * kCell);
        if (t <= 0) continue;
        const Real w = t * t * t, phase = 2 * kPi * direction.dot(d);
        re += w * std::cos(phase);
        im += w * std::sin(phase);
      }
  // |G| is about 0.5 in the mean; where it is small the phase turns about a point.
  const Real squared = re * re + im * im;
  return {std::atan2(im, re), squared / (squared + 0.05)};
}

Real rope_profile(Real phase) {
  // sqrt(r + cos^2(phase / 2)), made -1 at the bottom of valleys, then freed of its mean (measured, see the test).
  constexpr Real kRound = 0.06, kMean = 0.15796;
  const Real low = std::sqrt(kRound), high = std::sqrt(1 + kRound);
  const Real c = 0.5 * (1 + std::cos(phase));
  return 2 * (std::sqrt(kRound + c) - low) / (high - low) - 1 - kMean;
}

}  // namespace effuse::skin
