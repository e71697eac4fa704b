#include "importers/terrain/fill_holes.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "geometry/base/check.h"
#include "geometry/base/zones.h"

namespace effuse::importers {

namespace {

std::size_t at(int i, int j, int nx) { return static_cast<std::size_t>(j) * static_cast<std::size_t>(nx) + static_cast<std::size_t>(i); }

/// Posts of the largest connected hole (four neighbours).
std::size_t largest_hole(const std::vector<char>& hole, int nx, int ny) {
  std::vector<char> open(hole);
  std::vector<std::size_t> stack;
  std::size_t largest = 0;
  for (std::size_t start = 0; start < open.size(); ++start) {
    if (!open[start]) continue;
    std::size_t posts = 0;
    stack.push_back(start);
    open[start] = 0;
    while (!stack.empty()) {
      const std::size_t post = stack.back();
      stack.pop_back();
      ++posts;
      const int i = static_cast<int>(post % static_cast<std::size_t>(nx)), j = static_cast<int>(post / static_cast<std::size_t>(nx));
      const auto visit = [&](int x, int y) {
        if (x < 0 || y < 0 || x >= nx || y >= ny || !open[at(x, y, nx)]) return;
        open[at(x, y, nx)] = 0;
        stack.push_back(at(x, y, nx));
      };
      visit(i - 1, j), visit(i + 1, j), visit(i, j - 1), visit(i, j + 1);
    }
    largest = std::max(largest, posts);
  }
  return largest;
}

/// Half of a grid: each post the mean of those of its four that are there.
void halve(const std::vector<Real>& z, int nx, int ny, std::vector<Real>& half, int hx, int hy) {
  half.assign(static_cast<std::size_t>(hx) * static_cast<std::size_t>(hy), std::numeric_limits<Real>::quiet_NaN());
  for (int j = 0; j < hy; ++j)
    for (int i = 0; i < hx; ++i) {
      Real sum = 0;
      int count = 0;
      for (int y = 2 * j; y < std::min(2 * j + 2, ny); ++y)
        for (int x = 2 * i; x < std::min(2 * i + 2, nx); ++x)
          if (const Real value = z[at(x, y, nx)]; !std::isnan(value)) sum += value, ++count;
      if (count > 0) half[at(i, j, hx)] = sum / count;
    }
}

/// Gauss-Seidel with over-relaxation on the posts in holes.
void relax(std::vector<Real>& z, const std::vector<char>& hole, int nx, int ny, int sweeps) {
  constexpr Real kOver = 1.6;
  for (int sweep = 0; sweep < sweeps; ++sweep)
    for (int j = 0; j < ny; ++j)
      for (int i = 0; i < nx; ++i) {
        if (!hole[at(i, j, nx)]) continue;
        Real sum = 0;
        int count = 0;
        if (i > 0) sum += z[at(i - 1, j, nx)], ++count;
        if (i + 1 < nx) sum += z[at(i + 1, j, nx)], ++count;
        if (j > 0) sum += z[at(i, j - 1, nx)], ++count;
        if (j + 1 < ny) sum += z[at(i, j + 1, nx)], ++count;
        if (count > 0) z[at(i, j, nx)] += kOver * (sum / count - z[at(i, j, nx)]);
      }
}

void solve(std::vector<Real>& z, int nx, int ny) {
  std::vector<char> hole(z.size());
  bool any = false;
  for (std::size_t k = 0; k < z.size(); ++k) any |= (hole[k] = std::isnan(z[k]));
  if (!any || (nx == 1 && ny == 1)) return;
  const int hx = (nx + 1) / 2, hy = (ny + 1) / 2;
  std::vector<Real> half;
  halve(z, nx, ny, half, hx, hy);
  solve(half, hx, hy);
  // From the coarse grid, whose posts are the means of pairs: a quarter of a coarse cell to either side.
  for (int j = 0; j < ny; ++j)
    for (int i = 0; i < nx; ++i) {
      if (!hole[at(i, j, nx)]) continue;
      const Real x = std::clamp((i - 0.5) / 2, Real{0}, Real(hx - 1)), y = std::clamp((j - 0.5) / 2, Real{0}, Real(hy - 1));
      const int k = std::min(static_cast<int>(x), std::max(hx - 2, 0)), l = std::min(static_cast<int>(y), std::max(hy - 2, 0));
      const int k1 = std::min(k + 1, hx - 1), l1 = std::min(l + 1, hy - 1);
      const Real u = x - k, v = y - l;
      z[at(i, j, nx)] = (1 - v) * ((1 - u) * half[at(k, l, hx)] + u * half[at(k1, l, hx)]) + v * ((1 - u) * half[at(k, l1, hx)] + u * half[at(k1, l1, hx)]);
    }
  relax(z, hole, nx, ny, 30);
}

}  // namespace

FilledHoles fill_holes(std::vector<Real>& z, int nx, int ny) {
  ZONE("import.fill_holes");
  CHECK_EQ(z.size(), static_cast<std::size_t>(nx) * static_cast<std::size_t>(ny));
  std::vector<char> hole(z.size());
  FilledHoles filled;
  for (std::size_t k = 0; k < z.size(); ++k) filled.posts += static_cast<std::size_t>(hole[k] = std::isnan(z[k]));
  if (filled.posts == 0 || filled.posts == z.size()) return {};
  filled.largest = largest_hole(hole, nx, ny);
  solve(z, nx, ny);
  return filled;
}

}  // namespace effuse::importers
