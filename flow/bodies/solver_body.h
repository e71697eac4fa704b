#pragma once

#include "flow/bodies/rotor.h"
#include "geometry/collide/rigid_pose.h"

namespace effuse::flow::bodies {

/// A body while impulses are solved for: momenta, and the velocities they make.
///
/// Bodies nobody can move have inverse mass 0 and inverse inertia 0; they are shared by islands that are solved at the same time,
/// and never written. Driven ones have a path: where they are after each substep of the look.
struct SolverBody {
  Vec3 x = Vec3::Zero();
  Quat q = Quat::Identity();
  Mat3 R = Mat3::Identity();
  Vec3 p = Vec3::Zero(), L = Vec3::Zero();  ///< momenta
  Vec3 v = Vec3::Zero(), w = Vec3::Zero();  ///< velocities
  Real im = 0;                              ///< 1 / mass
  Mat3 iI = Mat3::Zero();                   ///< inverse inertia, in the world
  Vec3 moments = Vec3::Ones();
  Vec3 force = Vec3::Zero(), torque = Vec3::Zero();
  bool keeps_axes = false;                  ///< anchors do not turn with it (spheres)
  const geometry::RigidPose* path = nullptr;

  bool moved_by_impulses() const { return im > 0; }
  Vec3 centre(int k) const { return path ? path[k].position : x; }
  /// An anchor's place in the world after substep k.
  Vec3 place(const Vec3& anchor, int k) const {
    if (path) return path[k].position + (keeps_axes ? anchor : path[k].orientation * anchor);
    return x + (keeps_axes ? anchor : Vec3(R * anchor));
  }
  Quat orientation(int k) const { return path ? path[k].orientation : q; }

  /// Impulse P at r from the centre, and a twist beside.
  void push(const Vec3& P, const Vec3& r) {
    if (im == 0) return;
    const Vec3 T = r.cross(P);
    p += P;
    L += T;
    v += im * P;
    w += iI * T;
  }
  void push_with(const Vec3& P, const Vec3& T) {
    if (im == 0) return;
    p += P;
    L += T;
    v += im * P;
    w += iI * T;
  }
  void twist(const Vec3& T) {
    if (im == 0) return;
    L += T;
    w += iI * T;
  }
  /// After q or the momenta were set.
  void refresh() {
    R = q.toRotationMatrix();
    if (im == 0) return;
    iI = R * moments.cwiseInverse().asDiagonal() * R.transpose();
    v = im * p;
    w = iI * L;
  }
};

}  // namespace effuse::flow::bodies
