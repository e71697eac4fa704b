#include "importers/terrain/depressions.h"

#include <algorithm>
#include <cmath>
#include <functional>
#include <numeric>
#include <queue>
#include <utility>

#include "geometry/base/check.h"
#include "geometry/base/zones.h"

namespace effuse::importers {

Flood flood(const std::vector<Real>& z, int nx, int ny, const Vec2& corner, const Vec2& spacing) {
  ZONE("import.flood");
  CHECK_EQ(z.size(), static_cast<std::size_t>(nx) * static_cast<std::size_t>(ny));
  CHECK_LT(z.size(), std::size_t{Flood::kNone});
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
  Flood out;
  out.level.resize(z.size());
  out.way_out.assign(z.size(), Flood::kNone);
  out.depression.assign(z.size(), Flood::kNone);
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
    out.level[post] = z[post];
    open.push({z[post], post});
  }

  // Water stands at each post as high as on the lowest way out.
  while (!open.empty()) {
    const auto [height, post] = open.top();
    open.pop();
    around(post, [&, from = height, here = post](std::size_t other) {
      if (seen[other]) return;
      seen[other] = 1;
      out.level[other] = std::max(from, z[other]);
      out.way_out[other] = static_cast<std::uint32_t>(here);
      open.push({out.level[other], other});
    });
  }

  // Posts under water, connected: one depression.
  const auto wet = [&](std::size_t post) { return !std::isnan(z[post]) && out.level[post] > z[post]; };
  const Real cell = spacing.x() * spacing.y();
  std::vector<Depression> found;
  for (std::size_t start = 0; start < z.size(); ++start) {
    if (out.depression[start] != Flood::kNone || !wet(start)) continue;
    Depression depression;
    depression.floor = depression.spill = out.level[start];
    const auto number = static_cast<std::uint32_t>(found.size());
    std::vector<std::size_t> stack = {start};
    out.depression[start] = number;
    while (!stack.empty()) {
      const std::size_t post = stack.back();
      stack.pop_back();
      ++depression.posts;
      depression.volume += (out.level[post] - z[post]) * cell;
      depression.spill = std::max(depression.spill, out.level[post]);
      if (z[post] < depression.floor) {
        depression.floor = z[post];
        depression.lowest_post = post;
        depression.lowest = corner + Vec2(static_cast<Real>(post % static_cast<std::size_t>(nx)) * spacing.x(),
                                          static_cast<Real>(post / static_cast<std::size_t>(nx)) * spacing.y());
      }
      around(post, [&](std::size_t other) {
        if (out.depression[other] != Flood::kNone || !wet(other)) return;
        out.depression[other] = number;
        stack.push_back(other);
      });
    }
    found.push_back(depression);
  }

  std::vector<std::uint32_t> order(found.size()), place(found.size());
  std::iota(order.begin(), order.end(), 0u);
  std::stable_sort(order.begin(), order.end(), [&](std::uint32_t a, std::uint32_t b) { return found[a].depth() > found[b].depth(); });
  for (std::uint32_t k = 0; k < order.size(); ++k) {
    place[order[k]] = k;
    out.depressions.push_back(found[order[k]]);
  }
  for (std::uint32_t& number : out.depression)
    if (number != Flood::kNone) number = place[number];
  return out;
}

std::vector<Depression> closed_depressions(const geometry::HeightField& field) {
  return flood(field.posts(), field.nx(), field.ny(), field.corner(), field.spacing()).depressions;
}

}  // namespace effuse::importers
