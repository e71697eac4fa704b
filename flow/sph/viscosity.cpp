#include "flow/sph/viscosity.h"

#include <algorithm>
#include <cmath>

#include "flow/sph/pair_kernels.h"
#include "geometry/base/check.h"
#include "geometry/base/parallel.h"
#include "geometry/base/zones.h"

namespace effuse::flow::sph {

namespace {

constexpr std::size_t kGrain = 256;    // particles a thread takes at a time
constexpr Real kNearest = 0.25;        // of the spacing: nearer walls drag no harder

/// Drag of one wall on v - wall.velocity, divided by -nu: (t, n) coefficients along the wall and across it.
struct WallDrag {
  Real along, across;
};
WallDrag wall_drag(const BoundaryTable& table, const Wall& wall, Real slip_length, Real spacing) {
  const Real d = std::max(wall.distance, kNearest * spacing);
  const BoundaryTable::Row row = table.at(d);
  return {wall.friction * row.drag_t / (d + slip_length), row.drag_n / d};
}

/// The walls' drag on i at velocity v [N/m^3]; walls at rest for the second.
Vec3 walls_drag(const ParticleSystem& s, Real mu, Real slip_length, const Vec3& v, std::size_t i, bool moving = true) {
  Vec3 sum = Vec3::Zero();
  for (const Wall& wall : (*s.walls)[i]) {
    const WallDrag drag = wall_drag(*s.boundary, wall, slip_length, s.spacing);
    const Vec3 dv = moving ? Vec3(v - wall.velocity) : v;
    const Vec3 across = dv.dot(wall.normal) * wall.normal;
    sum += mu * (drag.along * (dv - across) + drag.across * across);
  }
  return sum;
}
Vec3 still_walls_drag(const ParticleSystem& s, Real mu, Real slip_length, const Vec3& v, std::size_t i) { return walls_drag(s, mu, slip_length, v, i, false); }

}  // namespace

Real wall_dissipation(const ParticleSystem& s, Real mu, Real slip_length, const Vec3& v, std::size_t i) {
  Real sum = 0;
  for (const Wall& wall : (*s.walls)[i]) {
    const WallDrag drag = wall_drag(*s.boundary, wall, slip_length, s.spacing);
    const Vec3 dv = v - wall.velocity;
    const Real across = dv.dot(wall.normal);
    sum += mu * (drag.along * (dv.squaredNorm() - across * across) + drag.across * across * across);
  }
  return sum;
}

void viscous_acceleration(const ParticleSystem& s, Real density, std::span<const Real> mu, Real slip_length, std::span<const Vec3> v, std::span<Vec3> out) {
  CHECK_EQ(mu.size(), s.size());
  CHECK_EQ(v.size(), s.size());
  CHECK_EQ(out.size(), s.size());
  const PairsOf pairs(s);
  pairs->set_viscosity(mu);
  parallel_ranges(s.size(), kGrain, [&](std::size_t begin, std::size_t end) {
    pairs->viscous(begin, end, v, out);
    for (std::size_t i = begin; i < end; ++i) out[i] = -(out[i] + walls_drag(s, mu[i], slip_length, v[i], i)) / density;
  });
}

ViscosityResult ViscositySolver::solve(const ParticleSystem& s, Real density, std::span<const Real> mu, Real slip_length, Real dt, std::span<const Vec3> v0, Real tolerance,
                                       int max_iterations, std::span<Vec3> v) {
  ZONE("sph.viscosity");
  const std::size_t n = s.size();
  CHECK_EQ(mu.size(), n);
  CHECK_EQ(v0.size(), n);
  CHECK_EQ(v.size(), n);
  r_.resize(n);
  z_.resize(n);
  p_.resize(n);
  Ap_.resize(n);
  inverse_.resize(n);
  const Real factor = dt / density;
  const PairsOf pairs(s);
  pairs->set_viscosity(mu);
  ViscosityResult result;

  // Diagonal blocks, and the right-hand side: what moving walls drag along is known.
  parallel_ranges(n, kGrain, [&](std::size_t begin, std::size_t end) {
    Mat3 block[kGrain];
    pairs->viscous_block(begin, end, std::span(block, end - begin));
    for (std::size_t i = begin; i < end; ++i) {
      Mat3 sum = Mat3::Identity() + factor * block[i - begin];
      r_[i] = v0[i];
      for (const Wall& wall : (*s.walls)[i]) {
        const WallDrag drag = wall_drag(*s.boundary, wall, slip_length, s.spacing);
        const Mat3 across = wall.normal * wall.normal.transpose();
        const Mat3 matrix = factor * mu[i] * (drag.along * (Mat3::Identity() - across) + drag.across * across);
        sum += matrix;
        r_[i] += matrix * wall.velocity;
      }
      inverse_[i] = sum.inverse();
    }
  });
  const auto multiply = [&](std::span<const Vec3> in, std::span<Vec3> out) {
    parallel_ranges(n, kGrain, [&](std::size_t begin, std::size_t end) {
      pairs->viscous(begin, end, in, out);
      for (std::size_t i = begin; i < end; ++i) {
        if (s.is_fixed(i)) out[i].setZero();
        else out[i] = in[i] + factor * (out[i] + still_walls_drag(s, mu[i], slip_length, in[i], i));
      }
    });
  };
  const auto dot = [&](const std::vector<Vec3>& a, const std::vector<Vec3>& b) {
    return parallel_sum(n, 0.0, [&](std::size_t i) { return a[i].dot(b[i]); });
  };

  // The norm of the right-hand side counts; of fixed particles nothing is asked.
  const Real b2 = parallel_sum(n, 0.0, [&](std::size_t i) { return s.is_fixed(i) ? 0.0 : r_[i].dot(inverse_[i] * r_[i]); });
  multiply(v, Ap_);
  parallel_for(n, [&](std::size_t i) {
    r_[i] = s.is_fixed(i) ? Vec3(Vec3::Zero()) : Vec3(r_[i] - Ap_[i]);
    z_[i] = inverse_[i] * r_[i];
    p_[i] = z_[i];
  }, 2048);
  Real rz = dot(r_, z_);
  const Real goal = tolerance * tolerance * b2;
  while (rz > goal && result.iterations < max_iterations) {
    multiply(p_, Ap_);
    const Real pAp = dot(p_, Ap_);
    if (!(pAp > 0)) break;  // not a number, or rounding has the last word
    const Real alpha = rz / pAp;
    parallel_for(n, [&](std::size_t i) {
      v[i] += alpha * p_[i];
      r_[i] -= alpha * Ap_[i];
      z_[i] = inverse_[i] * r_[i];
    }, 2048);
    const Real next = dot(r_, z_);
    const Real beta = next / rz;
    rz = next;
    parallel_for(n, [&](std::size_t i) { p_[i] = z_[i] + beta * p_[i]; }, 2048);
    ++result.iterations;
  }
  result.residual = b2 > 0 ? std::sqrt(std::max(rz, 0.0) / b2) : 0;
  result.converged = rz <= goal;
  COUNT("sph.viscosity iterations", result.iterations);
  return result;
}

std::size_t ViscositySolver::memory() const {
  return (r_.capacity() + z_.capacity() + p_.capacity() + Ap_.capacity()) * sizeof(Vec3) + inverse_.capacity() * sizeof(Mat3);
}

}  // namespace effuse::flow::sph
