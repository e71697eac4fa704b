#include "importers/points/spacing.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <numeric>
#include <vector>

#include "geometry/base/check.h"
#include "geometry/base/parallel.h"
#include "geometry/base/zones.h"

namespace effuse::importers {

namespace {

constexpr std::size_t kNearest = 4, kSample = 20000, kLeaf = 8;

/// Squares of the distances to the nearest ones found so far, rising.
struct Nearest {
  std::array<Real, kNearest> square;
  Nearest() { square.fill(std::numeric_limits<Real>::infinity()); }
  void add(Real s) {
    if (!(s > 0) || s >= square.back()) return;
    const auto at = std::upper_bound(square.begin(), square.end(), s);
    std::move_backward(at, square.end() - 1, square.end());
    *at = s;
  }
};

/// A k-d tree in an order of the points: the middle one of a range parts it along the axis that its depth says.
class Tree {
 public:
  explicit Tree(std::span<const Vec3> x) : x_(x), order_(x.size()) {
    std::iota(order_.begin(), order_.end(), Index{0});
    build(0, x.size(), 0);
  }

  void find(const Vec3& p, Nearest& nearest) const { find(p, 0, order_.size(), 0, nearest); }

 private:
  void build(std::size_t begin, std::size_t end, int axis) {
    if (end - begin <= kLeaf) return;
    const std::size_t middle = (begin + end) / 2;
    const auto at = [&](std::size_t i) { return order_.begin() + static_cast<std::ptrdiff_t>(i); };
    std::nth_element(at(begin), at(middle), at(end), [&](Index a, Index b) { return x_[a][axis] < x_[b][axis]; });
    build(begin, middle, (axis + 1) % 3);
    build(middle + 1, end, (axis + 1) % 3);
  }

  void find(const Vec3& p, std::size_t begin, std::size_t end, int axis, Nearest& nearest) const {
    if (end - begin <= kLeaf) {
      for (std::size_t i = begin; i < end; ++i) nearest.add((x_[order_[i]] - p).squaredNorm());
      return;
    }
    const std::size_t middle = (begin + end) / 2;
    const Vec3& parting = x_[order_[middle]];
    nearest.add((parting - p).squaredNorm());
    const Real beyond = p[axis] - parting[axis];
    const bool upper = beyond > 0;
    const int next = (axis + 1) % 3;
    upper ? find(p, middle + 1, end, next, nearest) : find(p, begin, middle, next, nearest);
    if (beyond * beyond < nearest.square.back()) upper ? find(p, begin, middle, next, nearest) : find(p, middle + 1, end, next, nearest);
  }

  std::span<const Vec3> x_;
  std::vector<Index> order_;
};

}  // namespace

Real estimate_spacing(std::span<const Vec3> x) {
  ZONE("points.spacing");
  for (const Vec3& p : x) CHECK(p.allFinite());
  const Tree tree(x);
  const std::size_t sample = std::min(x.size(), kSample);
  std::vector<Real> distance(sample);
  parallel_for(sample, [&](std::size_t k) {
    Nearest nearest;
    tree.find(x[k * x.size() / sample], nearest);
    Real sum = 0, count = 0;
    for (const Real s : nearest.square) {
      if (!std::isfinite(s)) break;
      sum += std::sqrt(s);
      count += 1;
    }
    distance[k] = count > 0 ? sum / count : 0;
  });
  std::erase(distance, 0);
  if (distance.empty()) return 0;
  const auto middle = distance.begin() + static_cast<std::ptrdiff_t>(distance.size() / 2);
  std::nth_element(distance.begin(), middle, distance.end());
  return *middle;
}

}  // namespace effuse::importers
