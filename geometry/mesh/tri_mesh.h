#pragma once

#include <array>
#include <map>
#include <string>
#include <vector>

#include "geometry/base/types.h"

namespace effuse::geometry {

using Triangle = std::array<Index, 3>;

/// Values on vertices: width numbers each, vertex after vertex. float: they are for eyes and shaders.
struct VertexAttribute {
  int width = 1;
  std::vector<float> values;
};

/// Triangles on shared vertices, counter-clockwise from outside.
///
///   positions   [m]
///   triangles   three indices into positions each
///   normals     unit, one a vertex, or empty
///   attributes  by name (ECOSYSTEM 4d): "temperature" [K], "velocity" [m/s] width 3, "crust" 0..1,
///               "color" width 3, linear light, ...; each holds width * positions.size() numbers
///
/// Fields vary freely; validate() (validate.h) says whether they agree.
struct TriMesh {
  std::vector<Vec3> positions;
  std::vector<Triangle> triangles;
  std::vector<Vec3> normals;
  std::map<std::string, VertexAttribute> attributes;
};

}  // namespace effuse::geometry
