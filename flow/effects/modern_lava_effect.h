#pragma once

#include "flow/effects/lava_model.h"

namespace effuse::flow {

/// The parameters of [lava] with model = "modern": flow/sph/modern_lava.h. Faults stay in the table.
///
/// preset (flow/sph/lava_presets.h) gives the defaults of rheology, density, heat and the vents' temperature. Without
/// one: [lava.rheology]'s own, basalt's heat. Heat is computed if a preset is named or a table [lava.heat] stands in
/// the scene, unless heat.on says otherwise; without it particles keep the temperature they come out with, and no
/// conduction, loss or crust is computed or allocated. Shear rates are computed for lava that is not Newtonian, or has a
/// crust_viscosity, only. The ground is as warm as [terrain] says.
///
/// Of a preset's heat: the melting range is from its solidus to its eruption temperature, where crystals begin to grow in
/// its rheology, and the latent heat is that of the crystals which grow (LavaPreset::latent_heat_released).
///
/// Figures of the effect, all since the start but for those marked *, which are of the last step or of now:
///   particles* volume_m3* mass_emitted_kg mass_present_kg* mass_left_kg
///   steps smallest_step_s retries
///   awake*                                     particles whose motion the last step computed
///   pressure_iterations viscosity_iterations density_iterations   mean a step
///   density_error* largest_density_error       rms over particles of what is compressed: share
///   max_speed_m_s* min_temperature_K* mean_temperature_K* max_temperature_K*   of particles as wholes
/// and, where heat is computed, enthalpies (0 at 0 K) [J], with vent + viscous = stored + radiated + convected + ground +
/// left to rounding:
///   radiated_J convected_J ground_J            lost, as booked so far (Heat)
///   quenched_J                                 of radiated and convected, into the scene's water; where there is any
///   vent_J                                     came out of vents
///   viscous_J                                  gained by friction inside
///   stored_J*                                  in the particles there are
///   left_J                                     of particles that left over the ground's edge: what the other terms of the
///                                              steps in which some did do not account for
LavaModel read_modern_lava(Parameters& lava);

}  // namespace effuse::flow
