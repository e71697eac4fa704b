#include "geometry/collide/box_tree.h"

#include <fcl/broadphase/detail/hierarchy_tree.h>
#include <fcl/geometry/bvh/BVH_model.h>
#include <fmt/format.h>

#include <exception>
#include <limits>

#include "geometry/base/check.h"
#include "geometry/base/error.h"

namespace effuse::geometry {

namespace {

using Dynamic = fcl::detail::HierarchyTree<fcl::AABBd>;

Box3 from_fcl(const fcl::AABBd& box) { return {box.min_, box.max_}; }

int depth_of(std::span<const BoxTree::Binary> nodes) {
  int deepest = 0;
  std::vector<std::pair<int, int>> open{{0, 1}};
  while (!open.empty()) {
    const auto [node, depth] = open.back();
    open.pop_back();
    deepest = std::max(deepest, depth);
    if (nodes[node].left < 0) continue;
    open.emplace_back(nodes[node].left, depth + 1);
    open.emplace_back(nodes[node].right, depth + 1);
  }
  return deepest;
}

/// Half the surface of a box, which measures how often a walk comes to it.
Real half_surface(const Box3& box) {
  const Vec3 size = box.sizes();
  return size.x() * size.y() + size.y() * size.z() + size.z() * size.x();
}

float rounded_down(Real x) {
  const float f = static_cast<float>(x);
  return static_cast<Real>(f) > x ? std::nextafter(f, -std::numeric_limits<float>::infinity()) : f;
}

}  // namespace

void BoxTree::set_bounds(const Box3& bounds) {
  bounds_ = bounds;
  centre_ = bounds_.center();
  const Real extent = bounds_.sizes().maxCoeff() / 2;
  scale_ = extent > 1e-150 ? 1 / extent : 1;
}

void BoxTree::place(Node& node, int child, const Box3& box) const {
  for (int axis = 0; axis < 3; ++axis) {
    node.low[axis][child] = rounded_down((box.min()[axis] - centre_[axis]) * scale_) - kPad;
    node.high[axis][child] = -rounded_down(-(box.max()[axis] - centre_[axis]) * scale_) + kPad;
  }
}

BoxTree::BoxTree(std::span<const Binary> nodes) {
  if (nodes.empty()) return;
  CHECK_LE(depth_of(nodes), kDeepest);
  set_bounds(nodes[0].box);

  // A node's four children: its two, of which those of largest surface are replaced by theirs.
  struct Open {
    int binary;            // whose children the four are of; a leaf only as the whole tree
    std::int32_t parent;   // where the node's number is to be written
    int slot;
  };
  std::vector<Open> open{{0, -1, 0}};
  nodes_.reserve(nodes.size() / 4 + 1);
  while (!open.empty()) {
    const Open next = open.back();
    open.pop_back();
    const auto number = static_cast<std::int32_t>(nodes_.size());
    if (next.parent >= 0) nodes_[next.parent].child[next.slot] = number;
    int child[4], count = 0;
    if (nodes[next.binary].left < 0) {
      child[count++] = next.binary;
    } else {
      child[count++] = nodes[next.binary].left;
      child[count++] = nodes[next.binary].right;
    }
    while (count < 4) {
      int widest = -1;
      for (int k = 0; k < count; ++k) {
        if (nodes[child[k]].left < 0) continue;
        if (widest < 0 || half_surface(nodes[child[k]].box) > half_surface(nodes[child[widest]].box)) widest = k;
      }
      if (widest < 0) break;
      const Binary& split = nodes[child[widest]];
      child[count++] = split.right;
      child[widest] = split.left;
    }
    Node& node = nodes_.emplace_back();
    for (int k = 0; k < 4; ++k) {
      if (k < count) place(node, k, nodes[child[k]].box);
      for (int axis = 0; k >= count && axis < 3; ++axis) {
        node.low[axis][k] = std::numeric_limits<float>::infinity();
        node.high[axis][k] = -std::numeric_limits<float>::infinity();
      }
      node.child[k] = k < count ? nodes[child[k]].left : -1;
    }
    // The first child is laid out next.
    for (int k = count - 1; k >= 0; --k)
      if (nodes[child[k]].left >= 0) open.push_back({child[k], number, k});
  }
}

BoxTree triangle_tree(std::span<const Vec3> positions, std::span<const Triangle> triangles) {
  CHECK(!triangles.empty());
  if (triangles.size() > static_cast<std::size_t>(std::numeric_limits<std::int32_t>::max() / 4))
    throw InputError(Place{}, fmt::format("{} triangles are more than an obstacle may have", triangles.size()));
  try {
    std::vector<fcl::Vector3d> points(positions.begin(), positions.end());
    std::vector<fcl::Triangle> corners;
    corners.reserve(triangles.size());
    for (const auto& [a, b, c] : triangles) corners.emplace_back(a, b, c);

    // Halves by the mean make the better tree; by the median they are never deep.
    for (const auto method : {fcl::detail::SPLIT_METHOD_MEAN, fcl::detail::SPLIT_METHOD_MEDIAN}) {
      fcl::BVHModel<fcl::AABBd> model;
      model.bv_splitter = std::make_shared<fcl::detail::BVSplitter<fcl::AABBd>>(method);
      int code = model.beginModel(static_cast<int>(corners.size()), static_cast<int>(points.size()));
      if (code == fcl::BVH_OK) code = model.addSubModel(points, corners);
      if (code == fcl::BVH_OK) code = model.endModel();
      if (code != fcl::BVH_OK) throw InputError(Place{}, fmt::format("FCL cannot make a tree of the mesh's {} triangles (code {})", triangles.size(), code));

      std::vector<BoxTree::Binary> nodes(static_cast<std::size_t>(model.getNumBVs()));
      for (std::size_t k = 0; k < nodes.size(); ++k) {
        const auto& node = model.getBV(static_cast<int>(k));
        nodes[k].box = from_fcl(node.bv);
        nodes[k].left = node.isLeaf() ? -1 - node.primitiveId() : node.leftChild();
        nodes[k].right = node.isLeaf() ? 0 : node.rightChild();
      }
      if (method == fcl::detail::SPLIT_METHOD_MEDIAN || depth_of(nodes) <= BoxTree::kDeepest) return BoxTree(nodes);
    }
  } catch (const std::bad_alloc&) {
    throw ResourceError(fmt::format("no memory for an obstacle of {} triangles", triangles.size()));
  } catch (const InputError&) {
    throw;
  } catch (const std::exception& error) {
    throw InputError(Place{}, fmt::format("FCL cannot make a tree of the mesh's {} triangles: {}", triangles.size(), error.what()));
  }
  return {};
}

struct MovingBoxes::Impl {
  Dynamic tree;
  std::vector<Dynamic::NodeType*> leaf;  // of each item; nullptr: not there
  bool changed = false, unbalanced = false;
};

namespace {

constexpr Real kMostRoom = 1.2;  // a held box's surface over the box's own

/// The box, wider on all sides by what makes its surface seven eighths of the way to kMostRoom: it may go that far, and shrink a little.
Box3 with_room(const Box3& box) {
  const Vec3 side = box.sizes();
  const Real sum = side.sum(), add = 0.875 * (kMostRoom - 1) * half_surface(box);
  // (a + 2 p)(b + 2 p) + ... = ab + bc + ca + add: 12 p^2 + 4 sum p - add = 0.
  const Vec3 room = Vec3::Constant(add > 0 ? add / (2 * sum + std::sqrt(4 * sum * sum + 12 * add)) : 0);
  return Box3(box.min() - room, box.max() + room);
}

fcl::AABBd to_fcl(const Box3& box) {
  fcl::AABBd bv;
  bv.min_ = box.min();
  bv.max_ = box.max();
  return bv;
}

}  // namespace

MovingBoxes::MovingBoxes() : impl_(std::make_unique<Impl>()) {}
MovingBoxes::~MovingBoxes() = default;
MovingBoxes::MovingBoxes(MovingBoxes&&) noexcept = default;
MovingBoxes& MovingBoxes::operator=(MovingBoxes&&) noexcept = default;

void MovingBoxes::set(Index item, const Box3& box) {
  CHECK(!box.isEmpty() && box.min().allFinite() && box.max().allFinite());
  if (impl_->leaf.size() <= item) impl_->leaf.resize(item + 1, nullptr);
  auto& leaf = impl_->leaf[item];
  const bool is_new = leaf == nullptr;
  if (!is_new) {
    if (leaf->bv.contain(to_fcl(box)) && half_surface(from_fcl(leaf->bv)) <= kMostRoom * half_surface(box)) return;
    impl_->tree.remove(leaf);
  }
  // The leaf's data is the item's number, kept where FCL keeps a pointer.
  leaf = impl_->tree.insert(to_fcl(is_new ? box : with_room(box)), reinterpret_cast<void*>(static_cast<std::uintptr_t>(item)));
  impl_->changed = true;
  if (is_new) impl_->unbalanced = true;
}

void MovingBoxes::remove(Index item) {
  if (item >= impl_->leaf.size() || !impl_->leaf[item]) return;
  impl_->tree.remove(impl_->leaf[item]);
  impl_->leaf[item] = nullptr;
  impl_->changed = true;
}

bool MovingBoxes::changed() const { return impl_->changed; }

BoxTree MovingBoxes::flat() {
  impl_->changed = false;
  if (impl_->tree.empty()) return {};
  if (impl_->unbalanced) impl_->tree.balanceTopdown();
  impl_->unbalanced = false;
  std::vector<BoxTree::Binary> nodes;
  const auto lay_out = [&] {
    nodes.clear();
    nodes.reserve(2 * impl_->tree.size());
    std::vector<const Dynamic::NodeType*> source{impl_->tree.getRoot()};
    nodes.emplace_back();
    for (std::size_t k = 0; k < source.size(); ++k) {
      const Dynamic::NodeType& node = *source[k];
      nodes[k].box = from_fcl(node.bv);
      if (node.isLeaf()) {
        nodes[k].left = -1 - static_cast<int>(reinterpret_cast<std::uintptr_t>(node.data));
        continue;
      }
      nodes[k].left = static_cast<int>(nodes.size());
      nodes[k].right = nodes[k].left + 1;
      source.push_back(node.children[0]);
      source.push_back(node.children[1]);
      nodes.resize(nodes.size() + 2);
    }
  };
  lay_out();
  if (depth_of(nodes) > BoxTree::kDeepest) {
    impl_->tree.balanceTopdown();
    lay_out();
  }
  return BoxTree(nodes);
}

}  // namespace effuse::geometry
