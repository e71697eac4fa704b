#pragma once

#include <cstdint>
#include <filesystem>
#include <memory>
#include <string>
#include <vector>

#include "geometry/mesh/tri_mesh.h"

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

struct PreviewOptions {
  int width = 960, height = 540;
  Camera camera;
  Vec3 sun_direction = Vec3(-0.5, -0.4, 0.55);  ///< towards the sun
  Real sun = 3.0, sky = 1.0;                    ///< strengths
  int samples = 4;                              ///< rays a pixel
  Real exposure = 1.0;
};

/// Ray-traced pictures (Embree): terrain shaded by slope and altitude under sun and sky, lava by its "color" and "glow".
/// The terrain's tree is built once, the lava's for each frame. Same bits on any number of threads.
class Preview {
 public:
  explicit Preview(const geometry::TriMesh& terrain);
  ~Preview();
  Preview(const Preview&) = delete;
  Preview& operator=(const Preview&) = delete;
  Image render(const geometry::TriMesh& lava, const PreviewOptions& options) const;

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

/// sRGB 8 bit PNG after a filmic curve; whole or absent.
void write_png(const std::filesystem::path& file, const Image& image);
/// count pictures of the folder, evenly spread in time, side by side; each with its label burnt in.
void write_contact_sheet(const std::filesystem::path& file, const std::vector<std::filesystem::path>& pictures, const std::vector<std::string>& labels, int columns);

}  // namespace effuse::skin
