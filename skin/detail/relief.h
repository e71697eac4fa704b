#pragma once

#include "geometry/mesh/points.h"
#include "skin/detail/displace.h"
#include "skin/detail/material.h"
#include "skin/tessellate/regions.h"

namespace effuse::skin {

/// Height of the lava's surface over its smooth skin, as a function of the place and the particles: the same wherever a mesh
/// happens to have its vertices. Everything in it hangs on material coordinates, particles' ids and
/// distances from particles, so that it moves with the lava: rigidly where that moves rigidly, without jumps where particles
/// change neighbours, come up or sink, or one material frame takes over from the other.
///
///   cold       max(crust, 1 - smoothstep(solid, molten, T)), from the particles nearby
///   swell      gradient noise of `octaves` in both frames, of deviation 1; blended as in displace()
///   kAa        swell; a clinker (clinker.h) on each particle's region; fragments on and between them: broken pieces (plates.h), each a
///              wedge with a crest of its own, the largest 1.9 spacings, each octave's 0.56 times as wide as the one before. All grow
///              with cold
///   kPahoehoe  swell; rope_profile(fold_noise) across the squeeze (folds.h), where there is one; fine wrinkles
///   kBlock     plates (plates.h) 4/3 wavelengths across, each at a height and a tilt of its own; cracks between them open as the material
///              stretches: half of what a plate would have to grow by. Plates' tops carry fine roughness
///   kObsidian  folds of 2.4 spacings, sharp only when cold; no roughness
///
/// On drops all of it is lower: down to 0.35 of its height on one particle's, whose radius is 0.6 spacings; all of it from edges of a body on
/// (Material's weights 0.9 .. 2.2), so that bumps do not cut through one another in the necks between drops.
///
/// Means over a surface are zero within a few per cent of the amplitude. Points without rest (rest2): their positions stand
/// for it, and noise swims through moving lava. Velocities are used by kPahoehoe and kObsidian only.
/// Thread-safe after construction.
class Relief {
 public:
  /// Throws InputError as Material does. options as displace() checks them; kind not kNoise (checked).
  Relief(const geometry::Points& points, const DisplaceOptions& options);

  struct Sample {
    Real height = 0;  ///< along the normal [m], within +-0.35 spacings
    Real detail = 0;  ///< -1 in cracks and valleys .. 1 on crests
    Real cold = 0;    ///< 0 molten .. 1 cold or crusted
  };
  /// edge: of the mesh there [m]; octaves finer than two edges are left out, without a jump.
  Sample at(const Vec3& x, Real edge) const;

 private:
  struct Here;
  Real blended(const Here& here, Real wave, const Vec3& offset, std::uint64_t seed) const;
  Real fragments(const Here& here, int octaves, Real edge, std::uint64_t seed) const;
  Real swell(const Here& here, Real wavelength, int octaves, Real gain, Real edge, std::uint64_t seed) const;
  Sample aa(const Here&, Real edge) const;
  Sample pahoehoe(const Here&, Real edge) const;
  Sample block(const Here&, Real edge) const;
  Sample obsidian(const Here&, Real edge) const;

  DisplaceOptions o_;
  Material material_;
  Regions regions_;
  std::vector<std::uint64_t> id_;
};

}  // namespace effuse::skin
