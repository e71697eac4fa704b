#include "skin/surface/level_set.h"

#include <algorithm>
#include <cmath>

#include "geometry/base/check.h"
#include "geometry/base/parallel.h"
#include "geometry/base/zones.h"
#include "skin/surface/level_set_impl.h"
#include "skin/surface/rasterize.h"

namespace effuse::skin {

LevelSet::LevelSet() : impl_(std::make_unique<Impl>()) {}
LevelSet::~LevelSet() = default;
LevelSet::LevelSet(LevelSet&&) noexcept = default;
LevelSet& LevelSet::operator=(LevelSet&&) noexcept = default;

bool LevelSet::empty() const { return impl_->blocks.size() == 0; }
Real LevelSet::voxel() const { return impl_->voxel; }
const LevelSetReport& LevelSet::report() const { return impl_->report; }

std::size_t LevelSet::active_voxels() const {
  return static_cast<std::size_t>(std::count_if(impl_->phi.begin(), impl_->phi.end(), [](float v) { return std::abs(v) < 2; }));
}

LevelSet build_level_set(const geometry::Points& points, Real volume, const geometry::Terrain* terrain, const LevelSetOptions& options) {
  ZONE("skin.level_set");
  CHECK(options.spacing > 0 && std::isfinite(options.spacing));
  CHECK_GE(options.voxel, 0.0);
  CHECK_GT(options.radius, 0.0);
  CHECK_GT(options.influence, options.radius + 1);  // else a shift could push the surface out of the field
  CHECK_GE(options.sink, 0.0);
  LevelSet surface;
  LevelSet::Impl& s = surface.impl();
  s.spacing = options.spacing;
  s.voxel = options.voxel > 0 ? options.voxel : options.spacing / 2;
  const float d = static_cast<float>(s.spacing / s.voxel);  // everything below in voxels
  const float radius = static_cast<float>(options.radius) * d;
  s.reach = static_cast<float>(options.influence) * d;
  s.outside = s.reach - radius;
  s.lift = d / 2;  // the lowest particles float so high over the ground
  s.report.particles = points.size();
  s.particles = ParticleGrid(points, s.voxel, std::max(1.0, s.reach / 2.0));
  if (points.size() == 0) return surface;

  // The dual mesh rounds the edge where side and bottom meet: a voxel and a half keeps that under the ground. Blocks must
  // reach beyond the particles' own reach to hold the bottom.
  const float sink = options.sink > 0 ? static_cast<float>(options.sink / s.voxel) : 1.5f;
  s.blocks = blocks_around(s.particles, s.reach + (terrain ? sink + 1 : 0));
  RasterOptions raster{.reach = s.reach, .spacing = d, .radius_factor = 2 * static_cast<float>(options.radius), .outside = s.outside};
  Field weight;
  rasterize(s.particles, s.blocks, raster, s.phi, weight);

  const float near_surface = 1 - (radius / s.reach) * (radius / s.reach);
  const float lone = near_surface * near_surface * near_surface;
  const float sheet = static_cast<float>(kPi) / 4 * (s.reach / d) * (s.reach / d) * lone * near_surface;
  smooth(s.blocks, s.outside, static_cast<float>(options.smoothing) * d * d / 24, weight, lone, sheet, s.phi);

  GroundField ground;
  if (terrain) {
    s.terrain = *terrain;
    const float depth = sink + 2;  // voxels deeper than this are outside, whatever they were
    ground = sample_ground(s, *terrain, std::max(2 * s.lift, depth) + 1);
    Field lifted;
    lift_to_ground(s, ground, depth, lifted);
    s.phi.swap(lifted);
  }

  const auto voxels = [&](Real v) { return v / (s.voxel * s.voxel * s.voxel); };
  if (options.match_volume && volume > 0) {
    s.report.target = volume;
    const float shift = matching_shift(s.blocks, s.outside, s.phi, ground.above, voxels(volume), d / 2);
    s.report.shift = static_cast<Real>(shift) * s.voxel;
    parallel_for(
        s.phi.size(), [&](std::size_t i) { s.phi[i] -= shift; }, 1 << 14);
    s.outside -= shift;
  }
  if (terrain)
    parallel_for(
        s.phi.size(),
        [&](std::size_t i) {
          if (ground.distance[i] < kNoGround) s.phi[i] = std::min(s.outside, std::max(s.phi[i], -ground.distance[i] - sink));
        },
        1 << 14);
  drop_pieces(s.blocks, s.particles, options.drop_volume * std::pow(static_cast<Real>(d), 3), s.phi, s.report);

  s.report.volume = enclosed(s.blocks, s.outside, s.phi, ground.above, 0) * std::pow(s.voxel, 3);
  if (s.report.target > 0) s.report.residual = s.report.volume / s.report.target - 1;
  COUNT("skin.voxels", s.phi.size());
  return surface;
}

}  // namespace effuse::skin
