#pragma once

#include <cstddef>

#include "geometry/mesh/tri_mesh.h"

namespace effuse {

/// A thing as pictures and files show it, in its own frame: three vertices a triangle, normals smooth up to creases of 35 degrees,
/// "color" in linear light.
///   color  sRGB 0..1; negative: none given
///   kind   what it gets then: obstacles the grey of concrete, bodies of a file's mesh rock of shades, boxes and balls colours in turn
///   number among its kind
/// Balls have lighter and darker octants, so that one sees them roll.
enum class LookKind { kObstacle, kRock, kBox, kBall };
geometry::TriMesh make_look(const geometry::TriMesh& mesh, const Vec3& color, LookKind kind, std::size_t number);

/// A piece of something broken: its mesh has flat normals and "inner". color: linear, of the body it broke off; null: dark basalt.
/// Faces that breaking has made are paler than weathered ones, and pieces of different numbers differ a little; number 0: as the body.
geometry::TriMesh make_piece_look(const geometry::TriMesh& mesh, const float* color, Index number);

}  // namespace effuse
