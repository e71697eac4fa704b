#pragma once

#include <memory>
#include <optional>
#include <vector>

#include "flow/bodies/point_grid.h"
#include "geometry/collide/collision_mesh.h"
#include "geometry/collide/convex_hull.h"
#include "geometry/collide/rigid_pose.h"
#include "geometry/mesh/mass_properties.h"
#include "geometry/mesh/tri_mesh.h"

namespace effuse::flow::bodies {

/// What a body is made of, in body axes: origin at the centre of mass, axes along the principal moments of inertia.
/// Immutable, shared by bodies of one kind.
///
/// Spheres, hulls and parts meet each other exactly (parts in pairs). A mesh of any form (with holes, hollows, open sheets) is met through
/// its sample points, vertices and points along edges, each against the signed distance of the other, and
/// the other's points against it; where it is thinner than the samples are apart, corners may pass between them.
class Shape {
 public:
  enum class Kind { kSphere, kHull, kParts, kMesh };

  static std::shared_ptr<const Shape> sphere(Real radius);
  /// With edges of the lengths 2 * half.
  static std::shared_ptr<const Shape> box(const Vec3& half);
  /// The convex hull of a closed mesh's vertices, or of points that span a volume. Mass is the hull's.
  static std::shared_ptr<const Shape> hull(const geometry::TriMesh& mesh);
  /// The mesh itself. spacing [m]: of the sample points along edges; 0: a sixteenth of the size. One with a part that is no
  /// solid (CollisionMesh) has no mass: it is for static and driven bodies (RigidBodies::add refuses it), in its own axes.
  /// Throws InputError as CollisionMesh does.
  static std::shared_ptr<const Shape> mesh(const geometry::TriMesh& mesh, Real spacing = 0);
  /// Convex parts that touch and do not overlap, as one body (kHull if there is one): pieces of something broken. surface: closed, of all
  /// together. Mass is what is told (of volume > 0), not that of the hulls, which are flattened a little.
  static std::shared_ptr<const Shape> parts(std::vector<geometry::ConvexHull> parts, const geometry::MassProperties& mass, geometry::TriMesh surface);
  /// A mesh of which the mass is known.
  static std::shared_ptr<const Shape> mesh(const geometry::TriMesh& mesh, const geometry::MassProperties& mass);

  Kind kind() const { return kind_; }
  bool solid() const { return volume_ > 0; }
  Real volume() const { return volume_; }             ///< [m^3]; 0: not closed
  const Vec3& moments() const { return moments_; }    ///< of inertia at density 1 [m^5], rising
  /// The frame the shape was given in, from body axes: x_body = orientation * x_given + position.
  const geometry::RigidPose& body_from_given() const { return body_from_given_; }

  Real radius() const { return radius_; }             ///< of the sphere
  Real bounding_radius() const { return bound_; }     ///< about the centre of mass [m]
  Real core_radius() const { return core_; }          ///< of the largest sphere about the centre of mass inside [m]
  const geometry::ConvexHull& hull() const { return hulls_[0]; }            ///< kHull
  const std::vector<geometry::ConvexHull>& hulls() const { return hulls_; } ///< kHull: one; kParts
  const geometry::CollisionMesh& collision_mesh() const { return *mesh_; }  ///< kMesh, in body axes
  /// Points that stand for the surface against terrain and meshes: corners first, then along edges. None for spheres.
  const std::vector<Vec3>& samples() const { return samples_; }
  std::size_t corners() const { return corners_; }
  const PointGrid& sample_grid() const { return grid_; }                    ///< kMesh: over all samples
  /// Its surface in body axes, for pictures: spheres as a mesh inside them.
  geometry::TriMesh surface() const;
  /// Box of the shape in the pose given (world_from_body), tight for hulls and spheres.
  Box3 bounds(const Vec3& x, const Mat3& R) const;

 private:
  Shape() = default;
  void take_mass(const geometry::MassProperties& mass);
  void take_hulls(std::vector<geometry::ConvexHull> hulls);
  static std::shared_ptr<const Shape> make_mesh(const geometry::TriMesh& mesh, Real spacing, const geometry::MassProperties* mass);
  Kind kind_ = Kind::kSphere;
  Real volume_ = 0, radius_ = 0, bound_ = 0, core_ = 0;
  Vec3 moments_ = Vec3::Zero();
  geometry::RigidPose body_from_given_;
  std::vector<geometry::ConvexHull> hulls_;
  geometry::TriMesh outside_;  // of parts, in body axes
  std::optional<geometry::CollisionMesh> mesh_;
  std::vector<Vec3> samples_;
  std::size_t corners_ = 0;
  PointGrid grid_;
};

}  // namespace effuse::flow::bodies
