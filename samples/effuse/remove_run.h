#pragma once

#include <filesystem>

namespace effuse {

/// Takes away what a run wrote into its folder: frames, pictures, maps, checkpoints, flow.csv, run.json, manifest.json. Files of other
/// names stay, and so do the folders that hold some. Half-written ones go, too.
void remove_run(const std::filesystem::path& folder);

}  // namespace effuse
