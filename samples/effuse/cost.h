#pragma once

#include <string>
#include <vector>

#include "flow/scene/effect.h"
#include "samples/budget/machine.h"
#include "samples/effuse/load_scene.h"

/// What a scene is expected to cost: for `effuse check`, and for a run to be held to.
namespace effuse {

struct Cost {
  flow::Estimate sum;   ///< over the effects; of rehearsed lava as its rehearsals told
  double seconds = 0;   ///< of the clock, all of it, on the threads there are
  double lava_seconds = 0;       ///< of them: the lava's steps
  double processor_seconds = 0;  ///< of all threads
  double memory = 0;    ///< bytes, at the end
  double disk = 0;      ///< bytes
  bool rehearsed = false;
};

/// machine: used for rehearsed scenes; others are told in seconds of a usual machine with two cores, to a factor of two.
Cost cost_of(const LoadedScene& loaded, const budget::Machine& machine);

/// "412 MB"
std::string bytes_text(double bytes);
/// "40 s", "12 min", "3 h 20 min", "12 days"
std::string time_text(double seconds);

/// What was chosen for the accuracy a scene wants, and what it will come to: lines of a name and a text each.
std::vector<std::pair<std::string, std::string>> told(const budget::Forecast& forecast);

}  // namespace effuse
