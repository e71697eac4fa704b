#include "geometry/remesh/decimate.h"

#include <algorithm>
#include <cmath>
#include <queue>
#include <vector>

#include "geometry/base/check.h"
#include "geometry/base/zones.h"

namespace effuse::geometry {

namespace {

constexpr Index kNobody = static_cast<Index>(-1);
constexpr Real kBorderWeight = 10;   // of the planes that hold a border in place, to those of its triangles
constexpr Real kColorWeight = 0.25;  // a colour that is black where it was white counts as a move by this share of the mean edge
constexpr Real kLeastTurn = 0.2;     // cosine: no triangle's normal turns farther in one collapse
constexpr Real kThinnest = 0.05;     // 4 sqrt(3) area / sum of squared edges; thinner triangles are not made of thicker ones

/// Weighted sum of squared distances of a point x from planes, x^T A x + 2 b^T x + c; and of its shade s from what triangles would have there,
/// (g^T x + d - s)^2 each, of which the terms with s are apart: s^2 weight - 2 s (e^T x + f).
struct Quadric {
  Mat3 A = Mat3::Zero();
  Vec3 b = Vec3::Zero(), e = Vec3::Zero();
  Real c = 0, f = 0, weight = 0, shaded = 0;  // weights of planes, of shades

  void add_plane(const Vec3& normal, const Vec3& point, Real w) {
    const Real d = -normal.dot(point);
    A += w * normal * normal.transpose();
    b += w * d * normal;
    c += w * d * d;
    weight += w;
  }
  void add_shade(const Vec3& g, Real d, Real w) {
    A += w * g * g.transpose();
    b += w * d * g;
    c += w * d * d;
    e += w * g;
    f += w * d;
    shaded += w;
  }
  void operator+=(const Quadric& other) {
    A += other.A;
    b += other.b;
    c += other.c;
    e += other.e;
    f += other.f;
    weight += other.weight;
    shaded += other.shaded;
  }
  Real at(const Vec3& x, Real s) const { return std::max(x.dot(A * x) + 2 * b.dot(x) + c + s * (s * shaded - 2 * (e.dot(x) + f)), Real{0}); }
};

/// Positions relative to the box's middle: quadrics subtract squares.
class Collapser {
 public:
  explicit Collapser(TriMesh& mesh) : mesh_(mesh), x_(mesh.positions), around_(mesh.positions.size()), quadric_(x_.size()), kind_(x_.size(), Kind::kInner), into_(x_.size(), kNobody), stamp_(x_.size(), 0) {
    Vec3 low = x_.empty() ? Vec3(Vec3::Zero()) : x_.front(), high = low;
    for (const Vec3& p : x_) {
      low = low.cwiseMin(p);
      high = high.cwiseMax(p);
    }
    for (Vec3& p : x_) p -= 0.5 * (low + high);
    shade();
    collect();
  }

  Decimated run(std::size_t wanted) {
    Decimated result{mesh_.triangles.size(), alive_, 0};
    for (Index v = 0; v < x_.size(); ++v) aim(v);
    while (alive_ > wanted && !queue_.empty()) {
      const Candidate best = queue_.top();
      queue_.pop();
      if (best.stamp != stamp_[best.vertex] || into_[best.vertex] == kNobody) continue;
      const Quadric& q = quadric_[best.vertex];
      if (q.weight > 0) result.error = std::max(result.error, std::sqrt(cost(best.vertex, into_[best.vertex]) / (q.weight + quadric_[into_[best.vertex]].weight)));
      collapse(best.vertex, into_[best.vertex]);
    }
    compact();
    result.after = alive_;
    return result;
  }

 private:
  enum class Kind : char { kInner, kBorder, kFixed };
  struct Candidate {
    Real cost;
    Index vertex;
    std::uint32_t stamp;
    bool operator<(const Candidate& other) const { return cost != other.cost ? cost > other.cost : vertex > other.vertex; }  // cheapest on top
  };

  const Triangle& triangle(Index t) const { return mesh_.triangles[t]; }
  static bool has(const Triangle& t, Index v) { return t[0] == v || t[1] == v || t[2] == v; }
  bool dead(Index t) const { return triangle(t)[0] == kNobody; }
  Vec3 area_normal(const Triangle& t) const { return 0.5 * (x_[t[1]] - x_[t[0]]).cross(x_[t[2]] - x_[t[0]]); }
  /// 1: equilateral, 0: a line.
  Real shape(const Triangle& t) const {
    const Real sides = (x_[t[1]] - x_[t[0]]).squaredNorm() + (x_[t[2]] - x_[t[1]]).squaredNorm() + (x_[t[0]] - x_[t[2]]).squaredNorm();
    return sides > 0 ? 4 * std::sqrt(3.0) * area_normal(t).norm() / sides : 0;
  }

