#include "skin/surface/level_set.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <cstring>
#include <limits>
#include <optional>

#include "geometry/base/check.h"
#include "geometry/base/error.h"
#include "geometry/base/memory.h"
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
LevelSet::Impl::~Impl() {
  if (home) home->give_back(frame, std::move(phi));
}

bool LevelSet::empty() const { return impl_->blocks.size() == 0; }
Real LevelSet::voxel() const { return impl_->voxel; }
const LevelSetReport& LevelSet::report() const { return impl_->report; }

std::size_t LevelSet::active_voxels() const {
  return static_cast<std::size_t>(std::count_if(impl_->phi.begin(), impl_->phi.end(), [](float v) { return std::abs(v) < 2; }));
}

namespace {

constexpr float kCoverBlend = 0.3f;  // [spacings]: round enough for fans and relief to follow
// W at a particle over that of a full neighbourhood: in a box's corners 0.5 to 0.62, on its edges 0.55 to 0.7, on faces 0.74 and more.
constexpr float kStandsOut = 0.62f, kLiesFlat = 0.72f;

/// What becomes of the field; lengths in voxels.
struct Making {
  float sink = 0;
  const geometry::Terrain* terrain = nullptr;
  Real volume = 0;      // to be enclosed; 0: as it comes
  float most_shift = 0;
  Real least = 0;       // smaller pieces are dropped
  float depth() const { return sink + 2; }  // voxels deeper than this are outside, whatever they were
};

/// The field as it comes from the particles. felt: blocks whose values are asked for (rasterize_anisotropic); empty: all.
void rasterize(const LevelSet::Impl& s, const Blocks& blocks, RasterField& raster, std::span<const std::uint8_t> felt = {}) {
  if (s.rule.kernel == SurfaceKernel::kRound) return rasterize(s.particles, blocks, s.rule.raster, {}, raster);
  Blocks asked = blocks;
  if (!felt.empty()) {
    std::vector<BlockCoord> coords;
    for (std::size_t b = 0; b < blocks.size(); ++b)
      if (felt[b]) coords.push_back(blocks.coords()[b]);
    asked = Blocks(coords);
  }
  const Kernels kernels = anisotropic_kernels(s.particles, s.rule.raster.spacing, s.rule.raster.reach, &asked);
  rasterize_anisotropic(s.particles, kernels, blocks, s.rule.raster, raster.phi, raster.weight, felt);
}

/// The field before its shift, from the particles' own, on some of the blocks; ground: out. wanted: those of them whose values are asked for;
/// empty: all.
Field make_field(const LevelSet::Impl& s, const Blocks& blocks, const Making& making, Field phi, const Field& weight, GroundField& ground,
                 std::span<const std::uint8_t> wanted = {}) {
  if (making.terrain) wanted = {};  // lifting looks around
  smooth(blocks, s.outside, s.rule, weight, phi, wanted);
  cover_particles(s.particles, blocks, s.rule.cover, weight, phi, wanted);
  if (!making.terrain) return phi;
  ground = sample_ground(blocks, s.particles.origin(), s.voxel, *making.terrain, std::max(2 * s.lift, making.depth()) + 1);
  Field lifted;
  lift_to_ground(blocks, s.outside, s.lift, ground, making.depth(), phi, lifted);
  return lifted;
}

/// The same on all blocks of s, into the cache.
void fill_all(const LevelSet::Impl& s, const Making& making, SurfaceCache::Impl& cache) {
  cache.raster = {};  // coarser voxels have no sums at nodes
  rasterize(s, s.blocks, cache.raster);
  GroundField ground;
  if (s.rule.kernel == SurfaceKernel::kRound) {
    cache.lifted = make_field(s, s.blocks, making, cache.raster.phi, cache.raster.weight, ground);
  } else {
    cache.lifted = make_field(s, s.blocks, making, std::move(cache.raster.phi), cache.raster.weight, ground);
    cache.raster = {};
  }
  cache.distance = std::move(ground.distance);
  cache.above = std::move(ground.above);
}

/// The same on all blocks of s, in last.lifted: what is there is kept where nothing has changed. Returns what was made anew.
Renewal renew_field(const LevelSet::Impl& s, const Making& making, SurfaceCache::Impl& last) {
  // How far a value feels a particle, what it needs of the values around it (a voxel a step, the lift), and whether it depends on
  // what the blocks beside its own hold (sums at nodes; being deep inside).
  const int steps = smoothing_steps(s.rule.smoothing);
  const float lift = making.terrain ? 2 * s.lift + 2 : 0, beyond = static_cast<float>(steps) + lift;
  const bool round = s.rule.kernel == SurfaceKernel::kRound;
  // A voxel between nodes uses those within three; whether a block is deep inside depends on nodes up to eight beyond it, and their nearest particles.
  const Real reach = static_cast<Real>(s.reach), fine = std::max(reach + 3, kSide + static_cast<Real>(s.rule.raster.spacing));
  const Real felt = round ? s.rule.raster.reach >= kFineReach ? fine : reach
                          : std::max<Real>(kernel_influence(s.rule.raster.spacing, s.reach), kSide + static_cast<Real>(s.rule.raster.spacing));
  const Real largest = parallel_max(s.particles.size(), 0, [&](std::size_t i) { return static_cast<Real>(s.particles.radius()[i]); });
  const Real covered = static_cast<Real>(s.rule.cover.factor) * largest + static_cast<Real>(kCoverBand + lift + s.reach);
  constexpr Real kRounding = 0.01;  // [voxels] sums are of floats
  Renewal renewal = find_stale(last, s.particles, s.blocks, std::max(felt + static_cast<Real>(beyond), s.rule.cover.factor > 0 ? covered : 0) + kRounding,
                               reach + kRounding);
  const std::vector<std::uint8_t> used = widened(s.blocks, renewal.stale, static_cast<int>(std::ceil(beyond / kSide))),
                                  needed = round ? used : widened(s.blocks, used, 1);
  std::vector<BlockCoord> coords;
  std::vector<Index> from(s.blocks.size(), kNone);  // of each block, among the needed ones
  std::vector<Index> whole;                         // of each of these, among all
  std::vector<std::uint8_t> wanted, felt_in;
  for (std::size_t b = 0; b < s.blocks.size(); ++b) {
    if (!needed[b]) continue;
    from[b] = static_cast<Index>(coords.size());
    coords.push_back(s.blocks.coords()[b]);
    whole.push_back(static_cast<Index>(b));
    wanted.push_back(renewal.stale[b]);
    felt_in.push_back(used[b]);
  }
  if (coords.size() > s.blocks.size() * 2 / 3) {
    std::fill(renewal.stale.begin(), renewal.stale.end(), std::uint8_t{1});
    renewal.changed.assign(s.blocks.size(), ChangedVoxels{});
    renewal.stale_blocks = s.blocks.size();
    fill_all(s, making, last);
    return renewal;
  }
  const Blocks part(coords);
  RasterField raster;
  if (round) {
    rearrange(last.raster.phi, renewal.before);
    rearrange(last.raster.weight, renewal.before);
    if (!last.raster.nodes.empty()) {
      rearrange(last.raster.nodes, renewal.before, 1);
      rearrange(last.raster.covered, renewal.before, 1);
    }
    rasterize(s.particles, s.blocks, s.rule.raster, renewal.rows, last.raster);
    for (const auto& [to, all] : {std::pair(&raster.phi, &last.raster.phi), std::pair(&raster.weight, &last.raster.weight)}) {
      to->reserve(part.size() * kVoxels);
      for (const Index b : whole) to->insert(to->end(), &(*all)[kVoxels * b], &(*all)[kVoxels * b] + kVoxels);
    }
  } else {
    rasterize(s, part, raster, felt_in);
  }
  GroundField part_ground;
  const Field made = make_field(s, part, making, std::move(raster.phi), raster.weight, part_ground, wanted);

  ZONE("skin.keep");
  // What has come out the same is no reason to look at anything again.
  rearrange(last.lifted, renewal.before);
  if (making.terrain) {
    rearrange(last.distance, renewal.before);
    rearrange(last.above, renewal.before);
  }
  renewal.changed.assign(s.blocks.size(), ChangedVoxels::none());
  parallel_for(
      s.blocks.size(),
      [&](std::size_t b) {
        if (!renewal.stale[b]) return;
        const bool fresh = renewal.before[b] == kNone;
        const auto keep = [&](Field& kept, const Field& anew) { std::copy_n(&anew[kVoxels * from[b]], kVoxels, &kept[kVoxels * b]); };
        renewal.changed[b] = fresh ? ChangedVoxels{} : ChangedVoxels::between(&last.lifted[kVoxels * b], &made[kVoxels * from[b]]);
        if (renewal.changed[b].any()) keep(last.lifted, made);
        if (fresh && making.terrain) {
          keep(last.distance, part_ground.distance);
          keep(last.above, part_ground.above);
        }
      },
      64);
  return renewal;
}

/// Whether values of the last frame can be used at all.
bool fits(const SurfaceCache::Impl& last, const LevelSetOptions& o, const geometry::Terrain* terrain, const Vec3& origin) {
  const LevelSetOptions& p = last.options;
  return last.filled && last.terrain == terrain && last.origin == origin && p.spacing == o.spacing && p.voxel == o.voxel && p.influence == o.influence && p.kernel == o.kernel &&
         p.radius == o.radius && p.cover == o.cover && p.smoothing == o.smoothing && p.sink == o.sink;
}

/// The shift at which the volume asked for is enclosed; it is not made yet, but `outside` has moved. phi, above: of all blocks.
Shift match(LevelSet::Impl& s, const Making& making, const Field& phi, const Field& above, KnownVolumes& known) {
  Shift shift;
  if (!(making.volume > 0)) return shift;
  shift = matching_shift(s.blocks, s.outside, phi, above, making.volume, making.most_shift, known);
  s.report.shift = static_cast<Real>(shift.voxels()) * s.voxel;
  s.level = shift.exact / kShiftSteps;
  s.outside -= shift.voxels();
  return shift;
}

/// to[i] = value[i], shifted, and ended under the ground, for voxels of block b. distance: of all blocks, or empty; may be the same field.
void finish(const LevelSet::Impl& s, const Making& making, const Shift& shift, const Field& value, const Field& distance, std::size_t b, Field& to) {
  const float by = shift.voxels();
  const std::size_t first = b * kVoxels;
  if (!making.terrain) {
    for (std::size_t i = first; i < first + kVoxels; ++i) to[i] = value[i] - by;
    return;
  }
  for (std::size_t i = first; i < first + kVoxels; ++i)
    to[i] = distance[i] < kNoGround ? std::min(s.outside, std::max(value[i] - by, -distance[i] - making.sink)) : value[i] - by;
}

/// Without ground, and where nothing was dropped, the volume is the one that the shift was found for.
bool volume_is_known(const LevelSet::Impl& s, const Making& making, const Shift& shift) {
  return shift.volume >= 0 && !making.terrain && s.report.dropped_webs + s.report.dropped_pieces + s.report.filled_bubbles == 0;
}

/// The level set on its blocks. Returns its volume [voxels].
Real build(LevelSet::Impl& s, const Making& making) {
  GroundField ground;
  KnownVolumes known;
  RasterField raster;
  rasterize(s, s.blocks, raster);
  s.phi = make_field(s, s.blocks, making, std::move(raster.phi), raster.weight, ground);
  raster = {};
  const Shift shift = match(s, making, s.phi, ground.above, known);
  parallel_for(
      s.blocks.size(), [&](std::size_t b) { finish(s, making, shift, s.phi, ground.distance, b, s.phi); }, 32);
  drop_pieces(s.blocks, s.particles, making.least, s.phi, s.report);
  return volume_is_known(s, making, shift) ? shift.volume : enclosed(s.blocks, s.outside, s.phi, ground.above, 0);
}

/// The same, with what the frame before has left in the cache, to which this one's is left. fits: something of it can be used.
Real build_cached(LevelSet::Impl& s, const Making& making, SurfaceCache::Impl& c, bool fits) {
  c.filled = false;  // until all of it is of one frame again
  Renewal renewal;
  KnownVolumes known;
  std::vector<std::uint8_t> beside;  // blocks whose cells may have changed
  if (fits) {
    renewal = renew_field(s, making, c);
    s.report.renewed = renewal.stale_blocks;
    // Cells reach into the next block by a voxel; a block that is gone leaves `outside` behind.
    beside = near_changed(s.blocks, renewal.changed, 0, 1);
    for (std::size_t b = 0; b < beside.size(); ++b) beside[b] |= renewal.bereft[b];
    known.last = &c.volumes;
    known.last_range = &c.range;
    known.before = renewal.before;
    known.stale = beside;
    known.guess = c.shift;
  } else {
    fill_all(s, making, c);
  }
  const Shift shift = match(s, making, c.lifted, c.above, known);

  // The last frame's surface, where it was handed out and is held by nobody any more, is that of this one but for blocks made anew and
  // blocks of which pieces were dropped.
  const bool same_shift = fits && c.shift == shift.steps;
  if (same_shift) {
    s.unchanged = renewal.before;
    s.changed = std::move(renewal.changed);
    for (std::size_t b = 0; b < s.blocks.size(); ++b)
      if (s.changed[b].any()) s.unchanged[b] = kNone;
  }
  {
    ZONE("skin.shift");
    std::pair<std::uint64_t, Field> returned = c.returned->take();
    s.phi = std::move(returned.second);
    const bool kept = same_shift && returned.first == c.frame && s.phi.size() == c.blocks.size() * kVoxels;
    if (kept) rearrange(s.phi, renewal.before);
    else s.phi.resize(c.lifted.size());
    parallel_for(
        s.blocks.size(),
        [&](std::size_t b) {
          if (!kept || s.unchanged[b] == kNone || c.touched[s.unchanged[b]]) finish(s, making, shift, c.lifted, c.distance, b, s.phi);
        },
        32);
  }
  std::vector<std::uint8_t> touched = drop_pieces(s.blocks, s.particles, making.least, s.phi, s.report, &c.pieces, s.unchanged);
  for (std::size_t b = 0; b < s.unchanged.size(); ++b)
    if (touched[b] || (renewal.before[b] != kNone && c.touched[renewal.before[b]])) {
      s.unchanged[b] = kNone;
      s.changed[b] = {};
    }

  Real volume = shift.volume;
  if (volume_is_known(s, making, shift)) {
    c.final_volumes.clear();
  } else {
    KnownVolumes final;
    if (!s.unchanged.empty()) {
      beside = near_changed(s.blocks, s.changed, 0, 1);
      for (std::size_t b = 0; b < s.blocks.size(); ++b) beside[b] |= renewal.bereft[b];
      final.last = &c.final_volumes;
      final.before = renewal.before;
      final.stale = beside;
    }
    volume = enclosed(s.blocks, s.outside, s.phi, c.above, final);
    c.final_volumes = std::move(final.now);
  }

  s.frame = ++c.frame;
  s.home = c.returned;
  c.blocks = s.blocks;
  c.particles = s.particles;
  c.volumes = std::move(known.now);
  c.range = std::move(known.range);
  c.shift = shift.steps;
  c.touched = std::move(touched);
  c.filled = true;
  return volume;
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
  CHECK(options.cover >= 0 && options.cover <= options.radius);
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
  s.particles = ParticleGrid(points, s.voxel, std::max(1.0, s.reach / 2.0), last ? &last->impl().particles : nullptr);
  if (points.size() == 0) {
    if (last) *last = SurfaceCache();
    return surface;
  }

  // The dual mesh rounds the edge where side and bottom meet: a voxel and a half keeps that under the ground. Blocks must
  // reach beyond the particles' own reach to hold the bottom.
  const float sink = options.sink > 0 ? static_cast<float>(options.sink / s.voxel) : 1.5f;
  // Field, weights, rates of smoothing, the field before and after; the ground's distance, share and normals; numbers at nodes.
  const double per_block = kVoxels * sizeof(float) * (terrain ? 11.0 : 6.0) + 1500;
  const std::uint64_t available = available_memory();
  const std::size_t most = available > 0 ? static_cast<std::size_t>(static_cast<double>(available) / per_block) : std::numeric_limits<std::size_t>::max();
  std::optional<Blocks> blocks = blocks_around(s.particles, s.reach + (terrain ? sink + 1 : 0), most);
  if (!blocks)
    throw ResourceError(fmt::format("the level set of {} particles needs more than the {:.3g} GB of memory that are free, at voxels of {:.4g}: larger voxels, or particles that lie closer together, would do",
                                    points.size(), static_cast<double>(available) / 1e9, s.voxel));
  s.blocks = *blocks;
  if (terrain) s.terrain = *terrain;
  const float full = static_cast<float>(64 * kPi / 315) * std::pow(s.reach / d, 3.0f);  // W where particles are all round
  const float near_surface = 1 - (radius / s.reach) * (radius / s.reach);
  s.rule = {.kernel = options.kernel,
            .raster = {.reach = s.reach, .spacing = d, .radius_factor = 2 * static_cast<float>(options.radius), .outside = s.outside},
            .smoothing = static_cast<float>(options.smoothing) * d * d / 24,
            .lone = near_surface * near_surface * near_surface,
            .cover = {.factor = 2 * static_cast<float>(options.cover), .blend = kCoverBlend * d, .reach = s.reach, .all = kStandsOut * full, .none = kLiesFlat * full}};
  s.rule.sheet = static_cast<float>(kPi) / 4 * (s.reach / d) * (s.reach / d) * s.rule.lone * near_surface;
  Making making;
  making.sink = sink;
  making.terrain = terrain;

  const Real voxels = std::pow(s.voxel, -3);
  if (options.match_volume && volume > 0) {
    s.report.target = volume;
    making.volume = volume * voxels;
    making.most_shift = d / 2;
  }
  making.least = options.drop_volume * std::pow(static_cast<Real>(d), 3);
  s.report.blocks = s.report.renewed = s.blocks.size();
  if (last) {
    SurfaceCache::Impl& c = last->impl();
    s.report.volume = build_cached(s, making, c, fits(c, options, terrain, s.particles.origin())) / voxels;
    c.options = options;
    c.terrain = terrain;
    c.origin = s.particles.origin();
  } else {
    s.report.volume = build(s, making) / voxels;
  }
  if (s.report.target > 0) s.report.residual = s.report.volume / s.report.target - 1;
  COUNT("skin.voxels", s.phi.size());
  return surface;
}

}  // namespace effuse::skin
