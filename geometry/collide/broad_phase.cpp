#include "geometry/collide/broad_phase.h"

#include <fcl/broadphase/broadphase_dynamic_AABB_tree.h>
#include <fcl/geometry/shape/sphere.h>

#include <algorithm>
#include <cmath>

#include "geometry/base/check.h"

namespace effuse::geometry {
namespace {

using FclBox = fcl::AABB<Real>;
using Tree = fcl::detail::HierarchyTree<FclBox>;
using Node = Tree::NodeType;

/// An object of FCL that is nothing but its box.
class BoxObject : public fcl::CollisionObject<Real> {
 public:
  BoxObject(const std::shared_ptr<fcl::CollisionGeometry<Real>>& shape, Index which) : CollisionObject(shape), number(which) {}
  void place(const FclBox& box) { aabb = box; }
  Index number;
};

FclBox fcl_box(const Box3& box, Real slack) {
  return FclBox(box.min() - Vec3::Constant(slack), box.max() + Vec3::Constant(slack));
}

Index number_of(const Node* leaf) {
  return static_cast<const BoxObject*>(static_cast<const fcl::CollisionObject<Real>*>(leaf->data))->number;
}

}  // namespace

struct BroadPhase::Impl {
  explicit Impl(Real s) : slack(s), shape(std::make_shared<fcl::Sphere<Real>>(1)) {}

  Real slack;
  std::shared_ptr<fcl::CollisionGeometry<Real>> shape;  // objects need one; nobody looks at it
  std::vector<std::unique_ptr<BoxObject>> objects;
  std::vector<Box3> boxes, fat;  // as given; as the tree holds them (empty: not in the tree)
  fcl::DynamicAABBTreeCollisionManager<Real> manager;

  /// Calls leaf(number) for every fat box that meets `box`. The tree is walked here, so that questions are const and
  /// copy nothing.
  template <class F>
  void walk(const FclBox& box, std::vector<const Node*>& open, F&& leaf) const {
    if (manager.empty()) return;
    open.assign(1, manager.getTree().getRoot());
    while (!open.empty()) {
      const Node* node = open.back();
      open.pop_back();
      if (!node->bv.overlap(box)) continue;
      if (node->isLeaf()) {
        leaf(number_of(node));
      } else {
        open.push_back(node->children[0]);
        open.push_back(node->children[1]);
      }
    }
  }
};

BroadPhase::BroadPhase(Real slack) : impl_(std::make_unique<Impl>(slack)) {
  CHECK(std::isfinite(slack));
  CHECK_GE(slack, 0);
}
BroadPhase::~BroadPhase() = default;
BroadPhase::BroadPhase(BroadPhase&&) noexcept = default;
BroadPhase& BroadPhase::operator=(BroadPhase&&) noexcept = default;

void BroadPhase::update(Index i, const Box3& box) {
  Impl& m = *impl_;
  CHECK(box.min().allFinite() && box.max().allFinite());
  CHECK(!box.isEmpty());
  CHECK_LE(i, m.objects.size());
  const bool is_new = i == m.objects.size();
  if (is_new) {
    m.objects.push_back(std::make_unique<BoxObject>(m.shape, i));
    m.boxes.emplace_back();
    m.fat.emplace_back();
  }
  const bool in_tree = !m.fat[i].isEmpty();
  m.boxes[i] = box;
  if (in_tree && m.fat[i].contains(box)) return;

  m.fat[i] = Box3(box.min() - Vec3::Constant(m.slack), box.max() + Vec3::Constant(m.slack));
  m.objects[i]->place(fcl_box(box, m.slack));
  if (in_tree)
    m.manager.update(m.objects[i].get());
  else
    m.manager.registerObject(m.objects[i].get());
}

void BroadPhase::remove(Index i) {
  Impl& m = *impl_;
  CHECK_LT(i, m.objects.size());
  if (m.fat[i].isEmpty()) return;
  m.manager.unregisterObject(m.objects[i].get());
  m.fat[i].setEmpty();
}

std::size_t BroadPhase::size() const { return impl_->objects.size(); }

void BroadPhase::pairs(std::vector<std::array<Index, 2>>& out, const std::vector<unsigned char>& active) const {
  const Impl& m = *impl_;
  out.clear();
  if (!active.empty()) CHECK_EQ(active.size(), size());
  const auto asks = [&](Index i) { return active.empty() || active[i]; };
  std::vector<const Node*> open;
  for (Index i = 0; i < size(); ++i) {
    if (m.fat[i].isEmpty() || !asks(i)) continue;
    // Of two that ask, the lower one finds the pair; of one that does, that one.
    m.walk(fcl_box(m.boxes[i], 0), open, [&](Index j) {
      if (j == i || (j < i && asks(j)) || !m.boxes[i].intersects(m.boxes[j])) return;
      out.push_back({std::min(i, j), std::max(i, j)});
    });
  }
  std::sort(out.begin(), out.end());
}

void BroadPhase::query(const Box3& box, std::vector<Index>& out) const {
  const Impl& m = *impl_;
  out.clear();
  if (box.isEmpty()) return;
  std::vector<const Node*> open;
  m.walk(fcl_box(box, 0), open, [&](Index j) {
    if (m.boxes[j].intersects(box)) out.push_back(j);
  });
  std::sort(out.begin(), out.end());
}

}  // namespace effuse::geometry
