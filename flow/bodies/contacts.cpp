#include "flow/bodies/contacts.h"

#include <algorithm>
#include <cmath>

#include "geometry/collide/convex_contact.h"
#include "geometry/collide/swept.h"

namespace effuse::flow::bodies {

using geometry::ManifoldPoint;
using Kind = Shape::Kind;

namespace {

constexpr Real kSlop = 1e-3;        ///< of the smaller bounding radius: below it a face is as good as a pair of edges
constexpr Real kSameNormal = 0.95;  ///< cosine: places whose normals are nearer than 18 deg hold the same side up
constexpr std::size_t kPlacesASide = 5;  ///< of many samples on one side so many stay
constexpr std::size_t kSides = 8;
constexpr int kMarches = 64;        ///< of conservative advancement
constexpr Real kTouching = 1e-3;    ///< of the radius: nearer is a touch

/// A place found by a point of one body against the surface of another, not yet told which is a.
struct Probe {
  Vec3 sample, surface, outward;  // in the world; outward from the surface's body
  Real distance;
};

/// The surface of B as seen from p, when it is within reach. viewer: the middle of whom p belongs to; it says which side of a sheet is
/// the outer one, also for a point that has passed it.
bool probe(const PlacedShape& B, const Vec3& p, const Vec3& viewer, Real reach, Probe& out) {
  switch (B.shape->kind()) {
    case Kind::kSphere: {
      const Vec3 d = p - B.x;
      const Real length = d.norm();
      out.outward = length > 0 ? Vec3(d / length) : Vec3::UnitZ();
      out.distance = length - B.shape->radius();
      out.surface = B.x + B.shape->radius() * out.outward;
      break;
    }
    case Kind::kHull:
    case Kind::kParts: {
      geometry::HullPoint at = geometry::nearest_on_hull(B.hulls[0], p);
      for (std::size_t k = 1; k < B.hulls.size(); ++k)
        if (const geometry::HullPoint other = geometry::nearest_on_hull(B.hulls[k], p); other.distance < at.distance) at = other;
      out.outward = at.normal;
      out.distance = at.distance;
      out.surface = at.point;
      break;
    }
    case Kind::kMesh: {
      const auto at = B.shape->collision_mesh().nearest(B.R.transpose() * (p - B.x), reach);
      if (!at) return false;
      out.outward = B.R * at->normal;
      out.surface = B.x + B.R * at->point;
      out.distance = at->distance;
      if (!at->solid && (viewer - out.surface).dot(out.outward) < 0) {
        out.outward = -out.outward;
        out.distance = -out.distance;
      }
      break;
    }
  }
  out.sample = p;
  return out.distance <= reach;
}

/// Of places on the same side so many stay as hold it up: the deepest, and in turn those furthest from all chosen.
void thin_out(std::vector<Probe>& found) {
  if (found.size() <= kPlacesASide) return;
  std::vector<Probe> kept;
  std::vector<bool> taken(found.size(), false);
  for (std::size_t side = 0; side < kSides; ++side) {
    std::size_t deepest = found.size();
    for (std::size_t k = 0; k < found.size(); ++k)
      if (!taken[k] && (deepest == found.size() || found[k].distance < found[deepest].distance)) deepest = k;
    if (deepest == found.size()) break;
    const Vec3 direction = found[deepest].outward;
    std::vector<std::size_t> members;
    std::vector<Real> apart;  // squared, from the nearest chosen
    for (std::size_t k = 0; k < found.size(); ++k)
      if (!taken[k] && found[k].outward.dot(direction) > kSameNormal) {
        members.push_back(k);
        apart.push_back((found[k].sample - found[deepest].sample).squaredNorm());
        taken[k] = true;
      }
    taken[deepest] = true;
    kept.push_back(found[deepest]);
    for (std::size_t count = 1; count < kPlacesASide; ++count) {
      const std::size_t furthest = static_cast<std::size_t>(std::max_element(apart.begin(), apart.end()) - apart.begin());
      if (apart.empty() || apart[furthest] <= 0) break;
      const Probe& chosen = found[members[furthest]];
      kept.push_back(chosen);
      for (std::size_t k = 0; k < members.size(); ++k)
        apart[k] = std::min(apart[k], (found[members[k]].sample - chosen.sample).squaredNorm());
    }
  }
  found.swap(kept);
}

void append(Index a, const PlacedShape& A, Index b, const PlacedShape* B, const Vec3& on_a, const Vec3& on_b, const Vec3& normal,
            Real separation, Real of_a, std::vector<ContactPoint>& out) {
  ContactPoint point;
  point.a = a;
  point.b = b;
  point.on_a = A.anchor(on_a - A.x);
  point.on_b = B ? B->anchor(on_b - B->x) : on_b;
  point.normal = normal;
  point.separation = separation;
  point.of_a = of_a;
  out.push_back(point);
}

/// Places found by samples of A (sampled_a) or of B on the surface of the other.
void append_probes(Index a, const PlacedShape& A, Index b, const PlacedShape* B, const std::vector<Probe>& found, bool sampled_a,
                   std::vector<ContactPoint>& out) {
  for (const Probe& f : found) {
    if (sampled_a)
      append(a, A, b, B, f.sample, f.surface, -f.outward, f.distance, 1, out);
    else
      append(a, A, b, B, f.surface, f.sample, f.outward, f.distance, 0, out);
  }
}

/// Samples of S that may be near T, against T's surface.
void probe_samples(const PlacedShape& S, const PlacedShape& T, Real margin, std::vector<Probe>& found) {
  found.clear();
  Probe p;
  const std::vector<Vec3>& samples = S.shape->samples();
  const auto ask = [&](Index i) {
    if (probe(T, S.x + S.R * samples[i], S.x, margin, p)) found.push_back(p);
  };
  if (S.shape->kind() == Kind::kMesh) {
    // T's box, seen from S.
    Box3 box = T.shape->bounds(S.R.transpose() * (T.x - S.x), S.R.transpose() * T.R);
    box = Box3(box.min() - Vec3::Constant(margin), box.max() + Vec3::Constant(margin));
    S.shape->sample_grid().near(box, ask);
  } else {
    for (Index i = 0; i < samples.size(); ++i) ask(i);
  }
  thin_out(found);
}

/// A sphere against anything that answers ask(point, reach, probe): the nearest surface to its centre, and those nearest to
/// where it touched before.
template <class Ask>
void probe_sphere(const PlacedShape& S, bool sphere_is_a, std::span<const ContactPoint> before, Real margin, Ask&& ask, std::vector<Probe>& found) {
  const Real r = S.shape->radius();
  found.clear();
  const auto accept = [&](Probe p, bool as_seen) {
    // As seen from the centre; a place found from elsewhere is not its nearest, so the direction is that to the place.
    if (!as_seen) {
      const Vec3 d = S.x - p.surface;
      if (p.distance < 0 || d.norm() == 0) return;
      p.distance = d.norm();
      p.outward = d / p.distance;
    }
    p.distance -= r;
    p.sample = S.x - r * p.outward;
    if (p.distance > margin) return;
    for (const Probe& other : found)
      if (other.outward.dot(p.outward) > kSameNormal) return;
    found.push_back(p);
  };
  Probe p;
  if (ask(S.x, r + margin, p)) accept(p, true);
  for (const ContactPoint& old : before) {
    const Vec3 toward = sphere_is_a ? old.normal : Vec3(-old.normal);
    if (ask(S.x + 0.9 * r * toward, 0.1 * r + margin, p)) accept(p, false);
  }
}

/// Every part of A against every part of B whose boxes come within the margin.
void collide_parts(Index a, const PlacedShape& A, Index b, const PlacedShape& B, Real margin, std::vector<ContactPoint>& out) {
  const auto box_of = [](const PlacedShape& S, std::size_t k) { return S.boxes.empty() ? S.shape->bounds(S.x, S.R) : S.boxes[k]; };
  const Real slop = kSlop * std::min(A.shape->bounding_radius(), B.shape->bounding_radius());
  const std::size_t na = std::max<std::size_t>(A.hulls.size(), 1), nb = std::max<std::size_t>(B.hulls.size(), 1);
  Box3 whole_b = B.shape->bounds(B.x, B.R);
  whole_b = Box3(whole_b.min() - Vec3::Constant(margin), whole_b.max() + Vec3::Constant(margin));
  for (std::size_t i = 0; i < na; ++i) {
    Box3 near = box_of(A, i);
    if (!near.intersects(whole_b)) continue;
    near = Box3(near.min() - Vec3::Constant(margin), near.max() + Vec3::Constant(margin));
    for (std::size_t j = 0; j < nb; ++j) {
      if (!near.intersects(box_of(B, j))) continue;
      geometry::Manifold m;
      if (A.hulls.empty()) {
        m = geometry::hull_sphere_contact(B.hulls[j], A.x, A.shape->radius(), margin);
        m.normal = -m.normal;
        std::swap(m.points[0].on_a, m.points[0].on_b);
        m.points[0].of_a = 1;
      } else if (B.hulls.empty()) {
        m = geometry::hull_sphere_contact(A.hulls[i], B.x, B.shape->radius(), margin);
      } else {
        m = geometry::hull_contact(A.hulls[i], B.hulls[j], margin, slop);
      }
      for (const ManifoldPoint& p : m.all()) append(a, A, b, &B, p.on_a, p.on_b, m.normal, p.separation, p.of_a, out);
    }
  }
}

}  // namespace

void PlacedShape::place(const Shape& s, const Vec3& centre, const Mat3& orientation) {
  shape = &s;
  x = centre;
  R = orientation;
  hulls.resize(s.hulls().size());
  boxes.resize(hulls.size() > 1 ? hulls.size() : 0);
  for (std::size_t k = 0; k < hulls.size(); ++k) geometry::transform_into(s.hulls()[k], R, x, hulls[k]);
  for (std::size_t k = 0; k < boxes.size(); ++k) {
    boxes[k].setEmpty();
    for (const Vec3& v : hulls[k].vertices) boxes[k].extend(v);
  }
}

GroundShape::GroundShape(geometry::Terrain terrain) : terrain_(std::move(terrain)) {
  if (const geometry::HeightField* field = terrain_.height_field()) {
    spacing_ = field->spacing().minCoeff();
  } else {
    const auto& points = terrain_.mesh().positions;
    grid_ = PointGrid(points);
    const Vec3 extent = terrain_.bounds().sizes();
    spacing_ = std::sqrt(extent.x() * extent.y() / static_cast<Real>(std::max<std::size_t>(points.size(), 1)));
  }
}

template <class F>
void GroundShape::points_near(const Box3& box, F&& f) const {
  const geometry::HeightField* field = terrain_.height_field();
  if (!field) {
    grid_.near(box, [&](Index i) { f(terrain_.mesh().positions[i]); });
    return;
  }
  const Vec2 corner = field->corner(), spacing = field->spacing();
  const auto range = [&](int k, int n) {
    const Real low = std::ceil((box.min()[k] - corner[k]) / spacing[k]), high = std::floor((box.max()[k] - corner[k]) / spacing[k]);
    return std::pair(static_cast<int>(std::clamp(low, Real{0}, Real(n))), static_cast<int>(std::clamp(high, Real{-1}, Real(n - 1))));
  };
  const auto [i0, i1] = range(0, field->nx());
  const auto [j0, j1] = range(1, field->ny());
  for (int j = j0; j <= j1; ++j)
    for (int i = i0; i <= i1; ++i) {
      const Real z = field->post(i, j);
      if (z >= box.min().z() && z <= box.max().z()) f(Vec3(corner.x() + i * spacing.x(), corner.y() + j * spacing.y(), z));
    }
}

void collide(Index a, const PlacedShape& A, Index b, const PlacedShape& B, std::span<const ContactPoint> before, std::vector<ContactPoint>& out) {
  const Real margin = std::max(A.margin, B.margin);
  const Kind ka = A.shape->kind(), kb = B.shape->kind();
  if (ka == Kind::kParts || kb == Kind::kParts) {
    if (ka != Kind::kMesh && kb != Kind::kMesh) {
      collide_parts(a, A, b, B, margin, out);
      return;
    }
  } else if (ka != Kind::kMesh && kb != Kind::kMesh) {
    geometry::Manifold m;
    if (ka == Kind::kSphere && kb == Kind::kSphere) {
      m = geometry::sphere_contact(A.x, A.shape->radius(), B.x, B.shape->radius(), margin);
    } else if (kb == Kind::kSphere) {
      m = geometry::hull_sphere_contact(A.hulls[0], B.x, B.shape->radius(), margin);
    } else if (ka == Kind::kSphere) {
      m = geometry::hull_sphere_contact(B.hulls[0], A.x, A.shape->radius(), margin);
      m.normal = -m.normal;
      std::swap(m.points[0].on_a, m.points[0].on_b);
      m.points[0].of_a = 1;
    } else {
      const Real slop = kSlop * std::min(A.shape->bounding_radius(), B.shape->bounding_radius());
      m = geometry::hull_contact(A.hulls[0], B.hulls[0], margin, slop);
    }
    for (const ManifoldPoint& p : m.all()) append(a, A, b, &B, p.on_a, p.on_b, m.normal, p.separation, p.of_a, out);
    return;
  }

  std::vector<Probe> found;
  if (ka == Kind::kSphere || kb == Kind::kSphere) {
    const bool sphere_is_a = ka == Kind::kSphere;
    const PlacedShape &S = sphere_is_a ? A : B, &T = sphere_is_a ? B : A;
    probe_sphere(S, sphere_is_a, before, margin, [&](const Vec3& p, Real reach, Probe& at) { return probe(T, p, S.x, reach, at); }, found);
    append_probes(a, A, b, &B, found, sphere_is_a, out);
    if (S.shape->radius() < T.shape->bounding_radius() / 1e3) return;  // no corner of T sticks into a grain
  } else {
    probe_samples(A, B, margin, found);
    append_probes(a, A, b, &B, found, true, out);
    probe_samples(B, A, margin, found);
    append_probes(a, A, b, &B, found, false, out);
  }
}

void collide_terrain(Index a, const PlacedShape& A, const GroundShape& ground, std::span<const ContactPoint> before, std::vector<ContactPoint>& out) {
  const geometry::Terrain& terrain = ground.terrain();
  const Real bound = A.shape->bounding_radius();
  const auto ask = [&](const Vec3& p, Real reach, Probe& at) {
    const geometry::Contact c = terrain.contact(p, reach);
    at = {p, c.point, c.normal, c.distance};
    return c.any() && c.distance <= reach;
  };
  std::vector<Probe> found;
  if (A.shape->kind() == Kind::kSphere) {
    probe_sphere(A, true, before, A.margin, ask, found);
    append_probes(a, A, kTerrain, nullptr, found, true, out);
    return;
  }

  Probe p;
  if (!ask(A.x, bound + A.margin, p) && terrain.bounds().contains(A.x)) return;
  const bool fine = ground.finer_than(2 * bound);
  if (A.shape->kind() == Kind::kParts) {
    // Each part stands on its own corners: a wall on five places in all would be loaded as no wall is.
    for (std::size_t k = 0; k < A.hulls.size(); ++k) {
      const Vec3 middle = A.boxes[k].center();
      if (!ask(middle, A.boxes[k].diagonal().norm() / 2 + A.margin, p) && terrain.bounds().contains(middle)) continue;
      found.clear();
      for (const Vec3& corner : A.hulls[k].vertices)
        if (ask(corner, A.margin, p)) found.push_back(p);
      thin_out(found);
      append_probes(a, A, kTerrain, nullptr, found, true, out);
    }
  } else {
    const std::vector<Vec3>& samples = A.shape->samples();
    const std::size_t count = fine ? samples.size() : A.shape->corners();
    for (std::size_t i = 0; i < count; ++i)
      if (ask(A.x + A.R * samples[i], A.margin, p)) found.push_back(p);
    thin_out(found);
    append_probes(a, A, kTerrain, nullptr, found, true, out);
  }
  if (!fine) return;

  // Points of the ground that stick into the body. One pushes it the way out of its side only if that is a way out of the ground, too: a post of
  // flat ground just before a side is no peak that could stop it.
  const Real step_out = 1e-3 * bound;
  found.clear();
  Box3 box = A.shape->bounds(A.x, A.R);
  box = Box3(box.min() - Vec3::Constant(A.margin), box.max() + Vec3::Constant(A.margin));
  ground.points_near(box, [&](const Vec3& point) {
    if (!probe(A, point, point, A.margin, p)) return;
    const geometry::Contact out_there = terrain.contact(point - step_out * p.outward, 2 * step_out);
    if (!out_there.any() || out_there.distance >= 0.9999 * step_out) found.push_back(p);
  });
  thin_out(found);
  append_probes(a, A, kTerrain, nullptr, found, false, out);
}

void hand_on(std::span<const ContactPoint> before, std::span<ContactPoint> now, Real tolerance) {
  for (ContactPoint& point : now) {
    const ContactPoint* same = nullptr;
    Real nearest = tolerance * tolerance;
    for (const ContactPoint& old : before) {
      // A place slides over one of the two, at most: a corner over a face.
      const Real d = std::min((old.on_a - point.on_a).squaredNorm(), (old.on_b - point.on_b).squaredNorm());
      if (d < nearest) nearest = d, same = &old;
    }
    if (!same) continue;
    point.push = same->push;
    point.drag = same->drag - same->drag.dot(point.normal) * point.normal;
    point.twist = same->twist;
  }
}

Real first_touch(const PlacedShape& B, const geometry::RigidMotion& motion, const Vec3& x, const Vec3& d, Real radius) {
  if (B.shape->kind() == Kind::kMesh) {
    const auto impact = geometry::sweep(B.shape->collision_mesh(), motion, x, x + d, radius);
    return impact && impact->time > 0 ? impact->time : 1;
  }
  // How fast the gap may close: along the path, and by B's shift and turn.
  const Real speed = d.norm() + motion.shift().norm() + motion.turn().norm() * B.shape->bounding_radius();
  if (speed == 0) return 1;
  Real t = 0;
  for (int k = 0; k < kMarches; ++k) {
    const geometry::RigidPose pose = motion.pose(t);
    const Vec3 p = pose.body(x + t * d);
    Real distance = p.norm() - B.shape->radius();
    if (B.shape->kind() != Kind::kSphere) {
      distance = std::numeric_limits<Real>::infinity();
      for (const geometry::ConvexHull& hull : B.shape->hulls()) distance = std::min(distance, geometry::nearest_on_hull(hull, p).distance);
    }
    const Real gap = distance - radius;
    if (gap <= kTouching * radius) return t > 0 ? t : 1;
    t += gap / speed;
    if (t >= 1) return 1;
  }
  return t;
}

Real first_touch(const GroundShape& ground, const Vec3& x, const Vec3& d, Real radius) {
  const Real length = d.norm();
  if (length == 0) return 1;
  Real t = 0;
  for (int k = 0; k < kMarches; ++k) {
    const geometry::Contact c = ground.terrain().contact(x + t * d, radius + length);
    if (!c.any()) return 1;
    const Real gap = c.distance - radius;
    if (gap <= kTouching * radius) return t > 0 ? t : 1;
    t += gap / length;
    if (t >= 1) return 1;
  }
  return t;
}

}  // namespace effuse::flow::bodies
