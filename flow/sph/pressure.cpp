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

}  // namespace

void compression_rate(const ParticleSystem& s, std::span<const Vec3> v, std::span<Real> out) {
  CHECK_EQ(v.size(), s.size());
  CHECK_EQ(out.size(), s.size());
  const PairsOf pairs(s);
  parallel_ranges(s.size(), kGrain, [&](std::size_t begin, std::size_t end) {
    pairs->divergence(begin, end, v, out);
    for (std::size_t i = begin; i < end; ++i)
      for (const Wall& wall : (*s.walls)[i]) out[i] += 2 * s.boundary->at(wall.distance).slope * wall.normal.dot(v[i] - wall.velocity);
  });
}

void pressure_acceleration(const ParticleSystem& s, std::span<const Real> q, std::span<Vec3> out) {
  CHECK_EQ(q.size(), s.size());
  CHECK_EQ(out.size(), s.size());
  const PairsOf pairs(s);
  parallel_ranges(s.size(), kGrain, [&](std::size_t begin, std::size_t end) {
    pairs->gradient(begin, end, q, out);
    for (std::size_t i = begin; i < end; ++i) {
      Vec3 sum = out[i];
      for (const Wall& wall : (*s.walls)[i]) sum += 2 * q[i] * s.boundary->at(wall.distance).slope * wall.normal;
      out[i] = -sum;
    }
  });
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
  partial_.resize((n + kGrain - 1) / kGrain);
  PressureResult result;
  if (n == 0) return {0, 0, true};
  const PairsOf own(s);
  const PairKernels& pairs = *own.get();

  // f(begin, end) returns a range's share of some sums (and of one minimum).
  const auto sum_of = [&](auto&& f) {
    parallel_ranges(n, kGrain, [&](std::size_t begin, std::size_t end) { partial_[begin / kGrain] = f(begin, end); });
    Sums sum;
    for (const Sums& part : partial_) sum += part;
    return sum;
  };

  // Diagonal of A, by which the unknowns are scaled: q = scale y. And what walls push, once.
  push_.resize(s.walls->walls.size());
  parallel_for(n, [&](std::size_t i) { work_[i] = s.is_fixed(i) ? 0 : 1; }, 4096);
  parallel_ranges(n, kGrain, [&](std::size_t begin, std::size_t end) {
    pairs.compliance(begin, end, work_, a_, scale_);
    for (std::size_t i = begin; i < end; ++i) {
      Vec3 slope = a_[i];
      for (Index k = s.walls->first[i]; k < s.walls->first[i + 1]; ++k) {
        push_[k] = 2 * s.boundary->at(s.walls->walls[k].distance).slope * s.walls->walls[k].normal;
        slope += push_[k];
      }
      const Real diagonal = work_[i] * slope.squaredNorm() + scale_[i];
      scale_[i] = diagonal > 0 ? 1 / std::sqrt(diagonal) : 0;
    }
  });

  // a_ = -D^T q, 0 for fixed particles.
  const auto accelerate = [&](std::span<const Real> of) {
    parallel_ranges(n, kGrain, [&](std::size_t begin, std::size_t end) {
      pairs.gradient(begin, end, of, a_);
      for (std::size_t i = begin; i < end; ++i) {
        if (s.is_fixed(i)) {
          a_[i].setZero();
          continue;
        }
        Vec3 sum = a_[i];
        for (Index k = s.walls->first[i]; k < s.walls->first[i + 1]; ++k) sum += of[i] * push_[k];
        a_[i] = -sum;
      }
    });
  };
  // Ap = scale A scale p, with work = scale p; returns p . Ap and p . g.
  const auto multiply = [&] {
    accelerate(work_);
    return sum_of([&](std::size_t begin, std::size_t end) {
      pairs.divergence(begin, end, a_, Ap_);
      Sums sum;
      for (std::size_t i = begin; i < end; ++i) {
        Real rate_i = Ap_[i];
        for (Index k = s.walls->first[i]; k < s.walls->first[i + 1]; ++k) rate_i += push_[k].dot(a_[i]);
        Ap_[i] = -scale_[i] * rate_i;
        sum.first += p_[i] * Ap_[i];
        sum.second += p_[i] * g_[i];
      }
      return sum;
    });
  };
  // p = f(i), work = scale p; returns the longest step along -p that leaves none below its bound.
  const auto direct = [&](auto&& f) {
    return sum_of([&](std::size_t begin, std::size_t end) {
      Sums sum;
      for (std::size_t i = begin; i < end; ++i) {
        p_[i] = f(i);
        work_[i] = scale_[i] * p_[i];
        if (p_[i] > 0) sum.least = std::min(sum.least, (y_[i] - low_[i]) / p_[i]);
      }
      return sum;
    }).least;
  };
  // Free gradient: of unknowns off their bound; chopped: of those on it that want off.
  const auto free = [&](std::size_t i) { return y_[i] > low_[i] ? g_[i] : 0.0; };
  const auto chopped = [&](std::size_t i) { return y_[i] > low_[i] ? 0.0 : std::min(g_[i], 0.0); };
  // y -= step p, g -= step Ap; returns |free|^2, |chopped|^2, the error squared, and free . Ap.
  const auto advance = [&](Real step) {
    return sum_of([&](std::size_t begin, std::size_t end) {
      Sums sum;
      for (std::size_t i = begin; i < end; ++i) {
        y_[i] -= step * p_[i];
        g_[i] -= step * Ap_[i];
        const Real f = free(i), c = chopped(i), e = scale_[i] > 0 ? dt * dt * (f + c) / scale_[i] : 0;
        sum.first += f * f;
        sum.second += c * c;
        sum.third += e * e;
        sum.fourth += f * Ap_[i];
      }
      return sum;
    });
  };

  // Of half y A y - b y the gradient at the old pressures is (rate - D v) / dt. Pressures below their bound begin there.
  parallel_ranges(n, kGrain, [&](std::size_t begin, std::size_t end) {
    pairs.divergence(begin, end, v, Ap_);
    for (std::size_t i = begin; i < end; ++i) {
      Real rate_i = Ap_[i];
      for (Index k = s.walls->first[i]; k < s.walls->first[i + 1]; ++k) rate_i += push_[k].dot(v[i] - s.walls->walls[k].velocity);
      g_[i] = scale_[i] * (rate[i] - rate_i) / dt;
      y_[i] = scale_[i] > 0 ? q[i] / scale_[i] : 0;
      low_[i] = scale_[i] > 0 ? least[i] / scale_[i] : 0;
    }
  });
  direct([&](std::size_t i) { return -std::max(low_[i] - y_[i], 0.0); });
  if (parallel_max(n, 0, [&](std::size_t i) { return -p_[i]; }) > 0) multiply();
  else std::fill(Ap_.begin(), Ap_.end(), 0.0);
  Sums sums = advance(1);

  const Real goal = tolerance * tolerance * static_cast<Real>(n);
  Real feasible = direct(free);
  while (sums.third > goal && result.iterations < max_iterations) {
    ++result.iterations;
    if (sums.second <= sums.first) {
      const Sums products = multiply();
      if (!(products.first > 0)) break;
      const Real step = products.second / products.first;
      if (step <= feasible) {
        sums = advance(step);
        const Real beta = sums.fourth / products.first;
        feasible = direct([&](std::size_t i) { return free(i) - beta * p_[i]; });
        continue;
      }
      // Expansion: to the bound, then a projected step down the gradient.
      advance(feasible);
      direct([&](std::size_t i) { return y_[i] - std::max(low_[i], y_[i] - kExpansion * free(i)); });
      multiply();
      sums = advance(1);
      ++result.iterations;
    } else {
      // Proportioning: those on the bound that want off leave it.
      direct(chopped);
      const Sums products = multiply();
      if (!(products.first > 0)) break;
      sums = advance(sums.second / products.first);
    }
    feasible = direct(free);
  }
  result.error = std::sqrt(sums.third / static_cast<Real>(n));
  result.converged = sums.third <= goal;

  // v += dt a(q_new - q_old)
  parallel_for(n, [&](std::size_t i) {
    const Real next = scale_[i] * y_[i];
    work_[i] = next - q[i];
    q[i] = next;
  }, 4096);
  accelerate(work_);
  parallel_for(n, [&](std::size_t i) { v[i] += dt * a_[i]; }, 4096);
  COUNT("sph.pressure iterations", result.iterations);
  return result;
}

std::size_t PressureSolver::memory() const {
  return (y_.capacity() + low_.capacity() + scale_.capacity() + g_.capacity() + p_.capacity() + Ap_.capacity() + work_.capacity()) * sizeof(Real) + (a_.capacity() + push_.capacity()) * sizeof(Vec3) +
         partial_.capacity() * sizeof(Sums);
}

}  // namespace effuse::flow::sph
