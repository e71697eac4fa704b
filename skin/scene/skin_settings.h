#pragma once

#include <string>
#include <vector>

#include "flow/scene/parameters.h"
#include "geometry/terrain/terrain.h"
#include "skin/color/lava_color.h"
#include "skin/detail/displace.h"
#include "skin/preview/preview.h"
#include "skin/scene/scene_camera.h"
#include "skin/surface/level_set.h"
#include "skin/tessellate/make_skin.h"

namespace effuse::skin {

/// The tables [skin], [output] and [preview] of a scene.
struct SkinSettings {
  LevelSetOptions level_set;  ///< spacing is the effect's, set when there is one
  Real voxel = 0.5;           ///< in spacings
  TessellationKind tessellation = TessellationKind::kLevelSet;
  Real coarsen = 0;           ///< [spacings], of kLevelSet only
  DisplaceOptions detail;     ///< spacing, rest_ratio, seed and view are filled in frame by frame (detail_at)
  Real edge_pixels = 0;       ///< edges this many pixels of the picture long; 0: no view
  LavaColorOptions color;

  bool ply = true, obj = true, glb = true, vdb = true;
  bool vtp = false, usda = false, bgeo = false;
  bool flipbook = false;       ///< made of ply or glb
  int checkpoint_every = 10;  ///< frames
  int keep_checkpoints = 0;   ///< the newest so many; 0: all
  // For people who study flows: maps of the whole run, and a line of figures a frame.
  bool maps = true, map_tif = true, map_asc = true;
  Real map_cell = 0;           ///< side of a map's cell [m]; 0: the terrain's, over a mesh two particle spacings
  Place map_cell_place;        ///< in the scene
  Real arrival_thickness = 0;  ///< lava has arrived where it is thicker [m]; 0: half a particle spacing
  int thickness_every = 0;     ///< frames between two maps of the thickness; 0: none
  bool series = true;

  bool preview = true;
  PreviewOptions picture;
  SceneCamera camera;  ///< and sun
};

SkinSettings read_skin_settings(flow::Parameters& root);

/// The detail's options at a moment of the film [s]: with the view of the picture's camera, when edges go by its pixels.
DisplaceOptions detail_at(const SkinSettings& settings, const geometry::Terrain& terrain, Real film_time);

/// What make_skin() is to do at a moment of the film [s] with particles of that spacing [m]; detail's seed and rest_ratio are the caller's.
SkinOptions skin_at(const SkinSettings& settings, const geometry::Terrain& terrain, Real film_time, Real spacing);

/// The picture's options at a moment of the film [s].
PreviewOptions picture_at(const SkinSettings& settings, const geometry::Terrain& terrain, Real film_time);

/// check_scene_camera() of its camera, where there are pictures.
void check_camera(const SkinSettings& settings, const geometry::Terrain& terrain, int frames, Real fps);

}  // namespace effuse::skin
