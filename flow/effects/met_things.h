#pragma once

#include <functional>
#include <span>
#include <vector>

#include "flow/integrate/plane_contacts.h"
#include "flow/scene/effect.h"
#include "geometry/collide/obstacles.h"

namespace effuse::flow {

/// Obstacles of a scene, and its rigid bodies as another effect moves them, for an effect that meets them and moves none. Of a body that
/// has broken it meets the pieces, each coming from where it was in the body; of lava its blocks of crust, each from the moment on at which
/// the lava is first seen with it. An effect steps through a frame that the bodies' own has behind it, or before it: over that frame a body
/// goes straight from where it was to where it is, turning at a constant rate. One that lava steps with itself (Effect::led_by) meets them
/// standing, as they were when that step of the lava's began.
class MetThings {
 public:
  /// All are where they are at time 0.
  explicit MetThings(const World& world);
  /// Looks among the others for one that moves bodies, or may make blocks; as Effect::meet(). Without one they stay. Not to be called by an
  /// effect that is to meet nothing.
  void meet(const std::vector<Effect*>& others);

  /// There is nothing, nor will there be.
  bool empty() const { return obstacles_.empty() && !blocks_; }
  const geometry::Obstacles& obstacles() const { return obstacles_; }
  /// They go from where they are at t [s] to where they are dt later, dt >= 0.
  void move(Real t, Real dt);
  /// Adds to out the planes of what of ground (null: none) and things, up to three, each x may reach: within reach [m] of it, thickness [m] off.
  /// To be called after move().
  void add_planes(const geometry::Terrain* terrain, std::span<const Vec3> x, Real reach, Real thickness, std::vector<PlaneContact>& out);

  void save(StateWriter& out) const;
  void load(StateReader& in);

 private:
  /// A body of the scene, a piece of one, or a block (body: SolidPiece::kNoBody).
  struct Met {
    Index id, body;        // as SolidPiece has them
    std::size_t obstacle;  // kNone: loaded, and its mesh not yet asked for
    geometry::RigidPose from, to;  // at from_time_ and to_time_
  };
  static constexpr std::size_t kNone = ~std::size_t{0};
  void look();
  void find_meshes();
  std::size_t add(const geometry::TriMesh& mesh, const geometry::RigidPose& pose, Index id, Real temperature);
  Real temperature_of(const SolidPiece& piece) const { return piece.body == SolidPiece::kNoBody ? piece.temperature : temperature_[piece.body]; }
  bool may_go(const Met& each) const { return each.body == SolidPiece::kNoBody || breaks_[each.body]; }

  geometry::Obstacles obstacles_;
  std::vector<geometry::PoseTrack> tracks_;  // of the scene's obstacles, which come first
  std::vector<Met> bodies_;
  std::vector<std::uint8_t> breaks_;  // of the scene's bodies
  std::vector<Real> temperature_;     // of those [K]
  const Effect* mover_ = nullptr;
  bool blocks_ = false;  // it may make some
  Real from_time_ = 0, to_time_ = 0;  // [s]
  std::vector<geometry::Contact> found_;
};

}  // namespace effuse::flow
