#pragma once

#include <array>
#include <cstdint>
#include <map>
#include <memory>
#include <optional>
#include <span>
#include <vector>

#include "skin/surface/blocks.h"
#include "skin/surface/level_set.h"
#include "skin/surface/particle_grid.h"
#include "skin/surface/rasterize.h"

/// For the .cpp files of this folder: what a level set holds, and the steps of its making. Lengths in voxels unless [m].
namespace effuse::skin {

class ReturnedField;

/// A ball round each particle that stands out, joined to the field.
struct Cover {
  float factor = 0;         ///< of a ball, in its particle's radii; 0: none
  float blend = 1;          ///< [voxels], > 0
  float reach = 4;          ///< R of rasterize.h
  float all = 0, none = 1;  ///< particles where W is up to `all` have a whole ball, from `none` on they have none; all < none
};
/// What the field is made with before the ground cuts it, lengths in voxels.
struct FieldRule {
  SurfaceKernel kernel = SurfaceKernel::kRound;
  RasterOptions raster;
  float smoothing = 0;        // time of the flow
  float lone = 0, sheet = 0;  // W at the surface of a lone particle, of a plane sheet
  Cover cover;
};
/// How much of the flow acts where the field's weight is W: none on lone particles.
float smoothing_share(const FieldRule& rule, float W);

struct LevelSet::Impl {
  Impl() = default;
  ~Impl();  // gives the field back to the cache that it was made with
  Impl(const Impl&) = delete;

  Real voxel = 1;        ///< [m]
  Real spacing = 1;      ///< [m]
  float reach = 4;       ///< of a particle
  float outside = 2.8f;  ///< value where there are no blocks; nothing is larger
  float lift = 1;        ///< height of the lowest particles over the ground: what is under it is filled
  ParticleGrid particles;
  FieldRule rule;
  Blocks blocks;
  Field phi;  ///< the surface is its zero level; about a distance near it
  std::optional<geometry::Terrain> terrain;
  LevelSetReport report;
  Real level = 0;        ///< the shift [voxels], finer than the field's was: where the particles' own surface lies
  std::uint64_t frame = 0;       ///< of its SurfaceCache; 0: made without one
  std::shared_ptr<ReturnedField> home;  ///< of that cache
  std::vector<Index> unchanged;  ///< of each block with the values of one of the frame before: which; kNone. Empty: none has
  std::vector<ChangedVoxels> changed;  ///< of each block, unless unchanged is empty

