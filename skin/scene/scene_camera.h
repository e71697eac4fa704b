#pragma once

#include <optional>
#include <vector>

#include "flow/scene/parameters.h"
#include "geometry/motion/curve.h"
#include "geometry/terrain/terrain.h"
#include "skin/preview/preview.h"

namespace effuse::skin {

/// The camera and the sun of a scene's table [preview], each number of them one, or keys by seconds of film. The camera stands
///   round what it looks at: a circle of the map (`view`), a point (`target`) or the whole terrain, at azimuth and elevation from it; or
///   where tables [[preview.key]] put it, smoothly, linearly or in jumps from key to key.
struct SceneCamera {
  /// Where it stands and looks at a moment of the film [s], in the terrain file's coordinates.
  struct Stand {
    Real time = 0;
    Vec3 position, target;
    bool on_ground = false;  ///< heights count from the ground at x, y
    Place place;
  };
  geometry::Curve<Real> azimuth, elevation;  ///< [rad]
  Real turn = 0;                             ///< of the azimuth [rad] a second of film
  geometry::Curve<Real> field_of_view;       ///< vertical [rad]
  std::vector<Real> view;                    ///< map x, y [m] of the middle and the radius; as far away as holds it. Empty: not
  std::vector<Real> target;                  ///< map x, y and, if not on the ground, z [m]; empty: not. At most one of view and target
  geometry::Curve<Real> distance;            ///< of the camera from target [m], > 0 with one
  std::vector<Stand> keys;                   ///< instead of view and target
  geometry::Between between = geometry::Between::kCatmullRom;
  Place place;                               ///< of target, or of the keys, in the scene
  geometry::Curve<Real> sun_azimuth, sun_elevation, sun, exposure;
};

/// The camera's keys of the table [preview].
SceneCamera read_scene_camera(flow::Parameters& preview, const PreviewOptions& usual);

/// Camera, sun and exposure of a moment of the film [s].
void set_camera(PreviewOptions& picture, const SceneCamera& camera, const geometry::Terrain& terrain, Real film_time);

/// Throws InputError at the scene's line when a camera with a target or keys stands in the ground at a frame of the film, looks at where
/// it stands, or its heights are to be those of ground that is not there.
///   frames, fps  of the film
void check_scene_camera(const SceneCamera& camera, const geometry::Terrain& terrain, int frames, Real fps, Real aspect);

}  // namespace effuse::skin
