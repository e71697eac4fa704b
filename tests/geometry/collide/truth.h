#pragma once

#include <algorithm>
#include <cmath>
#include <limits>
#include <ostream>
#include <string>
#include <vector>

#include "geometry/base/random.h"
#include "geometry/collide/rigid_pose.h"
#include "geometry/procedural/primitives.h"

/// What contacts are measured against: every triangle asked, in long double, by formulas of their own.
namespace effuse::geometry::truth {

using Long = long double;
using LVec3 = Eigen::Matrix<Long, 3, 1>;

inline Vec3 unit(std::uint64_t seed, std::uint64_t index) {
  const Vec3 d(random_normal(seed, 0, index), random_normal(seed, 1, index), random_normal(seed, 2, index));
  return d.normalized();
}

inline RigidPose random_pose(std::uint64_t seed, std::uint64_t index, Real far) {
  const Quat q(random_normal(seed, 0, index), random_normal(seed, 1, index), random_normal(seed, 2, index), random_normal(seed, 3, index));
  return {far * unit(seed + 1, index), q.normalized()};
}

/// Nearest point of a triangle: of its inside, if the foot on the plane is there, else of its sides.
inline LVec3 nearest_on_triangle(const LVec3& p, const LVec3& a, const LVec3& b, const LVec3& c) {
  // Gram's matrix would do for fat triangles; a sliver's sides must be asked one by one.
  const LVec3 n = (b - a).cross(c - a);
  const auto left_of = [&](const LVec3& from, const LVec3& to) { return n.dot((to - from).cross(p - from)) >= 0; };
  if (n.dot(n) > 0 && left_of(a, b) && left_of(b, c) && left_of(c, a)) return p - n * (n.dot(p - a) / n.dot(n));
  LVec3 best = a;
  const auto side = [&](const LVec3& from, const LVec3& to) {
    const LVec3 d = to - from;
    const Long share = std::clamp((p - from).dot(d) / d.dot(d), Long{0}, Long{1});
    const LVec3 q = from + share * d;
    if ((p - q).squaredNorm() < (p - best).squaredNorm()) best = q;
  };
  side(a, b);
  side(b, c);
  side(c, a);
  return best;
}

struct Nearest {
  Long distance = std::numeric_limits<Long>::infinity();
  std::vector<Vec3> towards;  ///< unit, from p to every nearest point (to 1e-9 of the distance)
};

inline Nearest nearest(const TriMesh& mesh, const Vec3& p) {
  const LVec3 x = p.cast<Long>();
  std::vector<LVec3> foot;
  foot.reserve(mesh.triangles.size());
  Nearest found;
  for (const auto& [a, b, c] : mesh.triangles) {
    foot.push_back(nearest_on_triangle(x, mesh.positions[a].cast<Long>(), mesh.positions[b].cast<Long>(), mesh.positions[c].cast<Long>()));
    found.distance = std::min(found.distance, (foot.back() - x).norm());
  }
  for (const LVec3& q : foot)
    if (const LVec3 d = q - x; d.norm() <= found.distance * (1 + 1e-9L) && found.distance > 0) found.towards.push_back((d / d.norm()).cast<double>());
  return found;
}

/// How often the mesh goes round p: the sum of the solid angles of its triangles over 4 pi (Van Oosterom & Strackee 1983).
inline double winding(const TriMesh& mesh, const Vec3& p) {
  double sum = 0;
  for (const auto& t : mesh.triangles) {
    const Vec3 a = mesh.positions[t[0]] - p, b = mesh.positions[t[1]] - p, c = mesh.positions[t[2]] - p;
    const double la = a.norm(), lb = b.norm(), lc = c.norm();
    sum += 2 * std::atan2(a.dot(b.cross(c)), la * lb * lc + a.dot(b) * lc + b.dot(c) * la + c.dot(a) * lb);
  }
  return sum / (4 * kPi);
}

inline TriMesh placed(TriMesh mesh, const RigidPose& pose) {
  for (Vec3& x : mesh.positions) x = pose.world(x);
  return mesh;
}

inline Box3 bounds(const TriMesh& mesh) {
  Box3 box;
  for (const Vec3& x : mesh.positions) box.extend(x);
  return box;
}

/// Points in the frame of the mesh: a third anywhere in its box grown by half its size, a third near the surface (on
/// both sides, at distances from 1e-6 of the size on), a third next to edges and vertices.
inline Vec3 random_point(const TriMesh& mesh, std::uint64_t seed, std::uint64_t k) {
  const Box3 box = bounds(mesh);
  const Real size = box.sizes().norm();
  const auto u = [&](std::uint64_t stream) { return random_uniform(seed, stream, k); };
  if (k % 3 == 0) return box.center() + Vec3(u(0) - 0.5, u(1) - 0.5, u(2) - 0.5).cwiseProduct(1.5 * box.sizes() + Vec3::Constant(0.1 * size));
  const auto& t = mesh.triangles[static_cast<std::size_t>(u(3) * static_cast<Real>(mesh.triangles.size()))];
  Real a = u(4), b = u(5);
  if (k % 3 == 2) {
    a = k % 2 ? 0 : 1e-3 * a;
    b = k % 2 ? b : 0;
  } else if (a + b > 1) {
    a = 1 - a;
    b = 1 - b;
  }
  const Vec3 on = mesh.positions[t[0]] + a * (mesh.positions[t[1]] - mesh.positions[t[0]]) + b * (mesh.positions[t[2]] - mesh.positions[t[0]]);
  return on + std::pow(10.0, -6 + 5.5 * u(6)) * size * unit(seed + 7, k);
}

/// A knife: two faces that meet at 5 degrees, so that beside its edge one face's normal says little of the side.
inline TriMesh knife() {
  TriMesh mesh;
  const Real t = std::tan(2.5 * kPi / 180);
  mesh.positions = {{0, -1, 0}, {2, -1, -2 * t}, {2, -1, 2 * t}, {0, 1, 0}, {2, 1, -2 * t}, {2, 1, 2 * t}};
  mesh.triangles = {{0, 1, 2}, {3, 5, 4}, {0, 3, 4}, {0, 4, 1}, {1, 4, 5}, {1, 5, 2}, {2, 5, 3}, {2, 3, 0}};
  return mesh;
}

struct Shape {
  std::string name;
  TriMesh mesh;
  bool solid;
};

/// A block with a notch: edges that turn inward.
inline TriMesh notched_block() {
  TriMesh mesh;
  const Vec2 outline[6] = {{0, 0}, {2, 0}, {2, 1}, {1, 1}, {1, 2}, {0, 2}};
  for (const Real z : {0.0, 1.0})
    for (const Vec2& p : outline) mesh.positions.emplace_back(p.x(), p.y(), z);
  for (const auto& [a, b, c] : {Triangle{0, 1, 2}, {0, 2, 3}, {0, 3, 5}, {3, 4, 5}}) {
    mesh.triangles.push_back({a, c, b});
    mesh.triangles.push_back({a + 6, b + 6, c + 6});
  }
  for (Index k = 0; k < 6; ++k) {
    const Index next = (k + 1) % 6;
    mesh.triangles.push_back({k, next, next + 6});
    mesh.triangles.push_back({k, next + 6, k + 6});
  }
  return mesh;
}

inline void PrintTo(const Shape& shape, std::ostream* out) { *out << shape.name; }

inline std::vector<Shape> shapes() {
  return {{"PlaneSheet", make_grid({-3, -2, 0.5}, {0.5, 0.5}, 12, 8), false},
          {"Box", make_box({-1, -0.5, 0}, {1, 0.5, 0.7}), true},
          {"Sphere", make_sphere({0.2, 0, 0}, 1, 3), true},
          {"Torus", make_torus({0, 0, 0}, 1, 0.3, 48, 24), true},
          {"ThinPlate", make_box({-1, -1, 0}, {1, 1, 1e-3}), true},
          {"Notched", notched_block(), true},
          {"Knife", knife(), true}};
}

}  // namespace effuse::geometry::truth
