#include <algorithm>
#include <cmath>

#include "geometry/base/zones.h"
#include "skin/surface/level_set_impl.h"

namespace effuse::skin {

void drop_small_pieces(const Blocks& blocks, Real least, Field& phi, LevelSetReport& report) {
  ZONE("skin.pieces");
  std::vector<bool> seen(phi.size(), false);
  std::vector<std::size_t> piece;
  constexpr int kStep[6][3] = {{-1, 0, 0}, {1, 0, 0}, {0, -1, 0}, {0, 1, 0}, {0, 0, -1}, {0, 0, 1}};

  for (std::size_t start = 0; start < phi.size(); ++start) {
    if (seen[start]) continue;
    // Flood over voxels of the same side, until the rim of the blocks (the open air) is met or all are found.
    const bool inside = phi[start] < 0;
    bool open = false;
    Real volume = 0;
    piece.assign(1, start);
    seen[start] = true;
    for (std::size_t next = 0; next < piece.size(); ++next) {
      const std::size_t at = piece[next], b = at / kVoxels, v = at % kVoxels;
      // Voxels counted with a soft edge, the field's slope taken as one.
      volume += std::clamp(0.5 + static_cast<Real>(std::abs(phi[at])), 0.0, 1.0);
      const int p[3] = {static_cast<int>(v >> 6), static_cast<int>((v >> 3) & 7), static_cast<int>(v & 7)};
      for (const auto& d : kStep) {
        const int q[3] = {p[0] + d[0], p[1] + d[1], p[2] + d[2]};
        const Index block = blocks.around(b)[static_cast<std::size_t>(((q[0] >> 3) + 1) * 9 + ((q[1] >> 3) + 1) * 3 + (q[2] >> 3) + 1)];
        if (block == kNone) {
          open = open || !inside;
          continue;
        }
        const std::size_t to = block * kVoxels + voxel_index(q[0] & 7, q[1] & 7, q[2] & 7);
        if (seen[to] || (phi[to] < 0) != inside) continue;
        seen[to] = true;
        piece.push_back(to);
      }
    }
    if (open || volume >= least) continue;
    ++(inside ? report.dropped_pieces : report.filled_bubbles);
    for (const std::size_t at : piece) phi[at] = inside ? std::max(0.05f, -phi[at]) : std::min(-0.05f, -phi[at]);
  }
}

}  // namespace effuse::skin
