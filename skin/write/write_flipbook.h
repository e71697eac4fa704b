#pragma once

#include <cstdint>
#include <filesystem>
#include <memory>

#include "skin/write/write_mesh.h"

namespace effuse::skin {

/// A film of meshes whose topology changes, in one binary glTF 2.0 file that any reader of glTF plays: a node a frame, and one animation that
/// scales each from 0 to 1 while its frame is shown (STEP, no extension). Read without its animation, it shows the last frame.
///
/// Attributes, colours, glow and axes as write_glb has them (y up); all frames share one material with one ramp of glow. Everything stays in memory until
/// finish(), twice while that writes. GLB ends at 4 GB: more is an InputError that says how far the frames came.
class Flipbook {
 public:
  /// name: of nodes and scene.
  explicit Flipbook(std::string name);
  ~Flipbook();
  Flipbook(const Flipbook&) = delete;
  Flipbook& operator=(const Flipbook&) = delete;

  /// Something that is there all the time.
  void add_still(const std::string& name, const geometry::TriMesh& mesh);
  /// A frame, shown from `time` [s of film, which begins at 0] on until the next of its name; times rise (checked). An empty mesh shows nothing. Throws InputError naming
  /// the frame when the mesh is not well formed, or does not fit any more.
  void add_frame(const std::string& name, Real time, const geometry::TriMesh& mesh);
  std::uint64_t bytes() const;

  /// end: when the last frame ends [s of film].
  void finish(const std::filesystem::path& file, Real end, const Metadata& metadata = {});

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace effuse::skin
