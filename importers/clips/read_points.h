#pragma once

#include <filesystem>

#include "geometry/motion/point_clip.h"

namespace effuse::importers {

/// Trajectories of markers, as tools write out what their recordings (C3D) hold; by extension and what the text begins with:
///
///   .trc               TRC: units and rate from its header, y up as OpenSim has it, turned to z up; all three zero: not seen
///   .tsv .txt          the tracking system's table, tabs between: rows NO_OF_FRAMES, FREQUENCY, MARKER_NAMES, ..., then x y z of each marker,
///                      behind frame and time where a row Frame, Time, ... says so; millimetres, z up; all three zero, NULL or NaN: not seen
///   .csv .tsv .txt     the laboratory's table, commas or tabs between: a section that begins with a row Trajectories, then the rate [1/s], names over
///                      each three columns, Frame, Sub Frame, X, Y, Z, ..., units (mm, cm or m); other sections are passed over; z up
///   .csv .tsv .txt     else: a header time, name.x, name.y, name.z, ...; metres, seconds, z up
///
/// Empty places are points that were not seen. Throws InputError with the line where a file is none of these, a row has another number of
/// fields, or frames are not of equal distance.
geometry::PointClip read_points(const std::filesystem::path& file);

}  // namespace effuse::importers
