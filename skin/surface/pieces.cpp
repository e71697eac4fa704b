#include <algorithm>
#include <cmath>

#include "geometry/base/zones.h"
#include "skin/surface/level_set_impl.h"

namespace effuse::skin {

namespace {

/// Face-connected sets of voxels on one side of the surface.
struct Piece {
  std::size_t begin, end;  // its voxels in Pieces::voxels
  bool inside;
  bool open;     // outside, and reaches the rim of the blocks: the air
  Real volume;   // [voxels], with a soft edge, the field's slope taken as one
  bool settled;  // holds a particle
};

struct Pieces {
  std::vector<std::size_t> voxels;
  std::vector<Index> of;  // the piece of each voxel; kNone: not looked at
  std::vector<Piece> pieces;
};

/// Every piece inside, and outside too when asked for.
Pieces find_pieces(const Blocks& blocks, const Field& phi, bool outside_too) {
  constexpr int kStep[6][3] = {{-1, 0, 0}, {1, 0, 0}, {0, -1, 0}, {0, 1, 0}, {0, 0, -1}, {0, 0, 1}};
  Pieces found;
  found.of.assign(phi.size(), kNone);
  for (std::size_t start = 0; start < phi.size(); ++start) {
    const bool inside = phi[start] < 0;
    if (found.of[start] != kNone || (!inside && !outside_too)) continue;
    const Index name = static_cast<Index>(found.pieces.size());
    Piece piece{found.voxels.size(), 0, inside, false, 0, false};
    found.voxels.push_back(start);
    found.of[start] = name;
    for (std::size_t next = piece.begin; next < found.voxels.size(); ++next) {
      const std::size_t at = found.voxels[next], b = at / kVoxels, v = at % kVoxels;
      piece.volume += std::min(0.5 + static_cast<Real>(std::abs(phi[at])), 1.0);
      const int p[3] = {static_cast<int>(v >> 6), static_cast<int>((v >> 3) & 7), static_cast<int>(v & 7)};
      for (const auto& d : kStep) {
        const int q[3] = {p[0] + d[0], p[1] + d[1], p[2] + d[2]};
        const Index block = blocks.around(b)[static_cast<std::size_t>(((q[0] >> 3) + 1) * 9 + ((q[1] >> 3) + 1) * 3 + (q[2] >> 3) + 1)];
        if (block == kNone) {
          piece.open = piece.open || !inside;
          continue;
        }
        const std::size_t to = block * kVoxels + voxel_index(q[0] & 7, q[1] & 7, q[2] & 7);
        if (found.of[to] != kNone || (phi[to] < 0) != inside) continue;
        found.of[to] = name;
        found.voxels.push_back(to);
      }
    }
    piece.end = found.voxels.size();
    found.pieces.push_back(piece);
  }
  return found;
}

/// Marks the pieces with a voxel at a corner of a particle's cell.
void settle(const Blocks& blocks, const ParticleGrid& particles, Pieces& found) {
  for (const Vec3& x : particles.x())
    for (int corner = 0; corner < 8; ++corner) {
      const Vec3 p = x.array().floor().matrix() + Vec3(corner & 1, (corner >> 1) & 1, corner >> 2);
      const Index b = blocks.block_at(p);
      if (b == kNone) continue;
      const auto in = [&](int axis) { return static_cast<int>(p[axis]) & 7; };
      const Index piece = found.of[b * kVoxels + voxel_index(in(0), in(1), in(2))];
      if (piece != kNone) found.pieces[piece].settled = true;
    }
}

}  // namespace

void drop_pieces(const Blocks& blocks, const ParticleGrid& particles, Real least, Field& phi, LevelSetReport& report) {
  ZONE("skin.pieces");
  Pieces found = find_pieces(blocks, phi, least > 0);
  settle(blocks, particles, found);
  for (const Piece& piece : found.pieces) {
    const bool webs = piece.inside && !piece.settled, small = piece.volume < least && !piece.open;
    if (!webs && !small) continue;
    ++(!piece.inside ? report.filled_bubbles : webs ? report.dropped_webs : report.dropped_pieces);
    for (std::size_t i = piece.begin; i < piece.end; ++i) {
      float& value = phi[found.voxels[i]];
      value = piece.inside ? std::max(0.05f, -value) : std::min(-0.05f, -value);
    }
  }
}

}  // namespace effuse::skin
