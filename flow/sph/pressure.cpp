#include "flow/sph/pressure.h"

#include <Eigen/Eigenvalues>
#include <Eigen/QR>
#include <algorithm>
#include <array>
#include <cmath>
#include <limits>

#include "flow/sph/pair_kernels.h"
#include "geometry/base/check.h"
#include "geometry/base/parallel.h"
#include "geometry/base/zones.h"

namespace effuse::flow::sph {

namespace {

constexpr std::size_t kGrain = 256;  // particles a thread takes at a time
constexpr float kExpansion = 0.5;  // step down the scaled gradient; stable below 2 / |A scaled|, which is about 3
constexpr float kOnBound = 1e-6f;  // of an unknown: rounding in single precision
constexpr Real kDigits = 1e-4;     // of the error single precision takes away at a time
constexpr int kBrief = 4;           // iterations of a solve that is within its tolerance already, but not within the tight one
constexpr Real kMargin = 0.1;      // of the tolerance, where single precision alone does not reach it
constexpr Real kGain = 0.5;        // a round of refinement that leaves more was the last
constexpr Real kFloatNoise = 6e-8;  // of a product's terms: rounding in single precision
constexpr Real kLeastOwn = 0.2;    // share of the kernel that lava in a corner has at least
constexpr Real kTrust = 1e-3;      // of the tolerance: more noise is looked into

/// Sum of f(i), eight in turn: lanes for the compiler, one order on every processor.
template <class F>
Real lane_sum(std::size_t begin, std::size_t end, F&& f) {
  Real lanes[8] = {};
  std::size_t i = begin;
  for (; i + 8 <= end; i += 8)
    for (std::size_t k = 0; k < 8; ++k) lanes[k] += f(i + k);
  for (std::size_t k = 0; i < end; ++i, ++k) lanes[k] += f(i);
  return ((lanes[0] + lanes[4]) + (lanes[2] + lanes[6])) + ((lanes[1] + lanes[5]) + (lanes[3] + lanes[7]));
}
template <class F>
float lane_min(std::size_t begin, std::size_t end, F&& f) {
  constexpr float kMost = std::numeric_limits<float>::infinity();
  float lanes[8] = {kMost, kMost, kMost, kMost, kMost, kMost, kMost, kMost};
  std::size_t i = begin;
  for (; i + 8 <= end; i += 8)
    for (std::size_t k = 0; k < 8; ++k) {
      const float value = f(i + k);
      lanes[k] = value < lanes[k] ? value : lanes[k];
    }
  for (std::size_t k = 0; i < end; ++i, ++k) lanes[k] = std::min(lanes[k], f(i));
  return *std::min_element(lanes, lanes + 8);
}

}  // namespace

namespace {
bool any_mirrors(std::span<const Wall> walls) {
  return std::any_of(walls.begin(), walls.end(), [](const Wall& wall) { return wall.mirrors; });
}
}  // namespace

namespace {
/// Share of what lies behind two walls of what the shares a and b lie behind one: as trim_walls() has it.
Real hidden_by_both(Real a, Real b, Real cosine) {
  const Real c = 2 / kPi * std::asin(std::clamp(cosine, -1.0, 1.0));
  return c >= 0 ? (1 - c) * a * b + c * std::min(a, b) : (1 + c) * a * b;
}

/// 2 P slope n: what a wall pushes at unit pressure.
Vec3 push_of(const ParticleSystem& s, const Wall& wall, const Mat3& P) { return 2 * s.boundary->at(wall).slope * (P * wall.normal); }
}  // namespace

Mat3 mirrored(const ParticleSystem& s, std::size_t i) {
  if (!any_mirrors((*s.walls)[i])) return Mat3::Identity();
  const std::span<const Wall> walls = (*s.walls)[i];
  const auto missing = [&](const Wall& wall) { return s.boundary->at(wall.distance).moment_t; };
  const auto along = [](const Wall& wall) { return Mat3(Mat3::Identity() - wall.normal * wall.normal.transpose()); };
  Mat3 own = Mat3::Identity();
  for (std::size_t a = 0; a < walls.size(); ++a) {
    if (!walls[a].mirrors) continue;
    own -= missing(walls[a]) * along(walls[a]);
    for (std::size_t b = 0; b < a; ++b) {
      if (!walls[b].mirrors) continue;
      const Mat3 both = along(walls[a]) * along(walls[b]);
      own += hidden_by_both(missing(walls[a]), missing(walls[b]), walls[a].normal.dot(walls[b].normal)) / 2 * (both + both.transpose());
    }
  }
  const Eigen::SelfAdjointEigenSolver<Mat3> eigen(own);
  return eigen.eigenvectors() * eigen.eigenvalues().cwiseMax(kLeastOwn).cwiseInverse().asDiagonal() * eigen.eigenvectors().transpose();
}

namespace {
/// f(wall, weight) for the walls of particle i that mirror; weights add up to 1.
template <class F>
void for_each_mirror(const ParticleSystem& s, std::size_t i, F&& f) {
  Real sum = 0;
  for (const Wall& wall : (*s.walls)[i])
    if (wall.mirrors) sum += s.boundary->at(wall).moment_t;
  if (!(sum > 0)) return;
  for (const Wall& wall : (*s.walls)[i])
    if (wall.mirrors) f(wall, s.boundary->at(wall).moment_t / sum);
}
}  // namespace

void compression_rate(const ParticleSystem& s, std::span<const Vec3> velocities, std::span<Real> out) {
  CHECK_EQ(velocities.size(), s.size());
  CHECK_EQ(out.size(), s.size());
  const PairsOf pairs(s);
  std::vector<Vec3> v(velocities.begin(), velocities.end());
  parallel_for(s.size(), [&](std::size_t i) {
    Vec3 wall = Vec3::Zero();
    for_each_mirror(s, i, [&](const Wall& w, Real weight) { wall += weight * s.velocity_of(w); });
    v[i] += (mirrored(s, i) - Mat3::Identity()) * (v[i] - wall);
  }, 2048);
  parallel_ranges(s.size(), kGrain, [&](std::size_t begin, std::size_t end) {
    pairs->divergence(begin, end, v, out);
    for (std::size_t i = begin; i < end; ++i)
      if (const std::span<const Wall> walls = (*s.walls)[i]; !walls.empty()) {
        const Mat3 P = mirrored(s, i);
        for (const Wall& wall : walls) out[i] += push_of(s, wall, P).dot(velocities[i] - s.velocity_of(wall));
      }
  });
}

void pressure_acceleration(const ParticleSystem& s, std::span<const Real> q, std::span<Vec3> out) {
  CHECK_EQ(q.size(), s.size());
  CHECK_EQ(out.size(), s.size());
  const PairsOf pairs(s);
  parallel_ranges(s.size(), kGrain, [&](std::size_t begin, std::size_t end) {
    pairs->gradient(begin, end, q, out);
    for (std::size_t i = begin; i < end; ++i) {
      if (const std::span<const Wall> walls = (*s.walls)[i]; !walls.empty()) {
        const Mat3 P = mirrored(s, i);
        out[i] = P * out[i];
        for (const Wall& wall : walls) out[i] += q[i] * push_of(s, wall, P);
      }
      out[i] = -out[i];
    }
  });
}

void push_movables(const ParticleSystem& s, std::span<const Real> q, std::span<const Vec3> a, Real dt) {
  if (!s.any_gives_way()) return;
  CHECK_EQ(a.size(), s.size());
  const Real mass = s.density * s.volume();
  std::vector<std::vector<Vec3>> impulses;  // on the vertices of solids that deform
  for (const Pressed& solid : s.pressed) impulses.emplace_back(solid.vertices.size(), Vec3::Zero());
  const auto give = [&](const Wall& wall, const Vec3& impulse) {
    if (!gives_way(wall)) return;
    if (deforms(wall)) s.pressed[wall.movable].share(wall, impulse, impulses[wall.movable]);
    else s.movable[wall.movable].push(impulse, wall.arm);
  };
  for (std::size_t i = 0; i < s.size(); ++i) {
    if (s.is_fixed(i) || std::none_of((*s.walls)[i].begin(), (*s.walls)[i].end(), gives_way)) continue;
    Vec3 sum = a[i];
    const Mat3 P = mirrored(s, i);
    for (const Wall& wall : (*s.walls)[i]) {
      const Vec3 push = q[i] * push_of(s, wall, P);
      sum += push;
      give(wall, dt * mass * push);
    }
    const Vec3 extra = sum - P.inverse() * sum;  // (P - 1) of what the pairs gave
    for_each_mirror(s, i, [&](const Wall& wall, Real weight) { give(wall, -dt * mass * weight * extra); });
  }
  std::vector<Vec3> points, vertices;
  for (std::size_t b = 0; b < s.pressed.size(); ++b) {
    if (!s.pressed[b].near) continue;
    s.pressed[b].respond(impulses[b], points, vertices);
    s.pressed[b].add(1, points, vertices);
  }
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

// f(begin, end) returns a range's share of some sums (and of one minimum).
template <class F>
PressureSolver::Sums PressureSolver::sum_of(F&& f) {
  parallel_ranges(y_.size(), kGrain, [&](std::size_t begin, std::size_t end) { partial_[begin / kGrain] = f(begin, end); });
  Sums sum;
  for (const Sums& part : partial_) sum += part;
  return sum;
}

void PressureSolver::prepare(const ParticleSystem& s) {
  ZONE("sph.pressure");
  const std::size_t n = s.size();
  for (std::vector<float>* array : {&y_, &low_, &scale_, &g_, &p_, &Ap_}) array->resize(n);
  a_.resize(n);
  partial_.resize((n + kGrain - 1) / kGrain);
  push_.resize(s.walls->walls.size());
  pairs_.build(s);
  mirrored_.clear();
  for (std::size_t i = 0; i < n; ++i)
    if (any_mirrors((*s.walls)[i])) {
      Mirrored m{.particle = static_cast<Index>(i), .P = mirrored(s, i)};
      for_each_mirror(s, i, [&](const Wall& wall, Real weight) {
        if (!gives_way(wall)) m.wall += weight * wall.velocity;
      });
      mirrored_.push_back(m);
    }

  grips_.clear();
  answer_.resize(s.movable.size());
  bends_.resize(s.pressed.size());
  if (s.any_gives_way()) {
    std::size_t m = 0;
    for (Index i = 0; i < n; ++i) {
      while (m < mirrored_.size() && mirrored_[m].particle < i) ++m;
      const bool here = m < mirrored_.size() && mirrored_[m].particle == i;
      Real sum = 0;
      for (const Wall& wall : (*s.walls)[i]) sum += wall.mirrors ? s.boundary->at(wall).moment_t : 0;
      for (Index k = s.walls->first[i]; k < s.walls->first[i + 1]; ++k) {
        const Wall& wall = s.walls->walls[k];
        if (!gives_way(wall) || s.is_fixed(i)) continue;
        grips_.push_back({i, k, here ? static_cast<Index>(m) : kNotMovable, here && wall.mirrors && sum > 0 ? s.boundary->at(wall).moment_t / sum : 0});
      }
    }
  }

  // Diagonal of A, by which the unknowns are scaled: q = scale y. And what walls push, once.
  parallel_for(n, [&](std::size_t i) { pairs_.set(i, s.is_fixed(i) ? 0.0f : 1.0f); }, 4096);
  parallel_ranges(n, kGrain, [&](std::size_t begin, std::size_t end) {
    pairs_.compliance(begin, end, a_, scale_);
    for (std::size_t i = begin; i < end; ++i) {
      Real diagonal = scale_[i];
      Vec3 slope(a_[i].x, a_[i].y, a_[i].z);
      const Mat3 P = mirrored(s, i);
      for (Index k = s.walls->first[i]; k < s.walls->first[i + 1]; ++k) {
        push_[k] = push_of(s, s.walls->walls[k], P);
        slope += push_[k];
        if (gives_way(s.walls->walls[k]) && !s.is_fixed(i)) {
          const Wall& wall = s.walls->walls[k];
          if (deforms(wall)) {
            const Pressed& solid = s.pressed[wall.movable];
            const geometry::Triangle& t = solid.triangles[wall.triangle];
            const Real mobility = wall.arm.dot(Vec3(solid.mobility[t[0]], solid.mobility[t[1]], solid.mobility[t[2]]));
            diagonal += s.density * s.volume() * mobility * push_[k].squaredNorm();
            continue;
          }
          const Movable& body = s.movable[wall.movable];
          const Vec3 turn = wall.arm.cross(push_[k]);
          diagonal += s.density * s.volume() * (body.inverse_mass * push_[k].squaredNorm() + turn.dot(body.inverse_inertia * turn));
        }
      }
      if (!s.is_fixed(i)) diagonal += slope.squaredNorm();
      scale_[i] = diagonal > 0 ? static_cast<float>(1 / std::sqrt(diagonal)) : 0;
    }
  });
  // An estimate, on the safe side, will do.
  for (const Mirrored& m : mirrored_) scale_[m.particle] /= static_cast<float>(m.P.trace() / 3);
}

/// a_ (and answer_) = -D^T of the packed q = scale p, 0 for fixed particles.
void PressureSolver::accelerate(const ParticleSystem& s) {
  const Index* first = s.walls->first.data();
  FloatPairs::Vector* a = a_.data();
  parallel_ranges(y_.size(), kGrain, [&](std::size_t begin, std::size_t end) {
    pairs_.gradient(begin, end, a_);
    for (std::size_t i = begin; i < end; ++i) a[i] = {-a[i].x, -a[i].y, -a[i].z, 0};
    for (auto m = std::lower_bound(mirrored_.begin(), mirrored_.end(), begin, [](const Mirrored& one, std::size_t i) { return one.particle < i; });
         m != mirrored_.end() && m->particle < end; ++m) {
      const Vec3 own(a[m->particle].x, a[m->particle].y, a[m->particle].z);
      m->extra = m->P * own - own;
      const Eigen::Vector3f turned = (own + m->extra).cast<float>();
      a[m->particle] = {turned.x(), turned.y(), turned.z(), 0};
    }
    for (Index k = first[begin], i = static_cast<Index>(begin); k < first[end]; ++k) {
      while (k >= first[i + 1]) ++i;
      const Eigen::Vector3f push = scale_[i] * p_[i] * push_[k].cast<float>();
      a[i] = {a[i].x - push.x(), a[i].y - push.y(), a[i].z - push.z(), 0};
    }
    if (s.fixed.empty()) return;
    for (std::size_t i = begin; i < end; ++i)
      if (s.fixed[i]) a[i] = {};
  });
  answer([&](const Grip& grip) { return static_cast<Real>(scale_[grip.particle] * p_[grip.particle]); }, s);
}

/// Of the place of a wall that gives way.
Vec3 PressureSolver::answer_at(const Wall& wall, const ParticleSystem& s) const {
  if (deforms(wall)) return s.pressed[wall.movable].at(wall, bends_[wall.movable].vertices);
  return answer_[wall.movable].linear + answer_[wall.movable].angular.cross(wall.arm);
}

/// answer_, bends_: accelerations of what gives way to the pressures of(grip).
template <class F>
void PressureSolver::answer(F&& of, const ParticleSystem& s) {
  if (grips_.empty()) return;
  const Real mass = s.density * s.volume();
  std::fill(answer_.begin(), answer_.end(), Answer{});
  for (std::size_t b = 0; b < bends_.size(); ++b) bends_[b].force.assign(s.pressed[b].vertices.size(), Vec3::Zero());
  for (const Grip& grip : grips_) {
    const Wall& wall = s.walls->walls[grip.wall];
    Vec3 force = mass * of(grip) * push_[grip.wall];
    if (grip.mirrored != kNotMovable) force -= mass * grip.weight * mirrored_[grip.mirrored].extra;
    if (deforms(wall)) {
      s.pressed[wall.movable].share(wall, force, bends_[wall.movable].force);
      continue;
    }
    answer_[wall.movable].linear += force;
    answer_[wall.movable].angular += wall.arm.cross(force);
  }
  for (std::size_t b = 0; b < bends_.size(); ++b)
    if (s.pressed[b].near) s.pressed[b].respond(bends_[b].force, bends_[b].points, bends_[b].vertices);
  for (std::size_t b = 0; b < answer_.size(); ++b) {
    answer_[b].linear *= s.movable[b].inverse_mass;
    answer_[b].angular = s.movable[b].inverse_inertia * answer_[b].angular;
  }
}

/// Ap = scale A scale p, with scale p packed; returns p . Ap and p . g.
PressureSolver::Sums PressureSolver::multiply(const ParticleSystem& s) {
  accelerate(s);
  for (Mirrored& m : mirrored_) {
    FloatPairs::Vector& a = a_[m.particle];
    m.kept = {a.x, a.y, a.z};
    m.body.setZero();
  }
  for (const Grip& grip : grips_)
    if (grip.mirrored != kNotMovable) {
      const Wall& wall = s.walls->walls[grip.wall];
      mirrored_[grip.mirrored].body += grip.weight * answer_at(wall, s);
    }
  for (Mirrored& m : mirrored_) {
    FloatPairs::Vector& a = a_[m.particle];
    const Vec3 own = m.kept.cast<Real>();
    const Eigen::Vector3f turned = (own + (m.P - Mat3::Identity()) * (own - m.body)).cast<float>();
    a = {turned.x(), turned.y(), turned.z(), 0};
  }
  const Index* first = s.walls->first.data();
  const float *scale = scale_.data(), *g = g_.data(), *p = p_.data();
  float* Ap = Ap_.data();
  return sum_of([&](std::size_t begin, std::size_t end) {
    pairs_.divergence(begin, end, a_, Ap_);
    auto m = std::lower_bound(mirrored_.begin(), mirrored_.end(), begin, [](const Mirrored& one, std::size_t i) { return one.particle < i; });
    for (Index k = first[begin], i = static_cast<Index>(begin); k < first[end]; ++k) {
      while (k >= first[i + 1]) ++i;
      while (m != mirrored_.end() && m->particle < i) ++m;
      const Eigen::Vector3f push = push_[k].cast<float>();
      Eigen::Vector3f a = m != mirrored_.end() && m->particle == i ? m->kept : Eigen::Vector3f(a_[i].x, a_[i].y, a_[i].z);
      if (!grips_.empty() && gives_way(s.walls->walls[k])) a -= answer_at(s.walls->walls[k], s).cast<float>();
      Ap[i] += push.x() * a.x() + push.y() * a.y() + push.z() * a.z();
    }
    for (std::size_t i = begin; i < end; ++i) Ap[i] *= -scale[i];
    Sums sum;
    sum.first = lane_sum(begin, end, [=](std::size_t i) { return static_cast<Real>(p[i]) * Ap[i]; });
    sum.second = lane_sum(begin, end, [=](std::size_t i) { return static_cast<Real>(p[i]) * g[i]; });
    return sum;
  });
}

/// From y = 0 and its gradient: y until the error's sum of squares is down to goal. Returns the sums of advance() there.
PressureSolver::Sums PressureSolver::iterate(const ParticleSystem& s, Real dt, Real goal, int max_iterations, int& iterations) {
  const float *low = low_.data(), *scale = scale_.data();
  float *y = y_.data(), *g = g_.data(), *p = p_.data(), *Ap = Ap_.data();

  // p = f(i), packed = scale p; returns the longest step along -p that leaves none below its bound.
  const auto direct = [&](auto&& f) {
    return sum_of([&](std::size_t begin, std::size_t end) {
      for (std::size_t i = begin; i < end; ++i) p[i] = f(i);
      for (std::size_t i = begin; i < end; ++i) pairs_.set(i, scale[i] * p[i]);
      Sums sum;
      sum.least = lane_min(begin, end, [=](std::size_t i) {
        const float room = (y[i] - low[i]) / p[i];
        return p[i] > 0 ? room : std::numeric_limits<float>::infinity();
      });
      return sum;
    }).least;
  };
  // Free gradient: of unknowns off their bound; chopped: of those on it that want off.
  const auto free = [=](std::size_t i) { return y[i] > low[i] ? g[i] : 0.0f; };
  const auto chopped = [=](std::size_t i) {
    const float down = g[i] < 0 ? g[i] : 0.0f;
    return y[i] > low[i] ? 0.0f : down;
  };
  // y -= step p, g -= step Ap; returns |free|^2, |chopped|^2, the error squared, and free . Ap.
  const auto advance = [&](Real length) {
    const auto step = static_cast<float>(length);
    const auto dt4 = dt * dt * dt * dt;
    return sum_of([&](std::size_t begin, std::size_t end) {
      float f[kGrain], e[kGrain];
      for (std::size_t i = begin; i < end; ++i) {
        const float before = y[i], after = before - step * p[i], most = std::max(std::abs(before), std::abs(after));
        // Nearer to its bound than rounding can tell: on it.
        const float now = after - low[i] <= kOnBound * most ? low[i] : after;
        y[i] = now;
        g[i] -= step * Ap[i];
      }
      for (std::size_t i = begin; i < end; ++i) {
        f[i - begin] = free(i);
        const float whole = f[i - begin] + chopped(i), error = whole / scale[i];
        e[i - begin] = scale[i] > 0 ? error : 0.0f;
      }
      Sums sum;
      sum.second = lane_sum(begin, end, [=](std::size_t i) { return static_cast<Real>(chopped(i)) * chopped(i); });
      sum.first = lane_sum(0, end - begin, [&](std::size_t k) { return static_cast<Real>(f[k]) * f[k]; });
      sum.third = dt4 * lane_sum(0, end - begin, [&](std::size_t k) { return static_cast<Real>(e[k]) * e[k]; });
      sum.fourth = lane_sum(0, end - begin, [&](std::size_t k) { return static_cast<Real>(f[k]) * Ap[begin + k]; });
      return sum;
    });
  };

  // Pressures below their bound begin there.
  direct([=](std::size_t i) { return low[i] > 0 ? -low[i] : 0.0f; });
  const bool lifted = parallel_max(y_.size(), 0, [=](std::size_t i) { return low[i]; }) > 0;
  if (lifted) multiply(s);
  else std::fill(Ap_.begin(), Ap_.end(), 0.0f);
  Sums sums = advance(1);

  Real feasible = 0;
  bool directed = false;  // p conjugate to the last
  while (sums.third > goal && iterations < max_iterations) {
    ++iterations;
    if (sums.second <= sums.first) {
      if (!directed) feasible = direct(free);
      const Sums products = multiply(s);
      if (!(products.first > 0)) break;
      const Real step = products.second / products.first;
      if (step <= feasible) {
        sums = advance(step);
        const auto beta = static_cast<float>(sums.fourth / products.first);
        if (sums.third > goal) feasible = direct([=](std::size_t i) { return free(i) - beta * p[i]; });
        directed = true;
        continue;
      }
      // Expansion: to the bound, then a projected step down the gradient.
      advance(feasible);
      direct([=](std::size_t i) { return y[i] - std::max(low[i], y[i] - kExpansion * free(i)); });
      multiply(s);
      sums = advance(1);
      ++iterations;
    } else {
      // Proportioning: those on the bound that want off leave it.
      direct(chopped);
      const Sums products = multiply(s);
      if (!(products.first > 0)) break;
      sums = advance(sums.second / products.first);
    }
    directed = false;
  }
  return sums;
}

PressureResult PressureSolver::solve(const ParticleSystem& s, std::span<const Real> rate, std::span<const Real> least, Real dt, Real tolerance, int max_iterations,
                                     std::span<Vec3> v, std::span<Real> q) {
  prepare(s);
  return solve_prepared(s, rate, least, dt, tolerance, max_iterations, v, q);
}

PressureResult PressureSolver::solve_prepared(const ParticleSystem& s, std::span<const Real> rate, std::span<const Real> least, Real dt, Real tolerance,
                                              int max_iterations, std::span<Vec3> v, std::span<Real> q, Real tight) {
  ZONE("sph.pressure");
  const std::size_t n = s.size();
  CHECK_EQ(y_.size(), n);
  CHECK_EQ(push_.size(), s.walls->walls.size());
  CHECK_EQ(rate.size(), n);
  CHECK_EQ(least.size(), n);
  CHECK_EQ(v.size(), n);
  CHECK_EQ(q.size(), n);
  PressureResult result;
  if (n == 0) return {0, 0, true};
  const PairsOf own(s);
  const PairKernels& pairs = *own.get();
  change_.resize(n);
  const Real count = static_cast<Real>(n), goal = tolerance * tolerance * count;

  bool first = true;
  for (Real last = std::numeric_limits<Real>::infinity();;) {
    std::span<const Vec3> flow = v;
    if (!mirrored_.empty()) {
      flow_.assign(v.begin(), v.end());
      for (Mirrored& m : mirrored_) m.body = m.wall;
      for (const Grip& grip : grips_)
        if (grip.mirrored != kNotMovable) mirrored_[grip.mirrored].body += grip.weight * s.velocity_of(s.walls->walls[grip.wall]);
      for (const Mirrored& m : mirrored_) flow_[m.particle] += (m.P - Mat3::Identity()) * (v[m.particle] - m.body);
      flow = flow_;
    }
    // Of half y A y - b y the gradient at the pressures that have acted is (rate - D v) / dt.
    const Real start = sum_of([&](std::size_t begin, std::size_t end) {
      std::array<Real, kGrain> compression;
      pairs.divergence(begin, end, flow, std::span(compression).first(end - begin));
      Sums sum;
      for (std::size_t i = begin; i < end; ++i) {
        Real rate_i = compression[i - begin];
        for (Index k = s.walls->first[i]; k < s.walls->first[i + 1]; ++k) rate_i += push_[k].dot(v[i] - s.velocity_of(s.walls->walls[k]));
        y_[i] = 0;
        g_[i] = scale_[i] * static_cast<float>((rate[i] - rate_i) / dt);
        low_[i] = scale_[i] > 0 ? static_cast<float>((least[i] - q[i]) / scale_[i]) : 0;
        const Real counts = low_[i] < 0 ? rate_i - rate[i] : std::max(rate_i - rate[i], 0.0);
        if (scale_[i] > 0) sum.third += dt * dt * counts * counts;
      }
      return sum;
    }).third;
    // What single precision can do at a time; and no more rounds when they no longer help.
    const bool stuck = !(start < kGain * kGain * last);
    last = start;
    const Real aim = first ? goal : kMargin * kMargin * goal;  // a round that was worth measuring for leaves a margin
    const bool brief = first && start <= goal;
    const Sums sums = brief ? iterate(s, dt, tight * tight * count, std::min(kBrief, max_iterations), result.iterations)
                            : iterate(s, dt, std::max(aim, kDigits * kDigits * start), stuck ? 0 : max_iterations, result.iterations);
    first = false;
    result.error = std::sqrt(sums.third / count);
    result.converged = sums.third <= goal;

    // v += dt a(q_new - q_old)
    const Sums moved = sum_of([&](std::size_t begin, std::size_t end) {
      Sums sum;
      for (std::size_t i = begin; i < end; ++i) {
        const Real next = scale_[i] == 0 ? 0 : y_[i] <= low_[i] ? least[i] : std::max(least[i], q[i] + static_cast<Real>(scale_[i]) * y_[i]);
        change_[i] = 0;
        if (y_[i] == 0 && scale_[i] > 0) continue;
        change_[i] = next - q[i];
        q[i] = next;
        if (scale_[i] == 0) continue;
        const Real size = dt * dt * change_[i] / (static_cast<Real>(scale_[i]) * scale_[i]);
        sum.first += size * size;
      }
      return sum;
    });
    if (moved.first == 0) break;
    parallel_ranges(n, kGrain, [&](std::size_t begin, std::size_t end) {
      std::array<Vec3, kGrain> gradient;
      pairs.gradient(begin, end, change_, std::span(gradient).first(end - begin));
      auto m = std::lower_bound(mirrored_.begin(), mirrored_.end(), begin, [](const Mirrored& one, std::size_t i) { return one.particle < i; });
      for (std::size_t i = begin; i < end; ++i) {
        if (s.is_fixed(i)) continue;
        while (m != mirrored_.end() && m->particle < i) ++m;
        Vec3 sum = gradient[i - begin];
        if (m != mirrored_.end() && m->particle == i) {
          m->extra = sum - m->P * sum;
          sum -= m->extra;
        }
        for (Index k = s.walls->first[i]; k < s.walls->first[i + 1]; ++k) sum += change_[i] * push_[k];
        v[i] -= dt * sum;
      }
    });
    if (!grips_.empty()) {
      answer([&](const Grip& grip) { return change_[grip.particle]; }, s);
      for (std::size_t b = 0; b < bends_.size(); ++b)
        if (s.pressed[b].near) s.pressed[b].add(dt, bends_[b].points, bends_[b].vertices);
      for (std::size_t b = 0; b < answer_.size(); ++b) {
        s.movable[b].velocity += dt * answer_[b].linear;
        s.movable[b].spin += dt * answer_[b].angular;
      }
    }
    if (stuck || result.iterations >= max_iterations) break;
    if (result.converged && kFloatNoise * std::sqrt(moved.first) <= kTrust * tolerance * std::sqrt(count)) break;
  }
  COUNT("sph.pressure iterations", result.iterations);
  return result;
}

PressureResult PressureSolver::displace(const ParticleSystem& s, std::span<const Real> rate, Real tolerance, int max_iterations, std::span<Vec3> shift) {
  ZONE("sph.pressure");
  const std::size_t n = s.size();
  CHECK_EQ(y_.size(), n);
  CHECK_EQ(push_.size(), s.walls->walls.size());
  CHECK_EQ(rate.size(), n);
  CHECK_EQ(shift.size(), n);
  PressureResult result;
  if (n == 0) return {0, 0, true};
  const Real count = static_cast<Real>(n), goal = tolerance * tolerance * count;
  parallel_for(n, [&](std::size_t i) {
    y_[i] = low_[i] = 0;
    g_[i] = scale_[i] * static_cast<float>(rate[i]);
  }, 2048);
  const Sums sums = iterate(s, 1, goal, max_iterations, result.iterations);
  result.error = std::sqrt(sums.third / count);
  result.converged = sums.third <= goal;
  parallel_for(n, [&](std::size_t i) {
    p_[i] = y_[i];
    pairs_.set(i, scale_[i] * y_[i]);
  }, 2048);
  accelerate(s);
  parallel_for(n, [&](std::size_t i) { shift[i] = Vec3(a_[i].x, a_[i].y, a_[i].z); }, 2048);
  COUNT("sph.pressure iterations", result.iterations);
  return result;
}

std::size_t PressureSolver::memory() const {
  return pairs_.memory() + (y_.capacity() + low_.capacity() + scale_.capacity() + g_.capacity() + p_.capacity() + Ap_.capacity()) * sizeof(float) +
         a_.capacity() * sizeof(FloatPairs::Vector) + push_.capacity() * sizeof(Vec3) + mirrored_.capacity() * sizeof(Mirrored) + flow_.capacity() * sizeof(Vec3) + change_.capacity() * sizeof(Real) + partial_.capacity() * sizeof(Sums);
}

}  // namespace effuse::flow::sph
