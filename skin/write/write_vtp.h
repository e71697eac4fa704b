#pragma once

#include <filesystem>
#include <span>
#include <string>

#include "skin/write/write_mesh.h"

/// Meshes and particles for ParaView and all else that reads VTK's XML files.
namespace effuse::skin {

/// VTK PolyData (.vtp): the XML, and behind it the numbers, little-endian, raw or zlib in blocks. Points as float; triangles with
/// "Normals"; every attribute as a float array of its name and width; "color" as uchar sRGB for display, and linear, as it is, as
/// "color_linear". A mesh of vertices without triangles is particles: one vertex cell each, no normals. z up.
///   time      [s], as TimeValue, which ParaView takes for the file's time; finite (checked)
///   compress  zlib at its fastest: Maunga Whau's skin takes some 0.6 of the bytes; a frame takes 2.7 times as long to write (tests/skin/write_bench.cpp)
/// Metadata as strings of the FieldData; characters that XML cannot hold become blanks. The file is whole or absent, what cannot be
/// written is an InputError, as for the other formats.
/// Source: VTK File Formats (Kitware), XML; blocks of compressed data as in the VTK wiki, "VTK XML Formats".
void write_vtp(const std::filesystem::path& file, const geometry::TriMesh& mesh, Real time, const Metadata& metadata = {}, bool compress = true);

/// A file of a series and its time [s]; the name as seen from the folder of the series' own file.
struct TimedFile {
  std::string name;
  Real time = 0;
  int part = 0;  ///< of a collection: files of one time and several parts are shown together
};
/// ParaView's collection (.pvd).
void write_pvd(const std::filesystem::path& file, std::span<const TimedFile> files);
/// Its JSON sibling (.vtp.series), of one part.
void write_series(const std::filesystem::path& file, std::span<const TimedFile> files);

}  // namespace effuse::skin
