#include <Eigen/SparseCholesky>
#include <algorithm>
#include <cmath>

#include "flow/springs/spring_system.h"
#include "flow/springs/spring_system_internal.h"
#include "geometry/base/check.h"
#include "geometry/base/parallel.h"
#include "geometry/base/zones.h"

namespace effuse::flow::springs {

namespace {

constexpr Real kSufficient = 1e-4;  // Armijo's share of the decrease the slope promises
constexpr int kHalvings = 40;       // of a line search
constexpr Real kRounding = 1e-14;   // of the energy, relative

constexpr std::size_t kMostDirect = 600;  // points: there both ways of solving take as long
constexpr Real kLeastForcing = 1e-9;      // of conjugate gradients: relative residual

/// A quadratic that pulls one point along one direction, or all: what walls, contacts, friction and drag become for a step.
struct PointTerm {
  Index point;
  Mat3 hessian;   // of the damping part, constant through the step
};

/// The step's energy and its derivatives. Inactive walls and contacts count as soon as the trial goes through them.
class StepEnergy {
 public:
  StepEnergy(const SpringNetwork& n, const Surroundings& around, Real dt, ImplicitSolve& s, const SpringState& y) : n_(n), around_(around), dt_(dt), s_(s) {
    // Dampers act along the directions at the start, friction and wall dampers on points in touch there.
    s_.direction.resize(n.springs.size());
    for (std::size_t k = 0; k < n.springs.size(); ++k) {
      const Vec3 l = y.x[n.springs[k].a] - y.x[n.springs[k].b];
      const Real length = l.norm();
      s_.direction[k] = length > 0 ? Vec3(l / length) : Vec3(Vec3::Zero());
    }
    const Real c = around.contact_damping / dt;
    for (std::size_t i = 0; i < n.size(); ++i)
      for (const PenaltyWall& wall : around.walls)
        if (wall.normal.dot(y.x[i]) + wall.offset < 0) damped_.push_back({static_cast<Index>(i), c * wall.normal * wall.normal.transpose()});
    for (const PointContact& contact : around.contacts) {
      const Real depth = contact.normal.dot(y.x[contact.point] - contact.foot);
      if (depth >= 0) continue;
      const Vec3 v = y.v[contact.point] - contact.velocity;
      const Real speed = (v - contact.normal.dot(v) * contact.normal).norm();
      const Mat3 normal = contact.normal * contact.normal.transpose();
      const Real push = std::max(0.0, -around.contact_stiffness * depth - around.contact_damping * contact.normal.dot(v));
      const Real slide = speed > 0 ? std::min(c, around.friction * push / speed / dt) : (around.friction > 0 ? c : 0);
      damped_.push_back({contact.point, c * normal + slide * (Mat3::Identity() - normal)});
      moved_.push_back(dt * contact.velocity);
    }
    first_contact_ = damped_.size() - moved_.size();
  }

  Real value(const std::vector<Vec3>& x) const {
    Real sum = parallel_sum(n_.size(), 0.0, [&](std::size_t i) {
      if (n_.held[i]) return 0.0;
      Real e = n_.mass[i] * (x[i] - s_.target[i]).squaredNorm() / (2 * dt_ * dt_);
      e += n_.mass[i] * around_.drag / dt_ * (x[i] - s_.start[i] - dt_ * around_.wind).squaredNorm() / 2;
      for (const PenaltyWall& wall : around_.walls) {
        const Real depth = std::min(0.0, wall.normal.dot(x[i]) + wall.offset);
        e += around_.contact_stiffness * depth * depth / 2;
      }
      return e;
    });
    sum += parallel_sum(n_.springs.size(), 0.0, [&](std::size_t k) {
      const Spring& spring = n_.springs[k];
      const SpringMaterial& material = n_.materials[spring.material];
      const Real stretch = (x[spring.a] - x[spring.b]).norm() - spring.rest;
      const Real slid = s_.direction[k].dot(x[spring.a] - s_.start[spring.a] - x[spring.b] + s_.start[spring.b]);
      return material.stiffness * stretch * stretch / 2 + material.damping / dt_ * slid * slid / 2;
    });
    for (const PointContact& contact : around_.contacts) {
      const Real depth = std::min(0.0, contact.normal.dot(x[contact.point] - contact.foot - dt_ * contact.velocity));
      sum += around_.contact_stiffness * depth * depth / 2;
    }
    for (std::size_t k = 0; k < damped_.size(); ++k) {
      const Vec3 d = slid(k, x);
      sum += d.dot(damped_[k].hessian * d) / 2;
    }
    return sum;
  }

