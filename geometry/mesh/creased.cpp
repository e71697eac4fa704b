#include "geometry/mesh/creased.h"

#include <cmath>

namespace effuse::geometry {

TriMesh creased(const TriMesh& mesh, Real crease, std::vector<Index>* from) {
  const Real least = std::cos(crease);
  std::vector<Vec3> face;  // as long as twice its area
  std::vector<std::vector<Index>> at(mesh.positions.size());
  for (const Triangle& t : mesh.triangles) {
    for (const Index v : t) at[v].push_back(static_cast<Index>(face.size()));
    face.push_back((mesh.positions[t[1]] - mesh.positions[t[0]]).cross(mesh.positions[t[2]] - mesh.positions[t[0]]));
  }
  TriMesh out;
  if (from) from->clear();
  for (std::size_t f = 0; f < mesh.triangles.size(); ++f) {
    const auto first = static_cast<Index>(out.positions.size());
    for (const Index v : mesh.triangles[f]) {
      Vec3 sum = Vec3::Zero();
      for (const Index g : at[v])
        if (face[g].dot(face[f]) >= least * face[g].norm() * face[f].norm()) sum += face[g];
      out.positions.push_back(mesh.positions[v]);
      out.normals.push_back(sum.norm() > 0 ? Vec3(sum.normalized()) : Vec3(Vec3::UnitZ()));
      if (from) from->push_back(v);
    }
    out.triangles.push_back({first, first + 1, first + 2});
  }
  return out;
}

}  // namespace effuse::geometry
