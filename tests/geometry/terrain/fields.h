#pragma once

#include <fstream>
#include <limits>
#include <stdexcept>
#include <string>
#include <vector>

#include "geometry/base/random.h"
#include "geometry/terrain/height_field.h"

/// Height fields that tests and benchmarks share.
namespace effuse::geometry::fields {

/// An ESRI ASCII grid, read in the plainest way; heights times steepness.
inline HeightField read_asc(const std::string& path, Real steepness = 1) {
  std::ifstream in(path);
  std::string key;
  int nx = 0, ny = 0;
  Real x = 0, y = 0, cell = 0, hole = 0;
  in >> key >> nx >> key >> ny >> key >> x >> key >> y >> key >> cell >> key >> hole;
  if (!in) throw std::runtime_error("cannot read " + path);
  std::vector<Real> z(static_cast<std::size_t>(nx) * ny);
  for (int j = ny - 1; j >= 0; --j)
    for (int i = 0; i < nx; ++i) in >> z[static_cast<std::size_t>(j) * nx + i];
  if (!in) throw std::runtime_error("cannot read " + path);
  for (Real& h : z) h = h == hole ? std::numeric_limits<Real>::quiet_NaN() : steepness * h;
  return HeightField({0, 0}, {cell, cell}, nx, ny, std::move(z));
}

inline HeightField maunga_whau(Real steepness = 1) { return read_asc(EFFUSE_SOURCE_DIR "/samples/scenes/maunga-whau.asc", steepness); }

/// Rough: each post at random in [0, roughness * 2] cells, a share of them holes.
inline HeightField random_field(std::uint64_t seed, int nx, int ny, Real roughness, Real hole_share) {
  std::vector<Real> z(static_cast<std::size_t>(nx) * ny);
  for (std::size_t k = 0; k < z.size(); ++k) {
    z[k] = 2 * roughness * 2.5 * random_uniform(seed, 0, k);
    if (random_uniform(seed, 1, k) < hole_share) z[k] = std::numeric_limits<Real>::quiet_NaN();
  }
  return HeightField({-7, 3}, {2, 3}, nx, ny, std::move(z));
}

template <class F>
HeightField sampled(const Vec2& corner, const Vec2& spacing, int nx, int ny, F&& f) {
  std::vector<Real> z;
  for (int j = 0; j < ny; ++j)
    for (int i = 0; i < nx; ++i) z.push_back(f(corner.x() + i * spacing.x(), corner.y() + j * spacing.y()));
  return HeightField(corner, spacing, nx, ny, std::move(z));
}

}  // namespace effuse::geometry::fields
