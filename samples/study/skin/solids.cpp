#include "samples/study/skin/solids.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "geometry/base/check.h"
#include "geometry/base/parallel.h"
#include "geometry/base/random.h"
#include "geometry/mesh/measure.h"
#include "geometry/mesh/validate.h"
#include "geometry/query/mesh_tree.h"

namespace effuse::study {

namespace {

Box3 box_of(Real x, Real y, Real z) { return Box3(-Vec3(x + 0.5, y + 0.5, z + 0.5), Vec3(x + 0.5, y + 0.5, z + 0.5)); }

Vec3 direction(Real u, Real v) {
  const Real z = 2 * u - 1, r = std::sqrt(std::max(0.0, 1 - z * z)), a = 2 * kPi * v;
  return Vec3(r * std::cos(a), r * std::sin(a), z);
}

/// By central differences: of a distance, hence of length one where it is smooth.
std::function<Vec3(const Vec3&)> outward_of(std::function<Real(const Vec3&)> distance) {
  return [distance = std::move(distance)](const Vec3& p) {
    constexpr Real e = 1e-5;
    Vec3 g;
    for (int a = 0; a < 3; ++a) g[a] = distance(p + e * Vec3::Unit(a)) - distance(p - e * Vec3::Unit(a));
    return g.norm() > 0 ? Vec3(g.normalized()) : Vec3(Vec3::UnitZ());
  };
}

Real box_distance(const Vec3& p, const Vec3& half) {
  const Vec3 q = p.cwiseAbs() - half;
  return q.cwiseMax(0).norm() + std::min(0.0, q.maxCoeff());
}

/// A point of a box's six faces, by area; u is used up.
Vec3 point_of_box(const Vec3& half, Real u, Real v, Real w) {
  const Vec3 area(half.y() * half.z(), half.z() * half.x(), half.x() * half.y());
  Real at = u * area.sum();
  int axis = 0;
  while (axis < 2 && at >= area[axis]) at -= area[axis++];
  const Real side = at < area[axis] / 2 ? -1 : 1;
  Vec3 p;
  p[axis] = side * half[axis];
  p[(axis + 1) % 3] = (2 * v - 1) * half[(axis + 1) % 3];
  p[(axis + 2) % 3] = (2 * w - 1) * half[(axis + 2) % 3];
  return p;
}

Solid sphere(Real r) {
  Solid s{"sphere", "radius 8", box_of(r, r, r), 4.0 / 3 * kPi * r * r * r, [r](const Vec3& p) { return p.norm() - r; }, {}, {}};
  s.point = [r](Real u, Real v, Real) -> Vec3 { return r * direction(u, v); };
  return s;
}

Solid slab(const Vec3& half) {
  Solid s{"slab", "20 x 16 x 5", box_of(half.x(), half.y(), half.z()), 8 * half.prod(), [half](const Vec3& p) { return box_distance(p, half); }, {}, {}};
  s.point = [half](Real u, Real v, Real w) { return point_of_box(half, u, v, w); };
  return s;
}

/// A box grown by r all round; its area is that of six faces, twelve quarter cylinders and eight eighths of a sphere.
Solid round_slab(const Vec3& half, Real r) {
  const Vec3 core = half - Vec3::Constant(r);
  const Real faces = 8 * (core.x() * core.y() + core.y() * core.z() + core.z() * core.x()), edges = 4 * kPi * r * core.sum(), corners = 4 * kPi * r * r;
  Solid s{"round slab", "20 x 16 x 5, edges rounded by 1", box_of(half.x(), half.y(), half.z()), 0, [core, r](const Vec3& p) { return box_distance(p, core) - r; }, {}, {}};
  // Steiner: volume, area r, mean width r^2, ball.
  s.volume = 8 * core.prod() + faces * r + 2 * kPi * r * r * core.sum() + 4.0 / 3 * kPi * r * r * r;
  s.point = [=](Real u, Real v, Real w) -> Vec3 {
    Real at = u * (faces + edges + corners);
    if (at < faces) {
      const Vec3 p = point_of_box(core, at / faces, v, w);
      for (int a = 0; a < 3; ++a)
        if (std::abs(std::abs(p[a]) - core[a]) < 1e-12) return p + r * (p[a] > 0 ? 1 : -1) * Vec3::Unit(a);
      return p;
    }
    at -= faces;
    if (at < edges) {
      Real along = at / edges * core.sum();
      int axis = 0;
      while (axis < 2 && along >= core[axis]) along -= core[axis++];
      Vec3 p;
      p[axis] = (2 * along / core[axis] - 1) * core[axis];
      for (int k = 1; k <= 2; ++k) {
        const Real d = k == 1 ? std::cos(2 * kPi * v) : std::sin(2 * kPi * v);
        p[(axis + k) % 3] = (d > 0 ? 1 : -1) * core[(axis + k) % 3] + r * d;
      }
      return p;
    }
    const Vec3 d = direction(v, w);
    return r * d + d.cwiseSign().cwiseProduct(core);
  };
  return s;
}

Solid cylinder(Real r, Real half) {
  Solid s{"cylinder", "radius 5.5, height 14", box_of(r, r, half), 2 * kPi * r * r * half, {}, {}, {}};
  s.distance = [r, half](const Vec3& p) {
    const Real a = std::hypot(p.x(), p.y()) - r, b = std::abs(p.z()) - half;
    return std::hypot(std::max(a, 0.0), std::max(b, 0.0)) + std::min(0.0, std::max(a, b));
  };
  s.point = [r, half](Real u, Real v, Real w) -> Vec3 {
    const Real side = 2 * half / (2 * half + r), angle = 2 * kPi * v;  // areas 4 pi r half and 2 pi r^2
    if (u < side) return Vec3(r * std::cos(angle), r * std::sin(angle), (2 * w - 1) * half);
    const Real q = r * std::sqrt(w);
    return Vec3(q * std::cos(angle), q * std::sin(angle), u < (1 + side) / 2 ? -half : half);
  };
  return s;
}

Solid torus(Real R, Real r) {
  Solid s{"torus", "radii 6.5 and 3", box_of(R + r, R + r, r), 2 * kPi * kPi * R * r * r, {}, {}, {}};
  s.distance = [R, r](const Vec3& p) { return std::hypot(std::hypot(p.x(), p.y()) - R, p.z()) - r; };
  s.point = [R, r](Real u, Real v, Real) -> Vec3 {
    // Area goes as R + r cos b: b + (r / R) sin b = 2 pi u, by Newton's steps.
    Real b = 2 * kPi * u;
    for (int k = 0; k < 30; ++k) b -= (b + r / R * std::sin(b) - 2 * kPi * u) / (1 + r / R * std::cos(b));
    const Real a = 2 * kPi * v, q = R + r * std::cos(b);
    return Vec3(q * std::cos(a), q * std::sin(a), r * std::sin(b));
  };
  return s;
}

}  // namespace

const std::vector<Solid>& solids() {
  static const std::vector<Solid> all = [] {
    std::vector<Solid> s = {sphere(8), slab(Vec3(10, 8, 2.5)), round_slab(Vec3(10, 8, 2.5), 1), cylinder(5.5, 7), torus(6.5, 3)};
    for (Solid& one : s) one.outward = outward_of(one.distance);
    return s;
  }();
  return all;
}

SurfaceError surface_error(const geometry::TriMesh& mesh, const Solid& solid, std::size_t samples) {
  CHECK_EQ(mesh.normals.size(), mesh.positions.size());
  SurfaceError error;
  const geometry::MeshReport report = geometry::validate(mesh);
  error.solid = report.solid() && report.components == 1;
  error.what = geometry::to_string(report);
  if (mesh.triangles.empty()) {
    error.volume = error.hausdorff = error.mean = error.normal = std::numeric_limits<Real>::infinity();
    return error;
  }
  error.volume = std::abs(geometry::signed_volume(mesh) / solid.volume - 1);

  // The mesh from the surface.
  const std::size_t n = mesh.positions.size(), faces = mesh.triangles.size();
  const auto larger = [](Real a, Real b) { return std::max(a, b); };
  const Real vertices_off = parallel_reduce(n, Real{0}, [&](std::size_t i) { return std::abs(solid.distance(mesh.positions[i])); }, larger);
  struct Face {
    Real area, off;
  };
  std::vector<Face> face(faces);
  parallel_for(faces, [&](std::size_t t) {
    const auto& [a, b, c] = mesh.triangles[t];
    const Vec3 &p = mesh.positions[a], &q = mesh.positions[b], &r = mesh.positions[c];
    face[t] = {(q - p).cross(r - p).norm() / 2, std::abs(solid.distance((p + q + r) / 3))};
  });
  Real area = 0, faces_sum = 0, faces_off = 0;
  for (const Face& f : face) {
    area += f.area;
    faces_sum += f.area * f.off;
    faces_off = std::max(faces_off, f.off);
  }
  const Real turned = parallel_reduce(n, Real{0}, [&](std::size_t i) { return std::acos(std::clamp(mesh.normals[i].dot(solid.outward(mesh.positions[i])), -1.0, 1.0)); }, [](Real a, Real b) { return a + b; });
  error.normal = turned / static_cast<Real>(n);

  // The surface from the mesh.
  const geometry::MeshTree tree(mesh.positions, mesh.triangles);
  std::vector<Real> off(samples);
  parallel_for(
      samples,
      [&](std::size_t i) {
        const Vec3 p = solid.point(random_uniform(11, 0, i), random_uniform(11, 1, i), random_uniform(11, 2, i));
        off[i] = tree.nearest(p)->distance;
      },
      64);
  Real sum = 0, surface_off = 0;
  for (const Real d : off) {
    sum += d;
    surface_off = std::max(surface_off, d);
  }
  error.hausdorff = std::max({vertices_off, faces_off, surface_off});
  error.mean = std::max(faces_sum / area, sum / static_cast<Real>(samples));
  return error;
}

}  // namespace effuse::study
