#include "skin/surface/anisotropy.h"

#include <Eigen/Eigenvalues>
#include <algorithm>
#include <cmath>
#include <span>

#include "geometry/base/check.h"
#include "geometry/base/parallel.h"
#include "geometry/base/zones.h"
#include "skin/surface/clones.h"

namespace effuse::skin {

namespace {

constexpr int kPasses = 2;  // of smoothing
// Lengths in spacings.
constexpr Real kSupport = 2.5;             // of the covariance and of a layer
constexpr Real kThickness = 0.7;           // of a layer: the next one lies a spacing under it
constexpr Real kLongest = 1.6;             // ratio of a kernel's semi-axes; at 2.5 edges turn rounder and faces no flatter
constexpr Real kSharp = 2.4494897;         // ratio of eigenvalues beyond which a layer is as flat as can be
constexpr Real kRound = 0.3, kFlat = 0.8;  // 1 - (ratio of the lesser eigenvalues)^4 from which centres move, and move freely
constexpr Real kMostAmplitude = 6;

constexpr std::size_t kLanes = 8;
using Row = float __attribute__((vector_size(kLanes * sizeof(float))));

/// Particles near a cube of them and their centres, coordinates from the cube's corner. The sums run over them one by one, eight
/// particles side by side: those out of reach add nothing, so that a particle's numbers depend on its neighbours alone, to the bit.
struct Near {
  struct Particle {
    float x, y, z, cx, cy, cz;
  };
  std::vector<Particle> particles;
};

/// Sums over the neighbours of eight particles.
struct Moments {
  Row weight, crowd;
  Row x, y, z, xx, xy, xz, yy, yz, zz;  // weighted offsets and their products
};

EFFUSE_CLONES void gather_moments(const Near& near, const Row& x, const Row& y, const Row& z, float support, float reach, Moments& out) {
  const float per_support2 = 1 / (support * support), per_reach2 = 1 / (reach * reach);
  const Row zero{};
  Moments m{zero, zero, zero, zero, zero, zero, zero, zero, zero, zero, zero};
  for (const Near::Particle& p : near.particles) {
    const Row dx = p.x - x, dy = p.y - y, dz = p.z - z;
    const Row d2 = dx * dx + dy * dy + dz * dz;
    Row t = 1 - d2 * per_reach2, w = 1 - d2 * per_support2;
    t = t > zero ? t : zero;
    w = w > zero ? w : zero;
    m.crowd += t * t * t;
    m.weight += w;
    const Row wx = w * dx, wy = w * dy, wz = w * dz;
    m.x += wx, m.y += wy, m.z += wz;
    m.xx += wx * dx, m.xy += wx * dy, m.xz += wx * dz, m.yy += wy * dy, m.yz += wy * dz, m.zz += wz * dz;
  }
  out = m;
}

/// Eight particles, their centres and their normals.
struct Layered {
  Row x, y, z, cx, cy, cz, nx, ny, nz;
};

/// Sum of the weights of each one's layer, and of its heights over the particle along the normal.
EFFUSE_CLONES void gather_layers(const Near& near, const Layered& at, float reach, float thickness, Row& weight, Row& height) {
  const float per_reach2 = 1 / (reach * reach), per_thickness2 = 1 / (thickness * thickness);
  const Row zero{};
  Row W = zero, h = zero;
  for (const Near::Particle& p : near.particles) {
    const Row dx = p.x - at.x, dy = p.y - at.y, dz = p.z - at.z;
    const Row up = (p.cx - at.cx) * at.nx + (p.cy - at.cy) * at.ny + (p.cz - at.cz) * at.nz;
    Row t = 1 - (dx * dx + dy * dy + dz * dz) * per_reach2, u = 1 - up * up * per_thickness2;
    t = t > zero ? t : zero;
    u = u > zero ? u : zero;
    const Row w = t * t * (u * u);
    W += w;
    h += w * up;
  }
  weight = W;
  height = h;
}

/// 0 up to `from`, 1 from `to` on, once differentiable.
Real ramp(Real v, Real from, Real to) {
  const Real t = std::clamp((v - from) / (to - from), 0.0, 1.0);
  return t * t * (3 - 2 * t);
}

/// The direction in which a particle's centre may move, and how freely; and its kernel.
struct Shape {
  Eigen::Vector3f normal;
  Real freedom;
  std::array<float, 6> metric;
};

Shape shape_of(const Moments& m, std::size_t k, Real support) {
  const auto of = [k](const Row& row) { return static_cast<Real>(row[k]); };
  const Real weight = of(m.weight);
  const Vec3 mean = Vec3(of(m.x), of(m.y), of(m.z)) / weight;
  Mat3 C;
  C << of(m.xx), of(m.xy), of(m.xz), of(m.xy), of(m.yy), of(m.yz), of(m.xz), of(m.yz), of(m.zz);
  C = C / weight - mean * mean.transpose();
  // The particle itself weighs 1.
  const Real trust = ramp(weight - 1, 2, 4);
  const Real ball = support * support / 7;  // a full ball's eigenvalues under these weights
  constexpr Real kLeast = 1e-4;             // keeps particles that coincide from dividing by nothing
  C = trust * C + (1 - trust + kLeast) * ball * Mat3::Identity();

  Eigen::SelfAdjointEigenSolver<Mat3> solver;
  solver.computeDirect(C);
  Vec3 l = solver.eigenvalues();  // rising
  const Mat3& axes = solver.eigenvectors();
  const Real layer = std::max(l[0], l[2] / kSharp) / std::max(l[1], l[2] / kSharp), squared = layer * layer;
  const Vec3 n = axes.col(0);

  l = l.cwiseMax(l[2] / (kLongest * kLongest));
  l /= std::cbrt(l.prod());  // now the semi-axes' squares
  const Mat3 M = axes * l.cwiseInverse().asDiagonal() * axes.transpose();
  const auto narrow = [](Real v) { return static_cast<float>(v); };
  return {n.cast<float>(),
          ramp(1 - squared * squared, kRound, kFlat),
          {narrow(M(0, 0)), narrow(M(0, 1)), narrow(M(0, 2)), narrow(M(1, 1)), narrow(M(1, 2)), narrow(M(2, 2))}};
}

/// Particles by cubes, so wide that all neighbours of a particle lie in its cube and the 26 around it.
struct Cubes {
  KeyTable table;
  std::vector<std::array<int, 3>> coords;
  std::vector<Index> begin{0}, member;  // of cube c: member[begin[c]] .. member[begin[c + 1]], in an order of their own
  std::size_t size() const { return coords.size(); }
  std::span<const Index> of(std::size_t c) const { return std::span(member).subspan(begin[c], begin[c + 1] - begin[c]); }
};

Cubes cubes_of(const ParticleGrid& particles, Real side) {
  // Columns from west to east: their own order follows the points'.
  std::vector<ParticleGrid::Column> columns = particles.columns();
  std::sort(columns.begin(), columns.end(), [](const auto& a, const auto& b) { return a.x != b.x ? a.x < b.x : a.y < b.y; });
  Cubes cubes;
  std::vector<Index> cube(particles.size());
  for (const ParticleGrid::Column& column : columns)
    for (Index p = column.begin; p < column.end; ++p) {
      const auto at = [&](int axis) { return static_cast<int>(std::floor(particles.x()[p][axis] / side)); };
      const std::array<int, 3> c{at(0), at(1), at(2)};
      cube[p] = cubes.table.number(pack(c[0], c[1], c[2]));
      if (cube[p] == cubes.size()) {
        cubes.coords.push_back(c);
        cubes.begin.push_back(0);
      }
      ++cubes.begin[cube[p] + 1];
    }
  for (std::size_t c = 0; c < cubes.size(); ++c) cubes.begin[c + 1] += cubes.begin[c];
  std::vector<Index> filled(cubes.begin.begin(), cubes.begin.end() - 1);
  cubes.member.resize(particles.size());
  for (const ParticleGrid::Column& column : columns)
    for (Index p = column.begin; p < column.end; ++p) cubes.member[filled[cube[p]]++] = p;
  return cubes;
}

/// Particles within reach of those of the cube, counted from `corner`.
void gather_near(const ParticleGrid& particles, const std::vector<Vec3>& centre, const Cubes& cubes, std::size_t cube, const Vec3& corner,
                 Real reach, Near& near) {
  Box3 box;
  for (const Index p : cubes.of(cube)) box.extend(particles.x()[p]);
  const Vec3 low = box.min() - corner, high = box.max() - corner;
  const std::array<int, 3>& at = cubes.coords[cube];
  std::array<std::span<const Index>, 27> around;
  std::size_t most = 0;
  for (std::size_t k = 0; k < around.size(); ++k) {
    const auto step = [](std::size_t v) { return static_cast<int>(v % 3) - 1; };
    const Index other = cubes.table.find(pack(at[0] + step(k / 9), at[1] + step(k / 3), at[2] + step(k)));
    if (other != kNone) around[k] = cubes.of(other);
    most += around[k].size();
  }
  near.particles.resize(most);
  Near::Particle* to = near.particles.data();
  for (const std::span<const Index> members : around)
    for (const Index j : members) {
      const Vec3 x = particles.x()[j] - corner;
      const Eigen::Vector3f p = x.cast<float>(), c = (centre[j] - corner).cast<float>();
      *to = {p.x(), p.y(), p.z(), c.x(), c.y(), c.z()};
      to += (x - x.cwiseMax(low).cwiseMin(high)).squaredNorm() < reach * reach;  // else overwritten by the next
    }
  near.particles.resize(static_cast<std::size_t>(to - near.particles.data()));
}

/// How far from its particle a kernel can be felt [voxels].
Real felt_within(Real d, Real reach) {
  return static_cast<Real>(kKernelReach) * reach * std::cbrt(kLongest * kLongest) + kPasses * kThickness * d;
}

/// Cubes with a point within so many voxels of one of the blocks, along each axis.
std::vector<std::uint8_t> cubes_near(const Cubes& cubes, const Blocks& blocks, Real side, Real within) {
  std::vector<std::uint8_t> near(cubes.size(), 0);
  for (const BlockCoord& block : blocks.coords()) {
    std::array<int, 3> low, high;
    for (std::size_t a = 0; a < 3; ++a) {
      low[a] = static_cast<int>(std::floor((kSide * block[a] - within) / side));
      high[a] = static_cast<int>(std::floor((kSide * block[a] + kSide - 1 + within) / side));
    }
    for (int i = low[0]; i <= high[0]; ++i)
      for (int j = low[1]; j <= high[1]; ++j)
        for (int k = low[2]; k <= high[2]; ++k)
          if (const Index c = cubes.table.find(pack(i, j, k)); c != kNone) near[c] = 1;
  }
  return near;
}

}  // namespace

Real kernel_influence(float spacing, float reach) {
  const Real d = static_cast<Real>(spacing), R = static_cast<Real>(reach);
  // A kernel, its particle's neighbours in the second pass, theirs in the first.
  return felt_within(d, R) + kSupport * d + std::max(kSupport * d, R);
}

Kernels anisotropic_kernels(const ParticleGrid& particles, float spacing, float reach, const Blocks* wanted) {
  ZONE("skin.kernels");
  CHECK_GT(spacing, 0.0f);
  CHECK_GE(reach, spacing);
  const std::size_t n = particles.size();
  const Real d = static_cast<Real>(spacing), support = kSupport * d;
  Kernels kernels;
  kernels.centre = particles.x();
  kernels.metric.assign(n, {1, 0, 0, 1, 0, 1});
  kernels.amplitude.assign(n, 1);
  kernels.crowd.assign(n, 1);

  std::vector<Eigen::Vector3f> normal(n);
  std::vector<Real> freedom(n);
  const Real ratio = static_cast<Real>(reach) / d, full = 64 * kPi / 315 * ratio * ratio * ratio;
  const Real side = std::max({support, static_cast<Real>(reach), 1.0});  // at least a voxel: cubes can be numbered
  const Cubes cubes = cubes_of(particles, side);
  std::vector<std::uint8_t> in_first, in_second;  // cubes to see to in each pass; empty: all
  if (wanted) {
    const Real felt = felt_within(d, static_cast<Real>(reach));
    in_second = cubes_near(cubes, *wanted, side, felt);
    in_first = cubes_near(cubes, *wanted, side, felt + support);
  }

  std::vector<Vec3> moved = particles.x();
  // f(eight, near, corner) for the particles of each chosen cube, eight at a time.
  const auto eight_by_eight = [&](const std::vector<std::uint8_t>& chosen, const std::vector<Vec3>& centre, Real farthest, auto&& f) {
    parallel_ranges(cubes.size(), 4, [&](std::size_t begin, std::size_t end) {
      Near near;
      for (std::size_t c = begin; c < end; ++c) {
        if (!chosen.empty() && !chosen[c]) continue;
        const Vec3 corner = side * Vec3(cubes.coords[c][0], cubes.coords[c][1], cubes.coords[c][2]);
        gather_near(particles, centre, cubes, c, corner, farthest, near);
        const std::span<const Index> members = cubes.of(c);
        for (std::size_t first = 0; first < members.size(); first += kLanes)
          f(members.subspan(first, std::min(kLanes, members.size() - first)), near, corner);
      }
    });
  };
  // Each moved along its normal towards the mean height of its layer.
  const auto smooth = [&](std::span<const Index> eight, const Near& near, const Vec3& corner) {
    Layered at{};
    for (std::size_t k = 0; k < eight.size(); ++k) {
      const Index p = eight[k];
      const Eigen::Vector3f x = (particles.x()[p] - corner).cast<float>(), c = (kernels.centre[p] - corner).cast<float>();
      at.x[k] = x.x(), at.y[k] = x.y(), at.z[k] = x.z();
      at.cx[k] = c.x(), at.cy[k] = c.y(), at.cz[k] = c.z();
      at.nx[k] = normal[p].x(), at.ny[k] = normal[p].y(), at.nz[k] = normal[p].z();
    }
    Row weight{}, height{};
    const bool any = std::any_of(eight.begin(), eight.end(), [&](Index p) { return freedom[p] > 0; });
    if (any) gather_layers(near, at, static_cast<float>(support), static_cast<float>(kThickness * d), weight, height);
    for (std::size_t k = 0; k < eight.size(); ++k) {
      const Index p = eight[k];
      moved[p] = kernels.centre[p];
      if (freedom[p] == 0) continue;
      const Real W = static_cast<Real>(weight[k]);
      // A whole layer, one particle a squared spacing, weighs pi / 3 kSupport^2.
      const Real whole = ramp(W / (kPi / 3 * kSupport * kSupport), 0.1, 0.4);
      moved[p] += freedom[p] * whole * static_cast<Real>(height[k]) / W * normal[p].cast<Real>();
    }
  };
  eight_by_eight(in_first, particles.x(), side, [&](std::span<const Index> eight, const Near& near, const Vec3& corner) {
    Row x{}, y{}, z{};
    for (std::size_t k = 0; k < eight.size(); ++k) {
      const Eigen::Vector3f at = (particles.x()[eight[k]] - corner).cast<float>();
      x[k] = at.x(), y[k] = at.y(), z[k] = at.z();
    }
    Moments moments;
    gather_moments(near, x, y, z, static_cast<float>(support), reach, moments);
    for (std::size_t k = 0; k < eight.size(); ++k) {
      const Index p = eight[k];
      const Shape shape = shape_of(moments, k, support);
      normal[p] = shape.normal;
      freedom[p] = shape.freedom;
      kernels.metric[p] = shape.metric;
      kernels.crowd[p] = moments.crowd[k];
      const Real share = full / static_cast<Real>(moments.crowd[k]);
      kernels.amplitude[p] = static_cast<float>(std::min(kMostAmplitude, share * share));
    }
    smooth(eight, near, corner);
  });
  kernels.centre.swap(moved);
  eight_by_eight(in_second, kernels.centre, support, smooth);
  kernels.centre.swap(moved);
  return kernels;
}

}  // namespace effuse::skin
