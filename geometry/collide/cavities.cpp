#include <algorithm>
#include <cmath>

#include "geometry/collide/collision_mesh_internal.h"
#include "geometry/collide/swept.h"

namespace effuse::geometry {

using Impl = CollisionMesh::Impl;

namespace {
/// Solid angle of a triangle seen from p over 4 pi, signed (Van Oosterom & Strackee 1983, IEEE Trans. Biomed. Eng. 30, 125-126).
Real solid_angle(const Vec3& p, Vec3 a, Vec3 b, Vec3 c) {
  a -= p;
  b -= p;
  c -= p;
  const Real la = a.norm(), lb = b.norm(), lc = c.norm();
  return std::atan2(a.dot(b.cross(c)), la * lb * lc + a.dot(b) * lc + b.dot(c) * la + c.dot(a) * lb) / (2 * kPi);
}

using Corners = std::array<Vec3, 3>;
/// Whether a side of one goes through, or touches, the other.
bool cross(const Corners& s, const Corners& t) {
  for (int k = 0; k < 3; ++k) {
    if (sweep_triangle(s[k], s[(k + 1) % 3] - s[k], 0, t[0], t[1], t[2])) return true;
    if (sweep_triangle(t[k], t[(k + 1) % 3] - t[k], 0, s[0], s[1], s[2])) return true;
  }
  return false;
}
}  // namespace

/// Parts that faced inward and lie whole within one solid are turned back and joined to that: what is nearest says on which side of
/// both a point is.
void Impl::find_cavities() {
  if (turned_parts.empty()) return;
  const auto corners_of = [&](Index t) { return Corners{mesh.positions[triangles[t][0]], mesh.positions[triangles[t][1]], mesh.positions[triangles[t][2]]}; };
  const auto real = static_cast<Index>(mesh.triangles.size());  // without those of no area
  std::vector<Box3> box(is_solid.size());
  for (Index t = 0; t < real; ++t)
    for (const Vec3& x : corners_of(t)) box[part[t]].extend(x);
  BoxTree all;
  bool built = false;
  std::vector<char> taken(is_solid.size(), 0);
  for (const Index inner : turned_parts) {
    // Of the solids around it the smallest.
    const Vec3 place = mesh.positions[triangles[std::find(part.begin(), part.end(), inner) - part.begin()][0]];
    Index outer = kNobody;
    int around = 0;
    for (Index p = 0; p < is_solid.size(); ++p) {
      if (p == inner || !is_solid[p] || taken[p] || !box[p].contains(box[inner])) continue;
      Real winding = 0;
      for (Index t = 0; t < real; ++t) {
        if (part[t] != p) continue;
        const Corners c = corners_of(t);
        winding += solid_angle(place, c[0], c[1], c[2]);
      }
      if (winding < 0.5) continue;
      ++around;
      if (outer == kNobody || box[p].volume() < box[outer].volume()) outer = p;
    }
    // Within several that overlap it is no room.
    if (around != 1) continue;
    if (!built) all = triangle_tree(mesh.positions, mesh.triangles);
    built = true;
    bool free = true;
    for (Index t = 0; t < real && free; ++t) {
      if (part[t] != inner) continue;
      const Corners mine = corners_of(t);
      Box3 here;
      for (const Vec3& x : mine) here.extend(x);
      all.meeting(here, [&](Index other) { return free = part[other] == inner || !cross(mine, corners_of(other)); });
    }
    if (!free) continue;
    for (Index t = 0; t < triangles.size(); ++t) {
      if (part[t] != inner) continue;
      std::swap(triangles[t][1], triangles[t][2]);
      std::swap(across[t][0], across[t][2]);
      part[t] = outer;
    }
    taken[inner] = 1;
    --report.turned;
    --report.solids;
    --report.parts;
    ++report.cavities;
  }
  if (report.cavities > 0) renumber_sides();
}

}  // namespace effuse::geometry
