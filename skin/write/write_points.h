#pragma once

#include <filesystem>

#include "geometry/mesh/points.h"
#include "skin/write/write_mesh.h"

/// Particles for other programs, and for ours to read again (importers/points).
///
/// Positions and all they carry as float32 (a position is right to 6e-8 of the largest coordinate), under the names that
/// the format's users expect; what the points do not have is not written. Axes stay as they are (Houdini takes y for up). The
/// file is whole or absent (geometry/base/files.h); no points is a valid file, too. A number that is not finite, or an array
/// of the wrong length, is an InputError naming file and fault, a full disk a ResourceError. No radius is written when
/// points.radius is empty.
namespace effuse::skin {

/// Binary little-endian PLY, vertices only: x y z, radius, velocity_x .., temperature, crust, age, rest_x .., rest2_x ..,
/// id (uint; where one does not fit, double; InputError beyond
/// 2^53).
void write_points_ply(const std::filesystem::path& file, const geometry::Points& points, const Metadata& metadata = {});

/// Legacy VTK, binary: an UNSTRUCTURED_GRID of one vertex cell a particle (ParaView shows those, splashsurf reads them), the
/// rest as POINT_DATA arrays: radius, velocity, temperature, crust, age, rest, rest2, id (as above). Metadata on the title
/// line, as far as its 255 characters go.
void write_points_vtk(const std::filesystem::path& file, const geometry::Points& points, const Metadata& metadata = {});

/// Houdini's and Partio's binary BGEO, version 5: position, pscale, v, temperature, crust, age, rest, rest2, id (integer:
/// InputError from 2^31 on). The format has no place for metadata.
void write_points_bgeo(const std::filesystem::path& file, const geometry::Points& points);

}  // namespace effuse::skin
