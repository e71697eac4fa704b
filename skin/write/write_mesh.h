#pragma once

#include <filesystem>
#include <string>
#include <utility>
#include <vector>

#include "geometry/mesh/tri_mesh.h"
#include "skin/tessellate/labels.h"

/// Meshes for Blender, Houdini, ParaView and web viewers. Our own writers, because the libraries' drop the attributes
/// (temperature, velocity, crust) that a shader needs, or write files that are wrong.
///
/// All of them: the file is whole or absent (geometry/base/files.h); a mesh without triangles, or without vertices, is a
/// valid file too, so that a sequence has no gap before the lava comes; normals are always there (computed when the
/// mesh has none: readers shade flat without). A mesh that cannot be written (index out of range, a number that is not
/// finite, an attribute of the wrong length) is an InputError naming file and fault, a full disk a ResourceError.
namespace effuse::skin {

/// Lines of text that travel with the file: origin, CRS, time, ...; line breaks in them become blanks.
using Metadata = std::vector<std::pair<std::string, std::string>>;

/// Binary little-endian PLY: x y z float, nx ny nz (always: flat shading without), red green blue uchar sRGB from
/// "color", every other attribute as float scalars of its name (velocity_x, ...). Faces: `list uchar uint
/// vertex_indices`. Metadata as comments, all before the first element (some readers refuse later ones).
void write_ply(const std::filesystem::path& file, const geometry::TriMesh& mesh, const Metadata& metadata = {});
/// The same with x y z double.
void write_exact_ply(const std::filesystem::path& file, const geometry::TriMesh& mesh, const Metadata& metadata = {});

/// The same with the regions: of each vertex, and of each triangle where labels has them, the id of the particle whose region it is
/// in as `uint region`, its lower 32 bits; and where there are ids of more than that, `uint region_high`: id = region + 2^32 region_high.
/// PLY's readers know whole numbers of up to 32 bits (most refuse a file with longer ones). Many keep what they read as float, which is exact
/// up to 2^24 (Blender, and effuse's own reader): where there are larger ids, a comment in the file says so. Blender reads
/// a vertex's properties and skips those of a face. OBJ and GLB leave regions out: the one has no place for them, the other's
/// attributes are no whole numbers beyond 16 bits. Sizes must agree (checked).
void write_skin_ply(const std::filesystem::path& file, const geometry::TriMesh& mesh, const RegionLabels& labels,
                    const Metadata& metadata = {});

/// OBJ with normals and `v x y z r g b` (sRGB), z up (in Blender: forward Y, up Z), nine digits: positions to 5e-9 of
/// the largest coordinate, in one number of decimals for the file. OBJ has no place for other attributes.
void write_obj(const std::filesystem::path& file, const geometry::TriMesh& mesh, const Metadata& metadata = {});

/// Binary glTF 2.0, y up (x, z, -y), POSITION, NORMAL, COLOR_0 (linear, 16 bit), _TEMPERATURE, _VELOCITY, _CRUST and
/// every other attribute in upper case (three wide: a vector, turned to y up too). Metadata in asset.extras.
///
/// Glow: glTF has no emission per vertex, and unlit display colours would take the sun off the crust. So the mesh's
/// "glow" (linear emission, may exceed 1) becomes a ramp of 256 texels from dark to brightest, embedded as the
/// emissive texture; TEXCOORD_0 says where on it a vertex is, KHR_materials_emissive_strength how bright its end is.
/// Exact for emission that is a curve through colour space, as a black body's is; else the mean hue of each brightness.
/// COLOR_0 stays the display colour: a reader that ignores emission still shows hot lava hot.
/// A mesh without triangles writes a valid file without meshes.
void write_glb(const std::filesystem::path& file, const geometry::TriMesh& mesh, const Metadata& metadata = {});

/// Binary STL: positions as float and the triangles' own normals; no attributes. Its header of 80 bytes holds the metadata's
/// "origin" and as much of its "crs" as fits; it never begins with "solid".
void write_stl(const std::filesystem::path& file, const geometry::TriMesh& mesh, const Metadata& metadata = {});

}  // namespace effuse::skin
