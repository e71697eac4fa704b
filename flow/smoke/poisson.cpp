#include "flow/smoke/poisson.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "geometry/base/check.h"
#include "geometry/base/parallel.h"
#include "geometry/base/zones.h"

namespace effuse::flow::smoke {

namespace {
constexpr std::size_t kGrain = 8192;      // cells
constexpr std::size_t kRows = 64;         // rows that a thread takes at a time
constexpr std::size_t kCoarsest = 64;     // cells: then sweeps alone
constexpr int kCoarsestSweeps = 16;
}  // namespace

Poisson::Poisson(const std::array<int, 3>& n, std::span<const std::uint8_t> solid, const Open& open) {
  Level fine;
  fine.n = n;
  const auto nx = static_cast<std::size_t>(n[0]), ny = static_cast<std::size_t>(n[1]), nz = static_cast<std::size_t>(n[2]);
  CHECK(n[0] >= 1 && n[1] >= 1 && n[2] >= 1);
  CHECK_EQ(solid.size(), nx * ny * nz);
  const std::size_t cells = nx * ny * nz;
  for (auto* each : {&fine.to_x, &fine.to_y, &fine.to_z, &fine.beyond}) each->assign(cells, 0);
  for (std::size_t k = 0; k < nz; ++k)
    for (std::size_t j = 0; j < ny; ++j)
      for (std::size_t i = 0; i < nx; ++i) {
        const std::size_t c = (k * ny + j) * nx + i;
        if (solid[c]) continue;
        if (i + 1 < nx && !solid[c + 1]) fine.to_x[c] = 1;
        if (j + 1 < ny && !solid[c + nx]) fine.to_y[c] = 1;
        if (k + 1 < nz && !solid[c + nx * ny]) fine.to_z[c] = 1;
        const bool at[] = {i == 0, i + 1 == nx, j == 0, j + 1 == ny, k == 0, k + 1 == nz};
        for (std::size_t side = 0; side < 6; ++side)
          if (at[side] && open[side]) fine.beyond[c] += 1;
      }
  finish(fine);
  levels_.push_back(std::move(fine));
  while (levels_.back().diagonal.size() > kCoarsest) levels_.push_back(coarsened(levels_.back()));
  for (auto* each : {&r_, &z_, &q_}) each->assign(cells, 0);
  d_.assign(cells + 2 * levels_.front().pad, 0);
}

Poisson::Level Poisson::coarsened(const Level& fine) {
  Level coarse;
  for (std::size_t a = 0; a < 3; ++a) coarse.n[a] = (fine.n[a] + 1) / 2;
  const auto fx = static_cast<std::size_t>(fine.n[0]), fy = static_cast<std::size_t>(fine.n[1]), fz = static_cast<std::size_t>(fine.n[2]);
  const auto nx = static_cast<std::size_t>(coarse.n[0]), ny = static_cast<std::size_t>(coarse.n[1]), nz = static_cast<std::size_t>(coarse.n[2]);
  for (auto* each : {&coarse.to_x, &coarse.to_y, &coarse.to_z, &coarse.beyond}) each->assign(nx * ny * nz, 0);
  for (std::size_t k = 0; k < fz; ++k)
    for (std::size_t j = 0; j < fy; ++j)
      for (std::size_t i = 0; i < fx; ++i) {
        const std::size_t c = (k * fy + j) * fx + i, C = ((k / 2) * ny + j / 2) * nx + i / 2;
        // A face between two coarse cells counts by its four fine ones; those inside a coarse cell are gone.
        if (i % 2 == 1) coarse.to_x[C] += fine.to_x[c] / 4;
        if (j % 2 == 1) coarse.to_y[C] += fine.to_y[c] / 4;
        if (k % 2 == 1) coarse.to_z[C] += fine.to_z[c] / 4;
        coarse.beyond[C] += fine.beyond[c] / 4;
      }
  finish(coarse);
  return coarse;
}

void Poisson::finish(Level& l) {
  const auto nx = static_cast<std::size_t>(l.n[0]), ny = static_cast<std::size_t>(l.n[1]);
  const std::size_t cells = l.to_x.size(), layer = nx * ny;
  l.pad = layer;
  l.diagonal.assign(cells, 0);
  for (std::size_t c = 0; c < cells; ++c) {
    l.diagonal[c] += l.beyond[c] + l.to_x[c] + l.to_y[c] + l.to_z[c];
    if (c + 1 < cells) l.diagonal[c + 1] += l.to_x[c];
    if (c + nx < cells) l.diagonal[c + nx] += l.to_y[c];
    if (c + layer < cells) l.diagonal[c + layer] += l.to_z[c];
  }
  l.x.assign(cells + 2 * l.pad, 0);
  l.b.assign(cells, 0);
}

/// What the neighbours of c give to it: sum of openness times x. Weights to cells beyond the grid are 0, and x is padded.
/// kEdge: of a cell at a side of the grid. Behind it in memory lies another row's cell, which may be changing: not read.
template <bool kEdge>
Real Poisson::row(const Level& l, std::size_t c) {
  const auto nx = static_cast<std::size_t>(l.n[0]), layer = l.pad;
  const Real* x = l.x.data() + l.pad + c;
  const auto through = [](float open, const Real* other) { return kEdge && open == 0 ? Real(0) : open * *other; };
  Real sum = through(l.to_x[c], x + 1) + through(l.to_y[c], x + nx) + through(l.to_z[c], x + layer);
  if (c >= 1) sum += through(l.to_x[c - 1], x - 1);
  if (c >= nx) sum += through(l.to_y[c - nx], x - nx);
  if (c >= layer) sum += through(l.to_z[c - layer], x - layer);
  return sum;
}

/// Cells with i + j + k odd or even: these see only the others.
void Poisson::sweep(Level& l, int color) {
  const auto nx = static_cast<std::size_t>(l.n[0]), ny = static_cast<std::size_t>(l.n[1]), nz = static_cast<std::size_t>(l.n[2]);
  parallel_for(
      ny * nz,
      [&](std::size_t r) {
        const std::size_t j = r % ny, start = (j + r / ny + static_cast<std::size_t>(color)) % 2;
        const bool edge = j == 0 || j + 1 == ny;
        for (std::size_t i = start; i < nx; i += 2) {
          const std::size_t c = r * nx + i;
          if (l.diagonal[c] > 0) l.x[l.pad + c] = (l.b[c] + (edge || i == 0 || i + 1 == nx ? row<true>(l, c) : row<false>(l, c))) / l.diagonal[c];
        }
      },
      kRows);
}

/// levels_[l].x = about the inverse of A times levels_[l].b: symmetric and positive.
void Poisson::cycle(std::size_t at) {
  Level& l = levels_[at];
  std::fill(l.x.begin(), l.x.end(), 0);
  if (at + 1 == levels_.size()) {
    for (int k = 0; k < kCoarsestSweeps; ++k) sweep(l, 0), sweep(l, 1);
    for (int k = 0; k < kCoarsestSweeps; ++k) sweep(l, 1), sweep(l, 0);
    return;
  }
  sweep(l, 0);
  sweep(l, 1);
  // What is left, summed over eight cells. A counts in cells: twice as wide ones make it four times as small.
  Level& next = levels_[at + 1];
  const auto nx = static_cast<std::size_t>(l.n[0]), ny = static_cast<std::size_t>(l.n[1]), nz = static_cast<std::size_t>(l.n[2]);
  const auto mx = static_cast<std::size_t>(next.n[0]), my = static_cast<std::size_t>(next.n[1]), mz = static_cast<std::size_t>(next.n[2]);
  parallel_for(
      my * mz,
      [&](std::size_t r) {
        const std::size_t J = r % my, K = r / my;
        for (std::size_t I = 0; I < mx; ++I) {
          Real sum = 0;
          for (std::size_t k = 2 * K; k < std::min(2 * K + 2, nz); ++k)
            for (std::size_t j = 2 * J; j < std::min(2 * J + 2, ny); ++j)
              for (std::size_t i = 2 * I; i < std::min(2 * I + 2, nx); ++i) {
                const std::size_t c = (k * ny + j) * nx + i;
                if (l.diagonal[c] > 0) sum += l.b[c] - (l.diagonal[c] * l.x[l.pad + c] - row<false>(l, c));
              }
          next.b[r * mx + I] = sum / 2;
        }
      },
      kRows / 4);
  cycle(at + 1);
  parallel_for(
      ny * nz,
      [&](std::size_t r) {
        const std::size_t j = r % ny, k = r / ny;
        for (std::size_t i = 0; i < nx; ++i)
          if (l.diagonal[r * nx + i] > 0) l.x[l.pad + r * nx + i] += next.x[next.pad + ((k / 2) * my + j / 2) * mx + i / 2];
      },
      kRows);
  sweep(l, 1);
  sweep(l, 0);
}

void Poisson::apply(std::span<const Real> p, std::span<Real> out) const {
  const Level& l = levels_.front();
  CHECK_EQ(p.size(), l.diagonal.size());
  CHECK_EQ(out.size(), l.diagonal.size());
  const auto nx = static_cast<std::size_t>(l.n[0]);
  const std::size_t layer = l.pad, cells = p.size();
  parallel_for(
      cells,
      [&](std::size_t c) {
        Real sum = l.diagonal[c] * p[c];
        if (c + 1 < cells) sum -= l.to_x[c] * p[c + 1];
        if (c + nx < cells) sum -= l.to_y[c] * p[c + nx];
        if (c + layer < cells) sum -= l.to_z[c] * p[c + layer];
        if (c >= 1) sum -= l.to_x[c - 1] * p[c - 1];
        if (c >= nx) sum -= l.to_y[c - nx] * p[c - nx];
        if (c >= layer) sum -= l.to_z[c - layer] * p[c - layer];
        out[c] = sum;
      },
      kGrain);
}

Poisson::Report Poisson::solve(std::span<const Real> b, std::span<Real> p, Real tolerance, int most_iterations) {
  ZONE("smoke.pressure");
  Level& top = levels_.front();
  const std::size_t n = size();
  CHECK_EQ(b.size(), n);
  CHECK_EQ(p.size(), n);
  const auto dot = [&](const Real* u, const Real* v) { return parallel_sum(n, 0.0, [&](std::size_t i) { return u[i] * v[i]; }, kGrain); };
  const auto precondition = [&] {
    std::copy(r_.begin(), r_.end(), top.b.begin());
    cycle(0);
    std::copy_n(top.x.begin() + static_cast<std::ptrdiff_t>(top.pad), n, z_.begin());
  };
  Report report;
  apply(p, r_);
  parallel_for(n, [&](std::size_t i) { r_[i] = top.diagonal[i] > 0 ? b[i] - r_[i] : 0; }, kGrain);
  const Real whole = std::sqrt(parallel_sum(n, 0.0, [&](std::size_t i) { return top.diagonal[i] > 0 ? b[i] * b[i] : 0; }, kGrain));
  const Real enough = std::max(tolerance * whole, std::numeric_limits<Real>::min());
  Real left = std::sqrt(dot(r_.data(), r_.data()));
  Real* d = d_.data() + top.pad;
  Real rz = 0;
  for (; left > enough && report.iterations < most_iterations; ++report.iterations) {
    precondition();
    const Real next = dot(r_.data(), z_.data()), keep = report.iterations > 0 ? next / rz : 0;
    rz = next;
    parallel_for(n, [&](std::size_t i) { d[i] = z_[i] + keep * d[i]; }, kGrain);
    apply({d, n}, q_);
    const Real alpha = rz / dot(d, q_.data());
    if (!std::isfinite(alpha)) break;
    parallel_for(n, [&](std::size_t i) { p[i] += alpha * d[i], r_[i] -= alpha * q_[i]; }, kGrain);
    left = std::sqrt(dot(r_.data(), r_.data()));
  }
  report.residual = whole > 0 ? left / whole : 0;
  report.converged = left <= enough;
  return report;
}

std::size_t Poisson::memory() const {
  std::size_t bytes = (r_.capacity() + z_.capacity() + d_.capacity() + q_.capacity()) * sizeof(Real);
  for (const Level& l : levels_) bytes += (l.diagonal.capacity() + l.x.capacity() + l.b.capacity()) * sizeof(Real) + (l.to_x.capacity() + l.to_y.capacity() + l.to_z.capacity() + l.beyond.capacity()) * sizeof(float);
  return bytes;
}

}  // namespace effuse::flow::smoke
