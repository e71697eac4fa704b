#pragma once

#include <filesystem>

namespace effuse {

/// open_in_blender.py, open_in_houdini.py, open_in_paraview.py in a run's folder: plain text that reads manifest.json and the files beside it (samples/effuse/handoff).
void write_handoff_scripts(const std::filesystem::path& folder);

}  // namespace effuse
