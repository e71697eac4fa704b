#include "flow/integrate/plane_contacts.h"

#include <algorithm>

namespace effuse::flow {

Vec3 contact_force(const PlaneContact& contact, const PenaltyResponse& response, const Vec3& x, const Vec3& v) {
  const Real s = contact.normal.dot(x - contact.foot);
  if (s >= 0) return Vec3::Zero();
  const Vec3 relative = v - contact.velocity;
  const Real push = std::max(0.0, -response.stiffness * s - response.damping * contact.normal.dot(relative));
  const Vec3 slip = relative - contact.normal.dot(relative) * contact.normal;
  const Real speed = slip.norm();
  Vec3 force = push * contact.normal;
  if (speed > 0) force -= std::min(response.damping, response.friction * push / speed) * slip;
  return force;
}

ContactEnergy::ContactEnergy(std::span<const PlaneContact> contacts, const PenaltyResponse& response, std::span<const Vec3> x0, std::span<const Vec3> v0, Real dt)
    : contacts_(contacts), stiffness_(response.stiffness), dt_(dt) {
  for (const PlaneContact& c : contacts) {
    Damper& damper = dampers_.emplace_back(Damper{x0[c.point] + dt * c.velocity, Mat3::Zero()});
    const Real s = c.normal.dot(x0[c.point] - c.foot);
    if (s >= 0) continue;
    const Vec3 v = v0[c.point] - c.velocity;
    const Real speed = (v - c.normal.dot(v) * c.normal).norm();
    const Real push = std::max(0.0, -response.stiffness * s - response.damping * c.normal.dot(v));
    const Real brake = speed > 0 ? std::min(response.damping, response.friction * push / speed) : response.friction > 0 ? response.damping : 0;
    const Mat3 across = c.normal * c.normal.transpose();
    damper.strength = (response.damping * across + brake * (Mat3::Identity() - across)) / dt;
  }
}

Real ContactEnergy::depth(std::size_t k, std::span<const Vec3> x) const {
  const PlaneContact& c = contacts_[k];
  return std::min(0.0, c.normal.dot(x[c.point] - c.foot - dt_ * c.velocity));
}

Real ContactEnergy::value(std::span<const Vec3> x) const {
  Real sum = 0;
  for (std::size_t k = 0; k < contacts_.size(); ++k) {
    const Real s = depth(k, x);
    const Vec3 d = x[contacts_[k].point] - dampers_[k].from;
    sum += stiffness_ * s * s / 2 + d.dot(dampers_[k].strength * d) / 2;
  }
  return sum;
}

void ContactEnergy::derivatives(std::span<const Vec3> x, std::span<const std::uint8_t> held, BlockNewton::Sink& sink) const {
  for (std::size_t k = 0; k < contacts_.size(); ++k) {
    const PlaneContact& c = contacts_[k];
    if (held[c.point]) continue;
    const Real s = depth(k, x);
    sink.gradient(c.point, stiffness_ * s * c.normal + dampers_[k].strength * (x[c.point] - dampers_[k].from));
    sink.diagonal(c.point, dampers_[k].strength + (s < 0 ? stiffness_ : 0) * c.normal * c.normal.transpose());
  }
}

}  // namespace effuse::flow
