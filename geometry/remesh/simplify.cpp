#include <CGAL/Surface_mesh_simplification/Edge_collapse_visitor_base.h>
#include <CGAL/Surface_mesh_simplification/Policies/Edge_collapse/Count_stop_predicate.h>
#include <CGAL/Surface_mesh_simplification/Policies/Edge_collapse/LindstromTurk_cost.h>
#include <CGAL/Surface_mesh_simplification/Policies/Edge_collapse/LindstromTurk_placement.h>
#include <CGAL/Surface_mesh_simplification/edge_collapse.h>

#include <algorithm>
#include <cmath>

#include "geometry/base/check.h"
#include "geometry/base/zones.h"
#include "geometry/mesh/measure.h"
#include "geometry/query/closest_point.h"
#include "geometry/query/mesh_tree.h"
#include "geometry/remesh/cgal_mesh_internal.h"
#include "geometry/remesh/distance_bound.h"
#include "geometry/remesh/remesh.h"

namespace effuse::geometry {

namespace SMS = CGAL::Surface_mesh_simplification;

namespace {

/// What simplification knows of the input: its surface, and which of its vertices each vertex stands for now.
struct Original {
  const std::vector<Vec3>& positions;  // relative to the middle, as the mesh's
  const MeshTree& tree;
  std::vector<std::vector<Index>> stands_for;
  Real max_error;
};

Vec3 ours(const CgalKernel::Point_3& p) { return {p.x(), p.y(), p.z()}; }

/// Refuses placements that lead too far.
struct NearOriginal {
  Original* original;

  template <class Profile>
  boost::optional<typename Profile::Point> operator()(const Profile& profile, boost::optional<typename Profile::Point> placement) const {
    if (!placement) return placement;
    const Vec3 p = ours(*placement);
    const auto& mesh = profile.surface_mesh();
    const Real reach = original->max_error;
    const auto near = [&](const Vec3& x) { return original->tree.nearest(x, reach).has_value(); };
    if (!p.allFinite() || !near(p)) return boost::none;

    // The ring's triangles, their second vertex moved; the one or two beside the edge go.
    const auto& triangles = profile.triangles();
    const std::size_t gone = static_cast<std::size_t>(profile.left_face_exists()) + static_cast<std::size_t>(profile.right_face_exists());
    if (triangles.size() <= gone) return boost::none;
    std::vector<std::array<Vec3, 2>> ring;
    for (std::size_t k = gone; k < triangles.size(); ++k) {
      const Vec3 a = ours(mesh.point(triangles[k].v0)), old = ours(mesh.point(triangles[k].v1)), b = ours(mesh.point(triangles[k].v2));
      const Vec3 was = (a - old).cross(b - old), is = (a - p).cross(b - p);
      // No fold, and no needle that the next collapse could not tell from a line.
      const Real longest = std::max({(a - p).squaredNorm(), (b - p).squaredNorm(), (a - b).squaredNorm()});
      if (!(was.dot(is) > 0.2 * was.norm() * is.norm()) || is.norm() < 1e-6 * longest) return boost::none;
      ring.push_back({a, b});
    }
    for (const Index v : {static_cast<Index>(profile.v0().idx()), static_cast<Index>(profile.v1().idx())})
      for (const Index stood : original->stands_for[v]) {
        const Vec3& x = original->positions[stood];
        Real nearest = std::numeric_limits<Real>::infinity();
        for (std::size_t k = 0; k < ring.size() && nearest > reach; ++k) nearest = std::min(nearest, (closest_point_on_triangle(x, p, ring[k][1], ring[k][0]).point - x).norm());
        if (nearest > reach) return boost::none;
      }
    for (const auto& [a, b] : ring)
      if (!near((p + a + b) / 3) || !near((p + a) / 2) || !near((p + b) / 2)) return boost::none;
    return placement;
  }
};

/// Hands on what a vertex that goes stood for.
struct Inherit : SMS::Edge_collapse_visitor_base<CgalMesh> {
  Original* original = nullptr;
  void OnCollapsed(const Profile& profile, const vertex_descriptor& stays) {
    auto& lists = original->stands_for;
    const std::size_t a = profile.v0().idx(), b = profile.v1().idx(), to = stays.idx(), from = to == a ? b : a;
    lists[to].insert(lists[to].end(), lists[from].begin(), lists[from].end());
    std::vector<Index>().swap(lists[from]);
  }
};

}  // namespace

Remeshed simplify(const TriMesh& mesh, Real max_error) {
  ZONE("mesh.simplify");
  CHECK(std::isfinite(max_error) && max_error > 0);
  const Vec3 middle = bounds(mesh).center();
  std::vector<Vec3> positions = mesh.positions;
  for (Vec3& p : positions) p -= middle;
  const MeshTree tree(positions, mesh.triangles);
  Remeshed result;
  // A tenth is kept back for what lies between the points that collapses look at.
  for (Real asked = 0.9 * max_error;; asked *= 0.8) {
    CgalMesh surface = to_cgal_mesh(mesh, middle);
    Original original{positions, tree, {}, asked};
    for (Index v = 0; v < positions.size(); ++v) original.stands_for.push_back({v});
    Inherit inherit;
    inherit.original = &original;
    cgal_or_error("simplified", [&] {
      const SMS::Count_stop_predicate<CgalMesh> never(0);
      SMS::edge_collapse(surface, never,
                         CGAL::parameters::get_cost(SMS::LindstromTurk_cost<CgalMesh>()).get_placement(SMS::LindstromTurk_placement<CgalMesh>()).filter(NearOriginal{&original}).visitor(inherit));
      return true;
    });
    result.mesh = from_cgal_mesh(surface, middle);
    result.bound = std::max(distance_bound(mesh, result.mesh, max_error), distance_bound(result.mesh, mesh, max_error));
    if (result.bound <= max_error) break;
    // Refused at every point, nothing collapses: the input itself.
    if (asked < 0.05 * max_error) {
      result.mesh = mesh;
      result.bound = 0;
      return result;
    }
  }
  result.error = hausdorff_distance(mesh, result.mesh);
  transfer_attributes(mesh, result.mesh);
  return result;
}

}  // namespace effuse::geometry
