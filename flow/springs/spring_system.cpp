#include "flow/springs/spring_system.h"

#include <fmt/format.h>

#include <Eigen/Eigenvalues>
#include <algorithm>
#include <cmath>

#include "flow/springs/spring_system_internal.h"
#include "geometry/base/check.h"
#include "geometry/base/error.h"
#include "geometry/base/parallel.h"
#include "geometry/base/random.h"
#include "geometry/base/zones.h"

namespace effuse::flow::springs {

namespace {
constexpr std::size_t kGrain = 128;      // points a thread takes at a time
constexpr int kLanczosSteps = 60;        // the largest eigenvalue is right to 1 % long before
constexpr std::uint64_t kStream = 0x5b1; // of the random start vector

void check_network(const SpringNetwork& n) {
  const auto wrong = [](const std::string& what) { throw InputError(Place{"springs"}, what); };
  if (n.held.size() != n.size()) wrong(fmt::format("{} masses, but {} points said to be held or not", n.size(), n.held.size()));
  for (std::size_t i = 0; i < n.size(); ++i)
    if (!(n.mass[i] > 0) || !std::isfinite(n.mass[i])) wrong(fmt::format("point {} has the mass {} kg, wanted more than 0", i, n.mass[i]));
  for (const SpringMaterial& m : n.materials)
    if (!(m.stiffness >= 0) || !(m.damping >= 0) || !(m.tear_strain >= 0)) wrong("a stiffness, damping or tear strain is negative or no number");
  for (std::size_t s = 0; s < n.springs.size(); ++s) {
    const Spring& spring = n.springs[s];
    if (spring.a >= n.size() || spring.b >= n.size() || spring.a == spring.b)
      wrong(fmt::format("spring {} joins the points {} and {}, wanted two different ones below {}", s, spring.a, spring.b, n.size()));
    if (spring.material >= n.materials.size()) wrong(fmt::format("spring {} is of the material {}, there are {}", s, spring.material, n.materials.size()));
    if (!(spring.rest >= 0) || !std::isfinite(spring.rest)) wrong(fmt::format("spring {} has the rest length {} m", s, spring.rest));
  }
}
}  // namespace

SpringSystem::SpringSystem(const SpringNetwork& network) : impl_(std::make_unique<Impl>()) {
  check_network(network);
  impl_->network = &network;
  std::vector<std::size_t>& first = impl_->first;
  first.assign(network.size() + 1, 0);
  for (const Spring& s : network.springs) ++first[s.a + 1], ++first[s.b + 1];
  for (std::size_t i = 0; i < network.size(); ++i) first[i + 1] += first[i];
  impl_->half.resize(2 * network.springs.size());
  std::vector<std::size_t> next(first.begin(), first.end() - 1);
  for (const Spring& s : network.springs) {
    impl_->half[next[s.a]++] = {s.b, s.material, s.rest};
    impl_->half[next[s.b]++] = {s.a, s.material, s.rest};
    impl_->mean_rest += s.rest / static_cast<Real>(network.springs.size());
  }
}

SpringSystem::~SpringSystem() = default;
SpringSystem::SpringSystem(SpringSystem&&) noexcept = default;

void SpringSystem::velocity_rates(Real, const SpringState& y, SpringState& k) const {
  ZONE("springs.forces");
  const SpringNetwork& n = *impl_->network;
  CHECK_EQ(y.x.size(), n.size());
  CHECK_EQ(y.v.size(), n.size());
  k.v.resize(n.size());
  parallel_for(n.size(), [&](std::size_t i) {
    if (n.held[i]) {
      k.v[i] = Vec3::Zero();
      return;
    }
    const Vec3 x = y.x[i], v = y.v[i];
    Vec3 force = Vec3::Zero();
    for (std::size_t h = impl_->first[i]; h < impl_->first[i + 1]; ++h) {
      const HalfSpring& spring = impl_->half[h];
      const SpringMaterial& material = n.materials[spring.material];
      const Vec3 l = x - y.x[spring.other];
      const Real length2 = l.squaredNorm();
      if (length2 == 0) continue;
      const Real length = std::sqrt(length2);
      force -= (material.stiffness * (length - spring.rest) + material.damping * (v - y.v[spring.other]).dot(l) / length) / length * l;
    }
    for (const PenaltyWall& wall : surroundings.walls) {
      const Real s = wall.normal.dot(x) + wall.offset;
      if (s < 0) force -= (surroundings.response.stiffness * s + surroundings.response.damping * wall.normal.dot(v)) * wall.normal;
    }
    if (surroundings.field) force += surroundings.field->at(x);
    if (!surroundings.load.empty()) force += surroundings.load[i];
    k.v[i] = force / n.mass[i] + surroundings.gravity - surroundings.drag * (v - surroundings.wind);
  }, kGrain);

  for (const PlaneContact& c : surroundings.contacts)
    if (!n.held[c.point]) k.v[c.point] += contact_force(c, surroundings.response, y.x[c.point], y.v[c.point]) / n.mass[c.point];
}

void SpringSystem::position_rates(Real, const SpringState& y, SpringState& k) const { k.x = y.v; }

void SpringSystem::rates(Real t, const SpringState& y, SpringState& k) const {
  velocity_rates(t, y, k);
  position_rates(t, y, k);
}

namespace {
/// Largest eigenvalue of a symmetric, positive semi-definite operator on n vectors, by Lanczos' method without
/// reorthogonalisation (lost orthogonality repeats eigenvalues, it makes no false ones).
template <class Apply>
Real largest_eigenvalue(std::size_t n, Apply&& apply) {
  std::vector<Vec3> q(n), last(n, Vec3::Zero()), w(n);
  const auto dot = [&](const std::vector<Vec3>& a, const std::vector<Vec3>& b) { return parallel_sum(n, 0.0, [&](std::size_t i) { return a[i].dot(b[i]); }); };
  for (std::size_t i = 0; i < n; ++i)
    for (std::size_t c = 0; c < 3; ++c) q[i][static_cast<int>(c)] = random_normal(1, kStream, 3 * i + c);
  const Real size = std::sqrt(dot(q, q));
  for (Vec3& each : q) each /= size;
  std::vector<Real> alpha, beta;
  Real beta_last = 0;
  for (int step = 0; step < kLanczosSteps; ++step) {
    apply(q, w);
    alpha.push_back(dot(q, w));
    for (std::size_t i = 0; i < n; ++i) w[i] -= alpha.back() * q[i] + beta_last * last[i];
    beta_last = std::sqrt(dot(w, w));
    if (beta_last <= 1e-12 * std::abs(alpha.back())) break;
    beta.push_back(beta_last);
    std::swap(last, q);
    for (std::size_t i = 0; i < n; ++i) q[i] = w[i] / beta_last;
  }
  const auto m = static_cast<Eigen::Index>(alpha.size());
  Eigen::MatrixXd t = Eigen::MatrixXd::Zero(m, m);
  for (Eigen::Index i = 0; i < m; ++i) {
    t(i, i) = alpha[static_cast<std::size_t>(i)];
    if (i + 1 < m) t(i, i + 1) = t(i + 1, i) = beta[static_cast<std::size_t>(i)];
  }
  return std::max(0.0, Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd>(t, Eigen::EigenvaluesOnly).eigenvalues().maxCoeff());
}
}  // namespace

SpringSystem::Spectrum SpringSystem::spectrum(const SpringState& y) const {
  const SpringNetwork& n = *impl_->network;
  Spectrum found;
  if (n.size() == 0) return found;
  const auto of = [&](Real SpringMaterial::*strength) {
    return largest_eigenvalue(n.size(), [&](const std::vector<Vec3>& q, std::vector<Vec3>& out) {
      parallel_for(n.size(), [&](std::size_t i) {
        Vec3 sum = Vec3::Zero();
        if (!n.held[i])
          for (std::size_t h = impl_->first[i]; h < impl_->first[i + 1]; ++h) {
            const HalfSpring& spring = impl_->half[h];
            const Vec3 l = y.x[i] - y.x[spring.other];
            const Real length2 = l.squaredNorm();
            if (length2 == 0) continue;
            const Vec3 there = n.held[spring.other] ? Vec3(Vec3::Zero()) : Vec3(q[spring.other] / std::sqrt(n.mass[spring.other]));
            sum += n.materials[spring.material].*strength * l.dot(q[i] / std::sqrt(n.mass[i]) - there) / length2 * l;
          }
        out[i] = sum / std::sqrt(n.mass[i]);
      }, kGrain);
    });
  };
  Real lightest = std::numeric_limits<Real>::infinity();
  for (std::size_t i = 0; i < n.size(); ++i)
    if (!n.held[i]) lightest = std::min(lightest, n.mass[i]);
  found.omega = std::sqrt(of(&SpringMaterial::stiffness) + surroundings.response.stiffness / lightest);
  found.gamma = of(&SpringMaterial::damping) + surroundings.response.damping / lightest + surroundings.drag;
  return found;
}

Real longest_stable_step(Scheme scheme, const SpringSystem::Spectrum& spectrum) {
  const Real omega = spectrum.omega, gamma = spectrum.gamma, none = std::numeric_limits<Real>::infinity();
  const Real decay = gamma > 0 ? 2 / gamma : none;
  if (scheme == Scheme::kImplicitEuler || (omega == 0 && gamma == 0)) return none;
  switch (scheme) {
    case Scheme::kEuler: return omega > 0 ? std::min(gamma / (omega * omega), decay) : decay;
    case Scheme::kSymplecticEuler: return omega > 0 ? (std::sqrt(gamma * gamma + 4 * omega * omega) - gamma) / (omega * omega) : decay;
    case Scheme::kMidpoint: return omega > 0 ? std::min(std::cbrt(8e-3 / (2 * kPi)) / omega, decay) : decay;
    default: return 2.78 / std::max(omega, gamma);
  }
}

std::size_t SpringSystem::memory() const {
  std::size_t bytes = impl_->half.capacity() * sizeof(HalfSpring) + impl_->first.capacity() * sizeof(std::size_t);
  if (const ImplicitSolve* s = impl_->implicit.get())
    bytes += s->newton.memory() + (s->start.capacity() + s->target.capacity() + s->direction.capacity()) * sizeof(Vec3);
  return bytes;
}

std::size_t tear(SpringNetwork& network, const std::vector<Vec3>& x) {
  return std::erase_if(network.springs, [&](const Spring& s) {
    const Real strain = network.materials[s.material].tear_strain;
    return strain > 0 && (x[s.a] - x[s.b]).norm() > (1 + strain) * s.rest;
  });
}

}  // namespace effuse::flow::springs
