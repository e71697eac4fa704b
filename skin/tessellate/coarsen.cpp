#include "skin/tessellate/coarsen.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>

#include "geometry/base/check.h"
#include "geometry/base/zones.h"
#include "skin/tessellate/half_edges.h"
#include "skin/tessellate/stars.h"

namespace effuse::skin {

namespace {

using geometry::Triangle;
using geometry::TriMesh;

constexpr int kPasses = 4;         // the bound grows from pass to pass, so that the flattest places go first
constexpr int kLastPasses = 12;    // with the whole bound, while more than one in a hundred goes
constexpr Real kUpright = 0.5;     // least cosine between a triangle and its star's normal
constexpr std::size_t kMost = 16;  // neighbours of a vertex that is taken out, or that takes one in

Real cross(const Vec2& a, const Vec2& b) { return a.x() * b.y() - a.y() * b.x(); }

/// Sine of the least angle.
Real shape(const Vec3& a, const Vec3& b, const Vec3& c) {
  const Real x = (b - a).squaredNorm(), y = (c - b).squaredNorm(), z = (a - c).squaredNorm();
  const Real area = (b - a).cross(c - a).norm();
  return area > 0 ? area * std::sqrt(std::min({x, y, z}) / (x * y * z)) : 0;
}

class Coarsener {
 public:
  Coarsener(TriMesh& mesh, const CoarsenOptions& options, std::span<const Index> label)
      : mesh_(mesh),
        options_(options),
        label_(label),
        stars_(mesh.positions.size(), mesh.triangles),
        error_(mesh.triangles.size(), 0),
        gone_(mesh.triangles.size(), 0),
        taken_out_(mesh.positions.size(), 0),
        pass_of_(mesh.positions.size(), -1),
        least_sine_(std::sin(options.min_angle * kPi / 180)) {
    if (label.empty()) return;
    left_.assign(static_cast<std::size_t>(*std::max_element(label.begin(), label.end())) + 1, 0);
    for (const Index l : label) ++left_[l];
  }

  std::size_t pass(int number, Real bound) {
    std::size_t removed = 0;
    for (Index v = 0; v < mesh_.positions.size(); ++v) {
      // One around a place in a pass: vertices go evenly.
      if (taken_out_[v] || pass_of_[v] == number) continue;
      if (!label_.empty() && left_[label_[v]] == 1) continue;
      if (!look_around(v)) continue;
      Index into = kNone;
      Real least = bound - most_;
      for (std::size_t k = 0; k < ring_.size(); ++k)
        if (const Real h = height(k, least); h <= least) {
          least = h;
          into = static_cast<Index>(k);
        }
      if (into == kNone) continue;
      for (const Index w : ring_) pass_of_[w] = number;
      take_out(v, ring_[into], most_ + least);
      if (!label_.empty()) --left_[label_[v]];
      ++removed;
    }
    return removed;
  }

  /// Takes what is gone out of the arrays.
  CoarsenReport finish() {
    CoarsenReport report;
    std::vector<Index> place(mesh_.positions.size(), kNone);
    for (Index v = 0; v < taken_out_.size(); ++v) {
      if (taken_out_[v]) continue;
      place[v] = static_cast<Index>(report.kept.size());
      report.kept.push_back(v);
    }
    report.removed = taken_out_.size() - report.kept.size();
    std::size_t left = 0;
    for (std::size_t t = 0; t < mesh_.triangles.size(); ++t) {
      if (gone_[t]) continue;
      report.error = std::max(report.error, error_[t]);
      for (std::size_t k = 0; k < 3; ++k) mesh_.triangles[left][k] = place[mesh_.triangles[t][k]];
      ++left;
    }
    mesh_.triangles.resize(left);
    const auto keep = [&](auto& values, std::size_t width) {
      if (values.empty()) return;
      for (std::size_t v = 0; v < report.kept.size(); ++v)
        for (std::size_t k = 0; k < width; ++k) values[v * width + k] = values[report.kept[v] * width + k];
      values.resize(report.kept.size() * width);
    };
    keep(mesh_.positions, 1);
    keep(mesh_.normals, 1);
    for (auto& [name, attribute] : mesh_.attributes) keep(attribute.values, static_cast<std::size_t>(attribute.width));
    return report;
  }