  Vec3 world(const Vec3& p) const { return particles.origin() + voxel * p; }
};

/// The ground on a level set's voxels.
struct GroundField {
  Field distance;  ///< signed, above the ground positive; kNoGround where there is none
  Field above;     ///< share of the voxel's cube above ground, 0..1
  std::vector<Eigen::Vector3f> normal;
};
inline constexpr float kNoGround = 1e9f;

/// Ground distances at every second voxel from the terrain, trilinear between; blocks farther from the ground
/// than `reach` are kNoGround above it and -kNoGround below.
GroundField sample_ground(const Blocks& blocks, const Vec3& origin, Real voxel, const geometry::Terrain& terrain, float reach);

/// phi out: old, but each voxel at height g < 2 lift has the least value along the ground's normal at max(g, lift),
/// max(g, 1.5 lift), max(g, 2 lift); continuous. Voxels deeper than `depth` are left as they are.
void lift_to_ground(const Blocks& blocks, float outside, float lift, const GroundField& ground, float depth, const Field& old, Field& phi);

/// Mean-curvature flow phi_t = kappa |grad phi| for rule.smoothing [voxels^2], in explicit steps; where W (rasterize.h) is like a
/// lone particle's nothing moves. A voxel feels what lies within so many voxels as there are steps.
///   wanted  blocks whose values are asked for, those of the others mean nothing then; empty: all
int smoothing_steps(float time);
void smooth(const Blocks& blocks, float outside, const FieldRule& rule, const Field& weight, Field& phi, std::span<const std::uint8_t> wanted = {});

/// Radii of the balls round the sorted particles, rho_i below.
///   wanted  which are to be found, the others are 0; empty: all
std::vector<float> ball_radii(const ParticleGrid& particles, const Cover& cover, std::span<const std::uint8_t> wanted = {});
/// With rho_i = s factor r_i, s falling from 1 to 0 as W at the particle goes from `all` to `none`, and b = min |x - x_i| - rho_i,
///
///   phi = min(phi, b) - max(0, blend - |phi - b|)^2 / (4 blend)
///
/// within kCoverBand of a ball; the square rounds the edge between ball and field. Where balls of different sizes meet b is that of the least
/// |x - x_i|^2 - rho_i^2. A voxel feels particles within factor r_i + kCoverBand + R.
///   weight  W at the voxels
///   wanted  blocks to be covered; empty: all
void cover_particles(const ParticleGrid& particles, const Blocks& blocks, const Cover& cover, const Field& weight, Field& phi,
                     std::span<const std::uint8_t> wanted = {});
inline constexpr float kCoverBand = 2;

/// Volumes of blocks that the last frame knows, by shift in steps: out, those of this frame.
struct KnownVolumes {
  const std::map<int, std::vector<Real>>* last = nullptr;
  std::span<const Index> before;         ///< of each block, among the last frame's
  std::span<const std::uint8_t> stale;   ///< 1: a voxel that one of its cells has at a corner has changed
  int guess = 0;                         ///< the last frame's shift, in steps: where to look first
  std::map<int, std::vector<Real>> now;
  /// Least and greatest value of each block, low > high: not looked for.
  struct Range {
    float low, high;
  };
  const std::vector<Range>* last_range = nullptr;  ///< of blocks that are not stale
  std::vector<Range> range;
};

/// Volume [voxels] where phi < shift and above ground, phi linear in six tetrahedra a cell: what a mesh through the
/// same crossings encloses. above: GroundField::above, or empty.
Real enclosed(const Blocks& blocks, float outside, const Field& phi, const Field& above, float shift);
/// At shift 0, blocks that are known taken from there.
Real enclosed(const Blocks& blocks, float outside, const Field& phi, const Field& above, KnownVolumes& known);
inline constexpr int kShiftSteps = 128;
struct Shift {
  int steps = 0;     ///< of 1 / kShiftSteps voxels
  Real exact = 0;    ///< the same, between steps where the target is
  Real volume = -1;  ///< [voxels] enclosed by then
  float voxels() const { return static_cast<float>(steps) / kShiftSteps; }
};
/// The shift within +-most at which enclosed() is the target; the nearer end when there is none. Of the steps no farther from there than a
/// volume of 5e-4 of the target, and two steps, it is the roundest one (which the largest power of two divides), else the nearest: as a
/// film's lava moves it stays for some frames, and with it the surface where nothing moves. The same wherever one begins to look.
Shift matching_shift(const Blocks& blocks, float outside, const Field& phi, const Field& above, Real target, float most, KnownVolumes& known);

/// The face-connected sets of voxels on one side of the surface, within one block.
struct BlockPieces {
  std::vector<std::uint16_t> of;     // of each voxel
  std::vector<std::uint8_t> inside;  // of each set
  /// Along each axis: which sets meet which of the next block's, and of the one before where that is whole; met: there is one.
  struct Side {
    std::vector<std::array<std::uint16_t, 2>> meeting;  // mine, theirs
    bool met = false;
  };
  std::array<Side, 3> next, before;
};
/// Of all blocks. A block wholly inside or outside is one set, and has nothing here but that.
struct Pieces {
  std::vector<std::int8_t> side;                     // of each block: -1 inside, 1 outside, 0 both
  std::vector<std::uint16_t> sets;                   // how many each has, at hand: to ask the blocks themselves costs a way to memory each
  std::vector<std::unique_ptr<BlockPieces>> blocks;  // of those with both
};

/// Turns inner voxels into outer ones where a face-connected set of them holds no particle (webs between particles) or is
/// smaller than `least` [voxels], and closed bubbles smaller than that into inner ones. Returns the blocks that it changed.
///   last, unchanged  pieces of the last frame, left for the next; of each block whose values are those of one then, which; kNone
std::vector<std::uint8_t> drop_pieces(const Blocks& blocks, const ParticleGrid& particles, Real least, Field& phi, LevelSetReport& report,
                                      Pieces* last = nullptr, std::span<const Index> unchanged = {});

/// Distances to the zero level of phi, right to a twentieth of a voxel beside it and a fifth three voxels away, out to +-band and cut
/// there; the zero level stays where it is to a twentieth. Voxels without a block are outside.
Field distances(const Blocks& blocks, float outside, const Field& phi, float band);

/// The particles' carried numbers at points [voxels], taken at the lifted point near the ground.
std::vector<float> carried_at(const LevelSet::Impl& s, std::vector<Vec3> points);

}  // namespace effuse::skin
