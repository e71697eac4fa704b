#pragma once

#include <filesystem>

#include "flow/scene/node.h"
#include "importers/worlds/jello_world.h"

namespace effuse::importers {

/// A jello world as the scene it is: [[springs]] of a cube with the world's constants, state, walls (the room's six, then the plane, its
/// free side the one on which most of the cube starts) and force field, stepped as it says, over the room's floor. As many frames a
/// second as the world shows: 1 / (dt n); 300 of them unless told otherwise. file: for the places of its values.
flow::Node jello_scene(const JelloWorld& world, const std::filesystem::path& file);

}  // namespace effuse::importers
