#pragma once

#include <cstdint>
#include <vector>

#include "geometry/mesh/tri_mesh.h"
#include "skin/tessellate/regions.h"

namespace effuse::skin {

class ParticleSurface;

/// Lengths in spacings (of the Regions), areas in their squares, so that one setting serves every resolution.
struct VoronoiOptions {
  int refinement = 1;      ///< times the surface is cut finer where three regions meet, 0..4
  Real island = 0.05;      ///< smaller pieces of a region, beside its largest, go to the region around them
  Real largest_fan = 2.5;  ///< larger pieces get several centres
  Real flattest = 0.72;    ///< so do pieces bent so far that |sum of area vectors| is less than this share of their area
  Real merge = 0.15;       ///< shorter borders shrink to a node
  Real min_angle = 10;     ///< [deg] vertices of triangles thinner than this are moved on the surface
  Real wander = 0.3;       ///< by no more than this
  int sweeps = 8;          ///< over the thin triangles
};

/// What tessellating did.
struct VoronoiReport {
  std::size_t regions = 0;         ///< particles that have one
  std::size_t fans = 0;            ///< centres: regions in several pieces, round or large ones have several
  std::size_t islands = 0;         ///< pieces given away
  std::size_t unclaimed = 0;       ///< vertices of the surface with no particle within reach, given to a neighbour's region
  std::size_t dropped_pieces = 0;  ///< closed pieces of the surface with no particle within reach at all
  std::size_t merged = 0;          ///< borders shrunk to a node
  std::size_t moved = 0;           ///< vertices moved for better triangles
  std::size_t folded = 0;          ///< triangles that look away from the surface under them
  Real thin = 0;                   ///< share of triangles whose least angle is under 5 degrees
  Real least_angle = 0;            ///< [deg]
};

/// Triangle fans, one round each centre.
struct Tessellation {
  geometry::TriMesh mesh;         ///< vertices: first the centres, then the nodes (corners of regions)
  std::vector<Index> particle;    ///< of each region, among the points; rising
  std::vector<std::uint64_t> id;  ///< of each region's particle, its place where the points had no ids
  std::vector<Index> region;      ///< of each triangle, a place in particle and id
  std::vector<Index> center;      ///< of each vertex: the region it is a centre of; Regions::kNone for a node
  std::vector<Index> on;          ///< of each vertex: the triangle of the surface that it lies on
  VoronoiReport report;
};

/// Section 4.3 of Stora et al. 1999: the surface as triangle fans, one (or some) for each particle whose Voronoi region meets the
/// surface, so that triangles live as long as their particle is on the surface.
///
///   1. Each vertex of the surface is labelled with its nearest particle; where three labels meet it is cut finer.
///   2. Pieces of one label must be discs: pieces that are not, and large or round ones, get more centres.
///   3. Three labels in a triangle are a node, at the point of the surface as far from all three particles; borders run
///      from node to node. Two borders with the same ends, and closed ones, get nodes on their way.
///   4. A fan's centre is the surface point nearest the particle, as marching along the field's gradient finds it, if that is in the
///      piece; else its middle.
///   5. Short borders shrink to a node; centres and nodes of thin triangles move on the surface, those of folded ones farther.
///
/// Closed, oriented and manifold, by construction, for every surface that is. Every particle that is the nearest
/// to a vertex of the surface has a region, and nobody else.
///   surface  closed, oriented, manifold (checked along borders), edges about half a spacing or less; attributes and normals
///            are carried over, linear in its triangles. From mesh_level_set.
///   points   those of the regions, in the same order (sizes must agree, checked): their ids
///   particles  if given, vertices lie on their surface, in places that they say: nodes where the line of equal distance from three particles
///            meets it, centres where a line from the particle does. So a frame's fans go with lava that moves rigidly, wherever it is on the
///            voxels, but for what the mesh alone tells: which cells meet
/// Same bits on any number of threads and, for the same surface, in any order of the points. An empty surface gives an empty
/// tessellation.
///
/// Vertices lie on the surface; triangles, about a spacing wide, cut its corners: a frame of Maunga Whau loses 0.4 % of its
/// volume, its surface is 0.012 spacings off on average and 0.4 at worst; a blob of five spacings' radius loses 1.5 %, a drop of
/// one particle a sixth (lift_facets and refine_on bring it back). Thin triangles: none there, 0.05 % over random clusters. Of triangles that look
/// away from the surface (VoronoiReport::folded) that frame has 4 in 81,000, under the ground, thick layers none, random clusters 4 in
/// 10,000: on spikes that the surface itself hardly resolves. Where the lava moves by 0.01 spacings a frame, one
/// centre in thirty moves by more than 0.1 (when the borders round it change), the others with the lava.
/// Costs 2 us of processor time a vertex of the surface: 1.0 to 1.3 times mesh_level_set at a voxel of half a spacing, 0.8 times at
/// a third.
/// Source: Stora, Agliati, Cani, Neyret & Gascuel 1999, Animating lava flows, Graphics Interface '99, 203-210.
Tessellation tessellate_voronoi(const geometry::TriMesh& surface, const Regions& regions, const geometry::Points& points,
                                const VoronoiOptions& options = {}, const ParticleSurface* particles = nullptr);

}  // namespace effuse::skin
