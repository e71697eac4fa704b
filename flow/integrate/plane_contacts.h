#pragma once

#include <span>
#include <vector>

#include "flow/integrate/block_newton.h"

namespace effuse::flow {

/// The tangent plane of something that a point is near, found before a step and used through it.
struct PlaneContact {
  Index point = 0;
  Vec3 foot = Vec3::Zero(), normal = Vec3::UnitZ();  ///< normal: unit, out of the solid
  Vec3 velocity = Vec3::Zero();                      ///< of the solid there [m/s]
};

/// A penalty: with s = normal . (x - foot) < 0 and the velocity v relative to the solid's
///   push = max(0, -stiffness s - damping normal . v) along normal,
///   brake = min(damping |slip|, friction push) against slip, the velocity along the plane (Coulomb, a damper below its bound).
struct PenaltyResponse {
  Real stiffness = 0;  ///< [N/m]
  Real damping = 0;    ///< [N s/m]
  Real friction = 0;
};

/// Force on the point [N].
Vec3 contact_force(const PlaneContact& contact, const PenaltyResponse& response, const Vec3& x, const Vec3& v);

/// The same as an energy of the step's end x, for BlockNewton: springs on planes moved on by dt, dampers and friction as they stood at
/// the step's start (x0, v0), on points in touch there.
class ContactEnergy {
 public:
  ContactEnergy(std::span<const PlaneContact> contacts, const PenaltyResponse& response, std::span<const Vec3> x0, std::span<const Vec3> v0, Real dt);

  Real value(std::span<const Vec3> x) const;
  /// held: points to leave alone.
  void derivatives(std::span<const Vec3> x, std::span<const std::uint8_t> held, BlockNewton::Sink& sink) const;

 private:
  struct Damper {
    Vec3 from;      ///< the point's place at the start, moved with the solid
    Mat3 strength;  ///< over dt; 0 where it was not in touch
  };
  Real depth(std::size_t k, std::span<const Vec3> x) const;

  std::span<const PlaneContact> contacts_;
  Real stiffness_, dt_;
  std::vector<Damper> dampers_;
};

}  // namespace effuse::flow
