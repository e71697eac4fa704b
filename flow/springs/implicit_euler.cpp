#include <algorithm>
#include <cmath>

#include "flow/springs/spring_system.h"
#include "flow/springs/spring_system_internal.h"
#include "geometry/base/check.h"
#include "geometry/base/parallel.h"
#include "geometry/base/zones.h"

namespace effuse::flow::springs {

namespace {

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

  void derivatives(const std::vector<Vec3>& x, BlockNewton::Sink& sink) const {
    const auto add = [&](Index i, const Vec3& g, const Mat3& h) {
      sink.gradient(i, g);
      sink.diagonal(i, h);
    };
    for (Index i = 0; i < n_.size(); ++i) {
      if (n_.held[i]) {
        sink.diagonal(i, Mat3::Identity());
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
      if (a && b) sink.coupling(k, -h);
    }
  }

 private:
  Vec3 slid(std::size_t k, const std::vector<Vec3>& x) const {
    const Vec3 d = x[damped_[k].point] - s_.start[damped_[k].point];
    return k < first_contact_ ? d : Vec3(d - moved_[k - first_contact_]);
  }
  const SpringNetwork& n_;
  const Surroundings& around_;
  Real dt_;
  ImplicitSolve& s_;
  std::vector<PointTerm> damped_;  // walls first
  std::vector<Vec3> moved_;        // of the contacts among them
  std::size_t first_contact_ = 0;
};

}  // namespace

void SpringSystem::implicit_euler(Real, Real dt, SpringState& y) {
  ZONE("springs.implicit");
  const SpringNetwork& n = *impl_->network;
  CHECK_EQ(y.x.size(), n.size());
  CHECK_EQ(y.v.size(), n.size());
  if (!impl_->implicit) {
    std::vector<std::pair<Index, Index>> couplings;
    for (const Spring& spring : n.springs) couplings.emplace_back(spring.a, spring.b);
    impl_->implicit = std::make_unique<ImplicitSolve>(ImplicitSolve{BlockNewton(n.size(), couplings), {}, {}, {}, {}});
  }
  ImplicitSolve& s = *impl_->implicit;
  s.start = y.x;
  s.target.resize(n.size());
  for (std::size_t i = 0; i < n.size(); ++i) {
    Vec3 push = surroundings.gravity;
    if (surroundings.field) push += surroundings.field->at(y.x[i]) / n.mass[i];
    s.target[i] = y.x[i] + dt * y.v[i] + (n.held[i] ? Vec3(Vec3::Zero()) : Vec3(dt * dt * push));
    if (n.held[i]) y.x[i] = s.target[i];
  }
  const StepEnergy energy(n, surroundings, dt, s, {s.start, y.v});
  s.report = s.newton.minimise(
      y.x, [&](const std::vector<Vec3>& x) { return energy.value(x); }, [&](const std::vector<Vec3>& x, BlockNewton::Sink& sink) { energy.derivatives(x, sink); },
      {implicit.max_iterations, implicit.tolerance * (impl_->mean_rest > 0 ? impl_->mean_rest : 1)});
  for (std::size_t i = 0; i < n.size(); ++i)
    if (!n.held[i]) y.v[i] = (y.x[i] - s.start[i]) / dt;
}

BlockNewton::Report SpringSystem::implicit_report() const { return impl_->implicit ? impl_->implicit->report : BlockNewton::Report{}; }

}  // namespace effuse::flow::springs