 private:
  /// The star of v: its ring counter-clockwise, flat and as heights over its mean plane. False if it cannot go.
  bool look_around(Index v) {
    const auto star = stars_.of(v);
    if (star.size() < 3 || star.size() > kMost) return false;
    Vec3 up = Vec3::Zero();
    most_ = 0;
    worst_ = 1;
    std::array<std::array<Index, 2>, kMost> sides;
    for (std::size_t k = 0; k < star.size(); ++k) {
      const Triangle& t = mesh_.triangles[star[k]];
      const std::size_t at = t[0] == v ? 0 : t[1] == v ? 1 : 2;
      sides[k] = {t[(at + 1) % 3], t[(at + 2) % 3]};
      up += (mesh_.positions[t[1]] - mesh_.positions[t[0]]).cross(mesh_.positions[t[2]] - mesh_.positions[t[0]]);
      most_ = std::max(most_, error_[star[k]]);
      worst_ = std::min(worst_, shape(mesh_.positions[t[0]], mesh_.positions[t[1]], mesh_.positions[t[2]]));
    }
    const Real length = up.norm();
    if (!(length > 0)) return false;
    up_ = up / length;
    ring_.clear();
    ring_.push_back(sides[0][0]);
    Index next = sides[0][1];
    while (next != ring_[0]) {
      ring_.push_back(next);
      std::size_t k = 0;
      while (k < star.size() && sides[k][0] != next) ++k;
      CHECK_LT(k, star.size());
      next = sides[k][1];
    }
    CHECK_EQ(ring_.size(), star.size());

    const Vec3 side = (std::abs(up_.x()) < 0.6 ? up_.cross(Vec3::UnitX()) : up_.cross(Vec3::UnitY())).normalized(), ahead = up_.cross(side);
    flat_.clear();
    tall_.clear();
    for (const Index w : ring_) {
      const Vec3 d = mesh_.positions[w] - mesh_.positions[v];
      flat_.emplace_back(d.dot(side), d.dot(ahead));
      tall_.push_back(d.dot(up_));
    }
    for (std::size_t k = 0; k < ring_.size(); ++k) {
      const std::size_t l = (k + 1) % ring_.size();
      if (!upright(Vec3(flat_[k].x(), flat_[k].y(), tall_[k]), Vec3(flat_[l].x(), flat_[l].y(), tall_[l]))) return false;
    }
    v_ = v;
    return true;
  }
  /// The triangle of two sides looks up, and not too far sideways.
  static bool upright(const Vec3& a, const Vec3& b) {
    const Vec3 n = a.cross(b);
    return n.z() > kUpright * n.norm();
  }

  /// By how much heights change when v goes into ring_[at]; more than `bound` if it cannot, or by so much.
  Real height(std::size_t at, Real bound) {
    constexpr Real kNever = std::numeric_limits<Real>::infinity();
    const std::size_t m = ring_.size();
    const auto ring = [&](std::size_t k) { return (at + k) % m; };
    const Vec2& w = flat_[at];
    const Real z = tall_[at];
    const Vec3& position = mesh_.positions[ring_[at]];
    // The new triangles: w and the ring's other sides. v, the origin, is in one of them.
    Real least = kNever;
    for (std::size_t k = 1; k + 1 < m; ++k) {
      const std::size_t i = ring(k), j = ring(k + 1);
      const Vec2 a = flat_[i] - w, b = flat_[j] - w;
      const Real area = cross(a, b);
      if (!(area > 0)) return kNever;
      const Real s = cross(-w, b) / area, t = cross(a, -w) / area;
      if (s >= -1e-12 && t >= -1e-12 && s + t <= 1 + 1e-12) least = std::min(least, std::abs(z + s * (tall_[i] - z) + t * (tall_[j] - z)));
    }
    if (!(least <= bound)) return kNever;
    Real most = least;
    // Where a new edge from w crosses an old one from v.
    for (std::size_t k = 2; k + 1 < m; ++k) {
      const std::size_t i = ring(k);
      const Vec2 along = flat_[i] - w;
      for (std::size_t l = 1; l < m; ++l) {
        if (l == k) continue;
        const Vec2& old = flat_[ring(l)];
        const Real d = cross(along, old);
        if (d == 0) continue;
        // w + s along = t old.
        const Real s = cross(old, w) / d, t = cross(along, w) / d;
        if (s <= 0 || s >= 1 || t <= 0 || t >= 1) continue;
        most = std::max(most, std::abs(z + s * (tall_[i] - z) - t * tall_[ring(l)]));
      }
    }
    if (most > bound) return kNever;

    // Shape, length, and who would be neighbours.
    const Real wanted = std::min(least_sine_, worst_);
    for (std::size_t k = 1; k + 1 < m; ++k) {
      const std::size_t i = ring(k), j = ring(k + 1);
      if (!upright(Vec3(flat_[i].x() - w.x(), flat_[i].y() - w.y(), tall_[i] - z),
                   Vec3(flat_[j].x() - w.x(), flat_[j].y() - w.y(), tall_[j] - z)))
        return kNever;
      if (shape(position, mesh_.positions[ring_[i]], mesh_.positions[ring_[j]]) < wanted) return kNever;
      if (options_.longest > 0 && (mesh_.positions[ring_[j]] - position).norm() > options_.longest && k + 2 < m) return kNever;
    }
    return manifold_after(at) ? most : kNever;
  }

