#include "importers/terrain/depressions.h"

#include <algorithm>
#include <cmath>
#include <functional>
#include <queue>
#include <utility>

namespace effuse::importers {

std::vector<Depression> closed_depressions(const geometry::HeightField& field) {
  const int nx = field.nx(), ny = field.ny();
  const std::vector<Real>& z = field.posts();
  const auto around = [&](std::size_t post, const auto& visit) {
    const int i = static_cast<int>(post % static_cast<std::size_t>(nx)), j = static_cast<int>(post / static_cast<std::size_t>(nx));
    for (int dj = -1; dj <= 1; ++dj)
      for (int di = -1; di <= 1; ++di)
        if ((di || dj) && i + di >= 0 && i + di < nx && j + dj >= 0 && j + dj < ny)
          visit(static_cast<std::size_t>(j + dj) * static_cast<std::size_t>(nx) + static_cast<std::size_t>(i + di));
  };

  // Outlets: posts on the border or beside a hole.
  using Level = std::pair<Real, std::size_t>;
  std::priority_queue<Level, std::vector<Level>, std::greater<>> open;
  std::vector<Real> level(z.size());
  std::vector<char> seen(z.size(), 0);
  for (std::size_t post = 0; post < z.size(); ++post) {
    if (std::isnan(z[post])) {
      seen[post] = 1;
      continue;
    }
    std::size_t neighbours = 0;
    around(post, [&](std::size_t other) { neighbours += !std::isnan(z[other]); });
    if (neighbours == 8) continue;
    seen[post] = 1;
    level[post] = z[post];
    open.push({z[post], post});
  }

  // Water stands at each post as high as on the lowest way out.
  while (!open.empty()) {
    const auto [height, post] = open.top();
    open.pop();
    around(post, [&, from = height](std::size_t other) {
      if (seen[other]) return;
      seen[other] = 1;
      level[other] = std::max(from, z[other]);
      open.push({level[other], other});
    });
  }

  // Posts under water, connected: one depression.
  std::vector<Depression> found;
  std::vector<char> counted(z.size(), 0);
  const auto wet = [&](std::size_t post) { return !std::isnan(z[post]) && level[post] > z[post]; };
  const Real cell = field.spacing().x() * field.spacing().y();
  for (std::size_t start = 0; start < z.size(); ++start) {
    if (counted[start] || !wet(start)) continue;
    Depression depression;
    depression.floor = depression.spill = level[start];
    std::vector<std::size_t> stack = {start};
    counted[start] = 1;
    while (!stack.empty()) {
      const std::size_t post = stack.back();
      stack.pop_back();
      ++depression.posts;
      depression.volume += (level[post] - z[post]) * cell;
      depression.spill = std::max(depression.spill, level[post]);
      if (z[post] < depression.floor) {
        depression.floor = z[post];
        depression.lowest = field.corner() + Vec2(static_cast<Real>(post % static_cast<std::size_t>(nx)) * field.spacing().x(),
                                                  static_cast<Real>(post / static_cast<std::size_t>(nx)) * field.spacing().y());
      }
      around(post, [&](std::size_t other) {
        if (counted[other] || !wet(other)) return;
        counted[other] = 1;
        stack.push_back(other);
      });
    }
    found.push_back(depression);
  }
  std::stable_sort(found.begin(), found.end(), [](const Depression& a, const Depression& b) { return a.depth() > b.depth(); });
  return found;
}

}  // namespace effuse::importers
