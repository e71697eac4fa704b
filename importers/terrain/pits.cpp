#include "importers/terrain/pits.h"

#include <algorithm>
#include <cmath>

#include "geometry/base/zones.h"

namespace effuse::importers {

namespace {

/// Raises what is under water in the depressions that are shallow enough.
RemovedPits fill(std::vector<Real>& z, const Flood& flood, Real cell, Real deepest) {
  RemovedPits removed;
  for (std::size_t post = 0; post < z.size(); ++post) {
    const std::uint32_t number = flood.depression[post];
    if (number == Flood::kNone || flood.depressions[number].depth() > deepest) continue;
    ++removed.posts;
    removed.volume += (flood.level[post] - z[post]) * cell;
    z[post] = flood.level[post];
  }
  for (const Depression& d : flood.depressions) {
    if (d.depth() > deepest) continue;
    ++removed.pits;
    removed.deepest = std::max(removed.deepest, d.depth());
  }
  return removed;
}

/// Cuts a notch from the floor of each shallow depression to the first post as low on its way out.
void breach(std::vector<Real>& z, const Flood& flood, Real cell, Real deepest, RemovedPits& removed, std::vector<char>& changed) {
  for (const Depression& d : flood.depressions) {
    if (d.depth() > deepest) continue;
    ++removed.pits;
    removed.deepest = std::max(removed.deepest, d.depth());
    for (std::uint32_t post = flood.way_out[d.lowest_post]; post != Flood::kNone; post = flood.way_out[post]) {
      if (z[post] < d.floor) break;
      if (z[post] == d.floor) continue;
      removed.posts += !changed[post];
      changed[post] = 1;
      removed.volume += (z[post] - d.floor) * cell;
      z[post] = d.floor;
    }
  }
}

}  // namespace

RemovedPits remove_pits(std::vector<Real>& z, int nx, int ny, const Vec2& spacing, PitPolicy policy, Real deepest) {
  ZONE("import.pits");
  RemovedPits removed;
  if (policy == PitPolicy::kKeep) return removed;
  const Real cell = spacing.x() * spacing.y();
  std::vector<char> changed(z.size(), 0);
  // A notch drains the deepest post of a depression; what lower hollows it held are found by the next flood.
  constexpr int kRounds = 100;
  for (int round = 0; round < kRounds; ++round) {
    const Flood water = flood(z, nx, ny, Vec2::Zero(), spacing);
    const auto shallow = static_cast<std::size_t>(
        std::count_if(water.depressions.begin(), water.depressions.end(), [&](const Depression& d) { return d.depth() <= deepest; }));
    if (round == 0) removed.kept = water.depressions.size() - shallow;
    if (shallow == 0) break;
    if (policy == PitPolicy::kFill) {
      const std::size_t kept = removed.kept;
      removed = fill(z, water, cell, deepest);
      removed.kept = kept;
      break;
    }
    breach(z, water, cell, deepest, removed, changed);
  }
  return removed;
}

}  // namespace effuse::importers
