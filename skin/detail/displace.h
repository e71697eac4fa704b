#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <string_view>

#include "geometry/mesh/points.h"
#include "geometry/mesh/tri_mesh.h"
#include "geometry/terrain/terrain.h"
#include "skin/detail/refine.h"

namespace effuse::skin {

/// What the lava's surface looks like where it cools. relief.h says what each is made of.
enum class SkinKind {
  kNoise,     ///< swells and a net of cracks, from the mesh's attributes alone
  kAa,        ///< clinkers: rubble, a block on each particle's region
  kPahoehoe,  ///< smooth, ropy folds where the surface is squeezed along itself
  kBlock,     ///< plates of crust carried apart, cracks between them
  kObsidian,  ///< glassy, long smooth folds
};
inline constexpr std::array<std::string_view, 5> kSkinKindNames = {"noise", "aa", "pahoehoe", "block", "obsidian"};

/// Lengths in particle spacings, so that one setting serves every resolution.
struct DisplaceOptions {
  Real spacing = 0;         ///< of the particles [m], > 0
  SkinKind kind = SkinKind::kNoise;
  Real amplitude = 0.25;    ///< [spacings] half the height from valleys to crests where cold; 0: only "detail" is made
  Real wavelength = 3;      ///< [spacings] of the coarsest bumps; plates are 4/3 as wide
  int octaves = 4;          ///< each half as wide as the one before
  Real gain = 0.55;         ///< height from octave to octave
  Real roughness = 1;       ///< noise: 0 swells even where cold, 1 clinker; other kinds: share of their fine roughness
  Real molten_share = 0.3;  ///< of the amplitude where molten
  Real molten = 1440;       ///< [K] hotter than this the surface is smooth
  Real solid = 1150;        ///< [K] cooler than this it is rough
  Real fold_wavelength = 0; ///< [spacings] of folds; 0: the kind's own, 1.1 for pahoehoe, 2.4 for obsidian
  Real fold_time = 10;      ///< [s] in which the strain rate of the moment folds the surface
  Real edge = 0.5;          ///< [spacings] the edge length wanted: coarser meshes are refined, octaves finer than two edges left out
  Real oversample = 1;      ///< >= 1: edges so many times shorter than that, and no more octaves: triangles follow the bumps so much more closely
  std::optional<View> view; ///< with one, edges are as long as view.pixels of its pixels where that is more than `edge`
  Real rest_ratio = 0;      ///< of Points: detail = (1 - rest_ratio) f(rest) + rest_ratio f(rest2)
  std::uint64_t seed = 1;
};

struct DisplaceReport {
  int refined = 0;            ///< times every triangle was cut in four, or rounds of adaptive refinement
  Real largest = 0;           ///< displacement [m]
  std::size_t held_back = 0;  ///< vertices displaced less than asked for, because a triangle would have turned over
};

/// Moves the vertices along their normals by noise that belongs to the material, and adds the attribute "detail", -1 in cracks
/// .. 1 on crests. Whatever the options' kind: kNoise.
///
///   n_k      gradient noise of octave k at `rest` / wavelength 2^k, blended with that at `rest2` by rest_ratio and divided by
///            sqrt((1-q)^2 + q^2), so that a blend has the contrast of its ends; without "rest" at the world's position
///   swell    sum gain^k n_k, made to deviation 1
///   clinker  sum gain^k (1 - exp(-|n_k| / 0.13)) / sum gain^k: sharp valleys where noise is 0, broad plates between
///
/// The colder (by `molten`, `solid`) or the more "crust", the more clinker and the higher; both have mean zero, so that volume
/// changes by less than a percent or two. Within 0.75 spacings of the ground it fades to nothing: the cut stays. Never more than
/// 0.35 spacings, so that a sheet one particle thick stays whole; no triangle turns over. A mesh that was closed and
/// manifold is so after. Normals are computed anew. Same bits on any number of threads.
///   mesh     attributes "temperature", "crust", "rest", "rest2" are used if there
///   terrain  nullptr: nothing fades
DisplaceReport displace(geometry::TriMesh& mesh, const geometry::Terrain* terrain, const DisplaceOptions& options);

/// The same for a skin whose particles are at hand: the mesh is refined along a smooth surface through its vertices
/// and normals (refine.h), then moved by the Relief of the kind asked for (relief.h), which is a function of the particles and the
/// place alone: two meshes of one surface are moved alike. kNoise: as above. Bounds and fades as above.
/// Edges longer than 1.7 times `edge` / `oversample` are cut. 10 us a vertex and thread, all told.
///   points   those that the mesh is the skin of
DisplaceReport displace(geometry::TriMesh& mesh, const geometry::Points& points, const geometry::Terrain* terrain,
                        const DisplaceOptions& options);

/// The two halves of that, for who has something to do between them: displace() is refine_for() and then displace_only().
/// Regions, say, are those of the smooth surface, before vertices move.
///
/// Cuts the mesh as finely as the options ask; kNoise: all triangles alike, in fours. parent: as in refine.h.
RefineToReport refine_for(geometry::TriMesh& mesh, const DisplaceOptions& options);
/// How finely that is, kNoise apart.
RefineOptions fineness(const DisplaceOptions& options);
/// Moves the vertices that there are. DisplaceReport::refined: 0.
DisplaceReport displace_only(geometry::TriMesh& mesh, const geometry::Points& points, const geometry::Terrain* terrain,
                             const DisplaceOptions& options);

}  // namespace effuse::skin
