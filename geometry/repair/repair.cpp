#include "geometry/repair/repair.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "geometry/base/zones.h"
#include "geometry/mesh/measure.h"
#include "geometry/mesh/weld.h"
#include "geometry/repair/repair_internal.h"

namespace effuse::geometry {

bool RepairReport::changed() const {
  return welded_vertices + stitched_vertices + unused_vertices + collapsed_triangles + flat_triangles + duplicate_triangles + inner_walls + parted_edges +
             split_vertices + midpoint_vertices + cut_edges + turned_triangles + filled_holes >
         0;
}

bool sound(const MeshReport& r) { return r.manifold() && r.oriented() && r.repeated_indices == 0 && r.zero_area == 0 && r.unused_vertices == 0; }

std::vector<std::string> to_lines(const RepairReport& r) {
  std::vector<std::string> lines;
  const auto add = [&](std::size_t n, const char* one, const char* many) {
    if (n > 0) lines.push_back(fmt::format("{} {}", n, n == 1 ? one : many));
  };
  add(r.welded_vertices, "vertex welded to another at the same place", "vertices welded to others at the same place");
  add(r.stitched_vertices, "border vertex stitched to another a hair away", "border vertices stitched to others a hair away");
  add(r.unused_vertices, "vertex that no triangle used dropped", "vertices that no triangle used dropped");
  add(r.collapsed_triangles, "triangle with two corners at one place dropped", "triangles with two corners at one place dropped");
  add(r.flat_triangles, "triangle of no area taken out", "triangles of no area taken out");
  add(r.duplicate_triangles, "duplicate triangle dropped", "duplicate triangles dropped");
  add(r.inner_walls, "pair of triangles back to back between two solids dropped", "pairs of triangles back to back between two solids dropped");
  add(r.parted_edges, "edge of more than two triangles parted", "edges of more than two triangles parted");
  add(r.split_vertices, "vertex added where sheets touch", "vertices added where sheets touch");
  add(r.midpoint_vertices, "vertex added in the middle of an edge that a sheet runs along twice", "vertices added in the middle of edges that a sheet runs along twice");
  add(r.cut_edges, "edge cut open, because the surface has one side only", "edges cut open, because the surface has one side only");
  add(r.turned_triangles, "triangle turned over", "triangles turned over");
  if (r.filled_holes > 0)
    lines.push_back(fmt::format("{} {} filled with {} triangles", r.filled_holes, r.filled_holes == 1 ? "hole" : "holes", r.hole_triangles));
  if (r.dropped_normals) lines.push_back("vertex normals dropped: they did not fit the new mesh");
  return lines;
}

EdgeList edges_of(const TriMesh& mesh) {
  struct Entry {
    Index low, high;
    Side side;
  };
  std::vector<Entry> entries(3 * mesh.triangles.size());
  for (Side s = 0; s < entries.size(); ++s) {
    const Index a = from_of(mesh, s), b = to_of(mesh, s);
    entries[s] = {std::min(a, b), std::max(a, b), s};
  }
  std::sort(entries.begin(), entries.end(), [](const Entry& p, const Entry& q) { return p.low != q.low ? p.low < q.low : p.high != q.high ? p.high < q.high : p.side < q.side; });
  EdgeList edges;
  edges.sides.resize(entries.size());
  for (std::size_t k = 0; k < entries.size(); ++k) {
    if (k == 0 || entries[k].low != entries[k - 1].low || entries[k].high != entries[k - 1].high) edges.start.push_back(k);
    edges.sides[k] = entries[k].side;
  }
  edges.start.push_back(entries.size());
  return edges;
}

Index copy_vertex(TriMesh& mesh, Index v) {
  const Index one[] = {v};
  return mean_vertex(mesh, one);
}

Index mean_vertex(TriMesh& mesh, std::span<const Index> of) {
  const Real n = static_cast<Real>(of.size());
  const auto number = static_cast<Index>(mesh.positions.size());
  Vec3 position = Vec3::Zero();
  for (const Index v : of) position += mesh.positions[v];
  mesh.positions.push_back(of.size() == 1 ? mesh.positions[of[0]] : Vec3(position / n));
  if (!mesh.normals.empty()) mesh.normals.push_back(mesh.normals[of[0]]);
  for (auto& [name, attribute] : mesh.attributes) {
    const auto width = static_cast<std::size_t>(attribute.width);
    for (std::size_t k = 0; k < width; ++k) {
      Real sum = 0;
      for (const Index v : of) sum += attribute.values[v * width + k];
      attribute.values.push_back(static_cast<float>(sum / n));
    }
  }
  return number;
}

void drop_last_vertex(TriMesh& mesh) {
  mesh.positions.pop_back();
  if (!mesh.normals.empty()) mesh.normals.pop_back();
  for (auto& [name, attribute] : mesh.attributes) attribute.values.resize(mesh.positions.size() * static_cast<std::size_t>(attribute.width));
}

namespace {

/// Whether some closed component faces inward without lying in another: then the winding is wrong though consistent.
bool faces_outward(const TriMesh& mesh) {
  TriMesh copy;
  copy.positions = mesh.positions;
  copy.triangles = mesh.triangles;
  Turned turned{std::vector<char>(mesh.triangles.size(), 0)};
  RepairReport ignored;
  face_outward(copy, turned, ignored);
  return std::find(turned.triangle.begin(), turned.triangle.end(), 1) == turned.triangle.end();
}

}  // namespace

RepairReport repair(TriMesh& mesh, const RepairOptions& options) {
  ZONE("mesh.repair");
  RepairReport report;
  report.before = report.after = validate(mesh);
  if (mesh.triangles.empty()) return report;
  // Solids stay as they are, even where two vertices share a place: sheets that touch.
  if (report.before.solid() && sound(report.before) && faces_outward(mesh)) return report;

  const std::vector<Vec3> normals = mesh.normals;
  const WeldReport welded = weld(mesh);
  report.welded_vertices = welded.merged_vertices;
  report.unused_vertices = welded.dropped_vertices;
  report.collapsed_triangles = welded.dropped_triangles;
  const Real diagonal = bounds(mesh).isEmpty() ? 0 : bounds(mesh).diagonal().norm();
  stitch_borders(mesh, options.stitch < 0 ? RepairOptions::kStitch * diagonal : options.stitch, report);
  drop_flat(mesh, report);
  drop_duplicates(mesh, report);
  Turned turned{std::vector<char>(mesh.triangles.size(), 0)};
  part_sheets(mesh, turned, report);
  fill_holes(mesh, options.fill_holes, turned, report);
  face_outward(mesh, turned, report);
  report.turned_triangles = static_cast<std::size_t>(std::count(turned.triangle.begin(), turned.triangle.end(), 1));

  // Vertices that nobody uses any more go. (Not by weld(): it would join the sheets again that were parted.)
  std::vector<char> used(mesh.positions.size(), 0);
  for (const Triangle& t : mesh.triangles)
    for (const Index v : t) used[v] = 1;
  std::vector<Index> target(mesh.positions.size(), 0);
  std::size_t kept = 0;
  for (std::size_t v = 0; v < used.size(); ++v) {
    if (!used[v]) continue;
    target[v] = static_cast<Index>(kept);
    mesh.positions[kept] = mesh.positions[v];
    if (!mesh.normals.empty()) mesh.normals[kept] = mesh.normals[v];
    for (auto& [name, attribute] : mesh.attributes) {
      const auto width = static_cast<std::size_t>(attribute.width);
      for (std::size_t k = 0; k < width; ++k) attribute.values[kept * width + k] = attribute.values[v * width + k];
    }
    ++kept;
  }
  report.unused_vertices += used.size() - kept - report.stitched_vertices;
  mesh.positions.resize(kept);
  if (!mesh.normals.empty()) mesh.normals.resize(kept);
  for (auto& [name, attribute] : mesh.attributes) attribute.values.resize(kept * static_cast<std::size_t>(attribute.width));
  for (Triangle& t : mesh.triangles)
    for (Index& v : t) v = target[v];

  report.after = validate(mesh);
  if (!normals.empty() && report.changed()) {
    mesh.normals.clear();
    report.dropped_normals = true;
  }
  return report;
}

}  // namespace effuse::geometry
