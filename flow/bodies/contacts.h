#pragma once

#include <optional>
#include <span>
#include <vector>

#include "flow/bodies/shape.h"
#include "geometry/terrain/terrain.h"

/// Where bodies touch each other and the ground: the narrow phase.
namespace effuse::flow::bodies {

inline constexpr Index kTerrain = ~Index{0};

/// A place where two bodies touch, or will before the next look.
///
/// Anchors go with their bodies from look to look, so that between two looks the separation is
/// normal . (place of on_b - place of on_a). They are in body axes; of a sphere, which shows no turning, they are in the world's axes
/// from its centre; of the terrain they are places in the world.
struct ContactPoint {
  Index a = 0, b = 0;                             ///< bodies, a < b; b may be kTerrain
  Vec3 on_a = Vec3::Zero(), on_b = Vec3::Zero();  ///< anchors [m]
  Vec3 normal = Vec3::UnitZ();                    ///< unit, from a to b, in the world
  Real separation = 0;                            ///< [m] when looked for
  Real of_a = 0.5;                                ///< the impulses act on_a's place (1), on_b's (0) or half way (ManifoldPoint)
  Real push = 0;                                  ///< impulse along the normal in the last substep [N s], >= 0
  Vec3 drag = Vec3::Zero();                       ///< of friction, on b, in the world [N s]
  Vec3 twist = Vec3::Zero();                      ///< of rolling friction, on b [N m s]
};

/// A body as the narrow phase sees it.
struct PlacedShape {
  const Shape* shape = nullptr;
  Vec3 x = Vec3::Zero();
  Mat3 R = Mat3::Identity();
  std::vector<geometry::ConvexHull> hulls;  ///< of a hull and of parts: in the world
  std::vector<Box3> boxes;    ///< of parts
  Real margin = 0;            ///< [m]: contacts are made this far ahead

  void place(const Shape& s, const Vec3& centre, const Mat3& orientation);
  /// The anchor of a place given from x, in the world's axes.
  Vec3 anchor(const Vec3& from_x) const {
    return shape->kind() == Shape::Kind::kSphere ? from_x : Vec3(R.transpose() * from_x);
  }
};

/// The terrain, and the points of it that may stick into bodies larger than its cells.
class GroundShape {
 public:
  explicit GroundShape(geometry::Terrain terrain);
  const geometry::Terrain& terrain() const { return terrain_; }
  /// Whether its points lie closer than a body of this size is wide.
  bool finer_than(Real size) const { return spacing_ < size; }
  /// f(point) for points of the surface in the box, and perhaps some beside.
  template <class F>
  void points_near(const Box3& box, F&& f) const;

 private:
  geometry::Terrain terrain_;
  Real spacing_ = 0;
  PointGrid grid_;  // of a mesh's vertices
};

/// Appends the places where bodies a and b touch or come within the larger margin. `before`: those of the last look, so that a
/// sphere in a groove, whose nearest wall is on one side only, keeps the other.
void collide(Index a, const PlacedShape& A, Index b, const PlacedShape& B, std::span<const ContactPoint> before,
             std::vector<ContactPoint>& out);

/// The same for body a and the terrain.
void collide_terrain(Index a, const PlacedShape& A, const GroundShape& ground, std::span<const ContactPoint> before,
                     std::vector<ContactPoint>& out);

/// Impulses of `before` handed on to the places of `now` that are the same: of the same pair, with anchors on a or b within
/// `tolerance` of it (the nearest). Both sorted by pair, ranges of one pair each.
void hand_on(std::span<const ContactPoint> before, std::span<ContactPoint> now, Real tolerance);

/// Share of the way from x to x + d after which a sphere of this radius first touches the surface of B (any shape; B goes by
/// its motion meanwhile) or the terrain. 1: it does not, or it touches from the start.
Real first_touch(const PlacedShape& B, const geometry::RigidMotion& motion, const Vec3& x, const Vec3& d, Real radius);
Real first_touch(const GroundShape& ground, const Vec3& x, const Vec3& d, Real radius);

}  // namespace effuse::flow::bodies
