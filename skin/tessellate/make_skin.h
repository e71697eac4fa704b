#pragma once

#include <array>
#include <optional>
#include <string_view>

#include "geometry/mesh/points.h"
#include "geometry/mesh/tri_mesh.h"
#include "geometry/terrain/terrain.h"
#include "skin/detail/displace.h"
#include "skin/surface/level_set.h"
#include "skin/tessellate/keep_volume.h"
#include "skin/tessellate/labels.h"
#include "skin/tessellate/shapes.h"
#include "skin/tessellate/voronoi.h"

/// The front door of the skin: particles in, a mesh with its regions out. What it goes through has doors of its own, for other orders of
/// doing things: build_level_set, mesh_level_set, tessellate_voronoi, refine_on, displace, coarsen.
namespace effuse::skin {

enum class TessellationKind {
  kLevelSet,  ///< watertight mesh of the level set, triangles of one size; may be coarsened where flat
  kVoronoi,   ///< fans of triangles on the particles' Voronoi regions: triangles that live with their particle
};
inline constexpr std::array<std::string_view, 2> kTessellationNames = {"levelset", "voronoi"};

struct SkinOptions {
  LevelSetOptions level_set;  ///< its spacing is everybody's
  TessellationKind tessellation = TessellationKind::kLevelSet;
  /// [spacings] how far the mesh may be from the fine one so as to have fewer triangles where it is flat; 0: as it is. Of kLevelSet only
  /// (checked). Comes last, when the surface is displaced: relief lower than this goes.
  Real coarsen = 0;
  std::optional<DisplaceOptions> detail;  ///< refined and displaced by this, its spacing left out; without it smooth, as tessellated
  bool mesh = true;                       ///< false: the level set alone
};

struct SkinReport {
  LevelSetReport level_set;
  VoronoiReport voronoi;  ///< of kVoronoi, before it was refined
  DisplaceReport displace;
  VolumeKept volume;           ///< of the mesh, before it was coarsened; all 0: not asked for
  bool refined_enough = true;  ///< RefineToReport::enough
  std::size_t coarsened = 0;   ///< vertices taken out
  Real coarsen_error = 0;      ///< [m] CoarsenReport::error
  TriangleShapes shapes;       ///< of the mesh in the end
};

/// A frame's skin.
struct Skin {
  LevelSet surface;
  geometry::TriMesh mesh;  ///< closed, oriented, manifold; empty for no particles
  RegionLabels regions;
  SkinReport report;
};

/// The mesh of kLevelSet: mesh_level_set()'s, the vertices of its thinnest triangles moved along it by up to a third of a voxel
/// (widen_thin).
///   last  as for mesh_level_set
geometry::TriMesh tessellate_level_set(const LevelSet& surface, SurfaceCache* last = nullptr);

/// Level set, tessellation, regions, detail, volume, coarsening, as options ask.
///
/// With level_set.match_volume the mesh, too, displaced or not, encloses the particles' volume: its vertices are moved along the smooth
/// surface's normals by one distance (keep_volume), a quarter of a spacing at most. Not where a volume is a quarter and more off: then it is
/// not the mesh's doing (a roof over the lava, particles that overlap).
///
/// Displaced skins (an amplitude above 0) are displaced from the surface of the particles themselves (ParticleSurface), not of the level set's voxels, so that they go with
/// the lava wherever it is on the lattice. Vertices of kVoronoi, too, lie at places on it that the particles say (kRound): made anew after a
/// rigid motion such a skin is the same but for 0.2 to 0.4 % of its height (`effuse study skin`; 1.2 % where particles lie in rows and four regions meet
/// everywhere). kLevelSet's vertices lie where the voxels say, so that its triangles cut other parts of the bumps off: 1 to 5 %, under 1 % with DisplaceOptions::oversample 4.
///
/// The surface particles are those that are nearest to a vertex of the smooth surface: kLevelSet of the mesh refined, kVoronoi of the level
/// set's own mesh. Each has one region, nobody else has any. kLevelSet: vertices know theirs, also after displacement (a
/// region is where the smooth surface is nearest to its particle) and coarsening (which leaves every region a vertex). kVoronoi: triangles
/// know theirs, regions end at edges, so that the mesh is closed between them; a vertex on a border is of the smallest id's.
/// Refined, kVoronoi's vertices lie on the same smooth surface as kLevelSet's (refine_on.h); refined or not, they are lifted by what
/// its facets cut off (lift_facets), so that both enclose the same volume.
///   points   position, radius, and what else there is
///   volume   of the particles [m^3]: what the surface is to enclose (LevelSetOptions::match_volume)
///   terrain  where the skin ends, and relief fades; nullptr: none
///   last     what the frame before left of its surface (build_level_set): the same skin, sooner
/// Throws as build_level_set and Relief do. Same bits on any number of threads.
Skin make_skin(const geometry::Points& points, Real volume, const geometry::Terrain* terrain, const SkinOptions& options,
               SurfaceCache* last = nullptr);

}  // namespace effuse::skin
