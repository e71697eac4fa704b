#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "samples/effuse/load_scene.h"

namespace effuse {

/// What is left of a run that could not be kept stable, for who has to mend its scene: RUN/trouble/particles.ply, the particles within six
/// spacings of where it happened as they were before the step (or of the fastest, when that is not known), with velocity, temperature and id;
/// RUN/trouble/picture.png, those in red among the others, from near by; and the lines of the scene to change, told.
///   scene  the file, for its lines
/// Returns what to say, a line each; empty without particles. Does not throw: a second trouble must not hide the first.
std::vector<std::string> write_trouble(const std::filesystem::path& folder, const std::filesystem::path& scene, const LoadedScene& loaded, const UnstableError& error);

}  // namespace effuse
