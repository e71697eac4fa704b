#include "skin/tessellate/labels.h"

#include <algorithm>
#include <limits>

#include "geometry/base/check.h"
#include "geometry/base/parallel.h"
#include "geometry/base/zones.h"

namespace effuse::skin {

namespace {

using geometry::TriMesh;

Index nearest_of_all(const geometry::Points& points, const Vec3& x) {
  Index best = 0;
  Real least = std::numeric_limits<Real>::infinity();
  for (std::size_t i = 0; i < points.size(); ++i) {
    const Real d = (x - points.position[i]).squaredNorm();
    if (d >= least) continue;
    least = d;
    best = static_cast<Index>(i);
  }
  return best;
}

}  // namespace

RegionLabels label_vertices(const TriMesh& mesh, const Regions& regions, const geometry::Points& points) {
  ZONE("skin.label");
  const std::size_t n = mesh.positions.size();
  CHECK_EQ(regions.size(), points.size());
  if (n > 0) CHECK_GT(points.size(), std::size_t{0});
  RegionLabels labels;
  std::vector<Index>& of = labels.of_vertex;
  of.resize(n);
  parallel_for(n, [&](std::size_t v) { of[v] = regions.nearest(mesh.positions[v]); });
  labels.unreached = static_cast<std::size_t>(std::count(of.begin(), of.end(), Regions::kNone));
  if (labels.unreached > 0)
    parallel_for(n, [&](std::size_t v) {
      if (of[v] == Regions::kNone) of[v] = nearest_of_all(points, mesh.positions[v]);
    });

  // From particles to regions, in rising order.
  std::vector<Index> region(points.size(), Regions::kNone);
  for (const Index p : of) region[p] = 0;
  for (Index p = 0; p < region.size(); ++p) {
    if (region[p] == Regions::kNone) continue;
    region[p] = static_cast<Index>(labels.particle.size());
    labels.particle.push_back(p);
    labels.id.push_back(points.id.empty() ? p : points.id[p]);
  }
  parallel_for(n, [&](std::size_t v) { of[v] = region[of[v]]; });
  return labels;
}

}  // namespace effuse::skin