  /// The link condition: v and w have no neighbours in common but the two beside w on the ring; those keep three triangles.
  bool manifold_after(std::size_t at) const {
    const std::size_t m = ring_.size();
    const Index w = ring_[at], before = ring_[(at + m - 1) % m], after = ring_[(at + 1) % m];
    if (stars_.of(before).size() <= 3 || stars_.of(after).size() <= 3) return false;
    const auto star = stars_.of(w);
    if (star.size() + m > kMost + 4) return false;
    for (const Index t : star)
      for (const Index u : mesh_.triangles[t])
        if (u != w && u != before && u != after && u != v_ && std::find(ring_.begin(), ring_.end(), u) != ring_.end()) return false;
    return true;
  }

  void take_out(Index v, Index w, Real error) {
    const std::vector<Index> star(stars_.of(v).begin(), stars_.of(v).end());
    for (const Index t : star) {
      Triangle& c = mesh_.triangles[t];
      error_[t] = error;
      if (c[0] != w && c[1] != w && c[2] != w) {
        std::replace(c.begin(), c.end(), v, w);
        continue;
      }
      gone_[t] = 1;
      for (const Index u : Triangle(c)) stars_.remove(u, t);
    }
    stars_.join(w, v);
    taken_out_[v] = 1;
  }

  TriMesh& mesh_;
  const CoarsenOptions& options_;
  std::span<const Index> label_;
  std::vector<Index> left_;  // vertices of each label
  Stars stars_;
  std::vector<Real> error_;                     // of each triangle
  std::vector<std::uint8_t> gone_, taken_out_;  // triangles, vertices
  std::vector<int> pass_of_;                    // in which a vertex's surroundings last changed
  Real least_sine_;
  // The star looked at.
  Index v_ = kNone;
  std::vector<Index> ring_;
  std::vector<Vec2> flat_;
  std::vector<Real> tall_;
  Vec3 up_ = Vec3::Zero();
  Real most_ = 0, worst_ = 1;
};

}  // namespace

CoarsenReport coarsen(TriMesh& mesh, const CoarsenOptions& options, std::span<const Index> label) {
  ZONE("skin.coarsen");
  CHECK_GT(options.error, 0);
  CHECK_GE(options.longest, 0);
  if (!label.empty()) CHECK_EQ(label.size(), mesh.positions.size());
  number_edges(mesh.triangles, mesh.positions.size(), [](Index) { return true; });  // checks
  Coarsener coarsener(mesh, options, label);
  std::size_t left = mesh.positions.size();
  for (int pass = 0; pass < kPasses + kLastPasses; ++pass) {
    const std::size_t removed = coarsener.pass(pass, options.error * std::min(pass + 1, kPasses) / kPasses);
    left -= removed;
    if (pass >= kPasses && removed * 100 < left) break;
  }
  return coarsener.finish();
}

}  // namespace effuse::skin
