#include "flow/sph/pressure.h"

#include <Eigen/QR>
#include <algorithm>
#include <cmath>
#include <limits>

#include "flow/sph/pair_kernels.h"
#include "geometry/base/check.h"
#include "geometry/base/parallel.h"
#include "geometry/base/zones.h"

namespace effuse::flow::sph {

namespace {

constexpr std::size_t kGrain = 256;  // particles a thread takes at a time
constexpr Real kExpansion = 0.5;  // step down the scaled gradient; stable below 2 / |A scaled|, which is about 3


/// D v; walls at rest when kMoving is false.
template <bool kMoving>
void compress(const ParticleSystem& s, const PairKernels& pairs, std::span<const Vec3> v, std::span<Real> out) {
  parallel_ranges(s.size(), kGrain, [&](std::size_t begin, std::size_t end) {
    pairs.divergence(begin, end, v, out);
    for (std::size_t i = begin; i < end; ++i) {
      for (const Wall& wall : (*s.walls)[i]) {
        const Vec3 dv = kMoving ? Vec3(v[i] - wall.velocity) : v[i];
        out[i] += 2 * s.boundary->at(wall.distance).slope * wall.normal.dot(dv);
      }
    }
  });
}

void accelerate(const ParticleSystem& s, const PairKernels& pairs, std::span<const Real> q, std::span<Vec3> out) {
  parallel_ranges(s.size(), kGrain, [&](std::size_t begin, std::size_t end) {
    pairs.gradient(begin, end, q, out);
    for (std::size_t i = begin; i < end; ++i) {
      Vec3 sum = -out[i];
      for (const Wall& wall : (*s.walls)[i]) sum -= 2 * q[i] * s.boundary->at(wall.distance).slope * wall.normal;
      out[i] = sum;
    }
  });
}

}  // namespace

void compression_rate(const ParticleSystem& s, std::span<const Vec3> v, std::span<Real> out) {
  CHECK_EQ(v.size(), s.size());
  CHECK_EQ(out.size(), s.size());
  const PairsOf pairs(s);
  compress<true>(s, *pairs.get(), v, out);
}

void pressure_acceleration(const ParticleSystem& s, std::span<const Real> q, std::span<Vec3> out) {
  CHECK_EQ(q.size(), s.size());
  CHECK_EQ(out.size(), s.size());
  const PairsOf pairs(s);
  accelerate(s, *pairs.get(), q, out);
}

void smooth_linear(const ParticleSystem& s, std::span<const Real> values, std::span<Real> out) {
  CHECK_EQ(values.size(), s.size());
  CHECK_EQ(out.size(), s.size());
  with_kernel(s, [&](const auto& kernel, auto periodic) {
    parallel_for(s.size(), [&](std::size_t i) {
      Eigen::Matrix4d moments = Eigen::Matrix4d::Zero();
      Eigen::Vector4d right = Eigen::Vector4d::Zero();
      const auto add = [&](const Vec3& d, Real weight, Real value) {
        const Eigen::Vector4d basis(1, d.x() / s.support, d.y() / s.support, d.z() / s.support);
        moments += weight * basis * basis.transpose();
        right += weight * value * basis;
      };
      add(Vec3::Zero(), kernel.W(0), values[i]);
      for (const Index j : (*s.neighbors)[i]) {
        const Vec3 d = s.template separation<decltype(periodic)::value>(j, i);
        add(d, kernel.W(d.norm()), values[j]);
      }
      // In a sheet or thread the slope across is not known: the smallest one then.
      out[i] = moments.completeOrthogonalDecomposition().solve(right)[0];
    });
  });
}

PressureResult PressureSolver::solve(const ParticleSystem& s, std::span<const Real> rate, std::span<const Real> least, Real dt, Real tolerance, int max_iterations,
                                     std::span<Vec3> v, std::span<Real> q) {
  ZONE("sph.pressure");
  const std::size_t n = s.size();
  CHECK_EQ(rate.size(), n);
  CHECK_EQ(least.size(), n);
  CHECK_EQ(v.size(), n);
  CHECK_EQ(q.size(), n);
  for (std::vector<Real>* a : {&y_, &low_, &scale_, &g_, &p_, &Ap_, &work_}) a->resize(n);
  a_.resize(n);
  PressureResult result;
  if (n == 0) return {0, 0, true};

  // Diagonal of A, by which the unknowns are scaled: q = scale y.
  const PairsOf own(s);
  const PairKernels& pairs = *own.get();
  parallel_for(n, [&](std::size_t i) { work_[i] = s.is_fixed(i) ? 0 : 1; }, 4096);
  parallel_ranges(n, kGrain, [&](std::size_t begin, std::size_t end) {
    pairs.compliance(begin, end, work_, a_, scale_);
    for (std::size_t i = begin; i < end; ++i) {
      Vec3 slope = a_[i];
      for (const Wall& wall : (*s.walls)[i]) slope += 2 * s.boundary->at(wall.distance).slope * wall.normal;
      const Real diagonal = work_[i] * slope.squaredNorm() + scale_[i];
      scale_[i] = diagonal > 0 ? 1 / std::sqrt(diagonal) : 0;
    }
  });

  // y -> scale A scale y
  const auto multiply = [&](const std::vector<Real>& in, std::vector<Real>& out) {
    parallel_for(n, [&](std::size_t i) { work_[i] = scale_[i] * in[i]; }, 4096);
    accelerate(s, pairs, work_, a_);
    if (!s.fixed.empty()) parallel_for(n, [&](std::size_t i) { if (s.fixed[i]) a_[i].setZero(); }, 4096);
    compress<false>(s, pairs, a_, out);
    parallel_for(n, [&](std::size_t i) { out[i] *= -scale_[i]; }, 4096);
  };

  // Of half y A y - b y the gradient at the old pressures is (rate - D v) / dt.
  compress<true>(s, pairs, v, work_);
  bool below = false;
  for (std::size_t i = 0; i < n; ++i) {
    g_[i] = scale_[i] * (rate[i] - work_[i]) / dt;
    y_[i] = scale_[i] > 0 ? q[i] / scale_[i] : 0;
    low_[i] = scale_[i] > 0 ? least[i] / scale_[i] : 0;
    p_[i] = std::max(low_[i] - y_[i], 0.0);
    below |= p_[i] > 0;
  }
  if (below) {
    multiply(p_, Ap_);
    parallel_for(n, [&](std::size_t i) {
      y_[i] += p_[i];
      g_[i] += Ap_[i];
    }, 4096);
  }

  // Free gradient: of unknowns off their bound; chopped: of those on it that want off.
  const auto free = [&](std::size_t i) { return y_[i] > low_[i] ? g_[i] : 0.0; };
  const auto chopped = [&](std::size_t i) { return y_[i] > low_[i] ? 0.0 : std::min(g_[i], 0.0); };
  struct Sums {
    Real free = 0, chopped = 0, error = 0;
  };
  const auto look = [&] {
    return parallel_reduce(n, Sums{}, [&](std::size_t i) {
      const Real f = free(i), c = chopped(i), e = scale_[i] > 0 ? dt * dt * (f + c) / scale_[i] : 0;
      return Sums{f * f, c * c, e * e};
    }, [](const Sums& a, const Sums& b) { return Sums{a.free + b.free, a.chopped + b.chopped, a.error + b.error}; });
  };
  const Real goal = tolerance * tolerance * static_cast<Real>(n);
  Sums sums = look();
  parallel_for(n, [&](std::size_t i) { p_[i] = free(i); }, 4096);
  while (sums.error > goal && result.iterations < max_iterations) {
    if (sums.chopped <= sums.free) {
      multiply(p_, Ap_);
      const auto [pAp, gp] = parallel_reduce(n, std::pair<Real, Real>{0, 0}, [&](std::size_t i) { return std::pair<Real, Real>{p_[i] * Ap_[i], g_[i] * p_[i]}; },
                                             [](const auto& a, const auto& b) { return std::pair<Real, Real>{a.first + b.first, a.second + b.second}; });
      if (!(pAp > 0)) break;
      const Real step = gp / pAp;
      // The longest step along p that leaves none below its bound.
      const Real feasible = -parallel_max(n, -std::numeric_limits<Real>::infinity(), [&](std::size_t i) {
        return p_[i] > 0 ? -(y_[i] - low_[i]) / p_[i] : -std::numeric_limits<Real>::infinity();
      });
      if (step <= feasible) {
        parallel_for(n, [&](std::size_t i) {
          y_[i] -= step * p_[i];
          g_[i] -= step * Ap_[i];
        }, 4096);
        const Real beta = parallel_sum(n, 0.0, [&](std::size_t i) { return free(i) * Ap_[i]; }) / pAp;
        parallel_for(n, [&](std::size_t i) { p_[i] = free(i) - beta * p_[i]; }, 4096);
      } else {
        // Expansion: to the bound, then a projected step down the gradient.
        parallel_for(n, [&](std::size_t i) {
          y_[i] -= feasible * p_[i];
          g_[i] -= feasible * Ap_[i];
        }, 4096);
        parallel_for(n, [&](std::size_t i) {
          const Real next = std::max(low_[i], y_[i] - kExpansion * free(i));
          p_[i] = next - y_[i];
          y_[i] = next;
        }, 4096);
        multiply(p_, Ap_);
        parallel_for(n, [&](std::size_t i) { g_[i] += Ap_[i]; }, 4096);
        parallel_for(n, [&](std::size_t i) { p_[i] = free(i); }, 4096);
        ++result.iterations;
      }
    } else {
      // Proportioning: those on the bound that want off leave it.
      parallel_for(n, [&](std::size_t i) { p_[i] = chopped(i); }, 4096);
      multiply(p_, Ap_);
      const Real pAp = parallel_sum(n, 0.0, [&](std::size_t i) { return p_[i] * Ap_[i]; });
      if (!(pAp > 0)) break;
      const Real step = sums.chopped / pAp;
      parallel_for(n, [&](std::size_t i) {
        y_[i] -= step * p_[i];
        g_[i] -= step * Ap_[i];
      }, 4096);
      parallel_for(n, [&](std::size_t i) { p_[i] = free(i); }, 4096);
    }
    ++result.iterations;
    sums = look();
  }
  result.error = std::sqrt(sums.error / static_cast<Real>(n));
  result.converged = sums.error <= goal;

  // v += dt a(q_new - q_old)
  parallel_for(n, [&](std::size_t i) {
    const Real next = scale_[i] > 0 && y_[i] <= low_[i] ? least[i] : scale_[i] * y_[i];  // on the bound to the bit
    work_[i] = next - q[i];
    q[i] = next;
  }, 4096);
  accelerate(s, pairs, work_, a_);
  parallel_for(n, [&](std::size_t i) {
    if (!s.is_fixed(i)) v[i] += dt * a_[i];
  }, 4096);
  COUNT("sph.pressure iterations", result.iterations);
  return result;
}

std::size_t PressureSolver::memory() const {
  return (y_.capacity() + low_.capacity() + scale_.capacity() + g_.capacity() + p_.capacity() + Ap_.capacity() + work_.capacity()) * sizeof(Real) + a_.capacity() * sizeof(Vec3);
}

}  // namespace effuse::flow::sph
