#pragma once

#include <algorithm>
#include <span>
#include <vector>

#include "geometry/mesh/tri_mesh.h"

namespace effuse::skin {

/// The triangles round each vertex of a mesh from which vertices are taken out one by one.
class Stars {
 public:
  Stars(std::size_t vertices, std::span<const geometry::Triangle> triangles) : range_(vertices), pool_(3 * triangles.size()) {
    std::vector<Index> count(vertices, 0);
    for (const geometry::Triangle& t : triangles)
      for (const Index v : t) ++count[v];
    Index sum = 0;
    for (std::size_t v = 0; v < vertices; ++v) {
      range_[v] = {sum, sum};
      sum += count[v];
    }
    for (std::size_t t = 0; t < triangles.size(); ++t)
      for (const Index v : triangles[t]) pool_[range_[v].end++] = static_cast<Index>(t);
  }
  std::span<const Index> of(Index v) const { return std::span(pool_).subspan(range_[v].begin, range_[v].end - range_[v].begin); }
  void remove(Index v, Index triangle) {
    const auto begin = pool_.begin() + range_[v].begin, end = pool_.begin() + range_[v].end;
    const auto last = std::remove(begin, end, triangle);
    range_[v].end -= static_cast<Index>(end - last);
  }
  /// v's triangles and w's become v's.
  void join(Index v, Index w) {
    const auto begin = static_cast<Index>(pool_.size());
    for (const Index u : {v, w})
      for (Index k = range_[u].begin; k < range_[u].end; ++k) pool_.push_back(Index{pool_[k]});
    range_[v] = {begin, static_cast<Index>(pool_.size())};
    range_[w] = {0, 0};
  }

 private:
  struct Range {
    Index begin, end;
  };
  std::vector<Range> range_;
  std::vector<Index> pool_;
};

}  // namespace effuse::skin
