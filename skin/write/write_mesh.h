#pragma once

#include <filesystem>
#include <string>
#include <utility>
#include <vector>

#include "geometry/mesh/tri_mesh.h"

namespace effuse::skin {

using Metadata = std::vector<std::pair<std::string, std::string>>;

/// Binary little-endian PLY: x y z float, nx ny nz (always: flat shading without), red green blue uchar sRGB from
/// "color", every other attribute as float scalars of its name (velocity_x, ...). Metadata as comments.
void write_ply(const std::filesystem::path& file, const geometry::TriMesh& mesh, const Metadata& metadata = {});

/// OBJ with normals and `v x y z r g b` (sRGB), z up, nine digits.
void write_obj(const std::filesystem::path& file, const geometry::TriMesh& mesh, const Metadata& metadata = {});

/// Binary glTF 2.0, y up (x, z, -y), POSITION, NORMAL, COLOR_0 (linear), _TEMPERATURE, _VELOCITY, _CRUST; the
/// material glows by "glow" (linear emission) when there: KHR_materials_emissive_strength. Metadata in asset.extras.
/// A mesh without triangles writes a valid file without meshes.
void write_glb(const std::filesystem::path& file, const geometry::TriMesh& mesh, const Metadata& metadata = {});

}  // namespace effuse::skin
