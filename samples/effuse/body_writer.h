#pragma once

#include <filesystem>
#include <string>
#include <utility>
#include <vector>

#include "samples/effuse/load_scene.h"

namespace effuse {

/// What a run with rigid bodies or moving obstacles writes beside the meshes of its frames:
///
///   bodies.csv   where each is at each frame, a line each: frame, time_s, name, x, y, z [m] of its own origin in the run's local frame,
///                qw, qx, qy, qz; all digits, so that a run resumed reads its own
///   bodies.glb   one node a thing, moved by one animation of the film's frames (skin/write/write_animation.h)
///
/// Bodies that may break are left out: they and their pieces are in the frames' meshes. Nothing is done for a scene where nothing moves.
class BodyWriter {
 public:
  /// Writes nothing. loaded outlives this, its simulation too.
  BodyWriter(const LoadedScene& loaded, std::filesystem::path folder);

  /// Takes in the simulation's newest frame.
  void add_frame();
  /// bodies.csv up to the newest frame; to be called before a checkpoint is written.
  void write_series() const;
  /// bodies.glb, when glb is among the formats.
  void write_animation() const;
  /// Goes back to the simulation's frame, by the bodies.csv that is there. False where that does not reach it.
  bool restore();
  /// For the manifest: name and path of what has been written.
  std::vector<std::pair<std::string, std::string>> files() const;

 private:
  bool active() const { return !names_.empty(); }
  const LoadedScene& loaded_;
  std::filesystem::path folder_;
  std::vector<std::string> names_;                          // of obstacles, then bodies
  std::vector<std::size_t> things_;                         // numbers among the scene's looks
  std::vector<std::vector<geometry::RigidPose>> poses_;     // of each, frame by frame
};

}  // namespace effuse
