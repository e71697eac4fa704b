#include "geometry/collide/rigid_pose.h"

#include <cmath>

#include "geometry/base/check.h"

namespace effuse::geometry {

namespace {

/// Turned by the rotation vector w [rad].
Quat turned(const Quat& q, const Vec3& w) {
  const Real angle = w.norm();
  if (angle == 0) return q;
  return (Quat(Eigen::AngleAxisd(angle, w / angle)) * q).normalized();
}

}  // namespace

RigidMotion::RigidMotion(const RigidPose& from, const RigidPose& to, Real duration) : from_(from), to_(to), duration_(duration) {
  for (RigidPose* pose : {&from_, &to_}) {
    CHECK(pose->position.allFinite());
    CHECK(pose->orientation.coeffs().allFinite());
    CHECK_GT(pose->orientation.norm(), 0.0);
    pose->orientation.normalize();
  }
  CHECK(std::isfinite(duration));
  CHECK_GE(duration, 0.0);
  if (duration == 0) {
    from_ = to_;
    return;
  }
  shift_ = to_.position - from_.position;
  if (from_.orientation.coeffs() == to_.orientation.coeffs()) return;
  // q and -q are one orientation: the shorter way is that of the difference with w >= 0.
  Quat difference = to_.orientation * from_.orientation.conjugate();
  if (difference.w() < 0) difference.coeffs() = -difference.coeffs();
  const Real sine = difference.vec().norm();
  if (sine > 0) turn_ = 2 * std::atan2(sine, difference.w()) / sine * difference.vec();
}

RigidPose RigidMotion::pose(Real s) const {
  if (s <= 0 || !moves()) return from_;
  if (s >= 1) return to_;
  return {from_.position + s * shift_, turned(from_.orientation, s * turn_)};
}

RigidMotion RigidMotion::turned_back() const {
  if (!moves() || duration_ == 0) return RigidMotion(from_);
  RigidPose before = from_;
  before.position -= shift_;
  before.orientation = turned(from_.orientation, -turn_);
  return RigidMotion(before, from_, duration_);
}

Vec3 RigidMotion::velocity_at(const Vec3& world, Real s) const {
  if (duration_ == 0) return Vec3::Zero();
  return (shift_ + turn_.cross(world - (from_.position + s * shift_))) / duration_;
}

Box3 placed_box(const RigidPose& pose, const Box3& box) {
  if (box.isEmpty()) return box;
  const Mat3 turn = pose.orientation.toRotationMatrix();
  const Vec3 centre = pose.position + turn * box.center(), half = turn.cwiseAbs() * (box.sizes() / 2);
  // Grown by what rounding may have cost.
  const Vec3 slack = Vec3::Constant(4e-16 * (centre.cwiseAbs().maxCoeff() + box.sizes().maxCoeff()));
  return {centre - half - slack, centre + half + slack};
}

Box3 RigidMotion::swept_box(const Box3& box) const {
  if (box.isEmpty()) return box;
  Box3 swept = placed_box(from_, box);
  if (!moves()) return swept;
  swept.extend(placed_box(to_, box));
  if (!turns()) return swept;
  // A point at distance l from the frame's origin leaves the straight way between its ends by at most l angle^2 / 8.
  const Real furthest = box.min().cwiseAbs().cwiseMax(box.max().cwiseAbs()).norm();
  const Vec3 sagitta = Vec3::Constant(furthest * turn_.squaredNorm() / 8 * (1 + 1e-12));
  return {swept.min() - sagitta, swept.max() + sagitta};
}

}  // namespace effuse::geometry
