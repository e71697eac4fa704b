#pragma once

#include <memory>
#include <span>
#include <vector>

#include "geometry/collide/collision_mesh.h"
#include "geometry/collide/contact.h"
#include "geometry/collide/rigid_pose.h"

namespace effuse::geometry {

/// A mesh in the world, with its way through the current step.
///   shape        shared by as many obstacles as like
///   velocity     of the vertices of shape.mesh() [m/s], of an obstacle that deforms (Obstacles::deform); empty: it is rigid
///   temperature  [K], handed on in contacts; 0: none of its own
///   surface      handed on in contacts; 0 is the terrain's
struct Obstacle {
  CollisionMesh shape;
  RigidMotion motion;
  Real temperature = 0;
  Index surface = 1;
  std::vector<Vec3> velocity = {};

  bool deforms() const { return !velocity.empty(); }
  bool moves() const { return motion.moves() || (deforms() && motion.duration() > 0); }
  /// Of the place `point` (in the world) of a triangle of the mesh, at the step's end [m/s].
  Vec3 velocity_at(Index triangle, const Vec3& point) const;
};

/// Any number of obstacles behind one set of questions. FCL's dynamic tree of boxes holds them (broad phase); where
/// nothing is near, a question costs one box test.
///
/// Changes are for one thread; const questions for many, once update() has been called (checked). The same bits on any
/// number of threads.
class Obstacles {
 public:
  Obstacles();
  ~Obstacles();
  Obstacles(Obstacles&&) noexcept;
  Obstacles& operator=(Obstacles&&) noexcept;

  /// Its number: 0, 1, ... in the order they come.
  std::size_t add(Obstacle obstacle);
  void move(std::size_t i, const RigidMotion& motion);
  /// Makes i a surface that deforms: vertices of its mesh, in the world, at the step's end [m] and the velocities [m/s] at which they have
  /// come there through a step of `duration` [s], straight. Tree and normals are refitted, in O(n); other `triangles`, or a mesh that
  /// cannot be refitted (CollisionMesh::follow), make it anew. Vertices must then be all used, none at another's place.
  ///
  /// A particle (slide.h) meets it as a shape that goes straight, without turning, at the velocity of the place nearest to it: what is
  /// kept exactly is where it is beside that place. While no vertex goes further than two thirds of a particle's radius in a step, particles
  /// keep nine tenths of theirs.
  void deform(std::size_t i, std::span<const Vec3> positions, std::span<const Vec3> velocities, Real duration, std::span<const Triangle> triangles = {});
  void set_temperature(std::size_t i, Real kelvin);  ///< needs no update()
  /// Takes i out for good: nothing meets it. Numbers of the others stay.
  void remove(std::size_t i);
  /// After changes, before questions. The tree is laid out anew only when one has left the room that it is held with.
  void update();

  std::size_t size() const;   ///< removed ones included
  bool empty() const;         ///< none is left
  bool holds(std::size_t i) const;  ///< has not been removed
  const Obstacle& operator[](std::size_t i) const;  ///< one it holds (checked)
  Box3 bounds() const;        ///< of everything at the step's end; empty box: no obstacles
  Box3 swept_bounds() const;  ///< of everything on all of its way
  Box3 swept_bounds(std::size_t i) const;  ///< of one it holds

  /// For each point the up to per_point (1 .. 16) nearest obstacles within reach [m], one contact an obstacle, with obstacles
  /// where they are at the step's end (motion.to()); by distance, then surface, then number.
  ///   out  points.size() * per_point; those of point i from i * per_point on; any() false: no more
  /// surface_velocity is the motion's at the contact's point. In parallel. Points that are not finite have none.
  void contacts(std::span<const Vec3> points, Real reach, int per_point, std::span<Contact> out) const;
  /// Of one point; how many were found.
  int contacts(const Vec3& point, Real reach, std::span<Contact> out) const;

  /// The same with several contacts of one obstacle where its surfaces stand apart (CollisionMesh::surroundings): in corners.
  void surroundings(std::span<const Vec3> points, Real reach, int per_point, std::span<Contact> out) const;

  /// Numbers of the obstacles whose swept boxes meet `box`, rising.
  void meeting(const Box3& box, std::vector<Index>& out) const;

  struct Impl;
  const Impl& impl() const { return *impl_; }  ///< for geometry/collide only

 private:
  std::unique_ptr<Impl> impl_;
};

}  // namespace effuse::geometry
