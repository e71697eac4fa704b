#pragma once

#include <cstdint>
#include <vector>

#include "flow/scene/parameters.h"
#include "flow/sph/vent.h"
#include "geometry/base/error.h"
#include "geometry/terrain/terrain.h"

namespace effuse::flow {

/// A vent as the scene has it: map coordinates, the height left to the terrain.
struct PlannedVent {
  sph::Vent vent;
  Vec2 from, to;        ///< in the terrain file's coordinates [m]
  bool located = true;  ///< whether both could be read
  Place place;
};

/// The tables [[lava.vent]]; a fault when there is none. temperature [K]: of lava whose vent does not say.
std::vector<PlannedVent> read_vents(Parameters& lava, Real temperature);

/// Let out by time t [m^3].
Real let_out(const std::vector<PlannedVent>& vents, Real t);
/// Mean over the time until t of what has been let out [m^3].
Real mean_let_out(const std::vector<PlannedVent>& vents, Real t);
/// Sites of the widest vent, about.
Real most_sites(const std::vector<PlannedVent>& vents, Real spacing);

/// The vents in the terrain's local frame, their centre lines on the ground; a fault for each end that is beside it.
std::vector<sph::Vent> place_vents(const std::vector<PlannedVent>& vents, const geometry::Terrain& terrain, std::vector<Fault>& faults);
/// The same, all their sites on the terrain, or InputError.
std::vector<sph::Vent> place_whole_vents(const std::vector<PlannedVent>& vents, const geometry::Terrain& terrain, Real spacing);

}  // namespace effuse::flow
