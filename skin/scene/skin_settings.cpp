#include "skin/scene/skin_settings.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <optional>

#include "geometry/base/error.h"
#include "skin/preview/gloss.h"

namespace effuse::skin {

SkinSettings read_skin_settings(flow::Parameters& root) {
  using flow::Parameters;
  SkinSettings s;

  Parameters skin = root.table("skin", "the lava's surface");
  s.voxel = skin.number("voxel", "", s.voxel, {0.1, 1}, "of the level set, in particle spacings");
  LevelSetOptions& level_set = s.level_set;
  level_set.influence = skin.number("influence", "", level_set.influence, {1, 4}, "a particle is felt within this many spacings");
  level_set.radius = skin.number("radius", "", level_set.radius, {0.3, 1}, "of the sphere round a lone particle, in spacings");
  level_set.cover = skin.number("cover", "", level_set.cover, {0, 1}, "of the ball round each particle that is lava whatever its neighbours say, in spacings: keeps corners, edges and thin fronts; 0: none");
  level_set.kernel = static_cast<SurfaceKernel>(skin.choice("kernel", {kSurfaceKernelNames.begin(), kSurfaceKernelNames.end()}, static_cast<std::size_t>(level_set.kernel),
                                                            "particles are averaged with spheres, or with ellipsoids that follow the surface: flatter, sharper fronts, slower"));
  if (level_set.kernel == SurfaceKernel::kAnisotropic) level_set.smoothing = 0;
  level_set.smoothing = static_cast<int>(skin.integer("smoothing", level_set.smoothing, 0, 20, "passes of mean-curvature flow"));
  if (!(level_set.influence > level_set.radius + 1))
    skin.fault(skin.has("influence") ? "influence" : "radius", fmt::format("influence {:g} with radius {:g}: wanted an influence of more than the radius and one spacing", level_set.influence, level_set.radius));
  if (level_set.cover > level_set.radius) skin.fault(skin.has("cover") ? "cover" : "radius", fmt::format("cover {:g} with radius {:g}: wanted a cover of no more than the radius", level_set.cover, level_set.radius));
  level_set.drop_volume = skin.number("drop_volume", "", level_set.drop_volume, Parameters::not_negative(), "pieces of fewer particles are left out");
  level_set.match_volume = skin.flag("match_volume", level_set.match_volume, "enclose the particles' volume");
  s.tessellation = static_cast<TessellationKind>(skin.choice("tessellation", {kTessellationNames.begin(), kTessellationNames.end()}, static_cast<std::size_t>(s.tessellation),
                                                             "levelset: triangles of one size; voronoi: fans that live with their particle"));
  s.coarsen = skin.number("coarsen", "", s.coarsen, {0, 1}, "fewer triangles where the skin is flat to so many spacings; 0: none; goes with levelset");
  if (s.coarsen > 0 && s.tessellation == TessellationKind::kVoronoi) skin.fault("coarsen", "goes with tessellation = \"levelset\": voronoi's triangles belong to their particles");
  DisplaceOptions& detail = s.detail;
  const std::vector<std::string> kinds(kSkinKindNames.begin(), kSkinKindNames.end());
  detail.kind = static_cast<SkinKind>(skin.choice("kind", kinds, static_cast<std::size_t>(detail.kind),
                                                  "aa clinkers, pahoehoe ropes, block plates, obsidian folds; noise: swells and a net of cracks"));
  detail.amplitude = skin.number("amplitude", "", detail.amplitude, {0, 10}, "of the bumps where cold, in spacings; 0: none");
  detail.wavelength = skin.number("wavelength", "", detail.wavelength, {0.01, 1e6}, "of the coarsest bumps, in spacings");
  detail.octaves = static_cast<int>(skin.integer("octaves", detail.octaves, 1, 12, "of the bumps, each half as wide"));
  detail.gain = skin.number("gain", "", detail.gain, {0, 1}, "height from octave to octave");
  detail.roughness = skin.number("roughness", "", detail.roughness, {0, 1}, "share of the fine bumps; noise: 0 swells, 1 clinker");
  detail.molten_share = skin.number("molten_share", "", detail.molten_share, {0, 1}, "of the bumps' height, where molten");
  detail.solid = skin.number("solid", "K", detail.solid, {0, 5000, true}, "cooler than this the bumps are fully grown");
  detail.fold_wavelength = skin.number("fold_wavelength", "", detail.fold_wavelength, {0, 1e6}, "of ropes and folds, in spacings; 0: the kind's own");
  detail.fold_time = skin.number("fold_time", "s", detail.fold_time, Parameters::not_negative(), "in which the surface's strain rate folds it");
  detail.edge = skin.number("edge", "", detail.edge, {0.05, 10}, "length of the mesh's edges, in spacings");
  detail.oversample = skin.number("oversample", "", detail.oversample, {1, 16}, "edges so many times shorter, with no finer bumps: triangles follow the bumps more closely and change less from frame to frame; 4 for stills and slow shots");
  s.edge_pixels = skin.number("edge_pixels", "", s.edge_pixels, {0, 1000}, "edges as long as this many pixels of the picture's camera, where that is more than edge; 0: edge everywhere");
  s.color.strength = skin.number("glow", "", s.color.strength, {0, 1e6}, "light of lava at 1200 degC, white paper in the sun is 1");

  s.color.exponent = skin.number("glow_exponent", "", s.color.exponent, {0, 30}, "glow goes with this power of the temperature: 4 flat, 17 physical");
  s.color.molten = skin.number("molten", "K", s.color.molten, {0, 5000, true}, "hotter than this the lava has no crust of plates");
  s.color.plated = skin.number("plated", "K", s.color.plated, {0, 5000, true}, "cooler than this it is all plates, with cracks between");
  s.color.plate = skin.number("plate", "K", s.color.plate, {0, 5000, true}, "apparent temperature of a closed plate over hot lava");
  s.color.crack_width = skin.number("crack_width", "", s.color.crack_width, {0, 1}, "share of the plated surface that is cracks, roughly");
  if (s.color.plated >= s.color.molten) skin.fault("plated", "is not below molten");
  detail.molten = s.color.molten;
  if (detail.solid >= detail.molten) skin.fault("solid", "is not below molten");

  Parameters output = root.table("output", "what is written for each frame");
  const std::vector<std::string> formats = {"ply", "obj", "glb", "vdb", "vtp", "usda", "bgeo", "glb-flipbook"};
  const std::vector<std::size_t> wanted = output.choices("formats", formats, {0, 1, 2, 3}, "files of the skin; bgeo: of the particles; glb-flipbook: one file of the film, made of ply or glb");
  const auto has = [&](std::size_t format) { return std::find(wanted.begin(), wanted.end(), format) != wanted.end(); };
  s.ply = has(0);
  s.obj = has(1);
  s.glb = has(2);
  s.vdb = has(3);
  s.vtp = has(4);
  s.usda = has(5);
  s.bgeo = has(6);
  s.flipbook = has(7);
  if (s.flipbook && !s.ply && !s.glb) output.fault("formats", "glb-flipbook is made of the frames' ply or glb: wanted one of them beside it");
  s.checkpoint_every = static_cast<int>(output.integer("checkpoint_every", s.checkpoint_every, 1, 10000, "frames between two checkpoints"));
  s.keep_checkpoints = static_cast<int>(output.integer("keep_checkpoints", s.keep_checkpoints, 0, 10000, "so many of the newest stay, 0: all; a run may be gone on with differently after any that is there"));
  if (s.keep_checkpoints == 1) output.fault("keep_checkpoints", "is 1: wanted two at least, one to fall back on should the newest be damaged, or 0 for all");
  s.maps = output.flag("maps", s.maps, "maps/: largest thickness, highest temperature, arrival time, deposit");
  const std::vector<std::size_t> map_formats = output.choices("map_formats", {"tif", "asc"}, {0, 1}, "GeoTIFF, ESRI ASCII");
  s.map_tif = std::find(map_formats.begin(), map_formats.end(), std::size_t{0}) != map_formats.end();
  s.map_asc = std::find(map_formats.begin(), map_formats.end(), std::size_t{1}) != map_formats.end();
  s.map_cell = output.number("map_cell", "m", s.map_cell, Parameters::not_negative(), "side of a map's cell; 0: as the terrain's, over a mesh two particle spacings");
  s.map_cell_place = output.place("map_cell");
  s.arrival_thickness = output.number("arrival_thickness", "m", s.arrival_thickness, Parameters::not_negative(), "lava has arrived where it is thicker; 0: half a particle spacing");
  s.thickness_every = static_cast<int>(output.integer("thickness_every", s.thickness_every, 0, 1'000'000, "frames between two maps of the thickness; 0: none"));
  s.series = output.flag("series", s.series, "flow.csv: front, area, volume, discharge, temperatures, heat budget of every frame");

  Parameters preview = root.table("preview", "a ray-traced picture for each frame");
  s.preview = preview.flag("pictures", s.preview, "make them");
  PreviewOptions& picture = s.picture;
  picture.width = static_cast<int>(preview.integer("width", picture.width, 16, 8192, "pixels"));
  picture.height = static_cast<int>(preview.integer("height", picture.height, 16, 8192, "pixels"));
  picture.samples = static_cast<int>(preview.integer("samples", picture.samples, 1, 256, "rays a pixel"));
  picture.sky = preview.number("sky", "", picture.sky, {0, 1e6}, "strength");
  picture.haze = preview.number("haze", "", picture.haze, {0, 1e6}, "");
  picture.glow_light = preview.number("glow_light", "", picture.glow_light, {0, 1e6}, "how much lava lights the ground");
  s.camera = read_scene_camera(preview, picture);
  return s;
}

PreviewOptions picture_at(const SkinSettings& s, const geometry::Terrain& terrain, Real film_time) {
  PreviewOptions picture = s.picture;
  set_camera(picture, s.camera, terrain, film_time);
  picture.gloss = gloss_of(s.detail.kind);
  return picture;
}

void check_camera(const SkinSettings& s, const geometry::Terrain& terrain, int frames, Real fps) {
  if (s.preview) check_scene_camera(s.camera, terrain, frames, fps, static_cast<Real>(s.picture.width) / s.picture.height);
}

DisplaceOptions detail_at(const SkinSettings& s, const geometry::Terrain& terrain, Real film_time) {
  DisplaceOptions detail = s.detail;
  if (s.edge_pixels <= 0) return detail;
  const PreviewOptions picture = picture_at(s, terrain, film_time);
  View view;
  view.eye = picture.camera.eye;
  view.pixel_angle = picture.camera.field_of_view / picture.height;
  view.pixels = s.edge_pixels;
  view.direction = picture.camera.target - picture.camera.eye;
  // The cone round the picture's corners, and a tenth more for what casts shadows into it.
  const Real half = std::tan(picture.camera.field_of_view / 2), aspect = static_cast<Real>(picture.width) / picture.height;
  view.half_angle = std::min(1.1 * std::atan(half * std::hypot(Real{1}, aspect)), kPi);
  detail.view = view;
  return detail;
}

SkinOptions skin_at(const SkinSettings& s, const geometry::Terrain& terrain, Real film_time, Real spacing) {
  SkinOptions options;
  options.level_set = s.level_set;
  options.level_set.spacing = spacing;
  options.level_set.voxel = s.voxel * spacing;
  options.tessellation = s.tessellation;
  options.coarsen = s.coarsen;
  options.detail = detail_at(s, terrain, film_time);
  return options;
}

}  // namespace effuse::skin
