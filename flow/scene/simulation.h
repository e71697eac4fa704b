#pragma once

#include <filesystem>
#include <functional>
#include <memory>
#include <string>
#include <vector>

#include "flow/scene/effect.h"
#include "flow/scene/scene.h"

namespace effuse::flow {

/// The effects of a scene, stepped from frame to frame. Owns their state.
class Simulation {
 public:
  Simulation(const Scene& scene, const World& world);

  /// The last frame reached: 0 at the start.
  int frame() const { return frame_; }
  Real time() const { return scene_->frame_time(frame_); }
  const std::vector<std::unique_ptr<Effect>>& effects() const { return effects_; }

  /// Steps all effects to the next frame. Between steps keep_going() is asked; when it says no, returns
  /// false in the midst of the frame: the state may be saved and, loaded, goes on to the same bits.
  bool advance(const std::function<bool()>& keep_going);

  /// Hash of everything that will ever matter for the frames to come.
  std::string state_hash() const;
  std::size_t memory() const;

  /// Bytes of a checkpoint. scene_key: of the settings the state belongs to.
  std::string checkpoint(const std::string& scene_key) const;
  /// Throws InputError when the bytes are damaged, of another version, another scene_key or other effects.
  void restore(std::string_view bytes, const std::string& scene_key, const std::string& file);
  /// The same from a checkpoint of other settings, to go on with these; returns the scene_key it has.
  std::string branch(std::string_view bytes, const std::string& file);

 private:
  std::string load(std::string_view bytes, const std::string* scene_key, const std::string& file);
  const Scene* scene_;
  std::vector<std::unique_ptr<Effect>> effects_;
  int frame_ = 0;
};

/// DIR/checkpoints/checkpoint.0042.state, whole or absent; only the newest `keep` stay, 0: all.
void write_checkpoint(const std::filesystem::path& folder, const Simulation& simulation, const std::string& scene_key, std::size_t keep = 2);
/// The checkpoints there are, newest first.
std::vector<std::filesystem::path> checkpoints(const std::filesystem::path& folder);
/// Whether the bytes are a checkpoint as it was written, to the last bit.
bool undamaged(std::string_view checkpoint);

}  // namespace effuse::flow
