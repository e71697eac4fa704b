#include "flow/waves/wave_grid.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>

#include "geometry/base/check.h"
#include "geometry/base/error.h"
#include "geometry/base/parallel.h"
#include "geometry/base/zones.h"

namespace effuse::flow::waves {

namespace {
constexpr std::size_t kBand = 32;        // rows a thread takes at a time
constexpr std::size_t kGrain = 4096;     // cells
constexpr int kMostIterations = 2000;    // of conjugate gradients
constexpr Real kRoundingSlack = 1e-6;  // of a Courant number of 1 that a caller computed himself
}  // namespace

WaveGrid::WaveGrid(const WaveOptions& options, std::vector<Real> speed_squared) : options_(options), speed_squared_(std::move(speed_squared)) {
  CHECK_GE(options.nx, 1);
  CHECK_GE(options.ny, 1);
  CHECK_GT(options.cell, 0);
  CHECK_GE(options.damping, 0);
  const auto nx = static_cast<std::size_t>(options.nx), ny = static_cast<std::size_t>(options.ny);
  uniform_ = speed_squared_.size() == 1;
  if (!uniform_) CHECK_EQ(speed_squared_.size(), nx * ny);
  for (const Real c2 : speed_squared_) {
    CHECK(std::isfinite(c2) && c2 >= 0);
    fastest_squared_ = std::max(fastest_squared_, c2);
  }
  height_.assign(nx * ny, 0);
  rate_.assign(nx * ny, 0);
  if (uniform_) return;
  face_x_.resize(nx * ny);
  face_y_.resize(nx * ny);
  const auto between = [](Real a, Real b) { return a > 0 && b > 0 ? (a + b) / 2 : 0.0; };
  for (std::size_t j = 0; j < ny; ++j)
    for (std::size_t i = 0; i < nx; ++i) {
      face_x_[j * nx + i] = between(speed_squared_[j * nx + i], speed_squared_[j * nx + (i + 1) % nx]);
      face_y_[j * nx + i] = between(speed_squared_[j * nx + i], speed_squared_[(j + 1) % ny * nx + i]);
    }
}

Vec2 WaveGrid::centre(std::size_t cell) const {
  const auto nx = static_cast<std::size_t>(options_.nx);
  return options_.corner + options_.cell * Vec2(static_cast<Real>(cell % nx) + 0.5, static_cast<Real>(cell / nx) + 0.5);
}

Real WaveGrid::courant(Real dt) const { return std::sqrt(2.0 * fastest_squared_) * dt / options_.cell; }
Real WaveGrid::longest_step() const { return fastest_squared_ > 0 ? 1 / courant(1) : std::numeric_limits<Real>::infinity(); }

bool WaveGrid::step(Real dt) {
  CHECK_GT(dt, 0);
  if (options_.scheme == WaveScheme::kImplicit) return implicit_step(dt);
  if (options_.guarded && courant(dt) > 1 + kRoundingSlack)
    throw UnstableError(fmt::format("waves: a step of {:.3g} s has the Courant number {:.3g}; explicit steps stand at most 1, that is {:.3g} s here (or take the implicit scheme)",
                                    dt, courant(dt), longest_step()));
  ZONE("waves.explicit");
  // A band of rows reads one row beyond each of its ends, which the neighbouring band may write: those are copied first.
  const auto nx = static_cast<std::size_t>(options_.nx), ny = static_cast<std::size_t>(options_.ny);
  const std::size_t bands = (ny + kBand - 1) / kBand;
  std::vector<Real> edges(2 * bands * nx);
  for (std::size_t b = 0; b < bands; ++b) {
    const std::size_t below = (b * kBand + ny - 1) % ny, above = std::min((b + 1) * kBand, ny) % ny;
    std::copy_n(&height_[below * nx], nx, &edges[2 * b * nx]);
    std::copy_n(&height_[above * nx], nx, &edges[(2 * b + 1) * nx]);
  }
  parallel_for(bands, [&](std::size_t b) { explicit_rows(b * kBand, std::min((b + 1) * kBand, ny), dt, &edges[2 * b * nx], &edges[(2 * b + 1) * nx]); }, 1);
  return true;
}

/// Rows begin .. end - 1. The rate of a row needs the old heights of the rows beside it, so heights follow one row behind.
void WaveGrid::explicit_rows(std::size_t begin, std::size_t end, Real dt, const Real* below_band, const Real* above_band) {
  const auto nx = static_cast<std::size_t>(options_.nx), ny = static_cast<std::size_t>(options_.ny);
  const bool periodic = options_.border == Border::kPeriodic, absorbing = options_.border == Border::kAbsorbing;
  const Real cell = options_.cell, damping = options_.damping;
  const Real scale = dt / (cell * cell);
  const auto drift = [&](std::size_t j) {
    Real* h = &height_[j * nx];
    const Real* v = &rate_[j * nx];
    for (std::size_t i = 0; i < nx; ++i) h[i] += dt * v[i];
  };
  for (std::size_t j = begin; j < end; ++j) {
    const Real* h = &height_[j * nx];
    const Real* down = j > begin ? h - nx : below_band;
    const Real* up = j + 1 < end ? h + nx : above_band;
    if (!periodic && j == 0) down = h;  // no slope across the border
    if (!periodic && j + 1 == ny) up = h;
    Real* v = &rate_[j * nx];
    const Real row_edges = absorbing ? static_cast<Real>((j == 0) + (j + 1 == ny)) : 0;
    const auto kick = [&](std::size_t i, Real push, Real edges) {
      const Real c = uniform_ ? speed_squared_[0] : speed_squared_[j * nx + i];
      const Real k = damping + (edges > 0 ? edges * std::sqrt(c) / cell : 0);
      v[i] = (v[i] * (1 - k * dt / 2) + scale * push) / (1 + k * dt / 2);
    };
    const std::size_t last = nx - 1;
    if (uniform_) {
      const Real c = speed_squared_[0], k = damping * dt / 2 + row_edges * std::sqrt(c) / cell * dt / 2, keep = (1 - k) / (1 + k), gain = scale * c / (1 + k);
      for (std::size_t i = 1; i < last; ++i) v[i] = keep * v[i] + gain * ((h[i - 1] + h[i + 1]) + (down[i] + up[i]) - 4 * h[i]);
      const Real left = periodic ? h[last] : h[0], right = periodic ? h[0] : h[last];
      const Real side = absorbing ? 1.0 : 0.0;
      if (nx == 1) {
        kick(0, c * (left + right + down[0] + up[0] - 4 * h[0]), row_edges + 2 * side);
      } else {
        kick(0, c * (left + h[1] + down[0] + up[0] - 4 * h[0]), row_edges + side);
        kick(last, c * (h[last - 1] + right + down[last] + up[last] - 4 * h[last]), row_edges + side);
      }
    } else {
      const Real* fx = &face_x_[j * nx];
      const Real* fy = &face_y_[j * nx];
      const Real* fy_down = &face_y_[(j > 0 ? j - 1 : ny - 1) * nx];
      const auto flow = [&](std::size_t i, std::size_t left, std::size_t right) {
        return fx[left] * (h[left] - h[i]) + fx[i] * (h[right] - h[i]) + fy_down[i] * (down[i] - h[i]) + fy[i] * (up[i] - h[i]);
      };
      if (row_edges > 0) {
        for (std::size_t i = 1; i < last; ++i) kick(i, flow(i, i - 1, i + 1), row_edges);
      } else {
        const Real k = damping * dt / 2, keep = (1 - k) / (1 + k), gain = scale / (1 + k);
        for (std::size_t i = 1; i < last; ++i) v[i] = keep * v[i] + gain * flow(i, i - 1, i + 1);
      }
      const Real side = absorbing ? 1.0 : 0.0;
      const auto rim = [&](std::size_t i) {
        Real push = fy_down[i] * (down[i] - h[i]) + fy[i] * (up[i] - h[i]);
        if (i > 0 || periodic) push += fx[i > 0 ? i - 1 : last] * (h[i > 0 ? i - 1 : last] - h[i]);
        if (i < last || periodic) push += fx[i] * (h[i < last ? i + 1 : 0] - h[i]);
        kick(i, push, row_edges + side * static_cast<Real>((i == 0) + (i == last)));
      };
      rim(0);
      if (last > 0) rim(last);
    }
    if (j > begin) drift(j - 1);
  }
  drift(end - 1);
}

/// out = div(c^2 grad v): rows sum to 0 but for absorbing borders, which are no part of it.
void WaveGrid::apply(std::span<const Real> v, std::span<Real> out) const {
  const auto nx = static_cast<std::size_t>(options_.nx), ny = static_cast<std::size_t>(options_.ny);
  const bool periodic = options_.border == Border::kPeriodic;
  const Real scale = 1 / (options_.cell * options_.cell), c = speed_squared_[0];
  parallel_for(ny, [&](std::size_t j) {
    for (std::size_t i = 0; i < nx; ++i) {
      const std::size_t at = j * nx + i;
      Real sum = 0;
      const auto from = [&](std::size_t other, Real c2) { sum += c2 * (v[other] - v[at]); };
      const auto x = [&](std::size_t left) { return uniform_ ? c : face_x_[j * nx + left]; };
      const auto y = [&](std::size_t down) { return uniform_ ? c : face_y_[down * nx + i]; };
      if (i > 0) from(at - 1, x(i - 1));
      else if (periodic) from(at + nx - 1, x(nx - 1));
      if (i + 1 < nx) from(at + 1, x(i));
      else if (periodic) from(at + 1 - nx, x(i));
      if (j > 0) from(at - nx, y(j - 1));
      else if (periodic) from(at + (ny - 1) * nx, y(ny - 1));
      if (j + 1 < ny) from(at + nx, y(j));
      else if (periodic) from(i, y(j));
      out[at] = scale * sum;
    }
  }, kBand);
}

/// v1 = v0 + dt a, h1 = h0 + dt (v0 + v1) / 2 with a = L (h0 + h1) / 2 - k (v0 + v1) / 2, so
///   (1 + k dt / 2 - dt^2 / 4 L) v1 = (1 - k dt / 2) v0 + dt L h0 + dt^2 / 4 L v0.
bool WaveGrid::implicit_step(Real dt) {
  ZONE("waves.implicit");
  const std::size_t n = size();
  const auto nx = static_cast<std::size_t>(options_.nx), ny = static_cast<std::size_t>(options_.ny);
  std::vector<Real> v0(rate_.begin(), rate_.end()), v(v0), b(n), work(n), r(n), p(n), q(n), half_k(n);
  for (std::size_t i = 0; i < n; ++i) {
    const std::size_t x = i % nx, y = i / nx;
    const int edges = options_.border == Border::kAbsorbing ? (x == 0) + (x + 1 == nx) + (y == 0) + (y + 1 == ny) : 0;
    half_k[i] = dt / 2 * (options_.damping + edges * std::sqrt(speed_squared_[uniform_ ? 0 : i]) / options_.cell);
    work[i] = height_[i] + dt / 4 * v0[i];
  }
  apply(work, b);
  for (std::size_t i = 0; i < n; ++i) b[i] = (1 - half_k[i]) * v0[i] + dt * b[i];
  const auto times = [&](std::span<const Real> in, std::span<Real> out) {
    apply(in, out);
    parallel_for(n, [&](std::size_t i) { out[i] = (1 + half_k[i]) * in[i] - dt * dt / 4 * out[i]; }, kGrain);
  };
  const auto dot = [&](const std::vector<Real>& a, const std::vector<Real>& c) { return parallel_sum(n, 0.0, [&](std::size_t i) { return a[i] * c[i]; }, kGrain); };
  times(v, q);
  for (std::size_t i = 0; i < n; ++i) p[i] = r[i] = b[i] - q[i];
  Real rr = dot(r, r);
  const Real enough = options_.tolerance * options_.tolerance * std::max(dot(b, b), std::numeric_limits<Real>::min());
  for (int k = 0; rr > enough; ++k) {
    if (k == kMostIterations || !std::isfinite(rr)) return false;
    times(p, q);
    const Real alpha = rr / dot(p, q);
    parallel_for(n, [&](std::size_t i) { v[i] += alpha * p[i], r[i] -= alpha * q[i]; }, kGrain);
    const Real next = dot(r, r);
    parallel_for(n, [&](std::size_t i) { p[i] = r[i] + next / rr * p[i]; }, kGrain);
    rr = next;
  }
  for (std::size_t i = 0; i < n; ++i) {
    height_[i] += dt / 2 * (v0[i] + v[i]);
    rate_[i] = v[i];
  }
  return true;
}

Real WaveGrid::add_volume(const Vec2& at, Real radius, Real volume) {
  CHECK_GT(radius, 0);
  const Real reach = 3 * radius;
  const auto range = [&](Real middle, Real corner, int count) {
    const Real low = std::floor((middle - reach - corner) / options_.cell), high = std::ceil((middle + reach - corner) / options_.cell);
    return std::pair{static_cast<int>(std::clamp(low, 0.0, static_cast<Real>(count))), static_cast<int>(std::clamp(high, 0.0, static_cast<Real>(count)))};
  };
  const auto [x0, x1] = range(at.x(), options_.corner.x(), options_.nx);
  const auto [y0, y1] = range(at.y(), options_.corner.y(), options_.ny);
  const auto each = [&](auto&& body) {
    for (int j = y0; j < y1; ++j)
      for (int i = x0; i < x1; ++i) {
        const std::size_t cell = static_cast<std::size_t>(j) * static_cast<std::size_t>(options_.nx) + static_cast<std::size_t>(i);
        const Real d2 = (centre(cell) - at).squaredNorm();
        if (water(cell) && d2 < reach * reach) body(cell, std::exp(-d2 / (2 * radius * radius)));
      }
  };
  Real sum = 0;
  each([&](std::size_t, Real w) { sum += w; });
  if (sum == 0) return 0;
  const Real height = volume / (sum * options_.cell * options_.cell);
  each([&](std::size_t cell, Real w) { height_[cell] += height * w; });
  return volume;
}

Real WaveGrid::height_at(const Vec2& p) const {
  const Vec2 u = (p - options_.corner) / options_.cell;
  if (!(u.x() >= 0 && u.y() >= 0 && u.x() <= options_.nx && u.y() <= options_.ny)) return 0;
  const auto side = [](Real s, int n) {
    const Real at = std::clamp(s - 0.5, 0.0, static_cast<Real>(n - 1));
    const int first = std::min(static_cast<int>(at), std::max(0, n - 2));
    return std::pair{static_cast<std::size_t>(first), at - first};
  };
  const auto [i, fx] = side(u.x(), options_.nx);
  const auto [j, fy] = side(u.y(), options_.ny);
  const auto nx = static_cast<std::size_t>(options_.nx), ny = static_cast<std::size_t>(options_.ny);
  const std::size_t i1 = std::min(i + 1, nx - 1), j1 = std::min(j + 1, ny - 1);
  const auto h = [&](std::size_t x, std::size_t y) { return height_[y * nx + x]; };
  return (1 - fy) * ((1 - fx) * h(i, j) + fx * h(i1, j)) + fy * ((1 - fx) * h(i, j1) + fx * h(i1, j1));
}

Real WaveGrid::volume() const {
  return options_.cell * options_.cell * parallel_sum(size(), 0.0, [&](std::size_t i) { return height_[i]; }, kGrain);
}

Real WaveGrid::energy() const {
  std::vector<Real> out(size());
  apply(height_, out);  // h . -L h = sum of c^2 (differences)^2
  return options_.cell * options_.cell / 2 *
         parallel_sum(size(), 0.0, [&](std::size_t i) { return rate_[i] * rate_[i] - height_[i] * out[i]; }, kGrain);
}

std::size_t WaveGrid::memory() const {
  return (speed_squared_.capacity() + face_x_.capacity() + face_y_.capacity() + height_.capacity() + rate_.capacity()) * sizeof(Real);
}

void WaveGrid::add_to(StateHash& hash) const {
  hash.add(std::span<const Real>(height_));
  hash.add(std::span<const Real>(rate_));
}

void WaveGrid::save(StateWriter& out) const {
  out.array("height", height_);
  out.array("rate", rate_);
}

void WaveGrid::load(StateReader& in) {
  std::vector<Real> height, rate;
  in.array("height", height);
  in.array("rate", rate);
  if (height.size() != size() || rate.size() != size()) throw InputError(Place{"waves"}, fmt::format("the checkpoint holds {} cells, the grid has {}", height.size(), size()));
  height_ = std::move(height);
  rate_ = std::move(rate);
}

}  // namespace effuse::flow::waves