  /// Fills the gradient and the Hessian's lower half.
  void derivatives(const std::vector<Vec3>& x) {
    double* values = s_.hessian.valuePtr();
    std::fill(values, values + s_.hessian.nonZeros(), 0.0);
    s_.gradient.setZero();
    for (std::size_t i = 0; i < n_.size(); ++i) {
      if (n_.held[i]) {
        add_point(i, Mat3::Identity());
        continue;
      }
      const Real inertia = n_.mass[i] / (dt_ * dt_), drag = n_.mass[i] * around_.drag / dt_;
      Vec3 g = inertia * (x[i] - s_.target[i]) + drag * (x[i] - s_.start[i] - dt_ * around_.wind);
      Mat3 h = (inertia + drag) * Mat3::Identity();
      for (const PenaltyWall& wall : around_.walls) {
        const Real depth = wall.normal.dot(x[i]) + wall.offset;
        if (depth >= 0) continue;
        g += around_.contact_stiffness * depth * wall.normal;
        h += around_.contact_stiffness * wall.normal * wall.normal.transpose();
      }
      add(i, g, h);
    }
    for (const PointContact& contact : around_.contacts) {
      const Real depth = contact.normal.dot(x[contact.point] - contact.foot - dt_ * contact.velocity);
      if (depth < 0 && !n_.held[contact.point])
        add(contact.point, around_.contact_stiffness * depth * contact.normal, around_.contact_stiffness * contact.normal * contact.normal.transpose());
    }
    for (std::size_t k = 0; k < damped_.size(); ++k)
      if (!n_.held[damped_[k].point]) add(damped_[k].point, damped_[k].hessian * slid(k, x), damped_[k].hessian);
    for (std::size_t k = 0; k < n_.springs.size(); ++k) {
      const Spring& spring = n_.springs[k];
      const SpringMaterial& material = n_.materials[spring.material];
      const Vec3 l = x[spring.a] - x[spring.b];
      const Real length = l.norm();
      const Vec3 u = length > 0 ? Vec3(l / length) : Vec3(Vec3::UnitX());
      const Vec3& w = s_.direction[k];
      const Real slid = w.dot(x[spring.a] - s_.start[spring.a] - x[spring.b] + s_.start[spring.b]);
      const Vec3 g = material.stiffness * (length - spring.rest) * u + material.damping / dt_ * slid * w;
      const Real sideways = length > 0 ? std::max(0.0, 1 - spring.rest / length) : 0;
      const Mat3 uu = u * u.transpose();
      const Mat3 h = material.stiffness * (uu + sideways * (Mat3::Identity() - uu)) + material.damping / dt_ * w * w.transpose();
      const bool a = !n_.held[spring.a], b = !n_.held[spring.b];
      if (a) add(spring.a, g, h);
      if (b) add(spring.b, -g, h);
      if (a && b)
        for (std::size_t c = 0; c < 3; ++c)
          for (int r = 0; r < 3; ++r) values[s_.spring_slot[k][c] + r] -= h(r, static_cast<int>(c));
    }
  }

 private:
  Vec3 slid(std::size_t k, const std::vector<Vec3>& x) const {
    const Vec3 d = x[damped_[k].point] - s_.start[damped_[k].point];
    return k < first_contact_ ? d : Vec3(d - moved_[k - first_contact_]);
  }
  void add(std::size_t i, const Vec3& g, const Mat3& h) {
    s_.gradient.segment<3>(static_cast<Eigen::Index>(3 * i)) += g;
    add_point(i, h);
  }
  void add_point(std::size_t i, const Mat3& h) {
    double* values = s_.hessian.valuePtr();
    for (int c = 0; c < 3; ++c)
      for (int r = c; r < 3; ++r) values[s_.point_slot[i][static_cast<std::size_t>(c)] + r - c] += h(r, c);
  }

