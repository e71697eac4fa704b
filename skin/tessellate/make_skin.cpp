#include "skin/tessellate/make_skin.h"

#include <utility>
#include <vector>

#include "geometry/base/check.h"
#include "geometry/base/zones.h"
#include "skin/tessellate/coarsen.h"
#include "skin/tessellate/refine_on.h"

namespace effuse::skin {

namespace {

using geometry::TriMesh;

constexpr Real kThinnest = 10;  // [deg] thinner triangles are made wider,
constexpr Real kWander = 0.35;  // [voxels] by moving vertices so far

/// Of a tessellation whose triangles have regions: a vertex on a border gets that of the smallest id.
RegionLabels labels_of(Tessellation& t) {
  RegionLabels labels;
  labels.of_vertex.assign(t.mesh.positions.size(), Regions::kNone);
  for (std::size_t k = 0; k < t.mesh.triangles.size(); ++k)
    for (const Index v : t.mesh.triangles[k]) {
      Index& of = labels.of_vertex[v];
      if (of == Regions::kNone || t.id[t.region[k]] < t.id[of]) of = t.region[k];
    }
  labels.particle = std::move(t.particle);
  labels.id = std::move(t.id);
  labels.of_triangle = std::move(t.region);
  labels.unreached = t.report.unclaimed;
  return labels;
}

void coarsen_labelled(Skin& skin, Real error) {
  CoarsenOptions options;
  options.error = error;
  const CoarsenReport report = coarsen(skin.mesh, options, skin.regions.of_vertex);
  std::vector<Index>& of = skin.regions.of_vertex;
  for (std::size_t v = 0; v < report.kept.size(); ++v) of[v] = of[report.kept[v]];
  of.resize(report.kept.size());
  skin.report.coarsened = report.removed;
  skin.report.coarsen_error = report.error;
}

}  // namespace

TriMesh tessellate_level_set(const LevelSet& surface, SurfaceCache* last) {
  TriMesh mesh = mesh_level_set(surface, last);
  widen_thin(mesh, kThinnest, kWander * surface.voxel());
  return mesh;
}

Skin make_skin(const geometry::Points& points, Real volume, const geometry::Terrain* terrain, const SkinOptions& options,
               SurfaceCache* last) {
  ZONE("skin");
  const bool voronoi = options.tessellation == TessellationKind::kVoronoi;
  const Real spacing = options.level_set.spacing;
  CHECK_GE(options.coarsen, 0.0);
  CHECK(!voronoi || options.coarsen == 0);
  std::optional<DisplaceOptions> detail = options.detail;
  if (detail) detail->spacing = spacing;

  Skin skin;
  skin.surface = build_level_set(points, volume, terrain, options.level_set, last);
  skin.report.level_set = skin.surface.report();
  if (!options.mesh || skin.surface.empty()) return skin;
  const Regions regions(points, spacing);
  RefineToReport refined;
  if (voronoi) {
    const TriMesh surface = mesh_level_set(skin.surface, last);
    Tessellation tessellation = tessellate_voronoi(surface, regions, points);
    if (detail) refined = refine_on(tessellation, surface, fineness(*detail));
    lift_facets(tessellation.mesh);
    skin.report.voronoi = tessellation.report;
    skin.regions = labels_of(tessellation);
    skin.mesh = std::move(tessellation.mesh);
  } else {
    skin.mesh = tessellate_level_set(skin.surface, last);
    if (detail) refined = refine_for(skin.mesh, *detail);
    skin.regions = label_vertices(skin.mesh, regions, points);
  }
  if (detail) skin.report.displace = displace_only(skin.mesh, points, terrain, *detail);
  skin.report.displace.refined = refined.rounds;
  skin.report.refined_enough = refined.enough;
  if (options.coarsen > 0) coarsen_labelled(skin, options.coarsen * spacing);
  skin.report.shapes = triangle_shapes(skin.mesh);
  return skin;
}

}  // namespace effuse::skin
