#pragma once

#include <string>
#include <utility>
#include <vector>

#include "flow/effects/solid_world.h"
#include "flow/scene/parameters.h"
#include "flow/sph/modern_lava.h"

namespace effuse::flow {

/// [lava.crust_blocks]: when crust breaks into blocks that the flow carries.
struct CrustBlockOptions {
  bool on = false;
  Real thickness = 0.05;   ///< of crust that is strong enough to be a plate [m]
  Real strain = 0.3;       ///< of the surface since it was that thick: it breaks
  Real size = 0;           ///< of a block, across [m]
  Real depth = 0;          ///< of a block [m]; 0: the crust's own thickness
  Real density = 0;        ///< [kg/m^3]
  std::size_t most = 300;  ///< no more are born
  Real interval = 0.5;     ///< [s] between two looks at the crust
  std::uint64_t seed = 1;
};

/// The keys of the table; without it nothing is on. spacing [m] and density [kg/m^3] of the lava.
CrustBlockOptions read_crust_blocks(Parameters& lava, Real spacing, Real density);

/// Rigid plates of crust on a ModernLava, as bodies of its SolidWorld.
///
/// On each particle whose crust is thicker than `thickness` the strain of the surface is summed: sqrt(2 D : D) dt, D the symmetric
/// gradient of velocity along the surface, by least squares over surface particles within 2.5 spacings. Where the sum reaches `strain`,
/// the most strained particle first, the crust within half of `size` becomes a block: an irregular convex polygon, of the mean crust's
/// thickness (or `depth`: stiff, still glowing rock hangs under what counts as crust), in the mean plane of the surface. It goes with the velocity and spin of those particles.
///
/// The block's mass is taken from the lava: k whole particles of the patch leave it, with their momentum and heat, and the block's
/// thickness is such that its mass is theirs to rounding; so mass and momentum of lava and blocks together stay. (Massless rafts were the
/// other way: they would not tilt, ground or pile by their own weight.) Crust is full of bubbles: the block is lighter than the lava by
/// `density`, takes more room than the particles did, and floats. Once born it keeps its temperature.
///
/// Blocks and lava move each other as any body and lava do (sph::Movable); blocks meet each other, obstacles and ground by RigidBodies.
/// One that goes over the terrain's edge is taken out and counted. The same bits on any number of threads.
class CrustBlocks {
 public:
  CrustBlocks(const CrustBlockOptions& options, Real spacing);

  /// After a step of the lava. terrain: what blocks that are beyond its edge are taken from.
  void step(sph::ModernLava& lava, SolidWorld& world, const geometry::Terrain& terrain);

  std::size_t born() const { return static_cast<std::size_t>(totals_.born); }
  /// Mass [kg] of all blocks born, those that left among them, and heat [J] that went with them.
  Real mass() const { return totals_.mass; }
  Real heat() const { return totals_.heat; }
  std::vector<std::pair<std::string, double>> figures() const;

  void add_to(StateHash& hash) const;
  void save(StateWriter& out) const;
  void load(StateReader& in);

 private:
  void strain_crust(const sph::ModernLava& lava, Real dt);
  void give_birth(sph::ModernLava& lava, SolidWorld& world);
  template <class Self, class Archive>
  static void archive(Self& self, Archive& io);

  CrustBlockOptions options_;
  Real spacing_;
  Real last_ = 0;                // [s] of the last look
  std::vector<float> strain_;    // by id
  struct Totals {
    Real born = 0, mass = 0, heat = 0, left = 0;
  } totals_;
};

}  // namespace effuse::flow
