#include "flow/bodies/shape.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <set>

#include "geometry/base/check.h"
#include "geometry/procedural/primitives.h"

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

namespace {

/// What is the same for every hull once it stands in body axes.
struct HullExtras {
  Real bound, core;
  std::vector<Vec3> samples;
  explicit HullExtras(const geometry::ConvexHull& hull) : bound(largest_norm(hull.vertices)), core(bound), samples(hull.vertices) {
    for (const auto& face : hull.faces) core = std::min(core, face.offset);
    for (const auto& edge : hull.edges) sample_edge(hull.vertices[edge.vertices[0]], hull.vertices[edge.vertices[1]], bound / 3, samples);
  }
};

}  // namespace

std::shared_ptr<const Shape> Shape::box(const Vec3& half) {
  std::shared_ptr<Shape> s(new Shape);
  s->kind_ = Kind::kHull;
  s->hull_ = geometry::make_box_hull(half);
  s->volume_ = 8 * half.prod();
  const Vec3 squares = half.cwiseAbs2();
  s->moments_ = s->volume_ / 3 * (Vec3::Constant(squares.sum()) - squares);
  HullExtras extras(s->hull_);
  s->bound_ = extras.bound;
  s->core_ = extras.core;
  s->corners_ = s->hull_.vertices.size();
  s->samples_ = std::move(extras.samples);
  return s;
}

std::shared_ptr<const Shape> Shape::hull(const geometry::TriMesh& mesh) {
  std::shared_ptr<Shape> s(new Shape);
  s->kind_ = Kind::kHull;
  const geometry::ConvexHull given = geometry::make_convex_hull(mesh.positions);
  s->take_mass(geometry::mass_properties(geometry::mesh_of(given)));
  s->hull_ = geometry::transformed(given, s->body_from_given_.orientation.toRotationMatrix(), s->body_from_given_.position);
  HullExtras extras(s->hull_);
  s->bound_ = extras.bound;
  s->core_ = extras.core;
  s->corners_ = s->hull_.vertices.size();
  s->samples_ = std::move(extras.samples);
  return s;
}

std::shared_ptr<const Shape> Shape::mesh(const geometry::TriMesh& mesh, Real spacing) {
  CHECK(std::isfinite(spacing));
  CHECK_GE(spacing, 0);
  std::shared_ptr<Shape> s(new Shape);
  s->kind_ = Kind::kMesh;
  const geometry::CollisionMesh given(mesh);
  if (given.solid()) s->take_mass(geometry::mass_properties(given.mesh()));
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
    case Kind::kHull: return geometry::mesh_of(hull_);
    case Kind::kMesh: break;
  }
  return mesh_->mesh();
}

Box3 Shape::bounds(const Vec3& x, const Mat3& R) const {
  Box3 box;
  switch (kind_) {
    case Kind::kSphere: return Box3(x - Vec3::Constant(radius_), x + Vec3::Constant(radius_));
    case Kind::kHull:
      for (const Vec3& v : hull_.vertices) box.extend(R * v);
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
