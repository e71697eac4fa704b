#include <algorithm>
#include <cmath>

#include "flow/springs/spring_system.h"
#include "flow/springs/spring_system_internal.h"
#include "geometry/base/check.h"
#include "geometry/base/parallel.h"
#include "geometry/base/zones.h"

namespace effuse::flow::springs {

namespace {

/// The step's energy and its derivatives. Inactive walls and contacts count as soon as the trial goes through them.
class StepEnergy {
 public:
  StepEnergy(const SpringNetwork& n, const Surroundings& around, Real dt, ImplicitSolve& s, const SpringState& y) : n_(n), around_(around), dt_(dt), s_(s), contacts_(around.contacts, around.response, y.x, y.v, dt) {
    // Dampers act along the directions at the start, those of walls on points in touch there.
    s_.direction.resize(n.springs.size());
    for (std::size_t k = 0; k < n.springs.size(); ++k) {
      const Vec3 l = y.x[n.springs[k].a] - y.x[n.springs[k].b];
      const Real length = l.norm();
      s_.direction[k] = length > 0 ? Vec3(l / length) : Vec3(Vec3::Zero());
    }
    const Real c = around.response.damping / dt;
    for (std::size_t i = 0; i < n.size(); ++i)
      for (const PenaltyWall& wall : around.walls)
        if (wall.normal.dot(y.x[i]) + wall.offset < 0) damped_.push_back({static_cast<Index>(i), c * wall.normal * wall.normal.transpose()});
  }

  Real value(const std::vector<Vec3>& x) const {
    Real sum = parallel_sum(n_.size(), 0.0, [&](std::size_t i) {
      if (n_.held[i]) return 0.0;
      Real e = n_.mass[i] * (x[i] - s_.target[i]).squaredNorm() / (2 * dt_ * dt_);
      e += n_.mass[i] * around_.drag / dt_ * (x[i] - s_.start[i] - dt_ * around_.wind).squaredNorm() / 2;
      for (const PenaltyWall& wall : around_.walls) {
        const Real depth = std::min(0.0, wall.normal.dot(x[i]) + wall.offset);
        e += around_.response.stiffness * depth * depth / 2;
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
    for (const WallDamper& damper : damped_) {
      const Vec3 d = x[damper.point] - s_.start[damper.point];
      sum += d.dot(damper.strength * d) / 2;
    }
    return sum + contacts_.value(x);
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
        g += around_.response.stiffness * depth * wall.normal;
        h += around_.response.stiffness * wall.normal * wall.normal.transpose();
      }
      add(i, g, h);
    }
    for (const WallDamper& damper : damped_)
      if (!n_.held[damper.point]) add(damper.point, damper.strength * (x[damper.point] - s_.start[damper.point]), damper.strength);
    contacts_.derivatives(x, n_.held, sink);
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
  struct WallDamper {
    Index point;
    Mat3 strength;  // over dt
  };
  const SpringNetwork& n_;
  const Surroundings& around_;
  Real dt_;
  ImplicitSolve& s_;
  std::vector<WallDamper> damped_;
  ContactEnergy contacts_;
};

}  // namespace

ImplicitSolve& SpringSystem::Impl::begin(const Surroundings& around, Real dt, const SpringState& y) {
  const SpringNetwork& n = *network;
  CHECK_EQ(y.x.size(), n.size());
  CHECK_EQ(y.v.size(), n.size());
  if (!around.load.empty()) CHECK_EQ(around.load.size(), n.size());
  if (!implicit) {
    std::vector<std::pair<Index, Index>> couplings;
    for (const Spring& spring : n.springs) couplings.emplace_back(spring.a, spring.b);
    implicit = std::make_unique<ImplicitSolve>(ImplicitSolve{BlockNewton(n.size(), couplings), {}, {}, {}, {}});
  }
  ImplicitSolve& s = *implicit;
  s.start = y.x;
  s.target.resize(n.size());
  for (std::size_t i = 0; i < n.size(); ++i) {
    Vec3 push = around.gravity;
    if (around.field) push += around.field->at(y.x[i]) / n.mass[i];
    if (!around.load.empty()) push += around.load[i] / n.mass[i];
    s.target[i] = y.x[i] + dt * y.v[i] + (n.held[i] ? Vec3(Vec3::Zero()) : Vec3(dt * dt * push));
  }
  return s;
}

void SpringSystem::implicit_euler(Real, Real dt, SpringState& y) {
  ZONE("springs.implicit");
  const SpringNetwork& n = *impl_->network;
  ImplicitSolve& s = impl_->begin(surroundings, dt, y);
  for (std::size_t i = 0; i < n.size(); ++i)
    if (n.held[i]) y.x[i] = s.target[i];
  const StepEnergy energy(n, surroundings, dt, s, {s.start, y.v});
  s.report = s.newton.minimise(
      y.x, [&](const std::vector<Vec3>& x) { return energy.value(x); }, [&](const std::vector<Vec3>& x, BlockNewton::Sink& sink) { energy.derivatives(x, sink); },
      {implicit.max_iterations, implicit.tolerance * (impl_->mean_rest > 0 ? impl_->mean_rest : 1)});
  for (std::size_t i = 0; i < n.size(); ++i)
    if (!n.held[i]) y.v[i] = (y.x[i] - s.start[i]) / dt;
}

void SpringSystem::predict(Real dt, const SpringState& y, std::vector<Vec3>& velocity, BlockMatrix& answer) {
  ZONE("springs.predict");
  const SpringNetwork& n = *impl_->network;
  ImplicitSolve& s = impl_->begin(surroundings, dt, y);
  std::vector<Vec3> from = y.x;
  for (std::size_t i = 0; i < n.size(); ++i)
    if (n.held[i]) from[i] = s.target[i];
  const StepEnergy energy(n, surroundings, dt, s, {s.start, y.v});
  const std::vector<Vec3> gradient = s.newton.linearise(from, [&](const std::vector<Vec3>& x, BlockNewton::Sink& sink) { energy.derivatives(x, sink); }, dt * dt, answer);
  velocity.resize(n.size());
  answer.solve(gradient, velocity);
  for (std::size_t i = 0; i < n.size(); ++i) velocity[i] = n.held[i] ? y.v[i] : Vec3(-dt * velocity[i]);
}

BlockNewton::Report SpringSystem::implicit_report() const { return impl_->implicit ? impl_->implicit->report : BlockNewton::Report{}; }

}  // namespace effuse::flow::springs
