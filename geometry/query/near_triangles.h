#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <span>
#include <vector>

#include "geometry/query/mesh_tree.h"

namespace effuse::geometry {

/// The nearest triangle of a mesh within a reach that is known beforehand: cells of a grid about the surface, each with the triangles that
/// can be nearest to a point in it, so that a query is one look-up and a few distances. What a MeshTree finds, in about half the
/// time; a reach of some triangles at most, or there are too many cells. Const queries from many threads.
class NearTriangles {
 public:
  /// reach: finite, > 0 (checked). Positions finite, indices in range (checked); both are copied. Triangles of no area are left
  /// out. nullopt where a MeshTree is better: a reach of more than kMostTriangles triangles' usual size (the root of their mean
  /// area), or more than kMostCells cells to look at, each once for every triangle in reach: making it would take seconds and
  /// hundreds of megabytes.
  static std::optional<NearTriangles> build(std::span<const Vec3> positions, std::span<const Triangle> triangles, Real reach);

  /// As MeshTree::nearest for reach up to that of build (checked): of triangles at the same distance the one with the smallest number.
  std::optional<MeshTree::Nearest> nearest(const Vec3& p, Real reach) const;

  Real reach() const { return reach_; }
  std::size_t bytes() const;

  static constexpr Real kMostTriangles = 4;
  static constexpr Real kMostCells = 3e7;

 private:
  NearTriangles() = default;
  struct Corners {
    Vec3 a, b, c;
  };
  struct Cell {
    std::uint64_t key = kNoCell;
    std::uint32_t begin = 0, end = 0;
  };
  static constexpr std::uint64_t kNoCell = ~std::uint64_t{0};
  std::uint64_t key_of(const Vec3& p) const;

  Real reach_ = 0, cell_ = 0;
  Box3 box_;                           // of the mesh, and its reach
  std::array<std::uint64_t, 3> cells_{};  // along each axis
  std::vector<Corners> corners_;       // of all triangles
  std::vector<Index> candidates_;      // cell after cell, rising
  std::vector<Cell> table_;            // open addressing, a power of two long
};

}  // namespace effuse::geometry
