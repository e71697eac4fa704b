#include "skin/detail/smooth_surface.h"

#include <algorithm>
#include <cmath>
#include <numeric>
#include <vector>

#include "geometry/base/zones.h"
#include "skin/detail/blend.h"

namespace effuse::skin {

namespace {
constexpr Real kRadius = 2;       // [mean edges at the vertex]
constexpr Real kMostMoved = 1;       // [edges]
constexpr int kMostSteps = 8;     // two or three serve almost everywhere
constexpr Real kCloseEnough = 2e-4;  // of what it may move
// Length of the mean normal, both sides of a sheet counted: 0.93 on a cylinder as thick as the radius, 0.75 on a right-angled edge.
constexpr Real kSharp = 0.8, kBlunt = 0.93;
}

SmoothSurface::SmoothSurface(const geometry::TriMesh& mesh) {
  ZONE("skin.smooth_surface");
  const std::size_t n = mesh.positions.size();
  CHECK_EQ(mesh.normals.size(), n);
  std::vector<Real>& length = edge_;
  length.assign(n, 0);
  std::vector<int> count(n, 0);
  for (const geometry::Triangle& t : mesh.triangles)
    for (std::size_t k = 0; k < 3; ++k) {
      const Index a = t[k], b = t[(k + 1) % 3];
      const Real edge = (mesh.positions[a] - mesh.positions[b]).norm();
      for (const Index v : {a, b}) {
        length[v] += edge;
        ++count[v];
      }
    }
  // Pieces by their first vertex.
  piece_.resize(n);
  std::iota(piece_.begin(), piece_.end(), Index{0});
  const auto first_of = [&](Index v) {
    while (piece_[v] != v) v = piece_[v] = piece_[piece_[v]];
    return v;
  };
  for (const geometry::Triangle& t : mesh.triangles)
    for (const Index other : {t[1], t[2]}) {
      const Index a = first_of(t[0]), b = first_of(other);
      piece_[std::max(a, b)] = std::min(a, b);
    }
  for (std::size_t v = 0; v < n; ++v) piece_[v] = first_of(static_cast<Index>(v));

  std::vector<Vertex> vertices;
  Real sum = 0;
  for (std::size_t v = 0; v < n; ++v) {
    if (count[v] == 0 || !(length[v] > 0)) continue;
    edge_[v] = length[v] / count[v];
    const Real radius = kRadius * edge_[v];
    vertices.push_back({mesh.positions[v], mesh.normals[v], radius, piece_[v], static_cast<Index>(v)});
    reach_ = std::max(reach_, radius);
    sum += radius;
  }
  if (vertices.empty()) return;
  const Real mean = sum / static_cast<Real>(vertices.size());
  grid_ = NearGrid<Vertex>(std::move(vertices), std::max(mean, reach_ / 4));
}

void SmoothSurface::project(Vec3& x, Vec3& normal, Index piece, Real edge) const {
  const Vec3 start = x, start_normal = normal;
  Real share = 0;
  for (int step = 0; step < kMostSteps; ++step) {
    const Vec3 side = normal;  // the last step's, so that in the end it does not matter with which we began
    Real weight = 0, all = 0, along = 0;
    Vec3 n = Vec3::Zero(), every = Vec3::Zero(), offset = Vec3::Zero();
    grid_.each_near(x, reach_, [&](const Vertex& v) {
      if (v.piece != piece) return;
      const Vec3 d = x - v.x;
      const Real t = 1 - d.squaredNorm() / (v.radius * v.radius);
      if (t <= 0) return;
      const Real any = t * t * t, w = any * smoothstep(0, 0.5, v.normal.dot(side));
      all += any;
      every += any * v.normal;
      weight += w;
      n += w * v.normal;
      offset += w * d;
      along += w * v.normal.dot(d);
    });
    const Real length = n.norm();
    if (!(weight > 1e-9) || !(length > 1e-3 * weight)) break;
    n /= length;
    share = smoothstep(kSharp, kBlunt, every.norm() / all);
    const Real f = (along + n.dot(offset)) / (2 * weight);
    x -= f * n;
    normal = n;
    const Vec3 moved = x - start;
    const Real most = kMostMoved * edge;
    if (moved.squaredNorm() > most * most) x = start + most * moved.normalized();
    if (std::abs(f) < kCloseEnough * most) break;
  }
  x = start + share * (x - start);
  normal = (start_normal + share * (normal - start_normal)).normalized();
}

}  // namespace effuse::skin
