#pragma once

#include "flow/springs/builders.h"
#include "flow/springs/spring_system.h"
#include "importers/worlds/jello_world.h"

namespace effuse {

/// A world of the jello cube assignment as springs: the 8^3 cube with structural, shear (faces and body) and bend springs of
/// kElastic and dElastic, the six walls of the room and the plane as penalty walls of kCollision and dCollision, the force field.
/// The plane's free side is the one on which most of the cube starts.
struct JelloScene {
  flow::springs::SpringBody body;  ///< in the state the world starts from
  flow::springs::Surroundings surroundings;  ///< its field is the world's: the world must outlive it
  flow::Scheme scheme = flow::Scheme::kRk4;
};

JelloScene jello_scene(const importers::JelloWorld& world);

}  // namespace effuse
