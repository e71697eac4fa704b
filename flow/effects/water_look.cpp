#include "flow/effects/water_look.h"

#include <algorithm>
#include <cmath>

#include "flow/effects/effect_table.h"
#include "geometry/base/parallel.h"
#include "geometry/mesh/measure.h"

namespace effuse::flow {

namespace {
constexpr Index kNone = ~Index{0};
// Film boiling under a plate is 160 W/(m^2 K) in saturated water by Berenson's formula (0.425 (k^3 rho_v (rho_l - rho_v) g h' /
// (mu dT sqrt(sigma / (g (rho_l - rho_v)))))^(1/4), steam at 900 K, dT 1000 K), more in cold water; the most that water takes up is
// Zuber's 1.1 MW/m^2. What crust there is matters more after its first second.
// Sources: Berenson 1961, J. Heat Transfer 83, 351-356; Zuber 1959, AECU-4439.
constexpr Real kBoiling = 500;
}  // namespace

void read_water(Parameters& p, WaterLook& look, Real& temperature, Real& boiling) {
  look.color = read_color(p, Vec3(0.07, 0.24, 0.30), "red, green and blue, 0 to 1 (sRGB), of deep water");
  look.clear = p.number("clear", "m", look.clear, Parameters::positive(), "in which what lies under it fades to 1/e");
  temperature = p.number("temperature", "K", 288.15, {200, 400}, "of the water");
  boiling = p.number("boiling", "W/(m2 K)", kBoiling, Parameters::not_negative(), "heat transfer of lava under it, radiation apart; 0: it does not quench");
}

void paint_water(geometry::TriMesh& mesh, const WaterLook& look) {
  const std::size_t n = mesh.positions.size();
  geometry::VertexAttribute &color = mesh.attributes["color"], &water = mesh.attributes["water"];
  color.width = 3;
  color.values.resize(3 * n);
  water.width = 1;
  water.values.assign(n, static_cast<float>(look.clear));
  for (std::size_t i = 0; i < 3 * n; ++i) color.values[i] = static_cast<float>(look.color[static_cast<Eigen::Index>(i % 3)]);
}

WaterSurface::WaterSurface(const WaterLook& look, const PlanCells& cells, const std::vector<Real>& depth, Real level)
    : look_(look), cells_(cells), level_(level) {
  const auto nx = static_cast<std::size_t>(cells.nx), ny = static_cast<std::size_t>(cells.ny);
  const auto water = [&](std::size_t i, std::size_t j) { return depth[j * nx + i] > 0; };
  // A quad that comes within two cells of water is drawn: the ground hides what is not wet, and between cells it may dip.
  const auto near_water = [&](std::size_t i, std::size_t j) {
    for (std::size_t b = j > 0 ? j - 1 : 0; b <= std::min(j + 1, ny - 1); ++b)
      for (std::size_t a = i > 0 ? i - 1 : 0; a <= std::min(i + 1, nx - 1); ++a)
        if (water(a, b)) return true;
    return false;
  };
  std::vector<Index> vertex(depth.size(), kNone);
  const auto use = [&](std::size_t i, std::size_t j) {
    Index& v = vertex[j * nx + i];
    if (v == kNone) {
      v = static_cast<Index>(vertex_cell_.size());
      vertex_cell_.push_back(static_cast<Index>(j * nx + i));
    }
    return v;
  };
  for (std::size_t j = 0; j + 1 < ny; ++j)
    for (std::size_t i = 0; i + 1 < nx; ++i) {
      if (!near_water(i, j) && !near_water(i + 1, j) && !near_water(i, j + 1) && !near_water(i + 1, j + 1)) continue;
      const Index a = use(i, j), b = use(i + 1, j), c = use(i + 1, j + 1), d = use(i, j + 1);
      // Split along alternating diagonals: no grain.
      if ((i + j) % 2 == 0) triangles_.insert(triangles_.end(), {{a, b, c}, {a, c, d}});
      else triangles_.insert(triangles_.end(), {{a, b, d}, {b, c, d}});
    }
  beside_.assign(vertex_cell_.size(), {kNone, kNone, kNone, kNone});
  for (std::size_t v = 0; v < vertex_cell_.size(); ++v) {
    const std::size_t i = vertex_cell_[v] % nx, j = vertex_cell_[v] / nx;
    if (water(i, j)) continue;
    // The nearest water cells, up to four, of those two away at most.
    std::vector<std::pair<int, Index>> found;
    for (int dj = -2; dj <= 2; ++dj)
      for (int di = -2; di <= 2; ++di) {
        const int a = static_cast<int>(i) + di, b = static_cast<int>(j) + dj;
        if (a < 0 || b < 0 || a >= cells.nx || b >= cells.ny || !water(static_cast<std::size_t>(a), static_cast<std::size_t>(b))) continue;
        found.emplace_back(di * di + dj * dj, static_cast<Index>(static_cast<std::size_t>(b) * nx + static_cast<std::size_t>(a)));
      }
    std::sort(found.begin(), found.end());
    for (std::size_t k = 0; k < std::min<std::size_t>(4, found.size()); ++k) beside_[v][k] = found[k].second;
  }
}

geometry::TriMesh WaterSurface::at(std::span<const Real> height, std::span<const Real> rate) const {
  geometry::TriMesh mesh;
  mesh.triangles = triangles_;
  const std::size_t n = vertex_cell_.size();
  mesh.positions.resize(n);
  geometry::VertexAttribute& velocity = mesh.attributes["velocity"];
  velocity.width = 3;
  velocity.values.assign(3 * n, 0);
  const auto nx = static_cast<std::size_t>(cells_.nx);
  parallel_for(n, [&](std::size_t v) {
    const std::size_t c = vertex_cell_[v];
    Real h = height[c], up = rate[c];
    if (beside_[v][0] != kNone) {
      h = up = 0;
      Real count = 0;
      for (const Index other : beside_[v]) {
        if (other == kNone) break;
        h += height[other];
        up += rate[other];
        ++count;
      }
      h /= count;
      up /= count;
    }
    const Vec2 p = cells_.corner + cells_.cell * Vec2(static_cast<Real>(c % nx) + 0.5, static_cast<Real>(c / nx) + 0.5);
    mesh.positions[v] = Vec3(p.x(), p.y(), level_ + h);
    velocity.values[3 * v + 2] = static_cast<float>(up);
  });
  geometry::compute_normals(mesh);
  paint_water(mesh, look_);
  return mesh;
}

std::size_t WaterSurface::memory() const {
  return triangles_.capacity() * sizeof(geometry::Triangle) + vertex_cell_.capacity() * sizeof(Index) + beside_.capacity() * sizeof(std::array<Index, 4>);
}

}  // namespace effuse::flow
