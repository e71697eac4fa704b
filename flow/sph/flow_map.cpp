#include "flow/sph/flow_map.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <unordered_map>

#include "geometry/base/check.h"
#include "geometry/base/error.h"
#include "geometry/base/parallel.h"
#include "geometry/base/zones.h"

namespace effuse::flow::sph {

namespace {

constexpr Index kNone = ~Index{0};
constexpr float kNothing = std::numeric_limits<float>::quiet_NaN();

/// Cells of a length [m], the last one whole; a length of whole cells to rounding gets no more.
double cells_along(Real length, Real cell) { return std::max(1.0, std::ceil(length / cell - 1e-9)); }

/// Cells that the open interval (low, high) reaches, of [0, n).
struct Span {
  int first, last;
  Span(Real low, Real high, int n)
      : first(static_cast<int>(std::clamp(std::floor(low), 0.0, Real(n)))), last(static_cast<int>(std::clamp(std::ceil(high) - 1, -1.0, Real(n - 1)))) {}
};

/// Length of [low, high] in cell k, of side 1.
Real overlap(Real low, Real high, int k) { return std::max(0.0, std::min(high, Real(k + 1)) - std::max(low, Real(k))); }

Real distance(const Vec2& p, const PlanLine& line) {
  const Vec2 d = line.to - line.from;
  const Real length2 = d.squaredNorm();
  const Real t = length2 > 0 ? std::clamp((p - line.from).dot(d) / length2, 0.0, 1.0) : 0;
  return (p - line.from - t * d).norm();
}

bool all_finite(const geometry::Points& points) {
  return parallel_sum(points.size(), std::size_t{0}, [&](std::size_t p) -> std::size_t { return !points.position[p].allFinite(); }) == 0;
}

}  // namespace

MapGrid map_grid(const geometry::Terrain& terrain, Real cell, Real spacing) {
  CHECK(cell >= 0 && std::isfinite(cell));
  CHECK(spacing > 0);
  MapGrid grid;
  Vec2 size;
  if (const geometry::HeightField* field = terrain.height_field()) {
    grid.cell = cell > 0 ? Vec2(cell, cell) : field->spacing();
    grid.corner = field->corner() - field->spacing() / 2;
    size = field->spacing().cwiseProduct(Vec2(field->nx(), field->ny()));
  } else {
    const Real side = cell > 0 ? cell : 2 * spacing;
    grid.cell = Vec2(side, side);
    grid.corner = (terrain.bounds().min().head<2>() / side).array().floor() * side;
    size = terrain.bounds().max().head<2>() - grid.corner;
  }
  const double nx = cells_along(size.x(), grid.cell.x()), ny = cells_along(size.y(), grid.cell.y());
  if (!(nx * ny <= kMostMapCells))
    throw InputError(Place{}, fmt::format("cells of {:.6g} m make a map of {:.3g} of them, at most {:.2g}: larger ones would do", grid.cell.x(), nx * ny, kMostMapCells));
  grid.nx = static_cast<int>(nx);
  grid.ny = static_cast<int>(ny);
  return grid;
}

FlowMap::FlowMap(const MapGrid& grid, Real arrival_thickness) : grid_(grid), arrival_thickness_(arrival_thickness), blocks_x_((grid.nx + kSide - 1) / kSide) {
  CHECK(grid.nx >= 1 && grid.ny >= 1);
  CHECK_LE(static_cast<double>(grid.size()), kMostMapCells);
  CHECK(grid.cell.minCoeff() > 0);
  CHECK(arrival_thickness >= 0);
  block_of_.assign(static_cast<std::size_t>(blocks_x_) * static_cast<std::size_t>((grid.ny + kSide - 1) / kSide), kNone);
}

std::size_t FlowMap::block_number(int i, int j) const { return static_cast<std::size_t>(j / kSide) * static_cast<std::size_t>(blocks_x_) + static_cast<std::size_t>(i / kSide); }

FlowMap::Cell& FlowMap::touch(int i, int j) {
  Index& block = block_of_[block_number(i, j)];
  if (block == kNone) {
    block = static_cast<Index>(blocks_.size());
    blocks_.emplace_back(kSide * kSide, Cell{0, kNothing, kNothing, kNothing});
  }
  return blocks_[block][static_cast<std::size_t>(j % kSide * kSide + i % kSide)];
}

const FlowMap::Cell* FlowMap::find(int i, int j) const {
  const Index block = block_of_[block_number(i, j)];
  return block == kNone ? nullptr : &blocks_[block][static_cast<std::size_t>(j % kSide * kSide + i % kSide)];
}

template <class Visit>
void FlowMap::visit(Visit&& visit) const {
  for (std::size_t b = 0; b < block_of_.size(); ++b) {
    if (block_of_[b] == kNone) continue;
    const Block& block = blocks_[block_of_[b]];
    const int i0 = static_cast<int>(b % static_cast<std::size_t>(blocks_x_)) * kSide, j0 = static_cast<int>(b / static_cast<std::size_t>(blocks_x_)) * kSide;
    for (int k = 0; k < kSide * kSide; ++k)
      if (!std::isnan(block[static_cast<std::size_t>(k)].max_thickness)) visit(i0 + k % kSide, j0 + k / kSide, block[static_cast<std::size_t>(k)]);
  }
}

void FlowMap::add(Real time, const geometry::Points& points, Real volume, std::span<const Real> surface_temperature) {
  ZONE("flow.map");
  const std::size_t n = points.size();
  CHECK(!any_ || time >= time_);
  CHECK(std::isfinite(time));
  CHECK_EQ(points.radius.size(), n);
  CHECK(points.temperature.empty() || points.temperature.size() == n);
  CHECK(surface_temperature.empty() || surface_temperature.size() == n);
  CHECK(all_finite(points));
  const std::span<const Real> temperature = surface_temperature.empty() ? points.temperature : surface_temperature;
  time_ = time;
  any_ = true;

  for (Block& block : blocks_)
    for (Cell& cell : block) cell.thickness = 0;

  // Lay the particles down, one after the other: the order of the sums is theirs.
  const Real cubes = parallel_sum(n, 0.0, [&](std::size_t p) { return points.radius[p] * points.radius[p] * points.radius[p]; });
  for (std::size_t p = 0; p < n; ++p) {
    const Real r = points.radius[p];
    CHECK(r > 0);
    // The square in cells from the corner, and the volume's height on it were it in one cell.
    const Vec2 low = (points.position[p].head<2>() - Vec2(r, r) - grid_.corner).cwiseQuotient(grid_.cell);
    const Vec2 high = (points.position[p].head<2>() + Vec2(r, r) - grid_.corner).cwiseQuotient(grid_.cell);
    const Real height = volume * (r * r * r / cubes) / grid_.cell_area() / ((high.x() - low.x()) * (high.y() - low.y()));
    const Span columns(low.x(), high.x(), grid_.nx), rows(low.y(), high.y(), grid_.ny);
    for (int j = rows.first; j <= rows.last; ++j) {
      const Real dy = overlap(low.y(), high.y(), j);
      for (int i = columns.first; i <= columns.last; ++i) {
        Cell& cell = touch(i, j);
        cell.thickness += height * (overlap(low.x(), high.x(), i) * dy);
        if (std::isnan(cell.max_thickness)) cell.max_thickness = 0;
        if (!temperature.empty()) cell.max_temperature = std::fmax(cell.max_temperature, static_cast<float>(temperature[p]));
      }
    }
  }

  for (Block& block : blocks_) {
    for (Cell& cell : block) {
      if (std::isnan(cell.max_thickness)) continue;
      cell.max_thickness = std::max(cell.max_thickness, static_cast<float>(cell.thickness));
      if (std::isnan(cell.arrival) && cell.thickness > arrival_thickness_) {
        cell.arrival = static_cast<float>(time);
        ++reached_;
      }
    }
  }
}

std::vector<float> FlowMap::layer(Layer which) const {
  std::vector<float> values(grid_.size(), kNothing);
  visit([&](int i, int j, const Cell& cell) {
    float& value = values[static_cast<std::size_t>(j) * static_cast<std::size_t>(grid_.nx) + static_cast<std::size_t>(i)];
    switch (which) {
      case Layer::kThickness: value = static_cast<float>(cell.thickness); break;
      case Layer::kMaxThickness: value = cell.max_thickness; break;
      case Layer::kMaxTemperature: value = cell.max_temperature; break;
      case Layer::kArrivalTime: value = cell.arrival; break;
    }
  });
  return values;
}

Real FlowMap::thickness(int i, int j) const {
  CHECK(i >= 0 && i < grid_.nx && j >= 0 && j < grid_.ny);
  const Cell* cell = find(i, j);
  return cell ? cell->thickness : 0;
}

Real FlowMap::volume() const {
  Real sum = 0;
  visit([&](int, int, const Cell& cell) { sum += cell.thickness; });
  return sum * grid_.cell_area();
}

std::size_t FlowMap::memory() const { return block_of_.capacity() * sizeof(Index) + blocks_.size() * (kSide * kSide * sizeof(Cell) + sizeof(Block)); }

void FlowMap::save(StateWriter& out) const {
  out.value("map_corner_x", grid_.corner.x());
  out.value("map_corner_y", grid_.corner.y());
  out.value("map_cell_x", grid_.cell.x());
  out.value("map_cell_y", grid_.cell.y());
  out.value("map_nx", grid_.nx);
  out.value("map_ny", grid_.ny);
  out.value("map_arrival_thickness", arrival_thickness_);
  out.value("map_any", static_cast<std::uint8_t>(any_));
  out.value("map_time", time_);
  std::vector<Index> number;
  std::vector<Real> thickness;
  std::vector<float> max_thickness, max_temperature, arrival;
  visit([&](int i, int j, const Cell& cell) {
    number.push_back(static_cast<Index>(j) * static_cast<Index>(grid_.nx) + static_cast<Index>(i));
    thickness.push_back(cell.thickness);
    max_thickness.push_back(cell.max_thickness);
    max_temperature.push_back(cell.max_temperature);
    arrival.push_back(cell.arrival);
  });
  out.array("map_cell", number);
  out.array("map_thickness", thickness);
  out.array("map_max_thickness", max_thickness);
  out.array("map_max_temperature", max_temperature);
  out.array("map_arrival", arrival);
}

void FlowMap::load(StateReader& in, const std::string& file) {
  MapGrid grid;
  Real arrival_thickness = 0;
  in.value("map_corner_x", grid.corner.x());
  in.value("map_corner_y", grid.corner.y());
  in.value("map_cell_x", grid.cell.x());
  in.value("map_cell_y", grid.cell.y());
  in.value("map_nx", grid.nx);
  in.value("map_ny", grid.ny);
  in.value("map_arrival_thickness", arrival_thickness);
  if (grid.corner != grid_.corner || grid.cell != grid_.cell || grid.nx != grid_.nx || grid.ny != grid_.ny)
    throw InputError(Place{file}, fmt::format("holds a map of {} x {} cells of {:.6g} x {:.6g} m, wanted {} x {} of {:.6g} x {:.6g} m in the same place", grid.nx, grid.ny, grid.cell.x(),
                                              grid.cell.y(), grid_.nx, grid_.ny, grid_.cell.x(), grid_.cell.y()));
  if (arrival_thickness != arrival_thickness_)
    throw InputError(Place{file}, fmt::format("holds arrivals of lava thicker than {:.6g} m, wanted {:.6g} m", arrival_thickness, arrival_thickness_));
  FlowMap read(grid, arrival_thickness);
  std::uint8_t any = 0;
  in.value("map_any", any);
  in.value("map_time", read.time_);
  read.any_ = any != 0;
  std::vector<Index> number;
  std::vector<Real> thickness;
  std::vector<float> max_thickness, max_temperature, arrival;
  in.array("map_cell", number);
  in.array("map_thickness", thickness);
  in.array("map_max_thickness", max_thickness);
  in.array("map_max_temperature", max_temperature);
  in.array("map_arrival", arrival);
  const std::size_t n = number.size();
  if (thickness.size() != n || max_thickness.size() != n || max_temperature.size() != n || arrival.size() != n) throw InputError(Place{file}, "the map's arrays differ in length");
  for (std::size_t k = 0; k < n; ++k) {
    if (number[k] >= grid.size() || !(thickness[k] >= 0) || !(max_thickness[k] >= 0)) throw InputError(Place{file}, fmt::format("value {} of the map is not one a map holds", k));
    read.touch(static_cast<int>(number[k] % static_cast<Index>(grid.nx)), static_cast<int>(number[k] / static_cast<Index>(grid.nx))) = {thickness[k], max_thickness[k], max_temperature[k], arrival[k]};
    read.reached_ += !std::isnan(arrival[k]);
  }
  *this = std::move(read);
}

Real covered_area(const geometry::Points& points) {
  ZONE("flow.covered_area");
  const std::size_t n = points.size();
  CHECK_EQ(points.radius.size(), n);
  CHECK(all_finite(points));
  if (n == 0) return 0;
  const Real side = 2 * parallel_max(n, 0, [&](std::size_t p) { return points.radius[p]; });
  CHECK(side > 0);
  Vec2 corner = points.position[0].head<2>(), far = corner;
  for (const Vec3& x : points.position) {
    corner = corner.cwiseMin(x.head<2>());
    far = far.cwiseMax(x.head<2>());
  }
  corner -= Vec2(side, side);
  CHECK((far - corner).maxCoeff() / side < 4e9);

  // Tiles of 8 x 8 cells, made where particles lie; neighbours in the arrays mostly share one.
  using Tile = std::array<Real, 64>;
  std::vector<Tile> tiles;
  std::unordered_map<std::uint64_t, std::size_t> tile_of;
  std::uint64_t last_key = ~std::uint64_t{0};
  std::size_t last_tile = 0;
  const auto area_in = [&](std::uint64_t i, std::uint64_t j) -> Real& {
    const std::uint64_t key = (j / 8) << 32 | (i / 8);
    if (key != last_key) {
      const auto [found, fresh] = tile_of.try_emplace(key, tiles.size());
      if (fresh) tiles.push_back({});
      last_key = key;
      last_tile = found->second;
    }
    return tiles[last_tile][j % 8 * 8 + i % 8];
  };

  // A particle no wider than a cell lies in one or two of them along x, and along y.
  for (std::size_t p = 0; p < n; ++p) {
    const Real r = points.radius[p] / side;  // in cells, as all below
    const Vec2 x = (points.position[p].head<2>() - corner) / side;
    const Real i = std::floor(x.x() - r), j = std::floor(x.y() - r);
    const Real east = std::max(0.0, x.x() + r - (i + 1)), north = std::max(0.0, x.y() + r - (j + 1));
    const Real wx[] = {2 * r - east, east}, wy[] = {2 * r - north, north};
    for (int b = 0; b < 2; ++b)
      for (int a = 0; a < 2; ++a)
        if (wx[a] * wy[b] > 0) area_in(static_cast<std::uint64_t>(i + a), static_cast<std::uint64_t>(j + b)) += wx[a] * wy[b];
  }
  Real covered = 0;
  for (const Tile& tile : tiles)
    for (const Real area : tile) covered += std::min(area, 1.0);
  return covered * side * side;
}

std::optional<Front> find_front(const geometry::Points& points, std::span<const PlanLine> vents) {
  if (points.size() == 0 || vents.empty()) return std::nullopt;
  const std::size_t n = points.size();
  std::vector<std::pair<Real, std::size_t>> far(n);  // minus the distance, particle: the farthest first, and the first of equals
  parallel_for(n, [&](std::size_t p) {
    Real nearest = std::numeric_limits<Real>::infinity();
    for (const PlanLine& vent : vents) nearest = std::min(nearest, distance(points.position[p].head<2>(), vent));
    far[p] = {-nearest, p};
  }, 2048);
  const auto at = far.begin() + static_cast<std::ptrdiff_t>(kBeyondFront * static_cast<Real>(n));
  std::nth_element(far.begin(), at, far.end());
  return Front{-at->first, points.position[at->second].head<2>()};
}

}  // namespace effuse::flow::sph
