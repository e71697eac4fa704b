#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <limits>
#include <memory>
#include <span>
#include <vector>

#include "geometry/base/types.h"
#include "geometry/mesh/tri_mesh.h"

/// Trees of boxes as FCL builds them, laid out flat for our own walks. For geometry/collide only.
namespace effuse::geometry {

/// Boxes over numbered items, four children a node, in float rounded outward about the boxes' centre and size: a walk
/// never misses an item, and sees some more. Const walks from many threads.
class BoxTree {
 public:
  /// A binary tree to lay out, node 0 its root. Leaves: left = -1 - item.
  struct Binary {
    Box3 box;
    int left = 0, right = 0;
  };
  static constexpr int kDeepest = 120;  ///< levels that may be laid out

  BoxTree() = default;  ///< no items
  explicit BoxTree(std::span<const Binary> nodes);

  /// Items have other boxes now: box(item). The tree keeps its branches, good while neighbours stay neighbours.
  template <class BoxOf>
  void refit(BoxOf&& box);

  bool empty() const { return nodes_.empty(); }
  const Box3& bounds() const { return bounds_; }

  /// visit(item, limit2): items whose boxes are no further from p than the square root of limit2, nearer boxes first;
  /// visit may lower limit2 [m^2].
  template <class Visit>
  void nearest(const Vec3& p, Real limit2, Visit&& visit) const;

  /// visit(item, t_max): items whose boxes, grown by r on each side, the segment p + t d meets in [0, t_max]; in the order
  /// of entering them. visit may lower t_max (at most 1).
  template <class Visit>
  void segment(const Vec3& p, const Vec3& d, Real r, Real t_max, Visit&& visit) const;

  /// visit(item) -> whether to go on: items whose boxes meet `box`.
  template <class Visit>
  void meeting(const Box3& box, Visit&& visit) const;

 private:
  using Four = Eigen::Array4f;
  struct alignas(64) Node {
    Four low[3], high[3];             // of no child: +inf, -inf
    std::array<std::int32_t, 4> child;  // -1 - item: a leaf
  };
  static constexpr int kStack = 3 * kDeepest + 4;
  static constexpr float kPad = 0x1p-21f;        // of the size: more than rounding a coordinate to float costs
  struct Waiting {
    float key;
    std::int32_t child;
  };
  /// About centre_ and scale_, rounded outward.
  void place(Node& node, int child, const Box3& box) const;
  void set_bounds(const Box3& bounds);
  /// Puts those of the four children with key <= limit on the stack, the least on top.
  static void push(const Node& node, const Four& key, float limit, Waiting* stack, int& top);

