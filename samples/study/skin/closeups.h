#pragma once

#include <vector>

#include "geometry/mesh/points.h"
#include "geometry/mesh/tri_mesh.h"
#include "geometry/terrain/terrain.h"
#include "skin/detail/displace.h"
#include "skin/preview/preview.h"

/// The lava that pictures of the kinds of skin are taken of.
namespace effuse::study {

/// How far lava has cooled: its surface's temperature and crust at the back and at the front.
struct CoolingStage {
  const char* name;
  Real back = 0, front = 0;              ///< [K]
  Real crust_back = 0, crust_front = 0;  ///< 0 .. 1
};
/// hot, cooling, cold.
inline constexpr CoolingStage kCoolingStages[] = {{"hot", 1450, 1340, 0, 0.25}, {"cooling", 1380, 1190, 0.4, 0.9}, {"cold", 620, 420, 1, 1}};

/// A toe of lava that has run down a slope of nine degrees along +x: 26 spacings long, 22 wide, 5 deep; about 2,300 particles,
/// at rest in a liquid's disorder. It slows down towards its front, and its material frames have been squeezed along the way and
/// spread across it. Spacing 1.
struct LavaToe {
  static constexpr Real kLength = 26, kHalfWidth = 11, kDepth = 5, kSlope = 0.16;
  std::vector<Vec3> x, velocity, rest;
  std::vector<Real> radius, temperature, crust;
  std::vector<std::uint64_t> id;
  explicit LavaToe(const CoolingStage& stage);
  geometry::Points points() const;
  geometry::Terrain ground() const;
};

/// A picture of the toe from close by: the same camera and light for all.
skin::PreviewOptions view_of_toe(int width, int height);

/// The toe's skin, coloured. kind: nullptr: without displacement. Edges are as long as `pixels` of the picture where it is seen.
geometry::TriMesh skin_of_toe(const LavaToe& toe, const skin::SkinKind* kind, const skin::PreviewOptions& picture, Real pixels);

}  // namespace effuse::study
