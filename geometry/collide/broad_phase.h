#pragma once

#include <array>
#include <memory>
#include <vector>

#include "geometry/base/types.h"

namespace effuse::geometry {

/// Which boxes meet: FCL's dynamic tree of boxes, behind numbers. Boxes are closed: touching ones meet.
///
/// A box that moves inside the fat one the tree holds (grown by `slack` on each side) costs nothing; only one that
/// leaves it is put into the tree anew. Pairs are those of the boxes themselves, not of the fat ones.
/// Not thread-safe, but const questions may be asked from many threads.
class BroadPhase {
 public:
  /// slack [m] >= 0, finite (checked).
  explicit BroadPhase(Real slack = 0);
  ~BroadPhase();
  BroadPhase(BroadPhase&&) noexcept;
  BroadPhase& operator=(BroadPhase&&) noexcept;

  /// Puts box i where it is now; numbers from 0 to size() (a new one). Finite, not empty (checked).
  void update(Index i, const Box3& box);
  /// Takes box i out: it meets nobody until updated again.
  void remove(Index i);
  std::size_t size() const;

  /// All pairs (i < j) of boxes that meet, by i and then j. Filter: pairs for which both flags are 0 are left out
  /// (flags empty: none is); size() of them.
  void pairs(std::vector<std::array<Index, 2>>& out, const std::vector<unsigned char>& active = {}) const;
  /// All boxes that meet `box`, rising.
  void query(const Box3& box, std::vector<Index>& out) const;

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace effuse::geometry
