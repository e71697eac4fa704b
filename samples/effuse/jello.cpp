#include "samples/effuse/jello.h"

namespace effuse {

using flow::springs::PenaltyWall;
using importers::JelloWorld;

JelloScene jello_scene(const JelloWorld& world) {
  JelloScene scene;
  scene.scheme = world.integrator == "Euler" ? flow::Scheme::kEuler : flow::Scheme::kRk4;
  // Rest lengths are those of the unit cube, wherever the points start.
  scene.body = flow::springs::jello_cube(JelloWorld::kSide, Vec3::Zero(), 1, world.mass, {world.elastic, world.elastic_damping, 0});
  scene.body.state = {world.positions, world.velocities};

  flow::springs::Surroundings& around = scene.surroundings;
  around.response = {world.collision, world.collision_damping, 0};
  if (world.field.resolution > 0) around.field = &world.field;
  for (int axis = 0; axis < 3; ++axis)
    for (const Real side : {1.0, -1.0}) around.walls.push_back({side * Vec3::Unit(axis), JelloWorld::kRoom});
  if (world.plane) {
    const Real length = world.plane->head<3>().norm();
    PenaltyWall wall{world.plane->head<3>() / length, (*world.plane)[3] / length};
    int above = 0;
    for (const Vec3& x : world.positions) above += wall.normal.dot(x) + wall.offset > 0 ? 1 : -1;
    if (above < 0) wall = {-wall.normal, -wall.offset};
    around.walls.push_back(wall);
  }
  return scene;
}

}  // namespace effuse
