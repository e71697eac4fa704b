#include "samples/effuse/solid_look.h"

#include <algorithm>
#include <cmath>
#include <vector>

#include "geometry/base/random.h"
#include "skin/color/srgb.h"

namespace effuse {

using geometry::TriMesh;

namespace {

const Real kCrease = std::cos(35 * kPi / 180);
constexpr Real kOctants = 0.62;  ///< brightness of the darker ones

/// sRGB.
Vec3 color_of(LookKind kind, std::size_t number) {
  static constexpr Real kTurn[][3] = {{0.76, 0.32, 0.20}, {0.90, 0.66, 0.26}, {0.27, 0.50, 0.52}, {0.86, 0.81, 0.69},
                                      {0.27, 0.36, 0.56}, {0.58, 0.38, 0.50}, {0.45, 0.58, 0.31}, {0.70, 0.48, 0.34}};
  if (kind == LookKind::kObstacle) return Vec3(0.68, 0.665, 0.645);
  if (kind == LookKind::kRock) return Vec3(0.62, 0.60, 0.575) * (1 - 0.08 * static_cast<Real>(number * 3 % 5));
  const Real* rgb = kTurn[number % std::size(kTurn)];
  return Vec3(rgb[0], rgb[1], rgb[2]);
}

}  // namespace

TriMesh make_piece_look(const TriMesh& mesh, const float* given, Index number) {
  constexpr Real kPale = 1.25, kSpread = 0.16;
  constexpr float kBasalt[] = {0.035f, 0.032f, 0.030f};
  const float* base = given ? given : kBasalt;
  const Real shade = number == 0 ? 1 : 1 + kSpread * (random_uniform(1, 7, number) - 0.5);
  TriMesh look;
  look.positions = mesh.positions;
  look.triangles = mesh.triangles;
  look.normals = mesh.normals;
  geometry::VertexAttribute& color = look.attributes["color"];
  color.width = 3;
  for (const float inner : mesh.attributes.at("inner").values)
    for (int c = 0; c < 3; ++c) color.values.push_back(static_cast<float>(std::min(1.0, base[c] * shade * (inner > 0 ? kPale : 1))));
  return look;
}

TriMesh make_look(const TriMesh& mesh, const Vec3& given, LookKind kind, std::size_t number) {
  const Vec3 srgb = given.minCoeff() < 0 ? color_of(kind, number) : given;
  const Vec3 linear = srgb.unaryExpr([](Real x) { return skin::linear_from_srgb(x); });

  // Normals of triangles, as long as they are large; which triangles meet at a vertex.
  std::vector<Vec3> face;
  std::vector<std::vector<Index>> at(mesh.positions.size());
  for (const geometry::Triangle& t : mesh.triangles) {
    for (const Index v : t) at[v].push_back(static_cast<Index>(face.size()));
    face.push_back((mesh.positions[t[1]] - mesh.positions[t[0]]).cross(mesh.positions[t[2]] - mesh.positions[t[0]]));
  }
  TriMesh look;
  geometry::VertexAttribute& color = look.attributes["color"];
  color.width = 3;
  for (std::size_t k = 0; k < mesh.triangles.size(); ++k) {
    const geometry::Triangle& t = mesh.triangles[k];
    const auto first = static_cast<Index>(look.positions.size());
    look.triangles.push_back({first, first + 1, first + 2});
    const Vec3 middle = mesh.positions[t[0]] + mesh.positions[t[1]] + mesh.positions[t[2]];
    const bool dark = kind == LookKind::kBall && (middle.x() > 0) != ((middle.y() > 0) != (middle.z() > 0));
    for (const Index v : t) {
      Vec3 normal = Vec3::Zero();
      for (const Index other : at[v])
        if (face[other].dot(face[k]) >= kCrease * face[other].norm() * face[k].norm()) normal += face[other];
      look.positions.push_back(mesh.positions[v]);
      look.normals.push_back(normal.norm() > 0 ? Vec3(normal.normalized()) : Vec3::UnitZ());
      for (int c = 0; c < 3; ++c) color.values.push_back(static_cast<float>(linear[c] * (dark ? kOctants : 1)));
    }
  }
  return look;
}

}  // namespace effuse
