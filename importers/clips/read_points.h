#pragma once

#include <filesystem>

#include "geometry/motion/point_clip.h"

namespace effuse::importers {

/// Trajectories of markers: TRC text (.trc: units and rate from its header, y up as OpenSim has it, turned to z up), or CSV (.csv: a header time,
/// name.x, name.y, name.z, ...; metres, seconds, z up). Empty places and zeros of all three in TRC are points that were not seen.
/// Throws InputError with the line where a file is none of these, a row has another number of fields, or times are not of equal distance.
geometry::PointClip read_points(const std::filesystem::path& file);

}  // namespace effuse::importers
