#pragma once

#include "geometry/mesh/tri_mesh.h"

namespace effuse::geometry {

/// Volume, centre of mass and inertia of a solid of density 1 kg/m^3: multiply volume and inertia by the density.
struct MassProperties {
  Real volume = 0;              ///< [m^3]
  Vec3 centre = Vec3::Zero();   ///< of mass [m]
  Mat3 inertia = Mat3::Zero();  ///< about the centre, along the mesh's axes [m^5]: sum of m (|r|^2 1 - r r^T)
};

/// Of the solid a closed, oriented mesh encloses: the integrals of 1, x and x x^T summed over the tetrahedra
/// between each triangle and one point of the mesh, each exact, so right to rounding also far from the origin:
///   volume V = d/6,  integral of x = V (a + b + c)/4,  of x x^T = V/20 (a a^T + b b^T + c c^T + s s^T),
///   d = a . (b x c), s = a + b + c.
/// Inward-facing meshes give a negative volume and inertia, open ones nonsense: ask validate() first. Indices must be
/// in range (checked). Fixed order: same bits always.
/// Source: Mirtich 1996, J. Graphics Tools 1(2), 31-50; Blow & Binstock 2004, how to find the inertia tensor.
MassProperties mass_properties(const TriMesh& mesh);

/// inertia = axes * diag(moments) * axes^T: moments along the principal axes, rising, and the rotation (right-handed,
/// unit) that takes vectors along them to the frame the inertia is in. Equal moments: any axes that serve.
struct PrincipalAxes {
  Vec3 moments = Vec3::Zero();
  Quat axes = Quat::Identity();
};

/// inertia: symmetric (its lower half is read), finite (checked).
PrincipalAxes principal_axes(const Mat3& inertia);

}  // namespace effuse::geometry
