#pragma once

#include <filesystem>
#include <string>

#include "samples/effuse/cost.h"

namespace effuse {

/// The forecast as `effuse check --json` and run.json have it, a JSON object. why: where the machine's figures come from.
std::string accuracy_json(const budget::Forecast& forecast, const Cost& cost, const std::string& why);

/// What a run has come to, the same figures: seconds of the clock and of all threads, without the rehearsals.
struct CameTo {
  double front = 0, particles = 0, steps = 0, seconds = 0, processor_seconds = 0, memory = 0, disk = 0;
};
/// Of the simulation's lava and of the folder's frames and pictures; times and memory are the caller's to fill in.
CameTo came_to(const LoadedScene& loaded, const std::filesystem::path& folder);
std::string came_to_json(const CameTo& c);

/// "predicted 41 s, came to 44 s; ...": for the end of a run.
std::string beside(const budget::Forecast& forecast, const Cost& cost, const CameTo& c);

}  // namespace effuse