  /// Shades in metres: brightness times kColorWeight mean edges.
  void shade() {
    const auto color = mesh_.attributes.find("color");
    if (color == mesh_.attributes.end() || color->second.width != 3 || mesh_.triangles.empty()) return;
    Real edges = 0;
    for (const Triangle& t : mesh_.triangles) edges += (x_[t[1]] - x_[t[0]]).norm();
    const Real metres = kColorWeight * edges / static_cast<Real>(mesh_.triangles.size());
    shade_.resize(x_.size());
    for (std::size_t v = 0; v < x_.size(); ++v) shade_[v] = metres * (Real{color->second.values[3 * v]} + color->second.values[3 * v + 1] + color->second.values[3 * v + 2]) / 3;
  }
  Real shade_of(Index v) const { return shade_.empty() ? 0 : shade_[v]; }

  /// Who is around whom; planes; borders.
  void collect() {
    for (Index t = 0; t < mesh_.triangles.size(); ++t) {
      const Triangle& corner = triangle(t);
      if (corner[0] == corner[1] || corner[1] == corner[2] || corner[2] == corner[0]) {
        mesh_.triangles[t][0] = kNobody;  // no triangle
        continue;
      }
      ++alive_;
      for (const Index v : corner) around_[v].push_back(t);
    }
    for (Index t = 0; t < mesh_.triangles.size(); ++t) {
      if (dead(t)) continue;
      const Triangle corner = triangle(t);
      const Vec3 normal = area_normal(corner);
      const Real area = normal.norm();
      if (area > 0) {
        for (const Index v : corner) quadric_[v].add_plane(normal / area, x_[v], area / 3);
        if (!shade_.empty()) {
          Vec3 g = Vec3::Zero();  // the shade's gradient in the triangle
          for (std::size_t k = 0; k < 3; ++k) g += shade_[corner[k]] * normal.cross(x_[corner[(k + 2) % 3]] - x_[corner[(k + 1) % 3]]) / (2 * area * area);
          for (const Index v : corner) quadric_[v].add_shade(g, shade_[corner[0]] - g.dot(x_[corner[0]]), area / 3);
        }
      }
      for (std::size_t k = 0; k < 3; ++k) {
        const Index a = corner[k], b = corner[(k + 1) % 3];
        const std::size_t n = sharing(a, b);
        if (n == 2) continue;
        for (const Index v : {a, b})
          if (n > 2 || kind_[v] == Kind::kInner) kind_[v] = n > 2 ? Kind::kFixed : Kind::kBorder;
        const Vec3 upright = (x_[b] - x_[a]).cross(normal);
        if (upright.norm() == 0) continue;
        for (const Index v : {a, b}) quadric_[v].add_plane(upright.normalized(), x_[v], kBorderWeight * (x_[b] - x_[a]).squaredNorm());
      }
    }
    // Where borders meet in a point, more than one path leaves it.
    for (Index v = 0; v < x_.size(); ++v) {
      if (kind_[v] != Kind::kBorder) continue;
      std::size_t ends = 0;
      neighbours(v, ring_);
      for (const Index w : ring_) ends += sharing(v, w) == 1;
      if (ends != 2) kind_[v] = Kind::kFixed;
    }
  }

  std::size_t sharing(Index a, Index b) const {
    std::size_t n = 0;
    for (const Index t : around_[a]) n += has(triangle(t), b);
    return n;
  }
  /// In ascending order, each once.
  void neighbours(Index v, std::vector<Index>& out) const {
    out.clear();
    for (const Index t : around_[v])
      for (const Index w : triangle(t))
        if (w != v) out.push_back(w);
    std::sort(out.begin(), out.end());
    out.erase(std::unique(out.begin(), out.end()), out.end());
  }

  Real cost(Index from, Index to) const { return quadric_[from].at(x_[to], shade_of(to)) + quadric_[to].at(x_[to], shade_of(to)); }

  /// ring_ are the neighbours of from.
  bool allowed(Index from, Index to) {
    const std::size_t shared = sharing(from, to);
    if (kind_[from] == Kind::kFixed || (kind_[from] == Kind::kBorder && shared != 1)) return false;
    // Link condition: neighbours of both are the corners opposite their edge, no others.
    neighbours(to, far_ring_);
    std::size_t common = 0;
    for (auto a = ring_.begin(), b = far_ring_.begin(); a != ring_.end() && b != far_ring_.end();) {
      if (*a < *b) ++a;
      else if (*b < *a) ++b;
      else ++common, ++a, ++b;
    }
    if (common != shared) return false;
    // A tetrahedron, or a lone triangle, would go flat.
    if (around_[from].size() + around_[to].size() <= 2 * shared + (shared == 2 ? 2 : 0)) return false;
    for (const Index t : around_[from]) {
      if (has(triangle(t), to)) continue;
      Triangle moved = triangle(t);
      for (Index& v : moved)
        if (v == from) v = to;
      const Vec3 before = area_normal(triangle(t)), after = area_normal(moved);
      if (before.norm() > 0 && before.dot(after) < kLeastTurn * before.norm() * after.norm()) return false;
      if (const Real thin = shape(moved); thin < kThinnest && thin < shape(triangle(t))) return false;
    }
    return true;
  }

