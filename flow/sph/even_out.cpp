#include "flow/sph/even_out.h"

#include <Eigen/Eigenvalues>
#include <algorithm>
#include <cmath>
#include <cstdint>

#include "flow/sph/pressure.h"
#include "geometry/base/check.h"
#include "geometry/base/parallel.h"
#include "geometry/base/zones.h"

namespace effuse::flow::sph {

namespace {
constexpr Real kPace = 40;        // of the strain of a step: share of its way back that a particle goes; 16 leaves a twentieth more of the drag
constexpr Real kMost = 0.3;       // of the way: at 0.5 neighbours that go at once begin to overshoot
constexpr Real kFarthest = 0.1;   // spacings, a step
constexpr Real kInside = 1.3;     // spacings below the free surface
constexpr Real kNearestWall = 0.25;  // spacings: nearer walls shear no harder
constexpr Real kSmall = 0.125;    // spacings: for the kernel's second derivative at 0
constexpr Real kFade = 0.5;       // spacings below kSure: there the correction of the pressure is whole
constexpr Real kSure = 1.5;       // spacings below the free surface: nearer, air takes from the moments
constexpr Real kLeast = 0.2;      // of a moment: what neighbours say less of is left as it is

bool beside_body(const ParticleSystem& s, std::size_t i) {
  const std::span<const Wall> walls = (*s.walls)[i];
  return std::any_of(walls.begin(), walls.end(), gives_way);
}
}  // namespace

std::vector<Mat3> even_pressure_factors(const ParticleSystem& s, std::span<const Real> off) {
  CHECK_EQ(off.size(), s.size());
  if (std::none_of(s.walls->walls.begin(), s.walls->walls.end(), gives_way)) return {};
  std::vector<Mat3> factors(s.size(), Mat3::Zero());
  with_kernel(s, [&](const auto& kernel, auto periodic) {
    parallel_for(s.size(), [&](std::size_t i) {
      const Real inside = std::clamp((off[i] / s.spacing - kSure) / kFade, 0.0, 1.0);
      if (inside == 0 || !beside_body(s, i)) return;
      Mat3 moment = Mat3::Zero();
      for (const Index j : (*s.neighbors)[i]) {
        const Vec3 d = s.template separation<decltype(periodic)::value>(i, j);
        const Real r = d.norm();
        if (r > 0) moment -= s.volume() * kernel.dW(r) / r * d * d.transpose();
      }
      for (const Wall& wall : (*s.walls)[i]) {
        const BoundaryTable::Row row = s.boundary->at(wall);
        moment += row.moment_t * Mat3::Identity() + (row.moment_n - row.moment_t) * wall.normal * wall.normal.transpose();
      }
      const Eigen::SelfAdjointEigenSolver<Mat3> eigen(moment);
      if (eigen.eigenvalues()[0] < kLeast) return;
      factors[i] = inside * (eigen.eigenvectors() * eigen.eigenvalues().cwiseInverse().asDiagonal() * eigen.eigenvectors().transpose() - Mat3::Identity());
    }, 256);
  });
  return factors;
}

void even_pressure(const ParticleSystem& s, std::span<const Real> off, std::span<const Real> q, std::span<Vec3> a) {
  CHECK_EQ(q.size(), s.size());
  CHECK_EQ(a.size(), s.size());
  ZONE("sph.even out");
  const std::vector<Mat3> factors = even_pressure_factors(s, off);
  if (factors.empty()) return;
  // Those that are corrected, and their neighbours, which the pairs push back.
  std::vector<std::uint8_t> pushed(s.size());
  for (std::size_t i = 0; i < s.size(); ++i) {
    if (factors[i].isZero(0)) continue;
    pushed[i] = 1;
    for (const Index j : (*s.neighbors)[i]) pushed[j] = 1;
  }
  with_kernel(s, [&](const auto& kernel, auto periodic) {
    parallel_for(s.size(), [&](std::size_t i) {
      if (!pushed[i]) return;
      Vec3 sum = Vec3::Zero();
      for (const Index j : (*s.neighbors)[i]) {
        const Vec3 d = s.template separation<decltype(periodic)::value>(i, j);
        const Real r = d.norm();
        if (r > 0) sum += (q[i] + q[j]) * s.volume() * kernel.dW(r) / r * ((factors[i] + factors[j]) * d);
      }
      a[i] -= mirrored(s, i) * sum / 2;
    }, 256);
  });
}

void even_out(const ParticleSystem& s, std::span<const Real> off, std::span<const Vec3> v, Real dt, std::span<Vec3> shift) {
  CHECK_EQ(off.size(), s.size());
  CHECK_EQ(v.size(), s.size());
  CHECK_EQ(shift.size(), s.size());
  if (!s.any_gives_way()) return;
  ZONE("sph.even out");
  with_kernel(s, [&](const auto& kernel, auto periodic) {
    const Real V = s.volume(), h = kSmall * s.spacing;
    const Real stiffness = 2 * V * (kernel.W(0) - kernel.W(h)) / (h * h);
    parallel_for(s.size(), [&](std::size_t i) {
      if (s.is_fixed(i) || off[i] < kInside * s.spacing || !beside_body(s, i)) return;
      Vec3 slope = Vec3::Zero();
      Mat3 gradient = Mat3::Zero();
      for (const Index j : (*s.neighbors)[i]) {
        const Vec3 d = s.template separation<decltype(periodic)::value>(i, j);
        const Real r = d.norm();
        if (!(r > 0)) continue;
        const Vec3 change = V * kernel.dW(r) / r * d;
        slope += change;
        gradient += (v[j] - v[i]) * change.transpose();
      }
      for (const Wall& wall : (*s.walls)[i]) {
        const BoundaryTable::Row row = s.boundary->at(wall);
        slope += row.slope * wall.normal;
        gradient += row.moment_n / std::max(wall.distance, kNearestWall * s.spacing) * (v[i] - s.velocity_of(wall)) * wall.normal.transpose();
      }
      const Real strain = dt * (gradient + gradient.transpose()).norm() / std::sqrt(2.0);
      Vec3 way = -std::min(kPace * strain, kMost) / stiffness * (mirrored(s, i) * slope);
      const Real far = way.norm(), farthest = kFarthest * s.spacing;
      if (far > farthest) way *= farthest / far;
      shift[i] += way;
    }, 256);
  });
}

}  // namespace effuse::flow::sph
