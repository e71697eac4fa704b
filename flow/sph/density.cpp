#include "flow/sph/density.h"

#include <Eigen/Eigenvalues>
#include <algorithm>
#include <array>
#include <cmath>

#include "flow/sph/pair_kernels.h"
#include "flow/sph/viscosity.h"
#include "geometry/base/check.h"
#include "geometry/base/parallel.h"
#include "geometry/base/zones.h"

namespace effuse::flow::sph {

namespace {
constexpr std::size_t kGrain = 256;  // particles a thread takes at a time
constexpr Real kUnseen = 1e9;   // depth of lava whose surface is far, in spacings
constexpr Real kNearOff = 1.55;  // spacings below the free surface: nearer, its distance is sure
constexpr Real kAcross = 0.7;    // cosine: nearer to straight across than this
constexpr Real kFlat = 0.05;     // of a full neighbourhood's moment: with less there is no gradient in that direction
constexpr Real kNearestWall = 0.25;  // spacings: nearer walls shear no harder
constexpr Real kSameFace = 0.6;  // cosine between the normals of two places of one face
constexpr Real kLoose = 0.8;    // of the density: with less a particle is a drop or in a sheet
constexpr Real kDrop = 4.83597586;  // area of a ball of the particle's volume, in faces: (36 pi)^(1/3); a sheet has 2
}  // namespace

Real lattice_sum(KernelKind kernel, Real support, Real spacing) {
  ParticleSystem s;
  s.kernel = kernel;
  s.support = support;
  return with_kernel(s, [&](const auto& W, auto) {
    Real sum = 0;
    const int m = static_cast<int>(support / spacing) + 1;
    for (int i = -m; i <= m; ++i)
      for (int j = -m; j <= m; ++j)
        for (int k = -m; k <= m; ++k) sum += W.W(spacing * std::sqrt(static_cast<Real>(i * i + j * j + k * k)));
    return sum * spacing * spacing * spacing;
  });
}

namespace {
/// Multiplies the walls' friction by what thin lava lacks of it.
///   depth  of films [m], kUnseen where the particle sees none on that wall
///   up     to the free surface, unit, of particles that are sure of it; 0 of others
///   off    how far that is [m]
void resist_thin_lava(const ParticleSystem& s, const FilmFriction& film, std::vector<Real>& depth, std::span<const Vec3> up, std::span<const Real> off, Walls& walls) {
  // Those near a wall that do not see the surface hear of it from neighbours that do, and from those on the same wall that have heard; by an
  // obstacle's also from those beyond the wall's reach (on the ground that would make films of six layers, with strength, too slow).
  std::vector<Real> told = depth;
  for (int round = 0; round < 2; ++round) {
    parallel_for(s.size(), [&](std::size_t i) {
      const bool several = walls[i].size() > 1;
      for (Index w = walls.first[i]; w < walls.first[i + 1]; ++w) {
        const Wall& wall = walls.walls[w];
        if (depth[w] != kUnseen || wall.across != kNothingAcross) continue;
        Real sum = 0, seen = 0;
        for (const Index j : (*s.neighbors)[i]) {
          Real least = kUnseen;
          for (Index k = walls.first[j]; k < walls.first[j + 1]; ++k) {
            if ((several || walls[j].size() > 1) && walls.walls[k].normal.dot(wall.normal) < kSameFace) continue;
            least = std::min(least, depth[k]);
          }
          if (least == kUnseen && wall.mirrors && walls[j].empty() && up[j].dot(wall.normal) > kAcross) least = wall.distance + s.separation<true>(j, static_cast<Index>(i)).dot(wall.normal) + off[j];
          if (least == kUnseen) continue;
          sum += least;
          seen += 1;
        }
        if (seen > 0) told[w] = sum / seen;
      }
    });
    depth = told;
  }
  parallel_for(walls.walls.size(), [&](std::size_t w) {
    Wall& wall = walls.walls[w];
    wall.friction *= depth[w] == kUnseen && wall.across != kNothingAcross ? film.channel(wall.across) : film.film(depth[w] == kUnseen ? kUnseen * s.spacing : depth[w]);
  }, 4096);
}
}  // namespace

void find_shape(const ParticleSystem& s, Real lattice, const FilmFriction& film, Walls& walls, FlowShape& shape) {
  ZONE("sph.density");
  const std::size_t n = s.size();
  const Real dx = s.spacing, face = dx * dx;
  for (auto* array : {&shape.density, &shape.off, &shape.missing, &shape.exposed, &shape.grounded}) array->resize(n);
  shape.surface.resize(n);
  std::vector<Real> depth(walls.walls.size(), kUnseen);  // of the film on each wall [m]
  std::vector<Vec3> up(n, Vec3::Zero());
  const auto share = [dx](Real distance) { return std::clamp(1.5 - distance / dx, 0.0, 1.0); };

  const Real own = with_kernel(s, [&](const auto& W, auto) { return s.volume() * W.W(0); });
  // Faces of air by lack of density: a power of it, through one particle alone and one in a sheet.
  const Real alone = own / lattice;
  const Real sheet = with_kernel(s, [&](const auto& W, auto) {
    Real sum = 0;
    for (int reach = static_cast<int>(s.support / dx) + 1, a = -reach; a <= reach; ++a)
      for (int b = -reach; b <= reach; ++b) sum += W.W(dx * std::sqrt(static_cast<Real>(a * a + b * b)));
    return sum * s.volume() / lattice;
  });
  const Real power = std::log(kDrop / 2) / std::log((1 - alone) / (1 - sheet));
  const PairsOf pairs(s);
  parallel_ranges(n, kGrain, [&](std::size_t begin, std::size_t end) {
    std::array<Vec3, kGrain> slopes;
    pairs->density(begin, end, shape.density, std::span(slopes).first(end - begin));
    for (std::size_t i = begin; i < end; ++i) {
      Real sum = own + shape.density[i];
      Vec3 slope = slopes[i - begin];
      shape.grounded[i] = 0;
      for (const Wall& wall : walls[i]) {
        const BoundaryTable::Row row = s.boundary->at(wall);
        sum += row.gamma;
        slope += row.slope * wall.normal;
        shape.grounded[i] = std::max(shape.grounded[i], face * share(wall.distance));
      }
      const Real off = s.boundary->distance_of_slope(slope.norm());
      shape.off[i] = off;
      shape.missing[i] = s.boundary->at(off).gamma / lattice;
      const Real density = sum / lattice + shape.missing[i];
      shape.density[i] = density;
      shape.surface[i] = off < 0.9 * dx || density < kLoose;
      Real exposed = share(off);
      if (density < kLoose) exposed = std::max(exposed, kDrop * std::pow((1 - density) / (1 - alone), power));
      shape.exposed[i] = face * exposed;

      // Depth of the film, where the free surface is near and across from the wall. To obstacles' walls, that stand beside films as often
      // as under them, straight across.
      if (!(off < kNearOff * dx)) continue;
      up[i] = -slope.normalized();
      for (Index w = walls.first[i]; w < walls.first[i + 1]; ++w) {
        const Wall& wall = walls.walls[w];
        if (slope.dot(wall.normal) < (wall.mirrors ? -kAcross * slope.norm() : 0)) depth[w] = wall.distance + off;
      }
    }
  });
  resist_thin_lava(s, film, depth, up, shape.off, walls);
}

void bend_walls(const ParticleSystem& s, Walls& walls, std::vector<Real>& distances) {
  distances.resize(walls.walls.size());
  for (std::size_t w = 0; w < distances.size(); ++w) distances[w] = walls.walls[w].distance;
  const Real most = 0.5 * s.spacing;
  parallel_for(s.size(), [&](std::size_t i) {
    const bool several = walls[i].size() > 1;
    for (Index w = walls.first[i]; w < walls.first[i + 1]; ++w) {
      const Wall wall = walls.walls[w];
      // Feet of the neighbours' perpendiculars on the same surface: on a sphere of radius R normals differ by feet / R.
      Real turn = 0, length = 0;
      for (const Index j : (*s.neighbors)[i]) {
        for (const Wall& other : walls[j]) {
          // Another face of the same solid, in a corner, is no turn of this one.
          if (other.surface != wall.surface || ((several || walls[j].size() > 1) && other.normal.dot(wall.normal) < kSameFace)) continue;
          const Vec3 foot = s.separation<true>(j, i) - other.reach * other.normal + wall.reach * wall.normal;
          turn += (other.normal - wall.normal).dot(foot);
          length += foot.squaredNorm();
        }
      }
      const Real curvature = length > 0 ? 2 * turn / length : 0;
      const BoundaryTable::Row row = s.boundary->at(wall.reach);
      walls.walls[w].curvature = curvature;
      if (row.slope < 0) walls.walls[w].distance = wall.reach + std::clamp(-curvature * row.bend / row.slope, -most, most);
    }
  });
}

void trim_walls(const BoundaryTable& boundary, Walls& walls) {
  const Real whole = boundary.at(-boundary.support()).gamma;
  parallel_for(walls.first.size() - 1, [&](std::size_t i) {
    const std::span<Wall> own(walls.walls.data() + walls.first[i], walls.first[i + 1] - walls.first[i]);
    if (own.size() < 2) return;
    const std::size_t n = std::min<std::size_t>(own.size(), 16);
    std::array<Real, 16> gamma;
    for (std::size_t k = 0; k < n; ++k) gamma[k] = boundary.at(own[k].distance).gamma / whole;
    for (std::size_t a = 0; a < n; ++a)
      for (std::size_t b = 0; b < n; ++b) {
        if (a == b) continue;
        const Real c = 2 / kPi * std::asin(std::clamp(own[a].normal.dot(own[b].normal), -1.0, 1.0));
        // The lesser gives way; of equal ones the later.
        const bool yields = gamma[a] != gamma[b] ? gamma[a] < gamma[b] : a > b;
        own[a].share *= c >= 0 ? 1 - (1 - c) * gamma[b] - (yields ? c : 0) : 1 - (1 + c) * gamma[b];
        if (yields) own[a].part *= c >= 0 ? 1 - (1 - c) * gamma[b] - c : 1 - (1 + c) * gamma[b];
      }
    for (Wall& wall : own) {
      wall.share = std::max(wall.share, 0.0);
      wall.part = std::max(wall.part, 0.0);
    }
  }, 2048);
}

void shear_rate_squared(const ParticleSystem& s, Real slip_length, std::span<const Vec3> v, std::span<Real> out) {
  ZONE("sph.shear rate");
  CHECK_EQ(v.size(), s.size());
  CHECK_EQ(out.size(), s.size());
  const PairsOf pairs(s);
  parallel_ranges(s.size(), kGrain, [&](std::size_t begin, std::size_t end) {
    std::array<Mat3, kGrain> gradients, moments;
    pairs->velocity_gradient(begin, end, v, std::span(gradients).first(end - begin), std::span(moments).first(end - begin));
    for (std::size_t i = begin; i < end; ++i) {
      Mat3 gradient = gradients[i - begin], moment = moments[i - begin];
      for (const Wall& wall : (*s.walls)[i]) {
        const BoundaryTable::Row row = s.boundary->at(wall);
        const Real depth = std::max(wall.distance, kNearestWall * s.spacing) + slip_length;
        const Mat3 across = wall.normal * wall.normal.transpose();
        gradient += row.moment_n / depth * (v[i] - s.velocity_of(wall)) * wall.normal.transpose();
        moment += row.moment_n * across + row.moment_t * (Mat3::Identity() - across);
      }
      // The inverse, without the directions that the neighbours say nothing of.
      const Eigen::SelfAdjointEigenSolver<Mat3> eigen(moment);
      Vec3 inverse = Vec3::Zero();
      for (int k = 0; k < 3; ++k)
        if (eigen.eigenvalues()[k] > kFlat) inverse[k] = 1 / eigen.eigenvalues()[k];
      const Mat3 G = gradient * (eigen.eigenvectors() * inverse.asDiagonal() * eigen.eigenvectors().transpose());
      out[i] = 0.5 * (G + G.transpose()).squaredNorm();
    }
  });
}

void dissipation(const ParticleSystem& s, std::span<const Real> mu, Real slip_length, std::span<const Vec3> v, std::span<Real> out) {
  ZONE("sph.dissipation");
  CHECK_EQ(mu.size(), s.size());
  CHECK_EQ(v.size(), s.size());
  CHECK_EQ(out.size(), s.size());
  const PairsOf pairs(s);
  pairs->set_viscosity(mu);
  parallel_ranges(s.size(), kGrain, [&](std::size_t begin, std::size_t end) {
    pairs->friction_power(begin, end, v, out);
    // Of a pair's power each has half.
    for (std::size_t i = begin; i < end; ++i) out[i] = out[i] / 2 + wall_dissipation(s, mu[i], slip_length, v[i], i);
  });
}

}  // namespace effuse::flow::sph
