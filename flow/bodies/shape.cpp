#include "flow/bodies/shape.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <set>

#include "geometry/base/check.h"
#include "geometry/procedural/primitives.h"
#include "geometry/query/closest_point.h"

namespace effuse::flow::bodies {
namespace {

/// Points inside the segment, at most spacing apart from each other and the ends.
void sample_edge(const Vec3& a, const Vec3& b, Real spacing, std::vector<Vec3>& out) {
  const int parts = static_cast<int>(std::ceil((b - a).norm() / spacing));
  for (int k = 1; k < parts; ++k) out.push_back(a + (b - a) * (static_cast<Real>(k) / parts));
}

Real largest_norm(std::span<const Vec3> points) {
  Real most = 0;
  for (const Vec3& p : points) most = std::max(most, p.norm());
  return most;
}

}  // namespace

/// Body axes: those of inertia, at the centre of mass.
void Shape::take_mass(const geometry::MassProperties& mass) {
  volume_ = mass.volume;
  const geometry::PrincipalAxes axes = geometry::principal_axes(mass.inertia);
  moments_ = axes.moments;
  const Quat body_from_given = axes.axes.conjugate();
  body_from_given_ = {-(body_from_given * mass.centre), body_from_given};
}

std::shared_ptr<const Shape> Shape::sphere(Real radius) {
  CHECK(std::isfinite(radius));
  CHECK_GT(radius, 0);
  std::shared_ptr<Shape> s(new Shape);
  s->kind_ = Kind::kSphere;
  s->radius_ = s->bound_ = s->core_ = radius;
  s->volume_ = 4 * kPi / 3 * radius * radius * radius;
  s->moments_.setConstant(2.0 / 5 * s->volume_ * radius * radius);
  return s;
}

/// What is the same for every hull once it stands in body axes. The core is left to who has several.
void Shape::take_hulls(std::vector<geometry::ConvexHull> hulls) {
  hulls_ = std::move(hulls);
  for (const geometry::ConvexHull& hull : hulls_) {
    bound_ = std::max(bound_, largest_norm(hull.vertices));
    samples_.insert(samples_.end(), hull.vertices.begin(), hull.vertices.end());
  }
  corners_ = samples_.size();
  core_ = bound_;
  for (const geometry::ConvexHull& hull : hulls_) {
    for (const auto& face : hull.faces) core_ = std::min(core_, face.offset);
    for (const auto& edge : hull.edges) sample_edge(hull.vertices[edge.vertices[0]], hull.vertices[edge.vertices[1]], bound_ / 3, samples_);
  }
}

std::shared_ptr<const Shape> Shape::box(const Vec3& half) {
  std::shared_ptr<Shape> s(new Shape);
  s->kind_ = Kind::kHull;
  s->volume_ = 8 * half.prod();
  const Vec3 squares = half.cwiseAbs2();
  s->moments_ = s->volume_ / 3 * (Vec3::Constant(squares.sum()) - squares);
  s->take_hulls({geometry::make_box_hull(half)});
  return s;
}

std::shared_ptr<const Shape> Shape::hull(const geometry::TriMesh& mesh) {
  std::shared_ptr<Shape> s(new Shape);
  s->kind_ = Kind::kHull;
  const geometry::ConvexHull given = geometry::make_convex_hull(mesh.positions);
  s->take_mass(geometry::mass_properties(geometry::mesh_of(given)));
  s->take_hulls({geometry::transformed(given, s->body_from_given_.orientation.toRotationMatrix(), s->body_from_given_.position)});
  return s;
}

std::shared_ptr<const Shape> Shape::parts(std::vector<geometry::ConvexHull> parts, const geometry::MassProperties& mass, geometry::TriMesh surface) {
  CHECK(!parts.empty());
  CHECK_GT(mass.volume, 0);
  std::shared_ptr<Shape> s(new Shape);
  s->kind_ = parts.size() == 1 ? Kind::kHull : Kind::kParts;
  s->take_mass(mass);
  const Mat3 R = s->body_from_given_.orientation.toRotationMatrix();
  for (geometry::ConvexHull& part : parts) part = geometry::transformed(part, R, s->body_from_given_.position);
  for (Vec3& p : surface.positions) p = s->body_from_given_.world(p);
  s->take_hulls(std::move(parts));
  if (s->kind_ == Kind::kHull) return s;
  // The centre may lie in no part: then there is no sphere about it.
  const bool held = std::any_of(s->hulls_.begin(), s->hulls_.end(), [](const geometry::ConvexHull& hull) {
    return std::all_of(hull.faces.begin(), hull.faces.end(), [](const auto& face) { return face.offset >= 0; });
  });
  s->core_ = held ? s->bound_ : 0;
  for (const geometry::Triangle& t : surface.triangles)
    s->core_ = std::min(s->core_, geometry::closest_point_on_triangle(Vec3::Zero(), surface.positions[t[0]], surface.positions[t[1]], surface.positions[t[2]]).point.norm());
  s->outside_ = std::move(surface);
  return s;
}

std::shared_ptr<const Shape> Shape::mesh(const geometry::TriMesh& mesh, Real spacing) { return make_mesh(mesh, spacing, nullptr); }
std::shared_ptr<const Shape> Shape::mesh(const geometry::TriMesh& mesh, const geometry::MassProperties& mass) {
  CHECK_GT(mass.volume, 0);
  return make_mesh(mesh, 0, &mass);
}

std::shared_ptr<const Shape> Shape::make_mesh(const geometry::TriMesh& mesh, Real spacing, const geometry::MassProperties* mass) {
  CHECK(std::isfinite(spacing));
  CHECK_GE(spacing, 0);
  std::shared_ptr<Shape> s(new Shape);
  s->kind_ = Kind::kMesh;
  const geometry::CollisionMesh given(mesh);
  if (mass) s->take_mass(*mass);
  else if (given.solid()) s->take_mass(geometry::mass_properties(given.mesh()));
  geometry::TriMesh turned;
  turned.triangles = given.mesh().triangles;
  for (const Vec3& p : given.mesh().positions) turned.positions.push_back(s->body_from_given_.world(p));
  s->mesh_.emplace(turned);

  const geometry::TriMesh& used = s->mesh_->mesh();
  s->bound_ = largest_norm(used.positions);
  s->core_ = std::max(Real{0}, -s->mesh_->signed_distance(Vec3::Zero()));
  if (spacing == 0) spacing = s->mesh_->bounds().diagonal().norm() / 16;
  s->samples_ = used.positions;
  s->corners_ = used.positions.size();
  std::set<std::pair<Index, Index>> edges;
  for (const geometry::Triangle& t : used.triangles)
    for (int k = 0; k < 3; ++k) edges.insert(std::minmax(t[k], t[(k + 1) % 3]));
  for (const auto& [a, b] : edges) sample_edge(used.positions[a], used.positions[b], spacing, s->samples_);
  s->grid_ = PointGrid(s->samples_);
  return s;
}

geometry::TriMesh Shape::surface() const {
  switch (kind_) {
    case Kind::kSphere: return geometry::make_sphere(Vec3::Zero(), radius_, 3);
    case Kind::kHull: return geometry::mesh_of(hulls_[0]);
    case Kind::kParts: return outside_;
    case Kind::kMesh: break;
  }
  return mesh_->mesh();
}

Box3 Shape::bounds(const Vec3& x, const Mat3& R) const {
  Box3 box;
  switch (kind_) {
    case Kind::kSphere: return Box3(x - Vec3::Constant(radius_), x + Vec3::Constant(radius_));
    case Kind::kHull:
    case Kind::kParts:
      for (const geometry::ConvexHull& hull : hulls_)
        for (const Vec3& v : hull.vertices) box.extend(R * v);
      break;
    case Kind::kMesh: {
      const Box3& own = mesh_->bounds();
      const Vec3 half = R.cwiseAbs() * (own.sizes() / 2), middle = R * own.center();
      box = Box3(middle - half, middle + half);
      break;
    }
  }
  box.translate(x);
  return box;
}

}  // namespace effuse::flow::bodies