  Box3 bounds_;
  Vec3 centre_ = Vec3::Zero();
  Real scale_ = 1;  // of lengths: the largest half extent becomes 1
  std::vector<Node> nodes_;
};

/// The tree over triangles, by fcl::BVHModel<AABB>. Finite positions, triangles of area > 0, at least one.
BoxTree triangle_tree(std::span<const Vec3> positions, std::span<const Triangle> triangles);

/// Boxes that come, go and move: fcl's dynamic tree of boxes. One that has moved is held with room around it, so that the tree stays as it
/// is while the box stays within it.
class MovingBoxes {
 public:
  MovingBoxes();
  ~MovingBoxes();
  MovingBoxes(MovingBoxes&&) noexcept;
  MovingBoxes& operator=(MovingBoxes&&) noexcept;
  /// Puts item where it is now. Finite, not empty (checked).
  void set(Index item, const Box3& box);
  void remove(Index item);
  /// Whether flat() would be another tree than it was the last time.
  bool changed() const;
  /// The tree as it stands: each box, with the room that it is held with.
  BoxTree flat();

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

template <class BoxOf>
void BoxTree::refit(BoxOf&& box) {
  if (empty()) return;
  // Children are laid out behind their parents.
  std::vector<Box3> whole(nodes_.size());
  const auto of = [&](std::int32_t child) { return child < 0 ? Box3(box(static_cast<Index>(-1 - child))) : whole[static_cast<std::size_t>(child)]; };
  const auto used = [](const Node& node, int k) { return node.low[0][k] <= node.high[0][k]; };
  for (std::size_t n = nodes_.size(); n-- > 0;)
    for (int k = 0; k < 4; ++k)
      if (used(nodes_[n], k)) whole[n].extend(of(nodes_[n].child[static_cast<std::size_t>(k)]));
  set_bounds(whole[0]);
  for (Node& node : nodes_)
    for (int k = 0; k < 4; ++k)
      if (used(node, k)) place(node, k, of(node.child[static_cast<std::size_t>(k)]));
}

inline void BoxTree::push(const Node& node, const Four& key, float limit, Waiting* stack, int& top) {
  const int first = top;
  for (int k = 0; k < 4; ++k) {
    if (!(key[k] <= limit)) continue;
    int place = top++;
    for (; place > first && stack[place - 1].key < key[k]; --place) stack[place] = stack[place - 1];
    stack[place] = {key[k], node.child[k]};
  }
}

template <class Visit>
void BoxTree::nearest(const Vec3& p, Real limit2, Visit&& visit) const {
  if (empty()) return;
  // Keys are squared distances in the tree's units, low by no more than rounding; far away p's own rounding counts,
  // and is as small a share of the distance.
  constexpr Real kUp = 1 + 0x1p-18, kLargest = 1e38;
  const auto limit_of = [&](Real l2) { return static_cast<float>(std::min(l2 * scale_ * scale_ * kUp, kLargest)); };
  const Vec3 local = ((p - centre_) * scale_).cwiseMax(-1e18).cwiseMin(1e18);
  const Four x = Four::Constant(static_cast<float>(local.x())), y = Four::Constant(static_cast<float>(local.y())),
             z = Four::Constant(static_cast<float>(local.z()));
  Waiting stack[kStack];
  int top = 0;
  float limit = limit_of(limit2);
  stack[top++] = {0, 0};
  while (top > 0) {
    const Waiting next = stack[--top];
    if (next.key > limit) continue;
    if (next.child < 0) {
      visit(static_cast<Index>(-1 - next.child), limit2);
      limit = limit_of(limit2);
      continue;
    }
    const Node& node = nodes_[next.child];
    const Four gx = (node.low[0] - x).max(x - node.high[0]).max(0.0f), gy = (node.low[1] - y).max(y - node.high[1]).max(0.0f),
               gz = (node.low[2] - z).max(z - node.high[2]).max(0.0f);
    push(node, gx * gx + gy * gy + gz * gz, limit, stack, top);
  }
}

template <class Visit>
void BoxTree::segment(const Vec3& p, const Vec3& d, Real r, Real t_max, Visit&& visit) const {
  if (empty()) return;
  // Only the stretch in the grown root box, in double: what float then rounds is of the root's size.
  Real from = 0, to = t_max;
  for (int k = 0; k < 3; ++k) {
    const Real low = bounds_.min()[k] - r - p[k], high = bounds_.max()[k] + r - p[k];
    if (d[k] == 0) {
      if (low > 0 || high < 0) return;
      continue;
    }
    const Real t0 = low / d[k], t1 = high / d[k];
    from = std::max(from, std::min(t0, t1));
    to = std::min(to, std::max(t0, t1));
  }
  constexpr Real kSlack = 1e-6;
  const Real slack = kSlack * (to - from) + 1e-12;
  if (from > to + slack) return;
  from = std::max(Real{0}, from - slack);
  to = std::max(from, std::min(t_max, to + slack));
  const Vec3 start = (p + from * d - centre_) * scale_, way = (to - from) * scale_ * d;
  const Real grow = r * scale_ * (1 + 0x1p-18) + kPad * 2;
  const float reach = static_cast<float>(std::min(grow, 1e18));
  Four at[3], inverse[3];
  for (int k = 0; k < 3; ++k) {
    const Real step = std::abs(way[k]) > 1e-30 ? way[k] : std::copysign(1e-30, way[k]);
    at[k] = Four::Constant(static_cast<float>(start[k]));
    inverse[k] = Four::Constant(static_cast<float>(1 / step));
  }
  // Keys are shares of the stretch; a few roundings of float may put them high.
  constexpr float kUp = 1 + 0x1p-20f;
  const auto limit_of = [&](Real t) { return to > from ? static_cast<float>(std::clamp((t - from) / (to - from), Real{0}, Real{1})) * kUp + 0x1p-22f : kUp; };
  Waiting stack[kStack];
  int top = 0;
  float limit = limit_of(t_max);
  stack[top++] = {0, 0};
  while (top > 0) {
    const Waiting next = stack[--top];
    if (next.key > limit) continue;
    if (next.child < 0) {
      visit(static_cast<Index>(-1 - next.child), t_max);
      limit = limit_of(t_max);
      continue;
    }
    const Node& node = nodes_[next.child];
    Four enter = Four::Zero(), leave = Four::Constant(limit);
    for (int k = 0; k < 3; ++k) {
      const Four t0 = (node.low[k] - reach - at[k]) * inverse[k], t1 = (node.high[k] + reach - at[k]) * inverse[k];
      enter = enter.max(t0.min(t1));
      leave = leave.min(t0.max(t1));
    }
    leave = leave * kUp + 0x1p-22f;
    const Four key = (enter <= leave).select(enter, Four::Constant(std::numeric_limits<float>::infinity()));
    push(node, key, limit, stack, top);
  }
}

template <class Visit>
void BoxTree::meeting(const Box3& box, Visit&& visit) const {
  if (empty() || !bounds_.intersects(box)) return;
  const Vec3 a = ((box.min() - centre_) * scale_).cwiseMax(-4).cwiseMin(4), b = ((box.max() - centre_) * scale_).cwiseMax(-4).cwiseMin(4);
  Four low[3], high[3];
  for (int k = 0; k < 3; ++k) {
    low[k] = Four::Constant(static_cast<float>(a[k]) - kPad);
    high[k] = Four::Constant(static_cast<float>(b[k]) + kPad);
  }
  std::int32_t stack[kStack];
  int top = 0;
  stack[top++] = 0;
  while (top > 0) {
    const std::int32_t next = stack[--top];
    if (next < 0) {
      if (!visit(static_cast<Index>(-1 - next))) return;
      continue;
    }
    const Node& node = nodes_[next];
    const auto met = node.low[0] <= high[0] && node.high[0] >= low[0] && node.low[1] <= high[1] && node.high[1] >= low[1] && node.low[2] <= high[2] &&
                     node.high[2] >= low[2];
    const Eigen::Array<bool, 4, 1> mask = met;
    for (int k = 3; k >= 0; --k)
      if (mask[k]) stack[top++] = node.child[k];
  }
}

}  // namespace effuse::geometry
