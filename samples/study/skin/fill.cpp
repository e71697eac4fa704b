#include "samples/study/skin/fill.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "geometry/base/parallel.h"
#include "geometry/base/random.h"
#include "skin/detail/near_grid.h"

namespace effuse::study {

namespace {

// [spacings]; kPressed: more than the mean distance of neighbours, so that all are pressed on, and pressed against the walls.
constexpr Real kMoved = 0.35, kPressed = 1.25, kYield = 0.25, kUnder = 0.45, kSlack = 0.02;
constexpr int kRounds = 60, kShifts = 8;

std::vector<Vec3> lattice(const Box3& box, const std::function<Real(const Vec3&)>& distance, const Vec3& shift) {
  std::vector<Vec3> x;
  const Vec3 first = box.min().array().floor() + shift.array() - 0.5;
  for (Real i = first.x(); i < box.max().x(); ++i)
    for (Real j = first.y(); j < box.max().y(); ++j)
      for (Real k = first.z(); k < box.max().z(); ++k)
        if (const Vec3 p(i, j, k); distance(p) < 0) x.push_back(p);
  return x;
}

Vec3 slope_of(const std::function<Real(const Vec3&)>& distance, const Vec3& p) {
  constexpr Real e = 1e-4;
  Vec3 slope;
  for (int a = 0; a < 3; ++a) slope[a] = (distance(p + e * Vec3::Unit(a)) - distance(p - e * Vec3::Unit(a))) / (2 * e);
  return slope;
}

struct Particle {
  Vec3 x;
  Index place;
};

/// One round: all are moved at once, from where all were.
std::vector<Vec3> pushed_apart(const std::vector<Vec3>& x, const std::function<Real(const Vec3&)>& distance) {
  std::vector<Particle> particles;
  for (std::size_t i = 0; i < x.size(); ++i) particles.push_back({x[i], static_cast<Index>(i)});
  const skin::NearGrid<Particle> grid(std::move(particles), kPressed);
  std::vector<Vec3> moved(x.size());
  parallel_for(x.size(), [&](std::size_t i) {
    Vec3 p = x[i];
    grid.each_near(x[i], kPressed, [&](const Particle& other) {
      const Vec3 d = x[i] - other.x;
      const Real length = d.norm();
      if (length > 0 && length < kPressed) p += (kYield * (kPressed - length) / length) * d;
    });
    // Where the distance has no slope there is nowhere to go. Three times: in a corner each takes it from one wall.
    for (int wall = 0; wall < 3; ++wall) {
      const Real too_near = distance(p) + kUnder;
      if (too_near <= 0) break;
      const Vec3 slope = slope_of(distance, p);
      if (slope.norm() > 0.1) p -= (too_near / slope.squaredNorm()) * slope;
    }
    // Where the body is too thin to go back in, better not to have moved.
    moved[i] = distance(p) > std::max(distance(x[i]), kSlack - kUnder) ? x[i] : p;
  });
  return moved;
}

}  // namespace

std::vector<Vec3> fill(const Box3& box, const std::function<Real(const Vec3&)>& distance, Real volume, Filling how, std::uint64_t seed) {
  std::vector<Vec3> x = lattice(box, distance, Vec3::Zero());
  if (volume > 0) {
    // Of equal numbers the one that lies most evenly.
    const auto rank = [&](const std::vector<Vec3>& y) {
      Vec3 middle = Vec3::Zero();
      for (const Vec3& p : y) middle += p - box.center();
      return std::pair(std::abs(static_cast<Real>(y.size()) - volume), std::round(1e6 * middle.norm() / static_cast<Real>(y.size())));
    };
    for (int k = 1; k < kShifts * kShifts * kShifts; ++k) {
      std::vector<Vec3> other = lattice(box, distance, Vec3(k % kShifts, k / kShifts % kShifts, k / kShifts / kShifts) / kShifts);
      if (rank(other) < rank(x)) x = std::move(other);
    }
  }
  if (how == Filling::kLattice) return x;

  for (std::uint64_t i = 0; i < x.size(); ++i) {
    const Vec3 p = x[i] + kMoved * Vec3(2 * random_uniform(seed, 0, i) - 1, 2 * random_uniform(seed, 1, i) - 1, 2 * random_uniform(seed, 2, i) - 1);
    if (distance(p) < 0) x[i] = p;
  }
  for (int round = 0; round < kRounds; ++round) x = pushed_apart(x, distance);
  return x;
}

}  // namespace effuse::study
