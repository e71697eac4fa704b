#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <memory>
#include <numeric>

#include "geometry/base/parallel.h"
#include "geometry/base/zones.h"
#include "skin/surface/level_set_impl.h"

namespace effuse::skin {

namespace {

/// Sets joined under the smallest of their numbers.
struct DisjointSets {
  std::vector<Index> parent;
  explicit DisjointSets(std::size_t n) : parent(n) { std::iota(parent.begin(), parent.end(), Index{0}); }
  Index root(Index a) {
    while (parent[a] != a) a = parent[a] = parent[parent[a]];
    return a;
  }
  void join(Index a, Index b) {
    a = root(a), b = root(b);
    if (a != b) parent[std::max(a, b)] = std::min(a, b);
  }
};

/// -1: all of a block is inside, 1 outside, 0 both; row: bit k of row r, voxel k of it is inside.
constexpr std::size_t kRows = kSide * kSide;
std::int8_t side_of(const float* phi, std::array<std::uint8_t, kRows>& row) {
  std::uint8_t any = 0, all = 255;
  for (std::size_t r = 0; r < kRows; ++r) {
    unsigned bits = 0;
    for (std::size_t k = 0; k < kSide; ++k) bits |= (phi[r * kSide + k] < 0 ? 1u : 0u) << k;
    row[r] = static_cast<std::uint8_t>(bits);
    any |= row[r];
    all &= row[r];
  }
  return static_cast<std::int8_t>(any == 0 ? 1 : all == 255 ? -1 : 0);
}

/// Row by row along z: runs of voxels on one side, joined with those beside them in the two rows before.
BlockPieces pieces_of(const std::array<std::uint8_t, kRows>& row) {
  BlockPieces found;
  struct Run {
    std::uint8_t end;  // of its voxels in the row; it begins where the one before ended
    std::uint8_t inside;
    std::uint16_t parent;
  };
  std::array<Run, kVoxels> run;
  std::array<std::uint16_t, kRows + 1> begin;  // of each row's runs
  const auto root = [&](std::uint16_t a) {
    while (run[a].parent != a) a = run[a].parent = run[run[a].parent].parent;
    return a;
  };
  std::uint16_t runs = 0;
  for (std::size_t r = 0; r < kRows; ++r) {
    begin[r] = runs;
    for (unsigned k = 0; k < kSide; ++runs) {
      const unsigned side = (row[r] >> k) & 1u, other = (side ? ~unsigned{row[r]} : unsigned{row[r]} | 256u) >> k;
      k = std::min<unsigned>(kSide, k + static_cast<unsigned>(std::countr_zero(other)));
      run[runs] = {static_cast<std::uint8_t>(k), static_cast<std::uint8_t>(side), runs};
    }
    begin[r + 1] = runs;
    for (const std::size_t step : {std::size_t{1}, std::size_t{kSide}}) {
      if (step == 1 ? r % kSide == 0 : r < kSide) continue;
      std::uint16_t a = begin[r], c = begin[r - step];
      while (a < begin[r + 1] && c < begin[r - step + 1]) {
        if (run[a].inside == run[c].inside) {
          const std::uint16_t ra = root(a), rc = root(c);
          run[std::max(ra, rc)].parent = std::min(ra, rc);
        }
        const std::uint8_t ends_a = run[a].end, ends_c = run[c].end;
        if (ends_a <= ends_c) ++a;
        if (ends_c <= ends_a) ++c;
      }
    }
  }
  std::array<std::uint16_t, kVoxels> name;
  found.of.resize(kVoxels);
  for (std::size_t r = 0; r < kRows; ++r)
    for (std::uint16_t a = begin[r]; a < begin[r + 1]; ++a) {
      const std::uint16_t first = root(a);
      if (first == a) {
        name[a] = static_cast<std::uint16_t>(found.inside.size());
        found.inside.push_back(run[a].inside);
      } else {
        name[a] = name[first];
      }
      for (std::size_t k = a == begin[r] ? 0 : run[a - 1u].end; k < run[a].end; ++k) found.of[r * kSide + k] = name[a];
    }
  return found;
}

}  // namespace

std::vector<std::uint8_t> drop_pieces(const Blocks& blocks, const ParticleGrid& particles, Real least, Field& phi, LevelSetReport& report,
                                      Pieces* last, std::span<const Index> unchanged) {
  ZONE("skin.pieces");
  const std::size_t n = blocks.size();
  Pieces in;
  in.side.resize(n);
  in.sets.resize(n);
  in.blocks.resize(n);
  const auto kept = [&](std::size_t b) { return !unchanged.empty() && unchanged[b] != kNone; };
  parallel_for(
      n,
      [&](std::size_t b) {
        if (kept(b)) {
          in.side[b] = last->side[unchanged[b]];
          in.sets[b] = last->sets[unchanged[b]];
          in.blocks[b] = std::move(last->blocks[unchanged[b]]);
          return;
        }
        std::array<std::uint8_t, kRows> row;
        in.side[b] = side_of(&phi[b * kVoxels], row);
        if (in.side[b] == 0) in.blocks[b] = std::make_unique<BlockPieces>(pieces_of(row));
        in.sets[b] = in.blocks[b] ? static_cast<std::uint16_t>(in.blocks[b]->inside.size()) : std::uint16_t{1};
      },
      64);
  const auto sets_of = [&](std::size_t b) { return std::size_t{in.sets[b]}; };
  const auto set_at = [&](std::size_t b, std::size_t voxel) { return in.blocks[b] ? in.blocks[b]->of[voxel] : std::uint16_t{0}; };
  const auto is_inside = [&](std::size_t b, std::size_t set) { return in.blocks[b] ? in.blocks[b]->inside[set] != 0 : in.side[b] < 0; };
  std::vector<Index> first(n + 1, 0);
  for (std::size_t b = 0; b < n; ++b) first[b + 1] = first[b] + static_cast<Index>(sets_of(b));

  // Sets of neighbouring blocks that meet in a face: told by the block with more than one, by the lower of two of these.
  constexpr std::size_t kNextSlot[3] = {22, 16, 14}, kSlotBefore[3] = {4, 10, 12}, kStep[3] = {64, 8, 1};  // the blocks beside along each axis
  parallel_for(
      n,
      [&](std::size_t b) {
        if (!in.blocks[b]) return;
        for (std::size_t axis = 0; axis < 3; ++axis)
          for (const bool up : {true, false}) {
            const Index other = blocks.around(b)[(up ? kNextSlot : kSlotBefore)[axis]];
            BlockPieces::Side& side = (up ? in.blocks[b]->next : in.blocks[b]->before)[axis];
            const bool meets = other != kNone && (up || !in.blocks[other]);
            if (meets && side.met && kept(b) && kept(other)) continue;
            side.met = meets;
            side.meeting.clear();
            if (!meets) continue;
            const std::size_t step = kStep[axis], others[2] = {axis == 0 ? 8u : 64u, axis == 2 ? 8u : 1u};
            for (std::size_t r = 0; r < kRows; ++r) {
              const std::size_t v = r / kSide * others[0] + r % kSide * others[1];
              const std::uint16_t mine = set_at(b, up ? v + 7 * step : v), theirs = set_at(other, up ? v : v + 7 * step);
              if (is_inside(b, mine) != is_inside(other, theirs)) continue;
              const std::array<std::uint16_t, 2> pair = {mine, theirs};
              if (side.meeting.empty() || side.meeting.back() != pair) side.meeting.push_back(pair);
            }
          }
      },
      16);
  DisjointSets sets(first[n]);
  for (std::size_t b = 0; b < n; ++b)
    for (std::size_t axis = 0; axis < 3; ++axis) {
      const Index next = blocks.around(b)[kNextSlot[axis]], before = blocks.around(b)[kSlotBefore[axis]];
      if (!in.blocks[b]) {
        if (next != kNone && in.side[b] == in.side[next]) sets.join(first[b], first[next]);
        continue;
      }
      for (const auto& [mine, theirs] : in.blocks[b]->next[axis].meeting) sets.join(first[b] + mine, first[next] + theirs);
      for (const auto& [mine, theirs] : in.blocks[b]->before[axis].meeting) sets.join(first[b] + mine, first[before] + theirs);
    }

  struct Piece {
    bool settled = false;  // a voxel at a corner of a particle's cell
    bool open = false;     // reaches the rim of the blocks
    Real volume = 0;       // [voxels], with a soft edge, the field's slope taken as one
  };
  std::vector<Piece> pieces(first[n]);
  std::size_t unsettled = 0;  // pieces of lava without a particle so far
  for (std::size_t b = 0; b < n; ++b)
    for (std::size_t k = 0; k < sets_of(b); ++k) {
      const Index name = first[b] + static_cast<Index>(k);
      unsettled += is_inside(b, k) && sets.root(name) == name;
    }
  Index home = kNone;  // of the particle before: the next one is often in the same block
  for (const Vec3& x : particles.x()) {
    if (unsettled == 0) break;
    const int i = static_cast<int>(std::floor(x.x())), j = static_cast<int>(std::floor(x.y())), k = static_cast<int>(std::floor(x.z()));
    const auto is_at = [&](Index b) { return blocks.coords()[b][0] == i >> 3 && blocks.coords()[b][1] == j >> 3 && blocks.coords()[b][2] == k >> 3; };
    if (home == kNone || !is_at(home)) home = blocks.block_at(Vec3(i, j, k));
    if (home == kNone) continue;
    Index last_block = kNone, last_set = kNone;
    for (int corner = 0; corner < 8; ++corner) {
      const int a = (i & 7) + (corner >> 2), c = (j & 7) + ((corner >> 1) & 1), e = (k & 7) + (corner & 1);
      const Index b = blocks.around(home)[static_cast<std::size_t>(13 + 9 * (a >> 3) + 3 * (c >> 3) + (e >> 3))];
      if (b == kNone) continue;
      const Index set = set_at(b, voxel_index(a & 7, c & 7, e & 7));
      if (b == last_block && set == last_set) continue;
      last_block = b, last_set = set;
      Piece& piece = pieces[sets.root(first[b] + set)];
      if (piece.settled) continue;
      piece.settled = true;
      unsettled -= is_inside(b, set);
    }
  }
  if (least > 0)
    for (std::size_t b = 0; b < n; ++b) {
      const auto piece = [&](std::uint16_t k) -> Piece& { return pieces[sets.root(first[b] + Index{k})]; };
      std::vector<Real> volume(sets_of(b), 0.0);
      for (std::size_t v = 0; v < kVoxels; ++v) volume[set_at(b, v)] += std::min(0.5 + static_cast<Real>(std::abs(phi[b * kVoxels + v])), 1.0);
      for (std::size_t k = 0; k < volume.size(); ++k) piece(static_cast<std::uint16_t>(k)).volume += volume[k];
      for (std::size_t face = 0; face < 6; ++face) {
        constexpr std::size_t kSlot[6] = {4, 22, 10, 16, 12, 14};  // beside the block, by axis
        if (blocks.around(b)[kSlot[face]] != kNone) continue;
        for (std::size_t v = 0; v < kVoxels; ++v) {
          const std::uint16_t k = set_at(b, v);
          if ((v / kStep[face / 2] & 7) == (face % 2 == 0 ? 0u : 7u) && !is_inside(b, k)) piece(k).open = true;
        }
      }
    }

  std::vector<std::uint8_t> dropped(first[n], 0);
  for (std::size_t b = 0; b < n; ++b)
    for (std::size_t k = 0; k < sets_of(b); ++k) {
      const Index name = first[b] + static_cast<Index>(k), root = sets.root(name);
      const Piece& piece = pieces[root];
      const bool web = is_inside(b, k) && !piece.settled, small = piece.volume < least && !piece.open;
      if (!web && !small) continue;
      dropped[name] = 1;
      if (root == name) ++(!is_inside(b, k) ? report.filled_bubbles : web ? report.dropped_webs : report.dropped_pieces);
    }
  std::vector<std::uint8_t> touched(n, 0);
  parallel_for(
      n,
      [&](std::size_t b) {
        if (std::none_of(dropped.begin() + first[b], dropped.begin() + first[b + 1], [](std::uint8_t d) { return d != 0; })) return;
        touched[b] = 1;
        for (std::size_t v = 0; v < kVoxels; ++v) {
          const std::uint16_t k = set_at(b, v);
          float& value = phi[b * kVoxels + v];
          if (dropped[first[b] + k]) value = is_inside(b, k) ? std::max(0.05f, -value) : std::min(-0.05f, -value);
        }
      },
      64);
  if (last) *last = std::move(in);
  return touched;
}

}  // namespace effuse::skin
