#include "skin/surface/level_set.h"

#include <algorithm>
#include <cmath>

#include "geometry/base/check.h"
#include "geometry/base/parallel.h"
#include "geometry/base/zones.h"
#include "skin/surface/anisotropy.h"
#include "skin/surface/level_set_impl.h"
#include "skin/surface/rasterize.h"
#include "skin/surface/surface_cache.h"

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

namespace {

/// What the field is made with; lengths in voxels.
struct Making {
  SurfaceKernel kernel = SurfaceKernel::kRound;
  RasterOptions raster;
  float smoothing = 0;       // time of the flow
  float lone = 0, sheet = 0;  // W at the surface of a lone particle, of a plane sheet
  float sink = 0;
  const geometry::Terrain* terrain = nullptr;
  float depth() const { return sink + 2; }  // voxels deeper than this are outside, whatever they were
};

/// The field before its shift, on some of the blocks; ground: out.
Field make_field(const LevelSet::Impl& s, const Blocks& blocks, const Making& making, GroundField& ground) {
  Field phi, weight;
  if (making.kernel == SurfaceKernel::kAnisotropic)
    rasterize_anisotropic(s.particles, anisotropic_kernels(s.particles, making.raster.spacing, making.raster.reach, &blocks), blocks, making.raster, phi, weight);
  else
    rasterize(s.particles, blocks, making.raster, phi, weight);
  smooth(blocks, s.outside, making.smoothing, weight, making.lone, making.sheet, phi);
  if (!making.terrain) return phi;
  ground = sample_ground(blocks, s.particles.origin(), s.voxel, *making.terrain, std::max(2 * s.lift, making.depth()) + 1);
  Field lifted;
  lift_to_ground(blocks, s.outside, s.lift, ground, making.depth(), phi, lifted);
  return lifted;
}

/// The same on all blocks, from the last frame where nothing has changed. stale: out, the blocks that were made anew.
Field renew_field(const LevelSet::Impl& s, const Making& making, SurfaceCache::Impl& last, const std::vector<std::uint64_t>& hash, GroundField& ground, Renewal& renewal) {
  // How far a value feels a particle, what it needs of the values around it (a voxel a step, the lift), and whether it depends on
  // what the blocks beside its own hold (sums at nodes; being deep inside).
  const int steps = smoothing_steps(making.smoothing);
  const float lift = making.terrain ? 2 * s.lift + 2 : 0, beyond = static_cast<float>(steps) + lift;
  const bool round = making.kernel == SurfaceKernel::kRound, blocks_beside = !round || making.raster.reach >= kFineReach;
  const Real felt = round ? static_cast<Real>(s.reach) + (blocks_beside ? 4 : 0)
                          : std::max<Real>(kernel_influence(making.raster.spacing, s.reach), kSide + static_cast<Real>(making.raster.spacing));
  renewal = find_stale(last, s.particles, hash, s.blocks, felt + static_cast<Real>(beyond));
  const std::vector<std::uint8_t> needed = widened(s.blocks, renewal.stale, static_cast<int>(std::ceil(beyond / kSide)) + (blocks_beside ? 1 : 0));
  std::vector<BlockCoord> coords;
  for (std::size_t b = 0; b < s.blocks.size(); ++b)
    if (needed[b]) coords.push_back(s.blocks.coords()[b]);
  if (coords.size() > s.blocks.size() * 2 / 3) {
    std::fill(renewal.stale.begin(), renewal.stale.end(), std::uint8_t{1});
    renewal.stale_blocks = s.blocks.size();
    return make_field(s, s.blocks, making, ground);
  }
  const Blocks part(std::move(coords));
  GroundField part_ground;
  const Field made = make_field(s, part, making, part_ground);

  Field field(s.blocks.size() * kVoxels);
  if (making.terrain) ground.distance.resize(field.size()), ground.above.resize(field.size());
  parallel_for(
      s.blocks.size(),
      [&](std::size_t b) {
        const BlockCoord& c = s.blocks.coords()[b];
        const std::size_t from = kVoxels * (renewal.stale[b] ? part.block_at(Vec3(kSide * c[0], kSide * c[1], kSide * c[2])) : renewal.before[b]);
        const auto take = [&](const Field& anew, const Field& old, Field& to) { std::copy_n(&(renewal.stale[b] ? anew : old)[from], kVoxels, &to[b * kVoxels]); };
        take(made, last.lifted, field);
        if (!making.terrain) return;
        take(part_ground.distance, last.distance, ground.distance);
        take(part_ground.above, last.above, ground.above);
      },
      64);
  return field;
}

/// Whether values of the last frame can be used at all.
bool fits(const SurfaceCache::Impl& last, const LevelSetOptions& o, const geometry::Terrain* terrain, const Vec3& origin) {
  const LevelSetOptions& p = last.options;
  return last.filled && last.terrain == terrain && last.origin == origin && p.spacing == o.spacing && p.voxel == o.voxel && p.influence == o.influence && p.kernel == o.kernel &&
         p.radius == o.radius && p.smoothing == o.smoothing && p.sink == o.sink;
}

}  // namespace

