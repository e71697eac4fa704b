#pragma once

#include <functional>
#include <span>
#include <vector>

#include "geometry/mesh/tri_mesh.h"
#include "skin/preview/light.h"

namespace effuse::skin {

/// The light of glowing triangles on what lies around them, without noise: summed once a frame into patches, and the
/// patches onto a grid of points over the ground; looked up bilinearly while shading.
class GlowField {
 public:
  GlowField() = default;

  /// Where light goes: height of the ground under (x, y), and whether ground lies between two points.
  struct Surroundings {
    std::function<float(float x, float y)> ground_height;
    std::function<bool(const Vec3f& from, const Vec3f& to)> hidden;
  };

  ///   positions  of the lava's vertices
  ///   glow       emitted radiance, linear, one a vertex
  /// Lava that does not glow makes an empty field. Same bits on any number of threads.
  GlowField(std::span<const Vec3f> positions, std::span<const geometry::Triangle> triangles, std::span<const Vec3f> glow,
            const Surroundings& surroundings);

  bool empty() const { return cells_.empty(); }
  /// Radiance of a white matt surface at p with normal n [same unit as glow]; 0 outside the grid.
  Vec3f operator()(const Vec3f& p, const Vec3f& n) const;

 private:
  struct Cell {
    Vec3f light = Vec3f::Zero();      ///< for a surface that faces the light
    Vec3f direction = Vec3f::Zero();  ///< mean towards the light, times luminance
  };
  int nx_ = 0, ny_ = 0;
  float x0_ = 0, y0_ = 0, cell_ = 1;
  std::vector<Cell> cells_;
};

}  // namespace effuse::skin
