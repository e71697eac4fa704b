#pragma once

#include <filesystem>
#include <string_view>

#include "importers/points/point_cloud.h"

/// Particles of other programs.
namespace effuse::importers {

struct PointImportOptions {
  /// Read the file's radii. Without, they may be missing, zero or wrong: whoever has a radius of his own need not mind.
  bool radius = true;
};

/// The particles of a file, by its ending; any of them may be gzipped (found by its first bytes, an ending .gz is looked
/// through):
///
///   .ply               vertices; ascii, binary of both byte orders (ply_reader.h)
///   .vtk               legacy VTK, versions 1 to 5, ascii and binary: points and point data of POLYDATA and UNSTRUCTURED_GRID
///   .vtp .vtu          VTK's XML: points and point data of all pieces; ascii, base64 and appended, plain or with zlib
///   .bgeo .bhclassic   Houdini's binary geometry before version 12 ("Bgeo", 'V', 5), which Partio, SPlisHSPlasH and
///                      Houdini's bhclassic write: point attributes of type float, integer, vector
///   .xyz .txt .csv     a line a particle, numbers between blanks, commas or semicolons; # begins a comment. Columns by name
///                      where the first line (or the comment right before the first numbers) names them, else x y z.
///                      An .xyz that is not text: x y z as little-endian float32, nothing else (splashsurf's)
///
/// What is recognised, in small or capital letters; vectors also as three scalars (vx vy vz, velocity_x .., "Velocity:0" ..):
///
///   radius       radius, pscale, particle_radius         velocity     velocity, velocities, vel, v
///   temperature  temperature, temp                       id           id, ids, idp, particle_id, globalids
///   crust        crust                                   age          age
///   rest, rest2  rest, rest2
///
/// Everything else is left out and named in the notes. Ids that are not whole numbers, or that the file's numbers are too
/// coarse to tell apart (float beyond 2^24), are left out, too.
///
/// Throws InputError (file, and the line or byte): a file of none of these kinds, truncated, with a count that does not
/// fit, a word that is no number, a position, velocity, temperature, ... that is not finite, a radius <= 0; and for VTK and
/// BGEO files of kinds that are not read, saying which. Memory is bounded by a small multiple of the file's (unzipped)
/// length, whatever its header promises; unzipped it may have 4 GiB.
/// A file of no particles is one. Deterministic; one thread.
PointCloud import_points(const std::filesystem::path& file, const PointImportOptions& options = {});

/// The same from memory: name stands for the file in messages, its ending chooses the reader.
PointCloud parse_points(std::string_view bytes, const std::string& name, const PointImportOptions& options = {});

/// Whether the file's ending is one of those that are particles whatever they hold (.vtk .vtp .vtu .bgeo .bhclassic .xyz,
/// also with .gz): a .ply may be a mesh, a .csv anything.
bool has_point_ending(const std::filesystem::path& file);

}  // namespace effuse::importers
