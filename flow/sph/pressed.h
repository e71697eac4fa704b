#pragma once

#include <span>
#include <vector>

#include "flow/integrate/deformable.h"
#include "flow/sph/boundary.h"

namespace effuse::flow::sph {

/// A solid that lava deforms, in one step: how its points answer to impulses. Its walls name it and a triangle of its surface (Wall::triangle).
///
///   surface    number of its contacts
///   triangles  of the surface as contacts know them, on the vertices of solid->surface()
///   free       velocities of the points [m/s] through the step if lava did nothing
///   velocity   the same as the solves have them; vertices: of the surface's vertices
///   answer     A [kg]: A (velocity - free) = impulses of lava
///   mobility   of each vertex [1/kg]: no impulse on it moves it by more than this times the impulse
///   near       some wall names it; if none does nothing of it is computed but its surface
struct Pressed {
  Deformable* solid = nullptr;
  Index surface = 0;
  std::vector<geometry::Triangle> triangles;
  std::vector<Vec3> free, velocity, vertices;
  BlockMatrix answer;
  std::vector<Real> mobility;
  bool near = false;

  /// Of a value on the vertices that at a wall's place.
  Vec3 at(const Wall& wall, std::span<const Vec3> on_vertices) const {
    const geometry::Triangle& t = triangles[wall.triangle];
    return wall.arm[0] * on_vertices[t[0]] + wall.arm[1] * on_vertices[t[1]] + wall.arm[2] * on_vertices[t[2]];
  }
  /// Shares out what acts at a wall's place among the triangle's vertices.
  void share(const Wall& wall, const Vec3& value, std::span<Vec3> to_vertices) const {
    const geometry::Triangle& t = triangles[wall.triangle];
    for (int k = 0; k < 3; ++k) to_vertices[t[static_cast<std::size_t>(k)]] += wall.arm[k] * value;
  }
  /// Velocities (of points and vertices) that impulses [N s] on the vertices add.
  void respond(std::span<const Vec3> impulses, std::vector<Vec3>& points, std::vector<Vec3>& on_vertices) const;
  /// Takes these up.
  void add(Real factor, std::span<const Vec3> points, std::span<const Vec3> on_vertices);
  /// What lava has done in the solves [N s], by point.
  std::vector<Vec3> impulses() const;
};

}  // namespace effuse::flow::sph