  const SpringNetwork& n_;
  const Surroundings& around_;
  Real dt_;
  ImplicitSolve& s_;
  std::vector<PointTerm> damped_;  // walls first
  std::vector<Vec3> moved_;        // of the contacts among them
  std::size_t first_contact_ = 0;
};

/// The pattern of the Hessian and where its blocks lie.
std::unique_ptr<ImplicitSolve> make_solve(const SpringNetwork& n) {
  auto s = std::make_unique<ImplicitSolve>();
  const auto size = static_cast<Eigen::Index>(3 * n.size());
  std::vector<Eigen::Triplet<double>> entries;
  entries.reserve(6 * n.size() + 9 * n.springs.size());
  const auto block = [&](Index row, Index column) {
    for (int c = 0; c < 3; ++c)
      for (int r = row == column ? c : 0; r < 3; ++r) entries.emplace_back(static_cast<int>(3 * row) + r, static_cast<int>(3 * column) + c, 0.0);
  };
  for (std::size_t i = 0; i < n.size(); ++i) block(static_cast<Index>(i), static_cast<Index>(i));
  for (const Spring& spring : n.springs) block(std::max(spring.a, spring.b), std::min(spring.a, spring.b));
  s->hessian.resize(size, size);
  s->hessian.setFromTriplets(entries.begin(), entries.end());
  s->hessian.makeCompressed();
  const auto slot = [&](Index row, int column) {
    const int* begin = s->hessian.innerIndexPtr() + s->hessian.outerIndexPtr()[column];
    const int* end = s->hessian.innerIndexPtr() + s->hessian.outerIndexPtr()[column + 1];
    return static_cast<int>(std::lower_bound(begin, end, static_cast<int>(row)) - s->hessian.innerIndexPtr());
  };
  s->point_slot.resize(n.size());
  for (std::size_t i = 0; i < n.size(); ++i)
    for (std::size_t c = 0; c < 3; ++c) s->point_slot[i][c] = slot(static_cast<Index>(3 * i + c), static_cast<int>(3 * i + c));
  s->spring_slot.resize(n.springs.size());
  for (std::size_t k = 0; k < n.springs.size(); ++k)
    for (std::size_t c = 0; c < 3; ++c)
      s->spring_slot[k][c] = slot(3 * std::max(n.springs[k].a, n.springs[k].b), static_cast<int>(3 * std::min(n.springs[k].a, n.springs[k].b) + c));
  s->direct = n.size() <= kMostDirect;
  if (s->direct) s->factor.analyzePattern(s->hessian);
  s->gradient.resize(size);
  return s;
}

/// Newton's move. Iterated only as far as the step's nearness to its minimum deserves; each is a way down all the same.
bool solve(ImplicitSolve& s, Real steepness) {
  if (s.direct) {
    s.factor.factorize(s.hessian);
    if (s.factor.info() != Eigen::Success) return false;
    s.move = s.factor.solve(-s.gradient);
    return true;
  }
  s.iterate.setTolerance(std::clamp(steepness / 10, kLeastForcing, 0.1));
  s.iterate.compute(s.hessian);
  if (s.iterate.info() != Eigen::Success) return false;
  s.move = s.iterate.solve(-s.gradient);
  return true;
}

}  // namespace

void SpringSystem::implicit_euler(Real, Real dt, SpringState& y) {
  ZONE("springs.implicit");
  const SpringNetwork& n = *impl_->network;
  CHECK_EQ(y.x.size(), n.size());
  CHECK_EQ(y.v.size(), n.size());
  if (!impl_->implicit) impl_->implicit = make_solve(n);
  ImplicitSolve& s = *impl_->implicit;
  s.report = {0, false};
  s.start = y.x;
  s.target.resize(n.size());
  s.trial.resize(n.size());
  for (std::size_t i = 0; i < n.size(); ++i) {
    Vec3 push = surroundings.gravity;
    if (surroundings.field) push += surroundings.field->at(y.x[i]) / n.mass[i];
    s.target[i] = y.x[i] + dt * y.v[i] + (n.held[i] ? Vec3(Vec3::Zero()) : Vec3(dt * dt * push));
    if (n.held[i]) y.x[i] = s.target[i];
  }
  StepEnergy energy(n, surroundings, dt, s, {s.start, y.v});
  const Real small = implicit.tolerance * (impl_->mean_rest > 0 ? impl_->mean_rest : 1);
  Real value = energy.value(y.x), first_steepness = 0;
  for (s.report.iterations = 0; s.report.iterations < implicit.max_iterations && !s.report.converged; ++s.report.iterations) {
    energy.derivatives(y.x);
    const Real steepness = s.gradient.norm();
    if (s.report.iterations == 0) first_steepness = steepness;
    if (!solve(s, steepness / first_steepness)) break;
    const Real largest = n.size() ? s.move.lpNorm<Eigen::Infinity>() : 0;
    if (!std::isfinite(largest)) break;
    const Real slope = s.gradient.dot(s.move);
    // Below its own rounding the energy cannot tell a better point: the last move is taken as it is.
    s.report.converged = largest <= small || -slope <= kRounding * std::abs(value);
    Real share = 1, tried = value;
    int halving = 0;
    for (; halving < kHalvings; ++halving, share /= 2) {
      for (std::size_t i = 0; i < n.size(); ++i) s.trial[i] = y.x[i] + share * s.move.segment<3>(static_cast<Eigen::Index>(3 * i));
      tried = energy.value(s.trial);
      if (s.report.converged || tried <= value + kSufficient * share * slope) break;
    }
    if (halving == kHalvings) break;
    y.x.swap(s.trial);
    value = tried;
  }
  for (std::size_t i = 0; i < n.size(); ++i)
    if (!n.held[i]) y.v[i] = (y.x[i] - s.start[i]) / dt;
}

ImplicitReport SpringSystem::implicit_report() const { return impl_->implicit ? impl_->implicit->report : ImplicitReport{}; }

}  // namespace effuse::flow::springs
