#pragma once

#include <filesystem>
#include <map>
#include <string>
#include <vector>

#include "geometry/mesh/tri_mesh.h"
#include "geometry/terrain/terrain.h"
#include "skin/preview/preview.h"
#include "skin/write/write_mesh.h"

namespace effuse {

/// The files of a run, read again: for pictures of it.
class RunFrames {
 public:
  /// Throws InputError: no run in the folder (scene.toml, manifest.json, terrain.ply).
  explicit RunFrames(std::filesystem::path folder);

  int count() const { return frames_; }  ///< frames done, from 1
  double fps() const { return fps_; }
  double time_scale() const { return time_scale_; }
  geometry::Terrain terrain() const;

  /// What a picture of the frame shows: skin, obstacles, other surfaces; grains, sparks and smoke. Throws InputError for a file that
  /// is missing or broken.
  struct Shown {
    geometry::TriMesh lava, others;
    skin::Air air;
  };
  Shown frame(int number) const;
  /// Names of what flies and is not in the files as it looks: puffs and flames. Of the frames read so far.
  const std::vector<std::string>& left_out() const { return left_out_; }

 private:
  std::filesystem::path file_of(const std::string& pattern, int number) const;
  std::filesystem::path folder_;
  std::map<std::string, std::string> patterns_;  // frames/NAME.####.ext by the manifest's names
  int frames_ = 0;
  double fps_ = 24, time_scale_ = 1;
  geometry::Georeference georeference_;
  bool obstacles_ = false;
  mutable std::vector<std::string> left_out_;
};

}  // namespace effuse
