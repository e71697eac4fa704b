#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <span>
#include <vector>

#include "geometry/base/types.h"

namespace effuse::flow::bodies {

/// Fixed points in cubic cells: which of them lie in a box.
class PointGrid {
 public:
  PointGrid() = default;
  /// About eight points a cell, were they spread over a volume.
  explicit PointGrid(std::span<const Vec3> points) {
    for (const Vec3& p : points) box_.extend(p);
    if (points.empty()) return;
    const Vec3 extent = box_.sizes();
    const Real longest = extent.maxCoeff();
    const Real cells = std::min(Real{64}, std::ceil(std::cbrt(static_cast<Real>(points.size()) / 8)));
    size_ = longest > 0 ? longest / cells : 1;
    for (int k = 0; k < 3; ++k) n_[k] = static_cast<std::size_t>(extent[k] / size_) + 1;
    first_.assign(n_[0] * n_[1] * n_[2] + 1, 0);
    std::vector<std::size_t> cell(points.size());
    for (std::size_t i = 0; i < points.size(); ++i) {
      cell[i] = number(coordinates(points[i]));
      ++first_[cell[i] + 1];
    }
    for (std::size_t c = 1; c < first_.size(); ++c) first_[c] += first_[c - 1];
    std::vector<Index> next(first_.begin(), first_.end() - 1);
    order_.resize(points.size());
    for (std::size_t i = 0; i < points.size(); ++i) order_[next[cell[i]]++] = static_cast<Index>(i);
  }

  /// f(i) for points whose cells meet the box: all those in it, and some beside. In a fixed order.
  template <class F>
  void near(const Box3& box, F&& f) const {
    if (order_.empty() || !box_.intersects(box)) return;
    const auto low = coordinates(box.min()), high = coordinates(box.max());
    for (std::size_t z = low[2]; z <= high[2]; ++z)
      for (std::size_t y = low[1]; y <= high[1]; ++y) {
        const Index begin = first_[number({low[0], y, z})], end = first_[number({high[0], y, z}) + 1];
        for (Index k = begin; k < end; ++k) f(order_[k]);
      }
  }

 private:
  std::array<std::size_t, 3> coordinates(const Vec3& p) const {
    std::array<std::size_t, 3> c{};
    for (int k = 0; k < 3; ++k)
      c[k] = static_cast<std::size_t>(std::clamp((p[k] - box_.min()[k]) / size_, Real{0}, static_cast<Real>(n_[k] - 1)));
    return c;
  }
  std::size_t number(const std::array<std::size_t, 3>& c) const { return (c[2] * n_[1] + c[1]) * n_[0] + c[0]; }

  Box3 box_;
  Real size_ = 1;
  std::array<std::size_t, 3> n_{};
  std::vector<Index> first_, order_;
};

}  // namespace effuse::flow::bodies
