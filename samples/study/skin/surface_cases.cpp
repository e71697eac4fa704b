#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <ctime>
#include <limits>
#include <span>

#include "geometry/base/parallel.h"
#include "geometry/base/random.h"
#include "samples/study/skin/cases.h"
#include "samples/study/skin/fill.h"
#include "samples/study/skin/solids.h"
#include "skin/detail/refine.h"
#include "skin/surface/level_set.h"
#include "skin/tessellate/regions.h"
#include "skin/tessellate/voronoi.h"

/// The skin of particles that fill a solid, beside the solid's surface.
namespace effuse::study {

namespace {

using geometry::TriMesh;

/// Bars: volume, and distances in spacings.
constexpr Real kVolume = 0.02, kHausdorff = 0.5, kMean = 0.15;
constexpr int kFinest = 4;  // voxels a spacing: 2, 3, 4

/// A way to a mesh.
struct Method {
  const char* name;
  int smoothing = 2;
  bool voronoi = false;
  Real refined = 0;  // [spacings] edge, 0: not
  skin::SurfaceKernel kernel = skin::SurfaceKernel::kRound;
};
constexpr Method kDefault = {"level set", 2, false, 0}, kAnisotropic = {"anisotropic", 0, false, 0, skin::SurfaceKernel::kAnisotropic};
constexpr Method kCompared[] = {kDefault, kAnisotropic};
constexpr Method kMethods[] = {kDefault,
                               kAnisotropic,
                               {"level set, not smoothed", 0, false, 0},
                               {"level set, smoothing 6", 6, false, 0},
                               {"level set, refined to 1/4", 2, false, 0.25},
                               {"voronoi", 2, true, 0},
                               {"voronoi, refined to 1/4", 2, true, 0.25}};

constexpr Filling kFillings[] = {Filling::kLattice, Filling::kDisorder};
constexpr std::size_t kSamples = 6000;  // of the true surface

/// Of the process [s]: what else runs on the machine counts only by the caches it takes.
Real processor_time() { return static_cast<Real>(std::clock()) / CLOCKS_PER_SEC; }

struct Particles {
  std::vector<Vec3> x;
  std::vector<Real> radius;
  geometry::Points points() const {
    geometry::Points p;
    p.position = x;
    p.radius = radius;
    return p;
  }
};
Particles particles_of(const Solid& solid, Filling how) {
  Particles p{fill(solid.box, solid.distance, solid.volume, how), {}};
  p.radius.assign(p.x.size(), 0.5);
  return p;
}

TriMesh mesh_of(const geometry::Points& points, Real volume, const Method& method, int voxels) {
  skin::LevelSetOptions options;
  options.spacing = 1;
  options.voxel = 1.0 / voxels;
  options.smoothing = method.smoothing;
  options.kernel = method.kernel;
  TriMesh mesh = skin::mesh_level_set(skin::build_level_set(points, volume, nullptr, options));
  if (method.voronoi) mesh = skin::tessellate_voronoi(mesh, skin::Regions(points, 1), points).mesh;
  if (method.refined > 0) {
    skin::RefineOptions edges;
    edges.edge = method.refined;
    skin::refine_to(mesh, edges);
  }
  return mesh;
}

struct Run {
  SurfaceError error;
  Real seconds = 0;  // median of three
};
Run run(const Solid& solid, const Particles& particles, const Method& method, int voxels) {
  Run result;
  std::array<Real, 3> seconds;
  TriMesh mesh;
  for (Real& s : seconds) {
    const Real begin = processor_time();
    mesh = mesh_of(particles.points(), solid.volume, method, voxels);
    s = processor_time() - begin;
  }
  std::sort(seconds.begin(), seconds.end());
  result.seconds = seconds[1];
  result.error = surface_error(mesh, solid, kSamples);
  return result;
}

/// The figures of one run, with their bars.
void add_measures(CaseResult& result, const SurfaceError& e, const std::string& which) {
  result.measures.push_back({which + ": volume", "", e.volume, 0, e.volume, kVolume, ""});
  result.measures.push_back({which + ": Hausdorff distance", "spacings", e.hausdorff, 0, e.hausdorff, kHausdorff, "spacings"});
  result.measures.push_back({which + ": mean distance", "spacings", e.mean, 0, e.mean, kMean, "spacings"});
  result.measures.push_back({which + ": closed, oriented, manifold, one piece", "", e.solid ? 1.0 : 0.0, 1, e.solid ? 0.0 : 1.0, 0, ""});
}

/// How far the farthest point of the true surface is from the nearest ball of a particle, half a spacing in radius: what no surface of such
/// particles can be sure of.
Real farthest_from_balls(const Solid& solid, const Particles& particles) {
  const skin::Regions regions(particles.points(), 1);
  return parallel_max(kSamples, 0, [&](std::size_t i) {
    const Vec3 p = solid.point(random_uniform(17, 0, i), random_uniform(17, 1, i), random_uniform(17, 2, i));
    const Index nearest = regions.nearest(p);
    return nearest == skin::Regions::kNone ? 0 : (particles.x[nearest] - p).norm() - particles.radius[nearest];
  });
}

/// Error against seconds, a curve for each method, a mark for each voxel size.
struct Curves {
  std::vector<Curve> volume, hausdorff, mean, normal;
  void add(const std::string& name, const std::vector<Run>& runs) {
    for (auto* curves : {&volume, &hausdorff, &mean, &normal}) curves->push_back({name, {}, {}, false, false});
    for (const Run& r : runs) {
      const auto put = [&](std::vector<Curve>& curves, Real y) {
        curves.back().x.push_back(r.seconds);
        curves.back().y.push_back(y);
      };
      put(volume, r.error.volume);
      put(hausdorff, r.error.hausdorff);
      put(mean, r.error.mean);
      put(normal, r.error.normal * 180 / kPi);
    }
  }
  /// bar: a line to be under; 0: none.
  static Plot plot(const std::string& file, const std::string& title, const std::string& label, std::vector<Curve> curves, Real bar) {
    Plot p{file, title, "processor time [s]", label, true, true, {}};
    if (bar > 0) {
      Real first = std::numeric_limits<Real>::infinity(), last = 0;
      for (const Curve& c : curves)
        for (const Real x : c.x) {
          first = std::min(first, x);
          last = std::max(last, x);
        }
      p.curves.push_back({"bar", {first, last}, {bar, bar}, false, true});
    }
    for (Curve& c : curves) p.curves.push_back(std::move(c));
    return p;
  }
  std::vector<Plot> plots(const std::string& file, const std::string& title) const {
    return {plot(file + "_hausdorff", title + ": Hausdorff distance against time, voxels 1/2, 1/3, 1/4", "Hausdorff distance [spacings]", hausdorff, kHausdorff),
            plot(file + "_mean", title + ": mean distance against time", "mean distance [spacings]", mean, kMean),
            plot(file + "_volume", title + ": volume against time", "relative error of the volume", volume, kVolume),
            plot(file + "_normal", title + ": normals against time", "mean error of the normals [deg]", normal, 0)};
  }
};

const char* name_of(Filling how) { return how == Filling::kLattice ? "lattice" : "disorder"; }

std::string dashed(std::string name) {
  std::replace(name.begin(), name.end(), ' ', '-');
  return name;
}

/// One solid, filled in some ways, by some methods.
CaseResult surfaces(const Solid& solid, const std::string& file, std::span<const Filling> fillings, std::span<const Method> methods) {
  CaseResult result;
  Curves curves;
  std::size_t count = 0;
  std::string balls;
  for (const Filling how : fillings) {
    const Particles particles = particles_of(solid, how);
    count = particles.x.size();
    balls += fmt::format("{}{:.2f} of the {}'s", balls.empty() ? "" : ", ", farthest_from_balls(solid, particles), name_of(how));
    for (const Method& method : methods) {
      std::vector<Run> runs;
      for (int voxels = 2; voxels <= kFinest; ++voxels) {
        runs.push_back(run(solid, particles, method, voxels));
        add_measures(result, runs.back().error, fmt::format("{}, {}, voxel 1/{}", method.name, name_of(how), voxels));
      }
      curves.add(fmt::format("{}, {}", method.name, name_of(how)), runs);
    }
  }
  result.plots = curves.plots(file, solid.name);
  result.note = fmt::format("{}: {} particles for a volume of {:.1f} spacings cubed. Distances both ways: {} points of the true surface to the mesh, vertices and "
                            "face centres to the true surface. Points of the true surface lie up to so many spacings from the nearest particle's ball of half a spacing: {}. "
                            "Seconds are processor time, median of three.",
                            solid.size, count, solid.volume, kSamples, balls);
  return result;
}

}  // namespace

void add_surface_cases(std::vector<Case>& cases) {
  for (const Solid& solid : solids()) {
    const std::string name = dashed(solid.name);
    cases.push_back({name, fmt::format("Level set of a {} filled with particles, three voxel sizes, round and anisotropic kernels", solid.name), "the solid itself", true,
                     [&solid, name] { return surfaces(solid, "skin_" + name, kFillings, kCompared); }});
  }
  for (const Solid& solid : solids()) {
    const std::string name = dashed(solid.name);
    cases.push_back({"work-" + name, fmt::format("Error against time on a {}: smoothing, refinement, both tessellations", solid.name), "the solid itself", false,
                     [&solid, name] { return surfaces(solid, "skin_work_" + name, {&kFillings[1], 1}, kMethods); }});
  }
}

}  // namespace effuse::study
