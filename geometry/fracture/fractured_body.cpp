#include "geometry/fracture/fractured_body.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <map>
#include <numeric>

#include "geometry/base/check.h"
#include "geometry/base/error.h"
#include "geometry/base/parallel.h"
#include "geometry/base/zones.h"
#include "geometry/collide/collision_mesh.h"
#include "geometry/fracture/mesh_cut.h"
#include "geometry/mesh/measure.h"
#include "geometry/mesh/self_intersections.h"

namespace effuse::geometry {
namespace {

constexpr Real kWeld = 1e-10;    ///< of the diagonal: nearer vertices are one
constexpr Real kConvex = 1e-9;   ///< of the diagonal: a vertex so far before a face's plane is still on it
constexpr Real kFills = 1e-9;    ///< of the volume: what cells may lack

/// Vertices, one where they are nearer than the tolerance.
class Pool {
 public:
  explicit Pool(Real tolerance) : tolerance_(tolerance) {}
  Index add(const Vec3& p) {
    const auto cell = key(p);
    for (int k = 0; k < 27; ++k) {
      const auto found = grid_.find({cell[0] + k % 3 - 1, cell[1] + k / 3 % 3 - 1, cell[2] + k / 9 - 1});
      if (found == grid_.end()) continue;
      for (const Index i : found->second)
        if ((points[i] - p).norm() <= tolerance_) return i;
    }
    grid_[cell].push_back(static_cast<Index>(points.size()));
    points.push_back(p);
    return static_cast<Index>(points.size() - 1);
  }
  std::vector<Vec3> points;

