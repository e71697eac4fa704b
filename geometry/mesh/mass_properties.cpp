#include "geometry/mesh/mass_properties.h"

#include <Eigen/Eigenvalues>

#include "geometry/base/check.h"

namespace effuse::geometry {

MassProperties mass_properties(const TriMesh& mesh) {
  MassProperties m;
  if (mesh.triangles.empty()) return m;
  const std::size_t n = mesh.positions.size();
  CHECK_LT(mesh.triangles[0][0], n);
  const Vec3 origin = mesh.positions[mesh.triangles[0][0]];  // near the mesh: nothing cancels far from the world's origin

  Real sixths = 0;
  Vec3 first = Vec3::Zero();
  Mat3 second = Mat3::Zero();
  for (const Triangle& t : mesh.triangles) {
    for (const Index i : t) CHECK_LT(i, n);
    const Vec3 a = mesh.positions[t[0]] - origin, b = mesh.positions[t[1]] - origin, c = mesh.positions[t[2]] - origin;
    const Vec3 s = a + b + c;
    const Real d = a.dot(b.cross(c));
    sixths += d;
    first += d * s;
    second += d * (a * a.transpose() + b * b.transpose() + c * c.transpose() + s * s.transpose());
  }
  m.volume = sixths / 6;
  if (m.volume == 0) {
    m.centre = origin;
    return m;
  }
  const Vec3 middle = first / (24 * m.volume);
  m.centre = origin + middle;
  const Mat3 about_centre = second / 120 - m.volume * (middle * middle.transpose());
  m.inertia = about_centre.trace() * Mat3::Identity() - about_centre;
  return m;
}

PrincipalAxes principal_axes(const Mat3& inertia) {
  CHECK(inertia.allFinite());
  const Eigen::SelfAdjointEigenSolver<Mat3> solver(inertia);
  Mat3 axes = solver.eigenvectors();
  if (axes.determinant() < 0) axes.col(2) = -axes.col(2);
  return {solver.eigenvalues(), Quat(axes).normalized()};
}

}  // namespace effuse::geometry
