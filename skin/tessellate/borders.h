#pragma once

#include <array>
#include <vector>

#include "skin/tessellate/cells.h"
#include "skin/tessellate/on_particles.h"
#include "skin/tessellate/surface_walk.h"

/// For the .cpp files of this folder: where cells meet.
namespace effuse::skin {

/// A corner of cells: three where three meet, two on the way of a border.
struct Node {
  Spot spot;
  Vec3 up = Vec3::UnitZ();  ///< unit normal of the surface there
  bool settled = false;     ///< where it is as far from three particles
  std::array<Index, 3> cells = {kNone, kNone, kNone};
};

/// A straight border between two nodes, left and right as seen from the first.
struct Border {
  Index from, to;
  Index left, right;
};

struct Borders {
  std::vector<Node> nodes;
  std::vector<Border> borders;
};

/// Three cells in a triangle are a node; borders run through the middles of triangles with two cells from node to node. Nodes are
/// added on the way of closed borders (three), of borders with the same two ends (one each) and of bent ones (by their length, or round an edge of the surface), so that each cell
/// has three nodes or more, and no two borders the same ends.
/// Nodes of three particles are put where the surface is as far from all three, if no fourth is nearer there.
///   particles  if given, it is their surface that nodes are put on
Borders trace_borders(const LabelledMesh& mesh, const Cells& cells, const Regions& regions, std::span<const Vec3> site,
                      const SurfaceWalk& walk, const ParticleSurface* particles);

}  // namespace effuse::skin
