#include "skin/tessellate/make_skin.h"

#include <algorithm>
#include <cmath>
#include <optional>
#include <utility>
#include <vector>

#include "geometry/base/check.h"
#include "geometry/base/zones.h"
#include "skin/tessellate/coarsen.h"
#include "skin/surface/particle_surface.h"
#include "skin/tessellate/refine_on.h"

namespace effuse::skin {

namespace {

using geometry::TriMesh;

constexpr Real kThinnest = 14;  // [deg] thinner triangles are made wider,
constexpr Real kThinFan = 8;     // [deg] the same for fans, which have been made better once, before their vertices went to the particles' surface
constexpr Real kFlattest = 0.6; // VoronoiOptions::flattest where fans are refined on the particles' surface: clear of the 0.71 of regions bent by 90 degrees
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

/// What the mesh is to enclose: what the level set was to, unless it could not; 0: nothing said.
Real wanted_volume(const LevelSetReport& level_set) {
  constexpr Real kReached = 0.05;
  if (!(level_set.target > 0)) return 0;
  return std::abs(level_set.residual) <= kReached ? level_set.target : level_set.volume;
}

/// The mesh's normals, shorter where triangles round the vertex look elsewhere: in creases and pinches, whose sides would cut through one another.
std::vector<Vec3> ways_out(const TriMesh& mesh) {
  constexpr Real kNowhere = 0.5, kFreely = 0.9;  // cosine of the worst triangle
  std::vector<Real> least(mesh.positions.size(), 1);
  for (const geometry::Triangle& t : mesh.triangles) {
    const Vec3 up = (mesh.positions[t[1]] - mesh.positions[t[0]]).cross(mesh.positions[t[2]] - mesh.positions[t[0]]).normalized();
    for (const Index v : t) least[v] = std::min(least[v], up.dot(mesh.normals[v]));
  }
  std::vector<Vec3> ways(mesh.normals);
  for (std::size_t v = 0; v < ways.size(); ++v) ways[v] *= std::clamp((least[v] - kNowhere) / (kFreely - kNowhere), 0.0, 1.0);
  return ways;
}

/// ways: of the smooth surface.
void match_volume(Skin& skin, const std::vector<Vec3>& ways, const geometry::Terrain* terrain, Real spacing) {
  constexpr Real kFarthest = 0.25, kOff = 0.25;
  const Real wanted = wanted_volume(skin.report.level_set);
  if (!(wanted > 0) || skin.mesh.positions.empty()) return;
  const std::optional<Real> now = volume_above(skin.mesh, terrain);
  if (now && std::abs(*now - wanted) < kOff * wanted) skin.report.volume = keep_volume(skin.mesh, ways, wanted, terrain, kFarthest * spacing);
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
  const bool displaced = detail && detail->amplitude > 0;

  Skin skin;
  skin.surface = build_level_set(points, volume, terrain, options.level_set, last);
  skin.report.level_set = skin.surface.report();
  if (!options.mesh || skin.surface.empty()) return skin;
  const Regions regions(points, spacing);
  RefineToReport refined;
  if (voronoi) {
    const TriMesh surface = mesh_level_set(skin.surface, last);
    std::optional<ParticleSurface> particles;
    if (displaced && options.level_set.kernel == SurfaceKernel::kRound) particles.emplace(skin.surface);
    VoronoiOptions fans;
    if (particles) fans.flattest = kFlattest;
    Tessellation tessellation = tessellate_voronoi(surface, regions, points, fans, particles ? &*particles : nullptr);
    if (detail) refined = refine_on(tessellation, surface, fineness(*detail), particles ? &*particles : nullptr);
    if (particles) widen_thin(tessellation.mesh, kThinFan, kWander * detail->edge * spacing);
    lift_facets(tessellation.mesh);
    skin.report.voronoi = tessellation.report;
    skin.regions = labels_of(tessellation);
    skin.mesh = std::move(tessellation.mesh);
  } else {
    skin.mesh = tessellate_level_set(skin.surface, last);
    if (detail) refined = refine_for(skin.mesh, *detail);
    skin.regions = label_vertices(skin.mesh, regions, points);
    if (displaced) ParticleSurface(skin.surface).project(skin.mesh);
  }
  const std::vector<Vec3> ways = ways_out(skin.mesh);
  // Before vertices that the particles place are displaced, too: relief is a function of the place, and the level set's own volume is the
  // lattice's to a hundredth of a voxel.
  if (displaced && voronoi) match_volume(skin, ways, terrain, spacing);
  if (detail) skin.report.displace = displace_only(skin.mesh, points, terrain, *detail);
  skin.report.displace.refined = refined.rounds;
  skin.report.refined_enough = refined.enough;
  match_volume(skin, ways, terrain, spacing);
  if (options.coarsen > 0) coarsen_labelled(skin, options.coarsen * spacing);
  skin.report.shapes = triangle_shapes(skin.mesh);
  return skin;
}

}  // namespace effuse::skin
