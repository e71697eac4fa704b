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

}  // namespace effuse
