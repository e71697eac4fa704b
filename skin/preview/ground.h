#pragma once

#include <array>
#include <vector>

#include "geometry/mesh/tri_mesh.h"
#include "skin/preview/light.h"

namespace effuse::skin {

/// The ground as it is drawn: the terrain as it is, an apron around it, a floor below the apron.
struct Ground {
  Vec3 origin = Vec3::Zero();  ///< [m] what positions are relative to: the terrain's centre, so that float will do
  std::vector<Vec3f> positions, normals;
  std::vector<geometry::Triangle> triangles;
  std::size_t terrain_vertices = 0;
  float low = 0, high = 1;  ///< heights of the terrain, relative
  float radius = 100;       ///< half the terrain's extent in the plane [m]
  float edge = 1;           ///< mean edge of the terrain's triangles [m]
};

/// Apron: every border edge of the terrain's largest border, where it faces outward, goes on away from the centre in
/// rings out to sixty radii, its height easing from the border's to the lowest border height within half a radius, with
/// low made-up hills from there. Where the terrain hangs over at its border, roof and floor of the hollow go on for a while, with a wall
/// between them. A terrain without border (closed, or empty) gets the floor alone.
/// Normals: by angle, smoothed twice over their neighbours, which hides the steps of a DEM in whole metres.
/// An open terrain whose triangles mostly face down is drawn turned over. Throws InputError when the terrain is not well
/// formed.
Ground build_ground(const geometry::TriMesh& terrain);

}  // namespace effuse::skin
