#pragma once

#include <cstdint>
#include <filesystem>
#include <memory>
#include <string>
#include <vector>

#include "geometry/mesh/tri_mesh.h"
#include "geometry/mesh/volume.h"

namespace effuse::skin {

/// Linear light, row by row from the top, three floats a pixel.
struct Image {
  int width = 0, height = 0;
  std::vector<float> rgb;
};

struct Camera {
  Vec3 eye = Vec3::Zero();     ///< [m]
  Vec3 target = Vec3::Zero();  ///< [m]
  Real field_of_view = 0.7;    ///< vertical [rad]
};

/// The nearest camera that holds the whole box, looking at it from azimuth (counter-clockwise from +x, where the eye
/// is) and elevation above the horizon [rad, within +-1.5]. aspect: width / height; margin: share of the picture's
/// height and width left free around the box. An empty box is a metre at the origin.
Camera frame_camera(const Box3& box, Real azimuth, Real elevation, Real aspect = 16.0 / 9, Real margin = 0.06, Real field_of_view = 0.7);

struct PreviewOptions {
  int width = 960, height = 540;
  Camera camera;
  /// Towards the sun. The sky goes with it: low is dusk (warm light, dark sky, where a glow reads best; the default),
  /// half a radian and higher is day, below the horizon is night.
  Vec3 sun_direction = Vec3(-0.80, -0.45, 0.22);
  Real sun = 3.0, sky = 1.0;  ///< strengths
  int samples = 4;            ///< rays a pixel
  Real exposure = 1.0;
  Real haze = 1.0;         ///< 0: none; 1: the horizon fades at some ten times the terrain's size
  Real bloom = 1.0;        ///< light that spills round bright pixels; 0: none
  Real glow_light = 1.0;   ///< how much the lava lights the ground around it; 0: not
  /// Of cold lava: 0 matt rubble, 1 glass. Lava that is hot and has no crust shines like half-dull glass at least.
  Real gloss = 0.15;
  std::uint64_t seed = 0;  ///< of the sample positions; the same for all frames, so that still ground does not shimmer
};

/// Light of a picture's sun and sky, linear, for other renderers' lamps: the irradiance of a surface that faces the sun, and the radiance of a white
/// one that looks up and sees the sky alone (the sky's mean).
struct Daylight {
  Vec3 sun = Vec3::Zero(), sky = Vec3::Zero();
};
Daylight daylight(const PreviewOptions& options);

/// Something small that is drawn by itself: a flake, a grain, a spark, a tongue of fire.
///   streak  how far it flies while the picture is taken [m]
///   color   linear light that it reflects; glow: that it gives off
///   soft    it fades from its middle to its rim; else it is a disk
struct Speck {
  Vec3 position = Vec3::Zero(), streak = Vec3::Zero();
  Real radius = 0.01;
  Vec3 color = Vec3::Zero(), glow = Vec3::Zero();
  Real opacity = 1;
  bool soft = false;
};

/// Density [1/m] and what it is made of.
struct Cloud {
  geometry::GridVolume grid;
  Vec3 color = Vec3::Ones();  ///< linear light that it scatters
};

/// What hangs or flies in the air of a picture.
struct Air {
  std::vector<Speck> specks;
  std::vector<Cloud> clouds;
  bool empty() const { return specks.empty() && clouds.empty(); }
};

/// Ray-traced pictures (Embree): terrain shaded by slope and altitude under sun and sky, lava by its "color" and "glow".
/// The terrain's tree is built once, the lava's for each frame. Same bits on any number of threads.
///
/// The ground is drawn as it is (the lava rests on it): only its normals are smoothed, and given grass, scree and rock
/// by a procedural texture. Beyond its border an apron of made-up land runs down to the lowest border height and out
/// into the haze. Emission lights the ground through a coarse grid of summed patches of lava, without noise.
/// Shadows of the ground leave out what is lower than a tenth of a terrain edge: facets' corners, and the steps of a DEM in whole
/// metres, which a low sun would stretch into dark tiles. Lava without "color" is dark rock, without "glow" does not shine,
/// without "temperature" is cold. Either mesh may be empty.
/// Costs 0.6 s of processor time at 960 x 540, 4 samples, 10 k triangles of ground, 90 k of lava; all but
/// the lava's tree (0.02 s) runs on every thread.
class Preview {
 public:
  /// Throws InputError when the terrain is not well formed (index out of range, position not finite).
  explicit Preview(const geometry::TriMesh& terrain);
  ~Preview();
  Preview(const Preview&) = delete;
  Preview& operator=(const Preview&) = delete;
  /// Linear light after exposure and bloom. Throws InputError for lava that is not well formed, or options out of
  /// range: sizes 1..16384, samples 1..1024, gloss 0..1, a field of view within (0, pi), an eye apart from its target.
  Image render(const geometry::TriMesh& lava, const PreviewOptions& options, const Air& air = {}) const;

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

/// sRGB 8 bit PNG after a filmic curve; whole or absent.
void write_png(const std::filesystem::path& file, const Image& image);
/// Pictures side by side, row by row, each with its label burnt in; whole or absent.
///   pictures  PNG files, at least one; each is scaled down (never up) to a common width of at most 480 pixels
///   labels    as many as pictures (checked); letters show as capitals, what the font does not have as '?'
///   columns   > 0 (checked)
/// Throws InputError when a picture is missing or broken.
void write_contact_sheet(const std::filesystem::path& file, const std::vector<std::filesystem::path>& pictures,
                         const std::vector<std::string>& labels, int columns);

}  // namespace effuse::skin
