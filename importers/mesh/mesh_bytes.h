#pragma once

#include <string>
#include <string_view>

#include "importers/mesh/import_mesh.h"

namespace effuse::importers {

/// An imported mesh as bytes and back, to the bit: what goes through read_apart's pipe.
std::string bytes_of_mesh(const MeshImport& import);
/// Throws InputError (name) when the bytes are not of bytes_of_mesh, or the mesh in them contradicts itself.
MeshImport mesh_of_bytes(std::string_view bytes, const std::string& name);

}  // namespace effuse::importers
