#pragma once

#include <filesystem>

namespace effuse {

/// Removes the run in a folder, for another in its place. Files that effuse did not write stay: those of effects are known by the
/// names in its manifest. scene.toml, which makes the folder a run's, stays too.
void remove_run(const std::filesystem::path& folder);

/// The same of the frames, pictures, maps and checkpoints from this frame on alone.
void remove_frames_from(const std::filesystem::path& folder, int frame);

}  // namespace effuse
