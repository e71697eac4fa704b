#pragma once

#include <optional>

#include "flow/scene/effect.h"
#include "geometry/mesh/tri_mesh.h"
#include "skin/preview/preview.h"
#include "skin/write/write_mesh.h"

namespace effuse {

inline constexpr Real kShutter = 0.5;  ///< of a frame's time: what flies is drawn as long as it flies in that

/// What flies, as a picture shows it. exposure: time the picture is taken in [s].
/// Puffs become a volume, of cells as wide as makes two million; all else specks.
void add_cloud(skin::Air& air, const flow::NamedCloud& cloud, Real exposure);
/// The same of a field; color: linear light that it scatters.
void add_volume(skin::Air& air, geometry::GridVolume volume, const Vec3& color);

/// How clouds and volumes are drawn, among what travels with their files, and read again from there: for pictures made of files
/// (`effuse render`). A cloud of points that says no look is nothing to draw: false.
skin::Metadata with_color(skin::Metadata about, const Vec3& color);
skin::Metadata with_look(skin::Metadata about, const flow::NamedCloud& cloud);
std::optional<Vec3> color_of(const skin::Metadata& about);
bool take_look(const skin::Metadata& about, flow::NamedCloud& cloud);

/// A small sphere (20 triangles) for each particle, with "color", "temperature", "velocity", "age".
geometry::TriMesh spheres_of(const flow::NamedCloud& cloud);

/// Meshes of a picture become one: of their attributes "color" and "water" go on.
void append_to_picture(geometry::TriMesh& all, const geometry::TriMesh& mesh);

}  // namespace effuse
