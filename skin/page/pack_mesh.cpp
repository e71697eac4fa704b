#include "skin/page/pack_mesh.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "geometry/base/check.h"
#include "geometry/base/zones.h"

namespace effuse::skin {

using geometry::TriMesh;
using geometry::Triangle;

namespace {

constexpr Index kNone = static_cast<Index>(-1);

/// Of each side of each triangle (3 t + k: from corner k to the next) the side of another triangle that shares its vertices, or none.
std::vector<Index> twins_of(const std::vector<Triangle>& triangles) {
  struct Side {
    Index low, high, at;
  };
  std::vector<Side> sides;
  sides.reserve(3 * triangles.size());
  for (std::size_t t = 0; t < triangles.size(); ++t)
    for (std::size_t k = 0; k < 3; ++k) {
      const auto [low, high] = std::minmax(triangles[t][k], triangles[t][(k + 1) % 3]);
      sides.push_back({low, high, static_cast<Index>(3 * t + k)});
    }
  std::sort(sides.begin(), sides.end(), [](const Side& a, const Side& b) { return std::tie(a.low, a.high, a.at) < std::tie(b.low, b.high, b.at); });
  std::vector<Index> twin(3 * triangles.size(), kNone);
  // Where more than two meet, they are paired as they come: any pairing will do for an order.
  for (std::size_t i = 0; i + 1 < sides.size(); ++i)
    if (sides[i].low == sides[i + 1].low && sides[i].high == sides[i + 1].high) {
      twin[sides[i].at] = sides[i + 1].at;
      twin[sides[i + 1].at] = sides[i].at;
      ++i;
    }
  return twin;
}

/// The triangles from neighbour to neighbour, round vertices where that goes on: depth first, the left side last.
std::vector<Index> walk(const std::vector<Triangle>& triangles) {
  const std::vector<Index> twin = twins_of(triangles);
  std::vector<Index> order, stack;
  order.reserve(triangles.size());
  std::vector<char> seen(triangles.size(), 0);
  for (std::size_t first = 0; first < triangles.size(); ++first) {
    if (seen[first]) continue;
    stack.push_back(static_cast<Index>(3 * first));
    while (!stack.empty()) {
      const Index side = stack.back(), t = side / 3;
      stack.pop_back();
      if (seen[t]) continue;
      seen[t] = 1;
      order.push_back(t);
      for (const Index step : {Index{1}, Index{2}}) {
        const Index next = twin[3 * t + (side + step) % 3];
        if (next != kNone && !seen[next / 3]) stack.push_back(next);
      }
    }
  }
  return order;
}

/// What the reader works out for itself: numbers of vertices by first use, and the parents of each.
struct Order {
  std::vector<Index> vertex;                     // new number -> old
  std::vector<std::pair<Index, Index>> parents;  // new numbers, smaller than its own
  std::string codes;
};

void append_varint(std::string& out, Index value) {
  for (; value >= 128; value >>= 7) out.push_back(static_cast<char>(value | 128));
  out.push_back(static_cast<char>(value));
}

Order order_of(const TriMesh& mesh) {
  Order order;
  std::vector<Index> number(mesh.positions.size(), kNone);
  for (const Index t : walk(mesh.triangles)) {
    Triangle corner = mesh.triangles[t];
    // New ones last: turned, so that it faces the way it did.
    const auto is_new = [&](std::size_t k) { return number[corner[k]] == kNone; };
    for (int turn = 0; turn < 2 && (is_new(0) ? !(is_new(1) && is_new(2)) : is_new(1) && !is_new(2)); ++turn) std::rotate(corner.begin(), corner.begin() + 1, corner.end());
    std::array<Index, 3> now{};
    for (std::size_t k = 0; k < 3; ++k) {
      Index& n = number[corner[k]];
      const auto next = static_cast<Index>(order.vertex.size());
      append_varint(order.codes, n == kNone ? 0 : next - n);
      if (n == kNone) {
        const Index before = next == 0 ? 0 : next - 1;
        order.parents.emplace_back(k == 0 ? before : now[0], k == 0 ? before : k == 1 ? now[0] : now[1]);
        order.vertex.push_back(corner[k]);
        n = next;
      }
      now[k] = n;
    }
  }
  return order;
}

/// A unit vector on the octahedron unfolded to a square, as two bytes.
/// Source: Meyer, Suessmuth, Sussner, Stamminger & Greiner 2010, On floating-point normal vectors, Computer Graphics Forum 29.
std::array<std::uint8_t, 2> octahedral(const Vec3& normal) {
  const Vec3 n = normal / std::max(normal.cwiseAbs().sum(), 1e-30);
  Vec2 p = n.head<2>();
  if (n.z() < 0) p = Vec2((1 - std::abs(n.y())) * (n.x() < 0 ? -1 : 1), (1 - std::abs(n.x())) * (n.y() < 0 ? -1 : 1));
  const auto byte = [](Real v) { return static_cast<std::uint8_t>(std::clamp(std::lround((v + 1) * 127.5), 0L, 255L)); };
  return {byte(p.x()), byte(p.y())};
}

std::uint16_t zigzag(std::uint16_t difference) {
  return static_cast<std::uint16_t>((difference << 1) ^ ((difference & 0x8000) ? 0xffff : 0));
}

/// Differences of 16 bit numbers, given in the new order: low bytes, then high bytes.
void append_words(std::string& out, const std::vector<std::uint16_t>& values, const Order& order) {
  const std::size_t n = values.size(), at = out.size();
  out.resize(at + 2 * n);
  for (std::size_t v = 0; v < n; ++v) {
    const auto [a, b] = order.parents[v];
    const unsigned mean = v == 0 ? 0u : (unsigned{values[a]} + values[b]) >> 1;
    const std::uint16_t code = zigzag(static_cast<std::uint16_t>(values[v] - mean));
    out[at + v] = static_cast<char>(code & 255);
    out[at + n + v] = static_cast<char>(code >> 8);
  }
}

void append_bytes_of(std::string& out, const std::vector<std::uint8_t>& values, const Order& order) {
  for (std::size_t v = 0; v < values.size(); ++v) {
    const auto [a, b] = order.parents[v];
    const unsigned mean = v == 0 ? 0u : (unsigned{values[a]} + values[b]) >> 1;
    out.push_back(static_cast<char>(static_cast<std::uint8_t>(values[v] - mean)));
  }
}

}  // namespace

PackedMesh pack_mesh(const TriMesh& mesh, const std::vector<BytePlane>& planes) {
  ZONE("page.pack");
  CHECK_EQ(mesh.normals.size(), mesh.positions.size());
  for (const Triangle& t : mesh.triangles)
    for (const Index v : t) CHECK(v < mesh.positions.size());
  for (const BytePlane& plane : planes) CHECK_EQ(plane.values.size(), mesh.positions.size());

  const Order order = order_of(mesh);
  PackedMesh packed;
  packed.vertices = order.vertex.size();
  packed.triangles = mesh.triangles.size();
  Box3 box;
  for (const Index v : order.vertex) box.extend(mesh.positions[v]);
  // The page has the box as float: numbers are of that one.
  for (int k = 0; k < 3 && !box.isEmpty(); ++k) {
    packed.box[static_cast<std::size_t>(k)] = static_cast<float>(box.min()[k]);
    packed.box[static_cast<std::size_t>(k + 3)] = static_cast<float>(box.max()[k]);
  }

  std::vector<std::uint16_t> words(packed.vertices);
  for (std::size_t k = 0; k < 3; ++k) {
    const Real low = packed.box[k], size = Real{packed.box[k + 3]} - low;
    for (std::size_t v = 0; v < packed.vertices; ++v) {
      const Real part = size > 0 ? (mesh.positions[order.vertex[v]][static_cast<Eigen::Index>(k)] - low) / size : 0;
      words[v] = static_cast<std::uint16_t>(std::clamp(std::lround(part * 65535), 0L, 65535L));
    }
    append_words(packed.bytes, words, order);
  }
  std::vector<std::uint8_t> bytes(packed.vertices);
  for (std::size_t k = 0; k < 2; ++k) {
    for (std::size_t v = 0; v < packed.vertices; ++v) bytes[v] = octahedral(mesh.normals[order.vertex[v]])[k];
    append_bytes_of(packed.bytes, bytes, order);
  }
  for (const BytePlane& plane : planes) {
    packed.planes.push_back(plane.name);
    for (std::size_t v = 0; v < packed.vertices; ++v) bytes[v] = plane.values[order.vertex[v]];
    append_bytes_of(packed.bytes, bytes, order);
  }
  packed.bytes += order.codes;
  return packed;
}

}  // namespace effuse::skin