 private:
  std::array<std::int64_t, 3> key(const Vec3& p) const {
    return {std::llround(p.x() / (4 * tolerance_)), std::llround(p.y() / (4 * tolerance_)), std::llround(p.z() / (4 * tolerance_))};
  }
  Real tolerance_;
  std::map<std::array<std::int64_t, 3>, std::vector<Index>> grid_;
};

bool is_convex(const TriMesh& mesh, Real tolerance) {
  for (const Triangle& t : mesh.triangles) {
    const Vec3 &a = mesh.positions[t[0]], &b = mesh.positions[t[1]], &c = mesh.positions[t[2]];
    const Vec3 n = (b - a).cross(c - a);
    const Real length = n.norm();
    if (length == 0) continue;
    for (const Vec3& p : mesh.positions)
      if (n.dot(p - a) > tolerance * length) return false;
  }
  return true;
}

Vec3 area_vector(const std::vector<Vec3>& points, const std::vector<Index>& loop) {
  Vec3 sum = Vec3::Zero();
  for (std::size_t k = 1; k + 1 < loop.size(); ++k) sum += (points[loop[k]] - points[loop[0]]).cross(points[loop[k + 1]] - points[loop[0]]) / 2;
  return sum;
}

/// Whether p, in the plane of a convex polygon, lies in it.
bool holds(const std::vector<Vec3>& points, const std::vector<Index>& loop, const Vec3& p, Real tolerance) {
  const Vec3 n = area_vector(points, loop).normalized();
  for (std::size_t k = 0; k < loop.size(); ++k) {
    const Vec3 &a = points[loop[k]], &b = points[loop[(k + 1) % loop.size()]];
    const Vec3 out = (b - a).cross(n);
    if (out.dot(p - a) > tolerance * out.norm()) return false;
  }
  return true;
}

Vec3 mean_of(const std::vector<Vec3>& points, const std::vector<Index>& loop) {
  Vec3 sum = Vec3::Zero();
  for (const Index i : loop) sum += points[i];
  return sum / static_cast<Real>(loop.size());
}

/// Faces of one region that hang together by vertices, as cells; numbers of their faces.
std::vector<std::vector<std::size_t>> connected(const std::vector<std::vector<Index>>& loops) {
  std::map<Index, std::size_t> first;
  std::vector<std::size_t> parent(loops.size());
  std::iota(parent.begin(), parent.end(), std::size_t{0});
  const auto root = [&](std::size_t f) {
    while (parent[f] != f) f = parent[f] = parent[parent[f]];
    return f;
  };
  for (std::size_t f = 0; f < loops.size(); ++f)
    for (const Index v : loops[f]) {
      const auto [at, fresh] = first.try_emplace(v, f);
      if (fresh) continue;
      const std::size_t a = root(at->second), b = root(f);
      parent[std::max(a, b)] = std::min(a, b);
    }
  std::map<std::size_t, std::vector<std::size_t>> groups;
  for (std::size_t f = 0; f < loops.size(); ++f) groups[root(f)].push_back(f);
  std::vector<std::vector<std::size_t>> out;
  for (auto& [r, faces] : groups) out.push_back(std::move(faces));
  return out;
}

/// Vertices that lie on an edge of a face become its corners.
void insert_corners(const std::vector<Vec3>& points, std::vector<Index>& loop, const std::vector<Index>& candidates, Real tolerance) {
  std::vector<Index> out;
  for (std::size_t k = 0; k < loop.size(); ++k) {
    const Index a = loop[k], b = loop[(k + 1) % loop.size()];
    const Vec3 &p = points[a], d = points[b] - p;
    const Real length = d.norm();
    out.push_back(a);
    std::vector<std::pair<Real, Index>> between;
    for (const Index i : candidates) {
      if (i == a || i == b) continue;
      const Vec3 r = points[i] - p;
      const Real along = r.dot(d) / length;
      if (along <= tolerance || along >= length - tolerance || (r - d * (along / length)).norm() > tolerance) continue;
      between.emplace_back(along, i);
    }
    std::sort(between.begin(), between.end());
    for (const auto& [along, i] : between) out.push_back(i);
  }
  loop.swap(out);
}

/// A flat face as triangles round its middle, so that corners along its edges do no harm.
template <class F>
void for_triangles(const std::vector<Vec3>& points, const std::vector<Index>& loop, F&& f) {
  if (loop.size() == 3) {
    f(points[loop[0]], points[loop[1]], points[loop[2]]);
    return;
  }
  const Vec3 middle = mean_of(points, loop);
  for (std::size_t k = 0; k < loop.size(); ++k) f(points[loop[k]], points[loop[(k + 1) % loop.size()]], middle);
}

std::vector<CellInterface> find_interfaces(const FracturedBody& body) {
  std::map<std::pair<Index, Index>, CellInterface> found;
  for (Index c = 0; c < body.cells.size(); ++c)
    for (const CellFace& face : body.cells[c].faces) {
      if (face.beyond == kOuterFace || face.beyond < c) continue;
      CellInterface& s = found.try_emplace({c, face.beyond}).first->second;
      s.a = c;
      s.b = face.beyond;
      for (const Index i : face.loop) s.rim.push_back(body.vertices[i]);
    }
  for (auto& [pair, s] : found) {
    Vec3 sum = Vec3::Zero(), first = Vec3::Zero();
    Mat3 second = Mat3::Zero();
    const Vec3 origin = s.rim[0];
    for (const CellFace& face : body.cells[s.a].faces) {
      if (face.beyond != s.b) continue;
      for_triangles(body.vertices, face.loop, [&](const Vec3& p, const Vec3& q, const Vec3& r) {
        const Vec3 a = p - origin, b = q - origin, c = r - origin, all = a + b + c, n = (b - a).cross(c - a) / 2;
        const Real area = n.norm();
        sum += n;
        first += area / 3 * all;
        second += area / 12 * (a * a.transpose() + b * b.transpose() + c * c.transpose() + all * all.transpose());
        s.area += area;
      });
    }
    if (s.area == 0) continue;
    const Vec3 middle = first / s.area;
    s.centre = origin + middle;
    s.normal = sum.normalized();
    s.second = second - s.area * (middle * middle.transpose());
  }
  std::vector<CellInterface> out;
  for (auto& [pair, s] : found)
    if (s.area > 0) out.push_back(std::move(s));
  return out;
}

}  // namespace

Index FracturedBody::cell_at(const Vec3& p) const {
  Index best = 0;
  Real least = std::numeric_limits<Real>::infinity(), nearest = least;
  for (Index c = 0; c < cells.size(); ++c) {
    Real out = -std::numeric_limits<Real>::infinity();
    for (const CellRegion::Side& side : regions[cells[c].region].sides) out = std::max(out, side.normal.dot(p) - side.offset);
    if (regions[cells[c].region].sides.empty()) out = 0;
    const Real far = (cells[c].mass.centre - p).norm();
    if (out < least || (out == least && far < nearest)) best = c, least = out, nearest = far;
  }
  return best;
}

FracturedBody fracture(const TriMesh& given, std::span<const CellRegion> regions) {
  ZONE("fracture.cut");
  CHECK(!regions.empty());
  const CollisionMesh checked(given);
  if (!checked.solid()) throw InputError(Place{}, "the mesh is open or folds back on itself: one that is to break must enclose a volume; shape = \"hull\" would do");
  const TriMesh& mesh = checked.mesh();
  const Real size = bounds(mesh).diagonal().norm(), tolerance = kWeld * size;
  if (const auto crossing = self_intersections(mesh); !crossing.empty())
    throw InputError(Place{}, fmt::format("the mesh cuts through itself ({} pairs of triangles, {} and {} the first): one that is to break must not; shape = \"hull\" would do", crossing.size(),
                                          crossing[0][0], crossing[0][1]));

  // What of the body lies in each region.
  const bool convex = checked.report().parts == 1 && is_convex(mesh, kConvex * size);
  std::vector<std::vector<ClipPolygon>> cut(regions.size());
  if (convex) {
    std::vector<ClipPolygon> whole;
    for (const Triangle& t : mesh.triangles) whole.push_back({{mesh.positions[t[0]], mesh.positions[t[1]], mesh.positions[t[2]]}, kOuterFace});
    parallel_for(
        regions.size(),
        [&](std::size_t r) {
          cut[r] = whole;
          for (Index k = 0; k < regions[r].sides.size(); ++k) clip(cut[r], regions[r].sides[k].normal, regions[r].sides[k].offset, k, 1e-12 * size);
        },
        4);
  } else {
    cut = cut_mesh(mesh, regions);
  }

  // Faces over shared vertices; one that has several regions behind it is divided among them.
  FracturedBody body;
  body.regions.assign(regions.begin(), regions.end());
  body.volume = signed_volume(mesh);
  Pool pool(tolerance);
  struct Loose {
    std::vector<Index> loop;
    Index beyond;  // region
  };
  std::vector<std::vector<Loose>> loose(regions.size());
  const auto add = [&](std::size_t r, const std::vector<Vec3>& corners, Index beyond) {
    Loose face{{}, beyond};
    for (const Vec3& p : corners)
      if (const Index i = pool.add(p); std::find(face.loop.begin(), face.loop.end(), i) == face.loop.end()) face.loop.push_back(i);
    if (face.loop.size() >= 3) loose[r].push_back(std::move(face));
  };
  for (std::size_t r = 0; r < regions.size(); ++r)
    for (const ClipPolygon& polygon : cut[r]) {
      if (polygon.side == kOuterFace) {
        add(r, polygon.corners, kOuterFace);
        continue;
      }
      const std::vector<Index>& beyond = regions[r].sides[polygon.side].beyond;
      for (const Index other : beyond) {
        std::vector<Vec3> part = polygon.corners;
        if (beyond.size() > 1)
          for (const CellRegion::Side& side : regions[other].sides)
            if (std::abs(side.normal.dot(regions[r].sides[polygon.side].normal)) < 1 - 1e-9) clip(part, side.normal, side.offset, 1e-12 * size);
        add(r, part, other);
      }
    }
  body.vertices = std::move(pool.points);

  // Cells: what hangs together in a region.
  std::vector<std::vector<Index>> cells_of(regions.size());
  for (std::size_t r = 0; r < regions.size(); ++r) {
    std::vector<std::vector<Index>> loops;
    for (const Loose& face : loose[r]) loops.push_back(face.loop);
    for (const std::vector<std::size_t>& faces : connected(loops)) {
      FractureCell cell;
      cell.region = static_cast<Index>(r);
      for (const std::size_t f : faces) cell.faces.push_back({loose[r][f].loop, loose[r][f].beyond});
      cells_of[r].push_back(static_cast<Index>(body.cells.size()));
      body.cells.push_back(std::move(cell));
    }
  }
  // The region behind a face becomes the cell there.
  const std::vector<FractureCell> by_region = body.cells;
  for (FractureCell& cell : body.cells)
    for (CellFace& face : cell.faces) {
      if (face.beyond == kOuterFace) continue;
      const std::vector<Index>& candidates = cells_of[face.beyond];
      Index behind = candidates.size() == 1 ? candidates[0] : kOuterFace;
      if (candidates.size() > 1) {
        const Vec3 middle = mean_of(body.vertices, face.loop);
        for (const Index c : candidates)
          for (const CellFace& other : by_region[c].faces)
            if (other.beyond == cell.region && holds(body.vertices, other.loop, middle, 1e-7 * size)) behind = c;
      }
      face.beyond = behind;
    }

  // Corners of neighbours on a face's edges are its corners, too.
  std::vector<std::vector<Index>> corners(body.cells.size());
  for (std::size_t c = 0; c < body.cells.size(); ++c) {
    for (const CellFace& face : body.cells[c].faces) corners[c].insert(corners[c].end(), face.loop.begin(), face.loop.end());
    std::sort(corners[c].begin(), corners[c].end());
    corners[c].erase(std::unique(corners[c].begin(), corners[c].end()), corners[c].end());
  }
  parallel_for(
      body.cells.size(),
      [&](std::size_t c) {
        FractureCell& cell = body.cells[c];
        std::vector<Index> near = corners[c];
        for (const CellFace& face : cell.faces)
          if (face.beyond != kOuterFace) near.insert(near.end(), corners[face.beyond].begin(), corners[face.beyond].end());
        std::sort(near.begin(), near.end());
        near.erase(std::unique(near.begin(), near.end()), near.end());
        for (CellFace& face : cell.faces) insert_corners(body.vertices, face.loop, near, 2 * tolerance);
        TriMesh surface;
        for (const CellFace& face : cell.faces)
          for_triangles(body.vertices, face.loop, [&](const Vec3& p, const Vec3& q, const Vec3& s) {
            const auto first = static_cast<Index>(surface.positions.size());
            surface.positions.insert(surface.positions.end(), {p, q, s});
            surface.triangles.push_back({first, first + 1, first + 2});
          });
        cell.mass = mass_properties(surface);
        cell.convex = convex || is_convex(surface, 1e-7 * size);
      },
      4);
  Real sum = 0;
  for (const FractureCell& cell : body.cells) sum += cell.mass.volume;
  if (!(std::abs(sum - body.volume) <= kFills * body.volume))
    throw InputError(Place{}, fmt::format("the cells fill {:.12g} of {:.12g} m3: the mesh cannot be cut cleanly here; another cell_seed or shape = \"hull\" would do", sum, body.volume));
  body.interfaces = find_interfaces(body);
  return body;
}

TriMesh surface_of(const FracturedBody& body, std::span<const Index> which) {
  std::vector<std::uint8_t> in(body.cells.size(), 0);
  for (const Index c : which) in[c] = 1;
  TriMesh mesh;
  VertexAttribute inner;
  for (const Index c : which)
    for (const CellFace& face : body.cells[c].faces) {
      if (face.beyond != kOuterFace && in[face.beyond]) continue;
      const Vec3 n = area_vector(body.vertices, face.loop).normalized();
      for_triangles(body.vertices, face.loop, [&](const Vec3& p, const Vec3& q, const Vec3& r) {
        const auto first = static_cast<Index>(mesh.positions.size());
        mesh.triangles.push_back({first, first + 1, first + 2});
        for (const Vec3& corner : {p, q, r}) {
          mesh.positions.push_back(corner);
          mesh.normals.push_back(n);
          inner.values.push_back(face.beyond == kOuterFace ? 0.0f : 1.0f);
        }
      });
    }
  mesh.attributes["inner"] = std::move(inner);
  return mesh;
}

MassProperties mass_of(const FracturedBody& body, std::span<const Index> which) {
  MassProperties all;
  Vec3 first = Vec3::Zero();
  for (const Index c : which) {
    all.volume += body.cells[c].mass.volume;
    first += body.cells[c].mass.volume * (body.cells[c].mass.centre - body.cells[which[0]].mass.centre);
  }
  all.centre = body.cells[which[0]].mass.centre + first / all.volume;
  for (const Index c : which) {
    const Vec3 r = body.cells[c].mass.centre - all.centre;
    all.inertia += body.cells[c].mass.inertia + body.cells[c].mass.volume * (r.squaredNorm() * Mat3::Identity() - r * r.transpose());
  }
  return all;
}

}  // namespace effuse::geometry
