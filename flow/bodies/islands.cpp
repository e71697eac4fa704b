#include "flow/bodies/islands.h"

#include <algorithm>
#include <numeric>

namespace effuse::flow::bodies {

std::vector<Island> make_islands(std::span<const unsigned char> moving, std::span<const Link> contacts, std::span<const std::pair<JointId, Link>> joints) {
  const Index n = static_cast<Index>(moving.size());
  std::vector<Index> root(n);
  std::iota(root.begin(), root.end(), Index{0});
  const auto find = [&](Index i) {
    while (root[i] != i) i = root[i] = root[root[i]];
    return i;
  };
  const auto moves = [&](Index i) { return i < n && moving[i]; };
  const auto join = [&](const Link& link) {
    if (!moves(link.a) || !moves(link.b)) return;
    const Index a = find(link.a), b = find(link.b);
    root[std::max(a, b)] = std::min(a, b);  // the lowest body is the root: numbering needs no order of joining
  };
  for (const Link& link : contacts) join(link);
  for (const auto& [id, link] : joints) join(link);

  std::vector<Island> islands;
  std::vector<Index> number(n);
  for (Index i = 0; i < n; ++i) {
    if (!moving[i]) continue;
    const Index r = find(i);
    if (r == i) {
      number[i] = static_cast<Index>(islands.size());
      islands.emplace_back();
    }
    islands[number[r]].bodies.push_back(i);
  }
  const auto island_of = [&](const Link& link) -> Island* {
    if (moves(link.a)) return &islands[number[find(link.a)]];
    if (moves(link.b)) return &islands[number[find(link.b)]];
    return nullptr;
  };
  for (Index k = 0; k < contacts.size(); ++k)
    if (Island* island = island_of(contacts[k])) island->points.push_back(k);
  for (const auto& [id, link] : joints)
    if (Island* island = island_of(link)) island->joints.push_back(id);
  return islands;
}

}  // namespace effuse::flow::bodies