  /// The neighbour that vertex goes into at the least cost, into the queue.
  void aim(Index vertex) {
    ++stamp_[vertex];
    into_[vertex] = kNobody;
    if (around_[vertex].empty() || kind_[vertex] == Kind::kFixed) return;
    neighbours(vertex, ring_);
    choices_.clear();
    for (const Index w : ring_) choices_.push_back({cost(vertex, w), w});
    std::sort(choices_.begin(), choices_.end());
    for (const auto& [price, to] : choices_)
      if (allowed(vertex, to)) {
        into_[vertex] = to;
        queue_.push({price, vertex, stamp_[vertex]});
        return;
      }
  }

  void collapse(Index from, Index to) {
    for (const Index t : around_[from]) {
      if (!has(triangle(t), to)) {
        for (Index& v : mesh_.triangles[t])
          if (v == from) v = to;
        around_[to].push_back(t);
        continue;
      }
      for (const Index v : triangle(t))
        if (v != from) std::erase(around_[v], t);
      mesh_.triangles[t][0] = kNobody;
      --alive_;
    }
    around_[from].clear();
    quadric_[to] += quadric_[from];
    ++stamp_[from];
    neighbours(to, changed_);
    aim(to);
    for (const Index v : changed_) aim(v);
  }

  /// What is left, in the old order.
  void compact() {
    std::erase_if(mesh_.triangles, [](const Triangle& t) { return t[0] == kNobody; });
    std::vector<Index> number(x_.size(), kNobody);
    std::vector<char> used(x_.size(), 0);
    for (const Triangle& t : mesh_.triangles)
      for (const Index v : t) used[v] = 1;
    std::size_t n = 0;
    for (Index v = 0; v < x_.size(); ++v) {
      if (!used[v]) continue;
      number[v] = static_cast<Index>(n);
      mesh_.positions[n] = mesh_.positions[v];
      if (!mesh_.normals.empty()) mesh_.normals[n] = mesh_.normals[v];
      for (auto& [name, attribute] : mesh_.attributes) {
        const auto width = static_cast<std::size_t>(attribute.width);
        std::copy_n(attribute.values.begin() + static_cast<std::ptrdiff_t>(width * v), width, attribute.values.begin() + static_cast<std::ptrdiff_t>(width * n));
      }
      ++n;
    }
    mesh_.positions.resize(n);
    if (!mesh_.normals.empty()) mesh_.normals.resize(n);
    for (auto& [name, attribute] : mesh_.attributes) attribute.values.resize(n * static_cast<std::size_t>(attribute.width));
    for (Triangle& t : mesh_.triangles)
      for (Index& v : t) v = number[v];
  }

  TriMesh& mesh_;
  std::vector<Vec3> x_;
  std::vector<Real> shade_;                 // of each vertex [m]; empty without colour
  std::vector<std::vector<Index>> around_;  // triangles of each vertex
  std::vector<Quadric> quadric_;
  std::vector<Kind> kind_;
  std::vector<Index> into_;           // of each vertex its best neighbour
  std::vector<std::uint32_t> stamp_;  // of its newest candidate: older ones in the queue are passed over
  std::priority_queue<Candidate> queue_;
  std::size_t alive_ = 0;
  std::vector<Index> ring_, far_ring_, changed_;
  std::vector<std::pair<Real, Index>> choices_;
};

}  // namespace

Decimated decimate(TriMesh& mesh, std::size_t triangles) {
  ZONE("geometry.decimate");
  for (const Triangle& t : mesh.triangles)
    for (const Index v : t) CHECK(v < mesh.positions.size());
  CHECK(mesh.normals.empty() || mesh.normals.size() == mesh.positions.size());
  for (const auto& [name, attribute] : mesh.attributes) CHECK_EQ(attribute.values.size(), mesh.positions.size() * static_cast<std::size_t>(attribute.width));
  if (mesh.triangles.size() <= triangles) return {mesh.triangles.size(), mesh.triangles.size(), 0};
  return Collapser(mesh).run(triangles);
}

}  // namespace effuse::geometry
