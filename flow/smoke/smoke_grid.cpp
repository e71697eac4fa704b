#include "flow/smoke/smoke_grid.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "geometry/base/check.h"
#include "geometry/base/error.h"
#include "geometry/base/parallel.h"
#include "geometry/base/zones.h"

namespace effuse::flow::smoke {

namespace {
constexpr std::size_t kGrain = 2048;
constexpr Real kTakeOn = 0.2;       // [s] in which air takes on a source's temperature and velocity
constexpr Real kLeastCells = 0.75;  // radius of a source that still meets a cell
constexpr std::size_t kNone = ~std::size_t{0};

std::size_t count(int n) { return static_cast<std::size_t>(n); }
}  // namespace

/// Values on points offset + (i, j, k) of the grid's own coordinates (cells), trilinear.
struct SmokeGrid::Field {
  const Real* values;
  int n[3];
  Vec3 offset;
  bool open[6];
  bool clear;  // what comes in through open sides is 0; else as at the border

  struct Around {
    Real value, low, high;
  };
  Around at(const Vec3& g, bool range) const {
    int i[3], up[3];
    Real f[3];
    for (int a = 0; a < 3; ++a) {
      const Real q = g[a] - offset[a];
      if (clear && ((open[2 * a] && q < -1) || (open[2 * a + 1] && q > n[a]))) return {0, 0, 0};
      const Real held = std::clamp(q, 0.0, static_cast<Real>(n[a] - 1));
      i[a] = std::min(static_cast<int>(held), n[a] - 1);
      up[a] = std::min(i[a] + 1, n[a] - 1);
      f[a] = held - i[a];
    }
    const auto v = [&](int x, int y, int z) { return values[(count(z) * count(n[1]) + count(y)) * count(n[0]) + count(x)]; };
    const Real c[8] = {v(i[0], i[1], i[2]), v(up[0], i[1], i[2]), v(i[0], up[1], i[2]), v(up[0], up[1], i[2]), v(i[0], i[1], up[2]), v(up[0], i[1], up[2]), v(i[0], up[1], up[2]), v(up[0], up[1], up[2])};
    const auto mix = [](Real a, Real b, Real t) { return a + t * (b - a); };
    const Real value = mix(mix(mix(c[0], c[1], f[0]), mix(c[2], c[3], f[0]), f[1]), mix(mix(c[4], c[5], f[0]), mix(c[6], c[7], f[0]), f[1]), f[2]);
    if (!range) return {value, 0, 0};
    return {value, *std::min_element(c, c + 8), *std::max_element(c, c + 8)};
  }
};

SmokeGrid::SmokeGrid(const SmokeOptions& options, std::vector<std::uint8_t> solid)
    : options_(options),
      nx_(count(options.n[0])),
      ny_(count(options.n[1])),
      nz_(count(options.n[2])),
      solid_(solid.empty() ? std::vector<std::uint8_t>(nx_ * ny_ * nz_, 0) : std::move(solid)),
      poisson_(options.n, solid_, options.open) {
  CHECK_GT(options.cell, 0);
  CHECK_GT(options.air_temperature, 0);
  CHECK_EQ(solid_.size(), nx_ * ny_ * nz_);
  const std::size_t n = nx_ * ny_ * nz_;
  for (auto* each : {&density_, &excess_, &pressure_, &outflow_}) each->assign(n, 0);
  u_[0].assign((nx_ + 1) * ny_ * nz_, options.wind.x());
  u_[1].assign(nx_ * (ny_ + 1) * nz_, options.wind.y());
  u_[2].assign(nx_ * ny_ * (nz_ + 1), 0);
  for (std::size_t c = 0; c < n; ++c) {
    if (!solid_[c]) continue;
    std::array<std::size_t, 6> air;
    air.fill(kNone);
    const std::size_t i = c % nx_, j = c / nx_ % ny_, k = c / (nx_ * ny_);
    std::size_t found = 0;
    const auto take = [&](bool inside, std::size_t other) {
      if (inside && !solid_[other]) air[found++] = other;
    };
    take(i > 0, c - 1);
    take(i + 1 < nx_, c + 1);
    take(j > 0, c - nx_);
    take(j + 1 < ny_, c + nx_);
    take(k > 0, c - nx_ * ny_);
    take(k + 1 < nz_, c + nx_ * ny_);
    if (found > 0) shores_.emplace_back(c, air);
  }
  close_faces();
}

Vec3 SmokeGrid::centre(std::size_t c) const {
  return options_.corner + options_.cell * Vec3(static_cast<Real>(c % nx_) + 0.5, static_cast<Real>(c / nx_ % ny_) + 0.5, static_cast<Real>(c / (nx_ * ny_)) + 0.5);
}

void SmokeGrid::add(const SmokeSource& s, Real dt) {
  const Real radius = std::max(s.radius / options_.cell, kLeastCells);
  const Vec3 at = (s.at - options_.corner) / options_.cell;
  int low[3], high[3];
  for (int a = 0; a < 3; ++a) {
    low[a] = std::max(0, static_cast<int>(std::floor(at[a] - radius - 1)));
    high[a] = std::min(options_.n[count(a)] - 1, static_cast<int>(std::ceil(at[a] + radius + 1)));
  }
  // Full in the inner half, then fading.
  const auto share = [&](const Vec3& g) { return std::clamp(2 * (1 - (g - at).norm() / radius), 0.0, 1.0); };
  const auto take_on = [&](Real w) { return -std::expm1(-w * dt / kTakeOn); };
  for (int k = low[2]; k <= high[2]; ++k)
    for (int j = low[1]; j <= high[1]; ++j)
      for (int i = low[0]; i <= high[0]; ++i) {
        const std::size_t c = index(i, j, k);
        const Real w = share(Vec3(i + 0.5, j + 0.5, k + 0.5));
        if (solid_[c] || w <= 0) continue;
        density_[c] += dt * w * s.density;
        if (s.temperature > 0) excess_[c] += take_on(w) * (s.temperature - options_.air_temperature - excess_[c]);
        if (s.velocity.isZero()) continue;
        // Of the cell's upper faces; what is closed is closed again before the projection.
        const std::size_t face[] = {(count(k) * ny_ + count(j)) * (nx_ + 1) + count(i) + 1, (count(k) * (ny_ + 1) + count(j) + 1) * nx_ + count(i), ((count(k) + 1) * ny_ + count(j)) * nx_ + count(i)};
        for (std::size_t a = 0; a < 3; ++a) u_[a][face[a]] += take_on(w) * (s.velocity[static_cast<Eigen::Index>(a)] - u_[a][face[a]]);
      }
}

bool SmokeGrid::add_at(const Vec3& at, Real density, Real temperature) {
  const Vec3 g = (at - options_.corner) / options_.cell;
  if (!(g.minCoeff() >= 0 && g.x() < options_.n[0] && g.y() < options_.n[1] && g.z() < options_.n[2])) return false;
  const int i = static_cast<int>(g.x()), j = static_cast<int>(g.y());
  for (int k = static_cast<int>(g.z()), most = std::min(k + 4, options_.n[2]); k < most; ++k) {
    const std::size_t c = index(i, j, k);
    if (solid_[c]) continue;
    density_[c] += density;
    excess_[c] += temperature;
    return true;
  }
  return false;
}

SmokeGrid::Field SmokeGrid::field(std::span<const Real> values, int stagger) const {
  Field f{values.data(), {options_.n[0], options_.n[1], options_.n[2]}, Vec3::Constant(0.5), {}, stagger < 0};
  if (stagger >= 0) {
    ++f.n[stagger];
    f.offset[stagger] = 0;
  }
  for (std::size_t side = 0; side < 6; ++side) f.open[side] = options_.open[side];
  return f;
}

/// Velocity of the step's beginning at a point, both in cells (and seconds).
Vec3 SmokeGrid::air_at(const Vec3& g) const {
  return Vec3(field(old_[0], 0).at(g, false).value, field(old_[1], 1).at(g, false).value, field(old_[2], 2).at(g, false).value) / options_.cell;
}

/// Where what arrives at g in dt has come from: the midpoint rule.
Vec3 SmokeGrid::origin_of(const Vec3& g, Real dt) const { return g - dt * air_at(g - dt / 2 * air_at(g)); }

void SmokeGrid::carry(std::vector<Real>& values, int stagger, Real dt) {
  const Field f = field(values, stagger);
  const std::size_t row = count(f.n[0]), rows = count(f.n[1]), n = values.size();
  const auto point = [&](std::size_t c) { return Vec3(f.offset + Vec3(static_cast<Real>(c % row), static_cast<Real>(c / row % rows), static_cast<Real>(c / (row * rows)))); };
  ahead_.resize(n);
  result_.resize(n);
  back_.resize(2 * n);  // the range that a value came from
  parallel_for(n, [&](std::size_t c) {
    const Field::Around from = f.at(origin_of(point(c), dt), true);
    ahead_[c] = from.value;
    back_[2 * c] = from.low;
    back_[2 * c + 1] = from.high;
  }, kGrain);
  if (options_.sharp) {
    const Field moved = field(ahead_, stagger);
    parallel_for(n, [&](std::size_t c) {
      const Real again = moved.at(origin_of(point(c), -dt), false).value;
      result_[c] = std::clamp(ahead_[c] + (values[c] - again) / 2, back_[2 * c], back_[2 * c + 1]);
    }, kGrain);
  } else {
    result_.swap(ahead_);
  }
  if (stagger < 0) put_back(values, dt);
  values.swap(result_);
}

/// Share of a cell that stays in the grid as it is moved along its middle's path.
Real SmokeGrid::staying(std::size_t c, Real dt) const {
  const Vec3 middle = Vec3(static_cast<Real>(c % nx_), static_cast<Real>(c / nx_ % ny_), static_cast<Real>(c / (nx_ * ny_))) + Vec3::Constant(0.5), to = origin_of(middle, -dt);
  Real share = 1;
  for (Eigen::Index a = 0; a < 3; ++a) {
    const auto side = static_cast<std::size_t>(2 * a);
    if (options_.open[side]) share *= std::clamp(to[a] + 0.5, 0.0, 1.0);
    if (options_.open[side + 1]) share *= std::clamp(options_.n[static_cast<std::size_t>(a)] + 0.5 - to[a], 0.0, 1.0);
  }
  return share;
}

/// Paths back do not know of volume: what they lost or made, of that which did not leave, is put back or taken off where the range that
/// a value came from leaves room, in proportion to it: nothing overshoots.
void SmokeGrid::put_back(std::span<const Real> before, Real dt) {
  const std::size_t n = before.size();
  const Real stayed = parallel_sum(n, 0.0, [&](std::size_t c) { return solid_[c] || before[c] == 0 ? 0 : before[c] * staying(c, dt); });
  const Real now = parallel_sum(n, 0.0, [&](std::size_t c) { return solid_[c] ? 0 : result_[c]; });
  const Real gap = stayed - now;
  const auto room = [&](std::size_t c) { return solid_[c] ? 0 : gap > 0 ? back_[2 * c + 1] - result_[c] : back_[2 * c] - result_[c]; };
  const Real all = parallel_sum(n, 0.0, room);
  if (!(std::abs(all) > 0)) return;
  const Real share = std::min(gap / all, 1.0);
  parallel_for(n, [&](std::size_t c) { result_[c] += share * room(c); }, kGrain);
}

/// Buoyancy, on the faces between two cells.
void SmokeGrid::push(Real dt) {
  const std::size_t layer = nx_ * ny_;
  parallel_for(layer * (nz_ - 1), [&](std::size_t f) {
    const std::size_t below = f, above = f + layer;
    if (solid_[below] || solid_[above]) return;
    const Real excess = (excess_[below] + excess_[above]) / 2, smoke = (density_[below] + density_[above]) / 2;
    u_[2][f + layer] += dt * (options_.gravity * excess / options_.air_temperature - options_.weight * smoke);
  }, kGrain);
}

/// Vorticity confinement: swirl h (N x omega), N the direction in which |omega| rises.
void SmokeGrid::swirl(Real dt) {
  if (options_.swirl <= 0 || nx_ < 3 || ny_ < 3 || nz_ < 3) return;
  ZONE("smoke.swirl");
  const std::size_t n = size(), layer = nx_ * ny_;
  const Real h = options_.cell;
  std::vector<Vec3> middle(n), omega(n, Vec3::Zero()), force(n, Vec3::Zero());
  parallel_for(n, [&](std::size_t c) { middle[c] = velocity_at(c); }, kGrain);
  const auto inside = [&](std::size_t c) {
    const std::size_t i = c % nx_, j = c / nx_ % ny_, k = c / layer;
    return i > 0 && j > 0 && k > 0 && i + 1 < nx_ && j + 1 < ny_ && k + 1 < nz_ && !solid_[c];
  };
  parallel_for(n, [&](std::size_t c) {
    if (!inside(c)) return;
    const Vec3 dx = (middle[c + 1] - middle[c - 1]) / (2 * h), dy = (middle[c + nx_] - middle[c - nx_]) / (2 * h), dz = (middle[c + layer] - middle[c - layer]) / (2 * h);
    omega[c] = Vec3(dy.z() - dz.y(), dz.x() - dx.z(), dx.y() - dy.x());
  }, kGrain);
  parallel_for(n, [&](std::size_t c) {
    if (!inside(c)) return;
    const Vec3 rise = Vec3(omega[c + 1].norm() - omega[c - 1].norm(), omega[c + nx_].norm() - omega[c - nx_].norm(), omega[c + layer].norm() - omega[c - layer].norm()) / (2 * h);
    const Real length = rise.norm();
    if (length > 1e-9 / h) force[c] = options_.swirl * h * (rise / length).cross(omega[c]);
  }, kGrain);
  for (std::size_t a = 0; a < 3; ++a) {
    const std::size_t row = nx_ + (a == 0), rows = ny_ + (a == 1), step = a == 0 ? 1 : a == 1 ? nx_ : layer;
    const auto axis = static_cast<Eigen::Index>(a);
    parallel_for(u_[a].size(), [&](std::size_t f) {
      const std::size_t at[3] = {f % row, f / row % rows, f / (row * rows)}, most[3] = {nx_, ny_, nz_};
      if (at[a] == 0 || at[a] == most[a]) return;
      const std::size_t c = (at[2] * ny_ + at[1]) * nx_ + at[0];
      u_[a][f] += dt / 2 * (force[c][axis] + force[c - step][axis]);
    }, kGrain);
  }
}

/// Faces of solid cells and walls are still; the wind comes in where it blows from.
void SmokeGrid::close_faces() {
  const std::size_t layer = nx_ * ny_;
  for (std::size_t a = 0; a < 3; ++a) {
    const std::size_t row = nx_ + (a == 0), rows = ny_ + (a == 1), step = a == 0 ? 1 : a == 1 ? nx_ : layer;
    const Real wind = a < 2 ? options_.wind[static_cast<Eigen::Index>(a)] : 0;
    parallel_for(u_[a].size(), [&](std::size_t f) {
      const std::size_t at[3] = {f % row, f / row % rows, f / (row * rows)}, most[3] = {nx_, ny_, nz_};
      const std::size_t c = (at[2] * ny_ + at[1]) * nx_ + at[0];
      const bool low = at[a] == 0, high = at[a] == most[a];
      if ((!high && solid_[c]) || (!low && solid_[c - step])) u_[a][f] = 0;
      else if (low && !options_.open[2 * a]) u_[a][f] = 0;
      else if (high && !options_.open[2 * a + 1]) u_[a][f] = 0;
      else if ((low && wind > 0) || (high && wind < 0)) u_[a][f] = wind;
    }, kGrain);
  }
}

/// Paths that end near the ground read what is in it: the air's beside it, or the ground would swallow smoke.
void SmokeGrid::fill_solids() {
  for (const auto& [c, air] : shores_) {
    Real density = 0, excess = 0, found = 0;
    for (const std::size_t other : air) {
      if (other == kNone) break;
      density += density_[other];
      excess += excess_[other];
      ++found;
    }
    density_[c] = density / found;
    excess_[c] = excess / found;
  }
}

SmokeGrid::Report SmokeGrid::step(Real dt) {
  ZONE("smoke");
  CHECK_GT(dt, 0);
  Report report;
  {
    ZONE("smoke.carry");
    old_ = u_;
    fill_solids();
    carry(density_, -1, dt);
    carry(excess_, -1, dt);
    for (int a = 0; a < 3; ++a) carry(u_[count(a)], a, dt);
  }
  push(dt);
  swirl(dt);
  close_faces();

  // Net outflow of each cell, in cells: A q = -outflow, u -= difference of q; open sides have q = 0 beyond.
  const std::size_t layer = nx_ * ny_;
  const auto outflow = [&](std::size_t c) {
    const std::size_t i = c % nx_, j = c / nx_ % ny_, k = c / layer, fx = (k * ny_ + j) * (nx_ + 1) + i, fy = (k * (ny_ + 1) + j) * nx_ + i;
    return solid_[c] ? 0 : (u_[0][fx + 1] - u_[0][fx]) + (u_[1][fy + nx_] - u_[1][fy]) + (u_[2][c + layer] - u_[2][c]);
  };
  parallel_for(size(), [&](std::size_t c) { outflow_[c] = -outflow(c); }, kGrain);
  report.pressure = poisson_.solve(outflow_, pressure_, options_.tolerance);
  for (std::size_t a = 0; a < 3; ++a) {
    const std::size_t row = nx_ + (a == 0), rows = ny_ + (a == 1), step = a == 0 ? 1 : a == 1 ? nx_ : layer;
    parallel_for(u_[a].size(), [&](std::size_t f) {
      const std::size_t at[3] = {f % row, f / row % rows, f / (row * rows)}, most[3] = {nx_, ny_, nz_};
      const std::size_t c = (at[2] * ny_ + at[1]) * nx_ + at[0];
      const bool low = at[a] == 0, high = at[a] == most[a];
      if ((!high && solid_[c]) || (!low && solid_[c - step])) return;
      if ((low && !options_.open[2 * a]) || (high && !options_.open[2 * a + 1])) return;
      u_[a][f] -= (high ? 0 : pressure_[c]) - (low ? 0 : pressure_[c - step]);
    }, kGrain);
  }

  const Real keep = options_.thinning > 0 ? std::exp(-dt / options_.thinning) : 1, warm = options_.cooling > 0 ? std::exp(-dt / options_.cooling) : 1;
  if (keep < 1 || warm < 1) parallel_for(size(), [&](std::size_t c) { density_[c] *= keep, excess_[c] *= warm; }, kGrain);
  report.fastest = parallel_max(size(), 0.0, [&](std::size_t c) { return velocity_at(c).norm(); });
  report.divergence = divergence();
  return report;
}

Vec3 SmokeGrid::velocity_at(std::size_t c) const {
  const std::size_t i = c % nx_, j = c / nx_ % ny_, k = c / (nx_ * ny_), fx = (k * ny_ + j) * (nx_ + 1) + i, fy = (k * (ny_ + 1) + j) * nx_ + i;
  return Vec3(u_[0][fx] + u_[0][fx + 1], u_[1][fy] + u_[1][fy + nx_], u_[2][c] + u_[2][c + nx_ * ny_]) / 2;
}

Real SmokeGrid::divergence() const {
  const std::size_t layer = nx_ * ny_;
  const Real sum = parallel_sum(size(), 0.0, [&](std::size_t c) {
    const std::size_t i = c % nx_, j = c / nx_ % ny_, k = c / layer, fx = (k * ny_ + j) * (nx_ + 1) + i, fy = (k * (ny_ + 1) + j) * nx_ + i;
    const Real out = solid_[c] ? 0 : (u_[0][fx + 1] - u_[0][fx]) + (u_[1][fy + nx_] - u_[1][fy]) + (u_[2][c + layer] - u_[2][c]);
    return out * out;
  });
  return std::sqrt(sum / static_cast<Real>(size())) / options_.cell;
}

Real SmokeGrid::mass() const {
  return std::pow(options_.cell, 3) * parallel_sum(size(), 0.0, [&](std::size_t c) { return solid_[c] ? 0 : density_[c]; });
}

bool SmokeGrid::finite() const {
  const Real sum = parallel_sum(size(), 0.0, [&](std::size_t c) { return density_[c] + excess_[c] + velocity_at(c).sum(); });
  return std::isfinite(sum);
}

std::size_t SmokeGrid::memory() const {
  std::size_t reals = density_.capacity() + excess_.capacity() + pressure_.capacity() + ahead_.capacity() + back_.capacity() + result_.capacity() + outflow_.capacity();
  for (std::size_t a = 0; a < 3; ++a) reals += u_[a].capacity() + old_[a].capacity();
  return reals * sizeof(Real) + solid_.capacity() + shores_.capacity() * sizeof(shores_[0]) + poisson_.memory();
}

void SmokeGrid::add_to(StateHash& hash) const {
  hash.add(std::span<const Real>(density_));
  hash.add(std::span<const Real>(excess_));
  for (const auto& u : u_) hash.add(std::span<const Real>(u));
}

void SmokeGrid::save(StateWriter& out) const {
  out.array("density", density_);
  out.array("excess", excess_);
  out.array("pressure", pressure_);  // where the next solve begins
  for (const auto& u : u_) out.array("velocity", u);
}

void SmokeGrid::load(StateReader& in) {
  std::vector<Real> density, excess, pressure;
  std::array<std::vector<Real>, 3> u;
  in.array("density", density);
  in.array("excess", excess);
  in.array("pressure", pressure);
  for (auto& each : u) in.array("velocity", each);
  if (density.size() != size() || excess.size() != size() || pressure.size() != size() || u[0].size() != u_[0].size() || u[1].size() != u_[1].size() || u[2].size() != u_[2].size())
    throw InputError(Place{"smoke"}, fmt::format("the checkpoint holds {} cells, the grid has {}", density.size(), size()));
  density_ = std::move(density);
  excess_ = std::move(excess);
  pressure_ = std::move(pressure);
  u_ = std::move(u);
}

}  // namespace effuse::flow::smoke
