#pragma once

#include <cstdint>

#include "flow/plants/plant_fire.h"
#include "geometry/mesh/tri_mesh.h"
#include "geometry/procedural/plant.h"

namespace effuse::flow::plants {

/// A plant that stands somewhere: one of a few that were grown, scaled and turned about the vertical.
struct Standing {
  std::uint32_t variant = 0;
  Vec3 foot = Vec3::Zero();
  Real scale = 1, turn = 0;
};

/// How a plant looks at time t [s], swayed and as far burnt as the fire says of it: leaves go brown, glow, curl up and fall; twigs char and go,
/// the thinnest first; what is thicker than a fifth of the stem stays, black and shrunk. Attributes "color" and "glow", linear light.
/// The same for all plants: which leaf goes when is a function of (plant, leaf).
geometry::TriMesh look_of(const geometry::Plant& grown, const Standing& standing, const geometry::Sway& sway, int sides, const PlantFire& fire, std::size_t plant, Real t, Real air, Real ignition);

/// Flames of a plant at time t: tongues on its leaves and limbs, a fifth of its height at most, that flicker. Attributes as above.
geometry::TriMesh flames_of(const geometry::Plant& grown, const Standing& standing, const PlantFire& fire, std::size_t plant, Real t);

}  // namespace effuse::flow::plants
