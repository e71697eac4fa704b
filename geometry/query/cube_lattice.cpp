#include "geometry/query/cube_lattice.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "geometry/base/check.h"
#include "geometry/base/error.h"
#include "geometry/base/parallel.h"
#include "geometry/mesh/measure.h"
#include "geometry/mesh/validate.h"
#include "geometry/query/mesh_surface.h"

namespace effuse::geometry {

namespace {
constexpr int kSamples = 4;  // a side, of a cube's share of the inside

/// Share of a cube that lies inside.
float share_inside(const MeshSurface& solid, const Vec3& low, Real spacing) {
  const Real distance = solid.contact(low + Vec3::Constant(spacing / 2)).distance, corner = spacing * std::sqrt(3.0) / 2;
  if (distance > corner) return 0;
  if (distance < -corner) return 1;
  int inside = 0;
  for (int s = 0; s < kSamples * kSamples * kSamples; ++s) {
    const Vec3 at(s / (kSamples * kSamples) + 0.5, s / kSamples % kSamples + 0.5, s % kSamples + 0.5);
    inside += solid.contact(low + spacing / kSamples * at, 2 * spacing).distance < 0;
  }
  return static_cast<float>(inside) / (kSamples * kSamples * kSamples);
}
}  // namespace

CubeLattice fill_with_cubes(const TriMesh& mesh, Real spacing, const std::string& what, std::size_t max_corners) {
  CHECK_GT(spacing, 0);
  const auto wrong = [&](const std::string& message) { throw InputError(Place{what}, message); };
  const MeshReport report = validate(mesh);
  if (!report.closed()) wrong("the mesh is not closed, so it has no inside to fill: " + to_string(report));
  const MeshSurface solid(mesh);
  const Box3 box = bounds(mesh);
  std::array<std::size_t, 3> n;
  Vec3 low;
  Real all_cubes = 1;
  for (int a = 0; a < 3; ++a) {
    const Real count = std::max(1.0, std::ceil(box.sizes()[a] / spacing * (1 - 1e-12)));
    all_cubes *= count;
    if (!(all_cubes <= 8.0 * static_cast<Real>(max_corners))) wrong(fmt::format("a spacing of {:g} m fills the mesh's box with more than {} cubes; take a wider one", spacing, 8 * max_corners));
    n[static_cast<std::size_t>(a)] = static_cast<std::size_t>(count);
    low[a] = box.center()[a] - count * spacing / 2;
  }
  const std::size_t all = n[0] * n[1] * n[2];
  const auto place_of = [&](std::size_t c) { return std::array<int, 3>{static_cast<int>(c / (n[1] * n[2])), static_cast<int>(c / n[2] % n[1]), static_cast<int>(c % n[2])}; };
  const auto cube_low = [&](std::size_t c) {
    const auto [i, j, k] = place_of(c);
    return Vec3(low + spacing * Vec3(i, j, k));
  };
  std::vector<float> share(all);
  parallel_for(all, [&](std::size_t c) { share[c] = share_inside(solid, cube_low(c), spacing); }, 16);
  const auto holding = [&](const Vec3& p) {
    std::array<std::size_t, 3> at;
    for (int a = 0; a < 3; ++a)
      at[static_cast<std::size_t>(a)] = std::min(n[static_cast<std::size_t>(a)] - 1, static_cast<std::size_t>(std::max(0.0, (p[a] - low[a]) / spacing)));
    return (at[0] * n[1] + at[1]) * n[2] + at[2];
  };
  std::vector<std::uint8_t> kept(all);
  for (std::size_t c = 0; c < all; ++c) kept[c] = share[c] > 0;
  for (const Vec3& p : mesh.positions) kept[holding(p)] = 1;

  CubeLattice lattice;
  lattice.spacing = spacing;
  constexpr Index kNone = ~Index{0};
  std::vector<Index> corner_number((n[0] + 1) * (n[1] + 1) * (n[2] + 1), kNone), cube_number(all, kNone);
  for (std::size_t c = 0; c < all; ++c) {
    if (!kept[c]) continue;
    cube_number[c] = static_cast<Index>(lattice.cubes.size());
    const auto [i, j, k] = place_of(c);
    std::array<Index, 8> corners;
    for (std::size_t q = 0; q < 8; ++q) {
      const std::size_t x = static_cast<std::size_t>(i) + (q >> 2), y = static_cast<std::size_t>(j) + (q >> 1 & 1), z = static_cast<std::size_t>(k) + (q & 1);
      Index& number = corner_number[(x * (n[1] + 1) + y) * (n[2] + 1) + z];
      if (number == kNone) {
        number = static_cast<Index>(lattice.corners.size());
        lattice.corners.push_back(low + spacing * Vec3(static_cast<Real>(x), static_cast<Real>(y), static_cast<Real>(z)));
      }
      corners[q] = number;
    }
    lattice.cubes.push_back(corners);
    lattice.place.push_back({i, j, k});
    lattice.share.push_back(share[c]);
  }
  if (lattice.corners.size() > max_corners) wrong(fmt::format("a spacing of {:g} m fills the mesh with {} points, more than {}; take a wider one", spacing, lattice.corners.size(), max_corners));
  for (const Vec3& p : mesh.positions) {
    const std::size_t c = holding(p);
    const Vec3 f = (p - cube_low(c)) / spacing;
    std::array<float, 8> weight;
    for (std::size_t q = 0; q < 8; ++q)
      weight[q] = static_cast<float>((q >> 2 ? f.x() : 1 - f.x()) * (q >> 1 & 1 ? f.y() : 1 - f.y()) * (q & 1 ? f.z() : 1 - f.z()));
    lattice.cube_of.push_back(cube_number[c]);
    lattice.weight.push_back(weight);
  }
  return lattice;
}

}  // namespace effuse::geometry
