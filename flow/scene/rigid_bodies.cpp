#include "flow/scene/rigid_bodies.h"

#include <fmt/format.h>

#include <filesystem>

#include "flow/scene/placing.h"
#include "geometry/collide/collision_mesh.h"
#include "geometry/collide/convex_hull.h"
#include "geometry/mesh/mass_properties.h"

namespace effuse::flow {

std::vector<PlannedBody> read_bodies(Parameters& root) {
  std::vector<PlannedBody> plans;
  for (Parameters& p : root.tables("body", "a rigid body that lava pushes, carries and floats, and that pushes back")) {
    PlannedBody plan;
    plan.place = p.place("");
    plan.file = p.text("file", std::nullopt, "any closed mesh, relative to the scene file");
    plan.file_place = p.place("file");
    if (p.has("file") && (plan.file.empty() || plan.file.find('\0') != std::string::npos)) p.fault("file", "is not the name of a file");
    plan.name = p.text("name", std::filesystem::path(plan.file).stem().string(), "for people and files");
    plan.scale = p.number("scale", "", plan.scale, Parameters::positive(), "of the mesh's numbers");
    plan.y_up = p.choice("up", {"z", "y"}, 0, "the mesh's axis that points up") == 1;
    plan.hull = p.choice("shape", {"hull", "mesh"}, 0, "what touches: its convex hull, or the mesh itself") == 0;
    plan.on_ground = p.flag("on_ground", plan.on_ground, "its height counts from the terrain at x, y");
    plan.pose = read_pose(p, true, {});
    plan.density = p.number("density", "kg/m3", std::nullopt, {1, 1e5}, "of what it is made of");
    const auto vector = [&](const char* key, const char* unit, const char* what) {
      const std::vector<Real> v = p.numbers(key, unit, 3, false, what);
      return v.size() == 3 ? Vec3(v[0], v[1], v[2]) : Vec3(Vec3::Zero());
    };
    plan.velocity = vector("velocity", "m/s", "at the start");
    plan.spin = vector("spin", "rad/s", "at the start, about its centre of mass");
    plan.friction = p.number("friction", "", plan.friction, {0, 100}, "Coulomb's number, against bodies, obstacles and the ground");
    plan.restitution = p.number("restitution", "", plan.restitution, {0, 1}, "of the speed of an impact that is given back");
    plan.temperature = p.number("temperature", "K", plan.temperature, {0, 5000}, "of its surface; 0: the ground's");
    plan.lava_friction = p.number("lava_friction", "", plan.lava_friction, {0, 1}, "of lava on it: 1 no slip, 0 free slip");
    plan.material = read_material(p, plan.density > 0 ? plan.density : 1);
    plans.push_back(std::move(plan));
  }
  return plans;
}

void place_body(const PlannedBody& plan, geometry::TriMesh mesh, const geometry::Terrain& terrain, std::vector<PlacedBody>& placed, std::vector<Fault>& faults) {
  PlacedBody body;
  body.name = plan.name;
  body.pose = plan.pose;
  body.density = plan.density;
  body.hull = plan.hull;
  body.friction = plan.friction;
  body.restitution = plan.restitution;
  body.velocity = plan.velocity;
  body.spin = plan.spin;
  body.temperature = plan.temperature;
  body.lava_friction = plan.lava_friction;
  body.material = plan.material;
  if (!put_on_terrain(body.pose, plan.on_ground, terrain, fmt::format("body '{}'", plan.name), plan.place, faults)) return;
  body.mesh = upright(std::move(mesh), plan.scale, plan.y_up);
  if (too_large(body.mesh, fmt::format("body '{}'", plan.name), plan.file_place, faults)) return;
  try {
    if (!plan.hull && !geometry::CollisionMesh(body.mesh).solid()) throw InputError(Place{}, "the mesh is not closed, so that it has no mass: shape = \"hull\" would do");
    body.volume = geometry::mass_properties(plan.hull ? geometry::mesh_of(geometry::make_convex_hull(body.mesh.positions)) : body.mesh).volume;
    if (!(body.volume > 0)) throw InputError(Place{}, "the mesh encloses no volume");
    placed.push_back(std::move(body));
  } catch (const InputError& error) {
    for (const Fault& fault : error.faults()) faults.push_back({plan.file_place, fmt::format("body '{}': {}", plan.name, fault.message)});
  }
}

}  // namespace effuse::flow
