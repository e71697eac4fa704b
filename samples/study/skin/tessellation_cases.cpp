#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "samples/study/skin/blobs.h"
#include "samples/study/skin/cases.h"
#include "samples/study/skin/soundness.h"

/// Both tessellations of what is hard for them: closed, with good triangles, each surface particle with its region.
namespace effuse::study {

namespace {

constexpr Real kThin = 0.005;  // the bar
constexpr skin::TessellationKind kBoth[] = {skin::TessellationKind::kLevelSet, skin::TessellationKind::kVoronoi};

CaseResult tessellations() {
  CaseResult result;
  Plot plot{"skin_tessellations", "Triangles with an angle under 5 degrees", "shape: clusters 0-9, sheet 10, merging from 11 on, parting from 59 on", "share of triangles [%]", false, false, {}};
  const auto shapes = blobs();
  plot.curves.push_back({"bar", {0, static_cast<Real>(shapes.size() - 1)}, {100 * kThin, 100 * kThin}, false, true});
  std::size_t triangles = 0;
  for (const skin::TessellationKind kind : kBoth)
    for (const bool displaced : {false, true}) {
      const std::string name = fmt::format("{}, {}", skin::kTessellationNames[static_cast<std::size_t>(kind)], displaced ? "displaced (aa)" : "smooth");
      Curve thin{name, {}, {}, true, false};
      std::size_t torn = 0, without = 0, others = 0, nowhere = 0;
      Real thinnest = 0;
      for (std::size_t s = 0; s < shapes.size(); ++s) {
        const std::vector<Vec3>& x = shapes[s].second;
        const std::vector<Real> radius(x.size(), 0.5), crust(x.size(), 1);
        geometry::Points points;
        points.position = points.rest = x;
        points.radius = radius;
        points.crust = crust;
        skin::SkinOptions options;
        options.level_set.spacing = 1;
        options.tessellation = kind;
        if (displaced) {
          options.detail.emplace();
          options.detail->kind = skin::SkinKind::kAa;
        }
        const skin::Skin skin = skin::make_skin(points, static_cast<Real>(x.size()), nullptr, options);
        const Soundness found = soundness(skin, points, options);
        triangles += skin.mesh.triangles.size();
        torn += !found.solid;
        thinnest = std::max(thinnest, found.thin);
        without += found.without_region;
        others += found.regions_of_others;
        nowhere += found.nowhere;
        thin.x.push_back(static_cast<Real>(s));
        thin.y.push_back(100 * found.thin);
      }
      const auto add = [&](const std::string& what, std::size_t count, const std::string& unit) {
        const Real n = static_cast<Real>(count);
        result.measures.push_back({name + ": " + what, unit, n, 0, n, 0, unit});
      };
      add("skins not closed, oriented and manifold", torn, "skins");
      result.measures.push_back({name + ": most triangles under 5 degrees", "", thinnest, 0, thinnest, kThin, ""});
      add("surface particles without a region", without, "particles");
      add("regions of particles not on the surface", others, "regions");
      add("regions with nothing in them", nowhere, "regions");
      plot.curves.push_back(std::move(thin));
    }
  result.plots.push_back(std::move(plot));
  result.note = fmt::format("{} shapes: {} random clusters of 150 particles, a sheet of one particle, {} frames of two merging blobs, {} of one that parts; four skins each, {} "
                            "triangles in all. Surface particles are those nearest to a vertex of the smooth surface, looked for one by one.",
                            shapes.size(), kClusters, kMergingFrames, kPartingFrames, triangles);
  return result;
}

}  // namespace

void add_tessellation_cases(std::vector<Case>& cases) {
  cases.push_back({"tessellations", "Both tessellations of clusters, a thin sheet, merging and parting blobs", "what a closed mesh is; the particles nearest to the surface", true, tessellations});
}

}  // namespace effuse::study
