#pragma once

#include <cstdint>

#include "geometry/mesh/tri_mesh.h"
#include "geometry/terrain/terrain.h"

namespace effuse::skin {

/// Lengths in particle spacings, so that one setting serves every resolution.
struct DisplaceOptions {
  Real spacing = 0;         ///< of the particles [m], > 0
  Real amplitude = 0.25;    ///< [spacings] half the height from valleys to crests where cold; 0: only "detail" is made
  Real wavelength = 3;      ///< [spacings] of the coarsest bumps
  int octaves = 4;          ///< each half as wide as the one before
  Real gain = 0.55;         ///< height from octave to octave
  Real roughness = 1;       ///< 0: swells even where cold; 1: clinker, plates between sharp cracks
  Real molten_share = 0.3;  ///< of the amplitude where molten
  Real molten = 1440;       ///< [K] hotter than this the surface is smooth
  Real solid = 1150;        ///< [K] cooler than this it is rough
  Real edge = 0.5;          ///< [spacings] the edge length wanted: coarser meshes are refined, octaves finer than two edges left out
  Real rest_ratio = 0;      ///< of Points: detail = (1 - rest_ratio) f(rest) + rest_ratio f(rest2)
  std::uint64_t seed = 1;
};

struct DisplaceReport {
  int refined = 0;            ///< times every triangle was cut in four
  Real largest = 0;           ///< displacement [m]
  std::size_t held_back = 0;  ///< vertices displaced less than asked for, because a triangle would have turned over
};

/// Moves the vertices along their normals by noise that belongs to the material, and adds the attribute "detail", -1 in cracks
/// .. 1 on crests.
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

}  // namespace effuse::skin
