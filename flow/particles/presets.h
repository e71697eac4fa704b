#pragma once

#include <string>
#include <vector>

#include "flow/particles/particle_cloud.h"

namespace effuse::flow::particles {

/// A kind of particles by name: how they move and what an emitter of them usually lets out. Drawn as flakes, grains, streaks or as
/// a volume of density.
struct Preset {
  std::string name, what;
  CloudOptions cloud;
  EmitterOptions emitter;
  bool volume = false;  ///< best seen as a density, not as points
  bool glows = false;   ///< best seen by its own light
  Vec3 color = Vec3(0.9, 0.9, 0.9);  ///< sRGB
  Real opacity = 1;     ///< through the middle of one as it is born
};

/// snow, dust, sand, sparks, fire, smoke, steam. Response times are those of spheres in air at rest (Stokes, or the terminal speed
/// seen over g): snow falls at 1 m/s, sand at 4 m/s, dust hangs.
const std::vector<Preset>& presets();

}  // namespace effuse::flow::particles
