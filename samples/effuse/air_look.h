#pragma once

#include "flow/scene/effect.h"
#include "geometry/mesh/tri_mesh.h"
#include "skin/preview/preview.h"

namespace effuse {

/// What flies, as a picture shows it. exposure: time the picture is taken in [s].
/// Puffs become a volume, of cells as wide as makes two million; all else specks.
void add_cloud(skin::Air& air, const flow::NamedCloud& cloud, Real exposure);
/// The same of a field; color: linear light that it scatters.
void add_volume(skin::Air& air, geometry::GridVolume volume, const Vec3& color);

/// A small sphere (20 triangles) for each particle, with "color", "temperature", "velocity", "age".
geometry::TriMesh spheres_of(const flow::NamedCloud& cloud);

/// Meshes of a picture become one: of their attributes "color" and "water" go on.
void append_to_picture(geometry::TriMesh& all, const geometry::TriMesh& mesh);

}  // namespace effuse