LevelSet build_level_set(const geometry::Points& points, Real volume, const geometry::Terrain* terrain, const LevelSetOptions& options,
                         SurfaceCache* last) {
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
  if (points.size() == 0) {
    if (last) *last = SurfaceCache();
    return surface;
  }

  // The dual mesh rounds the edge where side and bottom meet: a voxel and a half keeps that under the ground. Blocks must
  // reach beyond the particles' own reach to hold the bottom.
  const float sink = options.sink > 0 ? static_cast<float>(options.sink / s.voxel) : 1.5f;
  s.blocks = blocks_around(s.particles, s.reach + (terrain ? sink + 1 : 0));
  if (terrain) s.terrain = *terrain;
  const float near_surface = 1 - (radius / s.reach) * (radius / s.reach);
  Making making{.kernel = options.kernel,
                .raster = {.reach = s.reach, .spacing = d, .radius_factor = 2 * static_cast<float>(options.radius), .outside = s.outside},
                .smoothing = static_cast<float>(options.smoothing) * d * d / 24,
                .lone = near_surface * near_surface * near_surface,
                .sink = sink,
                .terrain = terrain};
  making.sheet = static_cast<float>(kPi) / 4 * (s.reach / d) * (s.reach / d) * making.lone * near_surface;

  GroundField ground;
  Renewal renewal;
  std::vector<std::uint64_t> hash;
  KnownVolumes known;
  std::vector<std::uint8_t> beside, edge;  // blocks whose cells may have changed; those that lost a neighbour
  if (last) hash = particle_hashes(s.particles);
  if (last && fits(last->impl(), options, terrain, s.particles.origin())) {
    s.phi = renew_field(s, making, last->impl(), hash, ground, renewal);
    // Cells reach into the next block; a block that is gone leaves `outside` behind.
    beside = widened(s.blocks, renewal.stale, 1);
    edge.assign(s.blocks.size(), 0);
    for (std::size_t b = 0; b < s.blocks.size(); ++b) {
      for (std::size_t slot = 0; slot < 27 && !beside[b]; ++slot)
        edge[b] = edge[b] || (s.blocks.around(b)[slot] == kNone && last->impl().blocks.around(renewal.before[b])[slot] != kNone);
      beside[b] = beside[b] || edge[b];
    }
    known.last = &last->impl().volumes;
    known.before = renewal.before;
    known.stale = beside;
  } else {
    s.phi = make_field(s, s.blocks, making, ground);
  }
  s.report.blocks = s.blocks.size();
  s.report.renewed = known.last ? renewal.stale_blocks : s.blocks.size();

  Field lifted = std::move(s.phi);
  const Real voxels = std::pow(s.voxel, -3);
  Shift shift{0, -1};
  if (options.match_volume && volume > 0) {
    s.report.target = volume;
    shift = matching_shift(s.blocks, s.outside, lifted, ground.above, volume * voxels, d / 2, known);
    s.report.shift = static_cast<Real>(shift.shift) * s.voxel;
    s.outside -= shift.shift;
  }
  s.phi.resize(lifted.size());
  parallel_for(
      s.phi.size(),
      [&](std::size_t i) {
        const float value = lifted[i] - shift.shift;
        s.phi[i] = terrain && ground.distance[i] < kNoGround ? std::min(s.outside, std::max(value, -ground.distance[i] - sink)) : value;
      },
      1 << 14);

  const Real least = options.drop_volume * std::pow(static_cast<Real>(d), 3);
  if (last) {
    SurfaceCache::Impl& c = last->impl();
    const bool same_shift = known.last && c.shift == shift.shift;
    if (same_shift) {
      s.unchanged = renewal.before;
      for (std::size_t b = 0; b < s.blocks.size(); ++b)
        if (renewal.stale[b]) s.unchanged[b] = kNone;
    }
    std::vector<std::uint8_t> touched = drop_pieces(s.blocks, s.particles, least, s.phi, s.report, &c.pieces, s.unchanged);
    for (std::size_t b = 0; b < s.unchanged.size(); ++b)
      if (s.unchanged[b] != kNone && (touched[b] || c.touched[s.unchanged[b]])) s.unchanged[b] = kNone;
    s.frame = ++c.frame;
    c.filled = true;
    c.options = options;
    c.terrain = terrain;
    c.origin = s.particles.origin();
    c.blocks = s.blocks;
    c.x = s.particles.x();
    c.hash = std::move(hash);
    c.lifted = std::move(lifted);
    c.distance = std::move(ground.distance);
    c.volumes = std::move(known.now);
    c.shift = shift.shift;
    c.touched = std::move(touched);
  } else {
    drop_pieces(s.blocks, s.particles, least, s.phi, s.report);
  }

  // Without ground, and where nothing was dropped, it is the volume that the shift was found for.
  if (shift.volume >= 0 && !terrain && s.report.dropped_webs + s.report.dropped_pieces + s.report.filled_bubbles == 0) {
    s.report.volume = shift.volume / voxels;
    if (last) last->impl().final_volumes.clear();
  } else {
    KnownVolumes final;
    if (last && !s.unchanged.empty()) {
      for (std::size_t b = 0; b < s.blocks.size(); ++b) beside[b] = s.unchanged[b] == kNone;
      beside = widened(s.blocks, std::move(beside), 1);
      for (std::size_t b = 0; b < s.blocks.size(); ++b) beside[b] = beside[b] || edge[b];
      final.last = &last->impl().final_volumes;
      final.before = renewal.before;
      final.stale = beside;
    }
    s.report.volume = enclosed(s.blocks, s.outside, s.phi, ground.above, final) / voxels;
    if (last) last->impl().final_volumes = std::move(final.now);
  }
  if (s.report.target > 0) s.report.residual = s.report.volume / s.report.target - 1;
  if (last) last->impl().above = std::move(ground.above);
  COUNT("skin.voxels", s.phi.size());
  return surface;
}

}  // namespace effuse::skin
