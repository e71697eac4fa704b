#include <algorithm>
#include <array>
#include <cmath>

#include "geometry/base/parallel.h"
#include "geometry/base/zones.h"
#include "skin/surface/level_set_impl.h"

namespace effuse::skin {

namespace {

/// Ground distance and normal on the 5^3 lattice of every second voxel of a block (0, 2, 4, 6, 8), trilinear between.
struct GroundLattice {
  struct Node {
    float distance;  // [voxels]
    float nx, ny, nz;
  };
  std::array<Node, 125> nodes;

  struct Value {
    float distance;
    Vec3 normal;
  };
  /// At voxel (i, j, k) of the block; kNoGround if a node needed has none.
  Value at(int i, int j, int k) const {
    float d = 0, nx = 0, ny = 0, nz = 0;
    for (int di = 0; di <= (i & 1); ++di)
      for (int dj = 0; dj <= (j & 1); ++dj)
        for (int dk = 0; dk <= (k & 1); ++dk) {
          const Node& n = nodes[static_cast<std::size_t>(((i >> 1) + di) * 25 + ((j >> 1) + dj) * 5 + (k >> 1) + dk)];
          if (n.distance >= kNoGround) return {kNoGround, Vec3::UnitZ()};
          d += n.distance;
          nx += n.nx;
          ny += n.ny;
          nz += n.nz;
        }
    const float nodes_used = static_cast<float>((1 + (i & 1)) * (1 + (j & 1)) * (1 + (k & 1)));
    const Vec3 normal(nx, ny, nz);
    const Real length = normal.norm();
    return {d / nodes_used, length > 1e-6 ? Vec3(normal / length) : Vec3::UnitZ()};
  }
};

GroundLattice lattice_of(const BlockCoord& c, const Vec3& origin, Real voxel, const geometry::Terrain& terrain, Real reach) {
  GroundLattice lattice;
  for (int i = 0; i < 5; ++i)
    for (int j = 0; j < 5; ++j)
      for (int k = 0; k < 5; ++k) {
        const Vec3 p(kSide * c[0] + 2 * i, kSide * c[1] + 2 * j, kSide * c[2] + 2 * k);
        const geometry::Contact contact = terrain.contact(origin + voxel * p, reach);
        GroundLattice::Node& node = lattice.nodes[static_cast<std::size_t>(i * 25 + j * 5 + k)];
        node.distance = contact.any() ? static_cast<float>(contact.distance / voxel) : kNoGround;
        node.nx = static_cast<float>(contact.normal.x());
        node.ny = static_cast<float>(contact.normal.y());
        node.nz = static_cast<float>(contact.normal.z());
      }
  return lattice;
}

constexpr float kHalfDiagonal = 6.1f;  // of a block's voxel centres: 3.5 sqrt(3)

}  // namespace

GroundField sample_ground(const Blocks& blocks, const Vec3& origin, Real voxel, const geometry::Terrain& terrain, float reach) {
  ZONE("skin.ground");
  GroundField ground;
  ground.distance.assign(blocks.size() * kVoxels, kNoGround);
  ground.above.assign(blocks.size() * kVoxels, 1.0f);
  ground.normal.assign(blocks.size() * kVoxels, {0, 0, 1});
  // The lattice reaches a voxel beyond the block, the block to half its diagonal, and interpolation needs both ends.
  const Real search = voxel * static_cast<Real>(reach + 2 * kHalfDiagonal + 4);
  parallel_for(
      blocks.size(),
      [&](std::size_t b) {
        const BlockCoord& c = blocks.coords()[b];
        const Vec3 middle(kSide * c[0] + 3.5, kSide * c[1] + 3.5, kSide * c[2] + 3.5);
        const geometry::Contact at_middle = terrain.contact(origin + voxel * middle, search);
        const float d = at_middle.any() ? static_cast<float>(at_middle.distance / voxel) : kNoGround;
        float* distance = &ground.distance[b * kVoxels];
        float* above = &ground.above[b * kVoxels];
        // A block beyond the terrain's rim may still have voxels within it: only a distance that is known tells.
        if (at_middle.any() && std::abs(d) > reach + kHalfDiagonal) {
          if (d < 0) {
            std::fill_n(distance, kVoxels, -kNoGround);
            std::fill_n(above, kVoxels, 0.0f);
          }
          return;
        }
        const GroundLattice lattice = lattice_of(c, origin, voxel, terrain, search);
        for (int i = 0; i < kSide; ++i)
          for (int j = 0; j < kSide; ++j)
            for (int k = 0; k < kSide; ++k) {
              const std::size_t v = voxel_index(i, j, k);
              const GroundLattice::Value g = lattice.at(i, j, k);
              distance[v] = g.distance;
              if (g.distance >= kNoGround) continue;
              const float share = static_cast<float>(1 / g.normal.lpNorm<1>());
              above[v] = std::clamp(0.5f + g.distance * share, 0.0f, 1.0f);
              ground.normal[b * kVoxels + v] = g.normal.cast<float>();
            }
      },
      4);
  return ground;
}

void lift_to_ground(const Blocks& blocks, float outside, float lift, const GroundField& ground, float depth, const Field& old, Field& phi) {
  ZONE("skin.lift");
  phi.resize(old.size());
  parallel_for(
      blocks.size(),
      [&](std::size_t b) {
        const BlockCoord& c = blocks.coords()[b];
        for (std::size_t v = 0; v < kVoxels; ++v) {
          const std::size_t at = b * kVoxels + v;
          const float g = ground.distance[at];
          phi[at] = old[at];
          if (g >= 2 * lift || g < -depth) continue;
          const Vec3 p(kSide * c[0] + static_cast<int>(v >> 6), kSide * c[1] + static_cast<int>((v >> 3) & 7),
                       kSide * c[2] + static_cast<int>(v & 7));
          const Vec3 normal = ground.normal[at].cast<Real>();
          for (const float height : {lift, 1.5f * lift, 2 * lift}) {
            const float value =
                height <= g ? old[at] : blocks.sample(old, outside, static_cast<Index>(b), p + static_cast<Real>(height - g) * normal);
            phi[at] = height == lift ? value : std::min(phi[at], value);
          }
        }
      },
      16);
}

std::vector<float> carried_at(const LevelSet::Impl& s, std::vector<Vec3> points) {
  ZONE("skin.carry");
  if (s.terrain) {
    const Real lift = static_cast<Real>(s.lift) * s.voxel;
    parallel_for(points.size(), [&](std::size_t i) {
      const geometry::Contact c = s.terrain->contact(s.world(points[i]), 8 * s.spacing);
      if (c.any() && c.distance < lift) points[i] += (lift - c.distance) / s.voxel * c.normal;
    });
  }
  std::vector<float> out(points.size() * static_cast<std::size_t>(s.particles.carried().width));
  s.particles.average(points, s.reach, out);
  return out;
}

}  // namespace effuse::skin
