#include "skin/write/mesh_arrays.h"

#include <fmt/format.h>

#include <cmath>

#include "geometry/base/error.h"
#include "geometry/base/parallel.h"
#include "geometry/mesh/measure.h"

namespace effuse::skin {

using geometry::TriMesh;
using geometry::VertexAttribute;

namespace {
/// Smallest i in [0, n) with bad(i), or n.
template <class Bad>
std::size_t first(std::size_t n, Bad&& bad) {
  return parallel_reduce(
      n, n, [&](std::size_t i) { return bad(i) ? i : n; }, [](std::size_t a, std::size_t b) { return std::min(a, b); }, 4096);
}

bool finite_as_float(const Vec3& v) { return v.cast<float>().allFinite(); }
}  // namespace

void require_well_formed(const std::string& name, const TriMesh& mesh) {
  const std::size_t n = mesh.positions.size();
  const auto fail = [&](const std::string& message) { throw InputError({name}, message); };
  if (n > 0xfffffffeULL) fail(fmt::format("{} vertices, at most 4294967294 will do", n));

  std::size_t i = first(n, [&](std::size_t k) { return !finite_as_float(mesh.positions[k]); });
  if (i < n) {
    const Vec3& p = mesh.positions[i];
    fail(fmt::format("vertex {} lies at ({}, {}, {}), wanted finite numbers", i, p.x(), p.y(), p.z()));
  }
  i = first(mesh.triangles.size(), [&](std::size_t k) {
    const geometry::Triangle& t = mesh.triangles[k];
    return t[0] >= n || t[1] >= n || t[2] >= n;
  });
  if (i < mesh.triangles.size())
    fail(fmt::format("triangle {} names vertices {}, {}, {}, there are {}", i, mesh.triangles[i][0], mesh.triangles[i][1],
                     mesh.triangles[i][2], n));
  if (!mesh.normals.empty()) {
    if (mesh.normals.size() != n) fail(fmt::format("{} normals for {} vertices", mesh.normals.size(), n));
    i = first(n, [&](std::size_t k) { return !finite_as_float(mesh.normals[k]); });
    if (i < n) fail(fmt::format("the normal of vertex {} is not finite", i));
  }
  for (const auto& [key, attribute] : mesh.attributes) {
    if (attribute.width < 1) fail(fmt::format("attribute \"{}\" has width {}, wanted 1 or more", key, attribute.width));
    const std::size_t wanted = n * static_cast<std::size_t>(attribute.width);
    if (attribute.values.size() != wanted)
      fail(fmt::format("attribute \"{}\" has {} numbers, wanted {} a vertex = {}", key, attribute.values.size(), attribute.width, wanted));
    i = first(wanted, [&](std::size_t k) { return !std::isfinite(attribute.values[k]); });
    if (i < wanted)
      fail(fmt::format("attribute \"{}\" of vertex {} is {}, wanted a finite number", key, i / static_cast<std::size_t>(attribute.width),
                       attribute.values[i]));
  }
}

std::vector<Vec3> unit_normals(const TriMesh& mesh) {
  std::vector<Vec3> normals = mesh.normals;
  if (normals.empty()) {
    TriMesh bare;
    bare.positions = mesh.positions;
    bare.triangles = mesh.triangles;
    geometry::compute_normals(bare);
    normals = std::move(bare.normals);
  }
  parallel_for(normals.size(), [&](std::size_t i) {
    const Real length = normals[i].norm();
    normals[i] = length > 0 ? Vec3(normals[i] / length) : Vec3(0, 0, 1);
  });
  return normals;
}

const VertexAttribute* find_color(const TriMesh& mesh) {
  const auto found = mesh.attributes.find("color");
  return found != mesh.attributes.end() && found->second.width == 3 ? &found->second : nullptr;
}

std::string one_line(const std::string& text) {
  std::string line = text;
  for (char& c : line)
    if (static_cast<unsigned char>(c) < 0x20 || c == 0x7f) c = ' ';
  return line;
}

}  // namespace effuse::skin
