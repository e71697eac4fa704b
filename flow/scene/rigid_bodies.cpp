#include "flow/scene/rigid_bodies.h"

#include <fmt/format.h>

#include <cmath>
#include <cstdint>

#include "flow/scene/placing.h"
#include "geometry/collide/collision_mesh.h"
#include "geometry/collide/convex_hull.h"
#include "geometry/mesh/mass_properties.h"

namespace effuse::flow {

namespace {
constexpr std::int64_t kMostCopies = 100000;
constexpr std::size_t kHullVertices = 400;  ///< of one that breaks: contacts are with its cells
}

std::vector<PlannedBody> read_bodies(Parameters& root, std::uint64_t seed) {
  std::vector<PlannedBody> plans;
  for (Parameters& p : root.tables("body", "a rigid body that lava pushes, carries and floats, and that pushes back")) {
    PlannedBody plan;
    read_form(p, "any closed mesh, relative to the scene file", plan);
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
    plan.rolling = p.number("rolling", "m", plan.rolling, Parameters::not_negative(), "lever arm of its resistance to rolling");
    plan.temperature = p.number("temperature", "K", plan.temperature, {0, 5000}, "of its surface; 0: the ground's");
    plan.lava_friction = p.number("lava_friction", "", plan.lava_friction, {0, 1}, "of lava on it: 1 no slip, 0 free slip");
    plan.material = read_material(p, plan.density > 0 ? plan.density : 1);
    plan.breaking = read_breaking(p, seed);
    const auto copies = p.integer("copies", 1, 1, kMostCopies, "so many of it, called name.1, name.2, ...");
    const Vec3 step = vector("step", "m", "from one copy to the next");
    if (copies == 1) {
      if (p.has("step")) p.fault("step", "goes with copies");
      plans.push_back(std::move(plan));
      continue;
    }
    if (step.isZero(0)) p.fault("copies", "need a step other than 0 from one to the next, or they would lie in one another");
    for (std::int64_t k = 0; k < copies; ++k) {
      plans.push_back(plan);
      plans.back().name = fmt::format("{}.{}", plan.name, k + 1);
      plans.back().pose.position += static_cast<Real>(k) * step;
    }
  }
  return plans;
}

BodySettings read_body_settings(Parameters& p) {
  BodySettings s;
  s.penalty = p.choice("contact", {"constraint", "penalty"}, 0, "how they are kept out of each other: impulses, or springs and dampers") == 1;
  if (s.penalty) {
    s.penalty_frequency = p.number("penalty_frequency", "Hz", s.penalty_frequency, {0.1, 1e5}, "f of the springs: k = m (2 pi f)^2; a body rests m g / k deep");
    s.penalty_damping = p.number("penalty_damping", "", s.penalty_damping, {0, 10}, "of critical");
  }
  s.step = p.number("step", "s", s.step, {1e-6, 1}, "contacts are looked for at least this often");
  s.substeps = static_cast<int>(p.integer("substeps", s.substeps, 1, 1000, "of one step between two such looks; penalty takes more if its springs need them"));
  s.ground_friction = p.number("ground_friction", "", s.ground_friction, {0, 100}, "Coulomb's number of the ground; two in contact: the geometric mean");
  s.ground_restitution = p.number("ground_restitution", "", s.ground_restitution, {0, 1}, "of the speed of an impact on the ground that is given back");
  s.sleep_speed = p.number("sleep_speed", "m/s", s.sleep_speed, Parameters::not_negative(), "what is slower falls asleep; 0: never");
  s.sleep_delay = p.number("sleep_delay", "s", s.sleep_delay, Parameters::not_negative(), "once it has been that slow for so long");
  return s;
}

void place_body(const PlannedBody& plan, geometry::TriMesh mesh, const geometry::Terrain& terrain, std::vector<PlacedBody>& placed, std::vector<Fault>& faults) {
  PlacedBody body;
  body.name = plan.name;
  body.pose = plan.pose;
  body.density = plan.density;
  body.hull = plan.hull;
  body.ball = plan.ball;
  body.box = plan.file.empty() && plan.ball == 0;
  body.rolling = plan.rolling;
  body.color = plan.color;
  body.friction = plan.friction;
  body.restitution = plan.restitution;
  body.velocity = plan.velocity;
  body.spin = plan.spin;
  body.temperature = plan.temperature;
  body.lava_friction = plan.lava_friction;
  body.material = plan.material;
  // One that breaks has flat faces.
  if (plan.breaking.breaks()) body.ball = 0;
  if (!put_on_terrain(body.pose, plan.on_ground, terrain, fmt::format("body '{}'", plan.name), plan.place, faults)) return;
  body.mesh = upright(std::move(mesh), plan.scale, plan.y_up);
  if (too_large(body.mesh, fmt::format("body '{}'", plan.name), plan.file_place, faults)) return;
  try {
    if (!plan.hull && body.ball == 0 && !geometry::CollisionMesh(body.mesh).solid()) throw InputError(Place{}, "the mesh is not closed, so that it has no mass: shape = \"hull\" would do");
    if (plan.breaking.breaks()) {
      if (plan.hull || plan.ball > 0) body.mesh = geometry::mesh_of(geometry::make_convex_hull(body.mesh.positions, kHullVertices));
      body.cells = cut_cells(plan.breaking, body.mesh);
      body.strength = plan.breaking.strength;
      body.smallest = plan.breaking.smallest;
      body.volume = body.cells->volume;
    } else if (body.ball > 0) body.volume = 4 * kPi / 3 * std::pow(body.ball, 3);
    else body.volume = geometry::mass_properties(plan.hull ? geometry::mesh_of(geometry::make_convex_hull(body.mesh.positions)) : body.mesh).volume;
    if (!(body.volume > 0)) throw InputError(Place{}, "the mesh encloses no volume");
    placed.push_back(std::move(body));
  } catch (const InputError& error) {
    for (const Fault& fault : error.faults()) faults.push_back({plan.file_place, fmt::format("body '{}': {}", plan.name, fault.message)});
  }
}

}  // namespace effuse::flow
