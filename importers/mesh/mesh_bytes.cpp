#include "importers/mesh/mesh_bytes.h"

#include "geometry/base/error.h"
#include "geometry/base/state_io.h"
#include "geometry/mesh/validate.h"

namespace effuse::importers {

std::string bytes_of_mesh(const MeshImport& import) {
  StateWriter out;
  out.array("positions", import.mesh.positions);
  out.array("triangles", import.mesh.triangles);
  out.array("normals", import.mesh.normals);
  out.value("attributes", std::uint64_t{import.mesh.attributes.size()});
  for (const auto& [name, attribute] : import.mesh.attributes) {
    out.text("name", name);
    out.value("width", attribute.width);
    out.array("values", attribute.values);
  }
  out.value("up", static_cast<int>(import.frame.up));
  out.value("unit", import.frame.metres_per_unit);
  out.array("origin", std::vector<Vec3>{import.frame.origin});
  out.text("crs", import.frame.crs);
  out.text("source", import.frame.source);
  out.value("notes", std::uint64_t{import.notes.size()});
  for (const std::string& note : import.notes) out.text("note", note);
  return out.bytes();
}

MeshImport mesh_of_bytes(std::string_view bytes, const std::string& name) {
  // The bytes come from a process that has met a broken file: nothing in them is believed.
  MeshImport import;
  StateReader in(bytes, name);
  in.array("positions", import.mesh.positions);
  in.array("triangles", import.mesh.triangles);
  in.array("normals", import.mesh.normals);
  std::uint64_t count = 0;
  in.value("attributes", count);
  for (std::uint64_t k = 0; k < count; ++k) {
    std::string key;
    geometry::VertexAttribute attribute;
    in.text("name", key);
    in.value("width", attribute.width);
    in.array("values", attribute.values);
    import.mesh.attributes[key] = std::move(attribute);
  }
  int up = 0;
  in.value("up", up);
  in.value("unit", import.frame.metres_per_unit);
  std::vector<Vec3> origin;
  in.array("origin", origin);
  in.text("crs", import.frame.crs);
  in.text("source", import.frame.source);
  in.value("notes", count);
  for (std::uint64_t k = 0; k < count; ++k) {
    std::string note;
    in.text("note", note);
    import.notes.push_back(std::move(note));
  }
  if (up < 0 || up > 3 || origin.size() != 1) throw InputError({name}, "was not read as a whole");
  import.frame.up = static_cast<UpAxis>(up);
  import.frame.origin = origin.front();
  try {
    geometry::validate(import.mesh);
  } catch (const InputError& error) {
    throw InputError({name}, error.faults().front().message);
  }
  return import;
}

}  // namespace effuse::importers
