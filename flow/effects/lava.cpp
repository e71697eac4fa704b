#include "flow/effects/lava.h"

#include <fmt/format.h>

#include <algorithm>
#include <limits>
#include <string>

#include "flow/effects/classic_lava_effect.h"
#include "flow/effects/modern_lava_effect.h"
#include "geometry/base/error.h"
#include "geometry/collide/convex_hull.h"

namespace effuse::flow {

namespace {

// Beyond these a number in the scene is a slip, and the run would never end.
constexpr Real kMostParticles = 1e9, kMostSites = 1e6, kMostSteps = 1e9;

/// A scene of the other model is told so, once; its parameters are unknown here.
void tell_of_the_other_model(Parameters& p, bool modern) {
  static constexpr const char* kClassic[] = {"viscosity",       "stiffness",     "air_exchange", "ground_exchange", "air_temperature",
                                             "ground_friction", "heat_capacity", "diffusivity",  "cohesion"};
  static constexpr const char* kModern[] = {"preset", "rheology", "heat", "crust_viscosity", "slip_length"};
  const auto tell = [&](const auto& keys, const char* other) {
    for (const char* key : keys) {
      if (!p.has(key)) continue;
      p.fault(key,
              fmt::format("is of the {0} model; this lava's model is {1}: model = \"{0}\" would do", other, modern ? "modern" : "classic"));
      return;
    }
  };
  if (modern)
    tell(kClassic, "classic");
  else
    tell(kModern, "modern");
}

/// Of the vent's sites from the shape, up to `reach` [m]; 0: one is in it.
Real way_between(const std::vector<Vec3>& sites, const geometry::CollisionMesh& shape, const geometry::RigidPose& pose, Real reach) {
  Real nearest = std::numeric_limits<Real>::infinity();
  for (const Vec3& site : sites) nearest = std::min(nearest, shape.inside(pose.body(site)) ? 0 : shape.signed_distance(pose.body(site), reach));
  return nearest;
}

/// Lava that comes out in or right beside an obstacle has nowhere to go; a body in its way is thrown off, or wedged in.
void refuse_blocked_vents(const std::vector<PlannedVent>& plans, const std::vector<sph::Vent>& vents, const World& world, Real spacing, std::vector<Fault>& faults) {
  if (spacing <= 0 || !(most_sites(plans, spacing) <= kMostSites)) return;  // told already
  std::size_t placed = 0;
  for (const PlannedVent& plan : plans) {
    if (!plan.located || placed == vents.size()) continue;
    const sph::Vent& vent = vents[placed++];
    const std::vector<Vec3> sites = vent.lattice(spacing);
    const auto keep_off = [&](const char* kind, const std::string& name, Real way, const char* wanted, Real room) {
      if (way >= room) return;
      faults.push_back({plan.place, fmt::format("{} '{}' is {} the vent when it opens, wanted at least {}, {:.3g} m, between them", kind, name, way <= 0 ? std::string("over") : fmt::format("{:.2g} m from", way), wanted, room)});
    };
    if (world.obstacles)
      for (const PlacedObstacle& each : *world.obstacles) keep_off("obstacle", each.name, way_between(sites, each.shape, each.track.at(vent.start), 2 * spacing), "two spacings", 2 * spacing);
    if (!world.bodies || vent.start > 0) continue;  // nobody knows where bodies will be by then
    Box3 around;
    for (const Vec3& site : sites) around.extend(site);
    for (const PlacedBody& each : *world.bodies) {
      Real radius = spacing;
      for (const Vec3& corner : each.mesh.positions) radius = std::max(radius, corner.norm() + spacing);
      if (around.squaredExteriorDistance(each.pose.position) > radius * radius) continue;
      const geometry::CollisionMesh shape(each.hull ? geometry::mesh_of(geometry::make_convex_hull(each.mesh.positions)) : each.mesh);
      keep_off("body", each.name, way_between(sites, shape, each.pose, spacing), "a spacing", spacing);
    }
  }
}

/// Bodies that the lava's walls would take for something a hundred times as large.
void refuse_specks(const World& world, Real spacing, const Place& place, std::vector<Fault>& faults) {
  constexpr Real kLeast = 0.01;  // spacings across
  if (!world.bodies) return;
  for (const PlacedBody& each : *world.bodies) {
    Box3 box;
    for (const Vec3& corner : each.mesh.positions) box.extend(corner);
    if (box.sizes().norm() < kLeast * spacing)
      faults.push_back({place, fmt::format("lava.spacing: particles of {:.4g} m beside body '{}', {:.3g} m across, wanted bodies no smaller than a hundredth of a particle", spacing, each.name, box.sizes().norm())});
  }
}

/// Particles that the ground, or all vents, are no match for: nothing would flow.
void refuse_giant_particles(const std::vector<PlannedVent>& vents, Real spacing, const Place& place, const geometry::Terrain& terrain, std::vector<Fault>& faults) {
  constexpr Real kAcross = 4, kWider = 5;  // particles on the ground's narrower side at least; spacings a vent may be narrower than one
  const Real across = terrain.bounds().sizes().head<2>().minCoeff();
  if (!(kAcross * spacing <= across)) {
    faults.push_back({place, fmt::format("lava.spacing: particles of {:.4g} m on a terrain {:.4g} m across, wanted at least {:.0f} side by side: {:.3g} m or less", spacing, across, kAcross, across / kAcross)});
    return;
  }
  for (const PlannedVent& plan : vents) {
    const Real size = std::max(plan.vent.width, (plan.to - plan.from).norm());
    if (plan.located && size > 0 && spacing > kWider * size)
      faults.push_back({place, fmt::format("lava.spacing: particles of {:.4g} m from a vent {:.4g} m across (line {}), wanted a vent at most {:.0f} times narrower than a particle", spacing, size, plan.place.line, kWider)});
  }
}

}  // namespace

EffectPlan read_lava(Parameters& p, Real duration) {
  const bool modern =
      p.choice("model", {"modern", "classic"}, 0,
               "the equations: modern has implicit pressure and viscosity, real rheology, heat and crust; classic is Stora et al. 1999") ==
      0;
  const LavaModel model = modern ? read_modern_lava(p) : read_classic_lava(p);
  tell_of_the_other_model(p, modern);
  const std::vector<PlannedVent> vents = read_vents(p, model.vent_temperature);

  EffectPlan plan;
  plan.name = "lava";
  if (model.spacing > 0) {  // without one there is nothing to count; that is told already
    plan.estimate = model.estimate(vents, duration);
    const Real widest = most_sites(vents, model.spacing);
    // Negated: what is not a number is too many as well.
    if (!(plan.estimate.particles <= kMostParticles)) {
      p.fault("spacing",
              fmt::format(
                  "the vents' rates would make {:.3g} particles of this size, at most {:.0e}: a larger spacing or a smaller rate would do",
                  plan.estimate.particles, kMostParticles));
    } else if (!(widest <= kMostSites)) {
      p.fault("spacing",
              fmt::format(
                  "the widest vent would have {:.3g} particles side by side, at most {:.0e}: a larger spacing or a narrower vent would do",
                  widest, kMostSites));
    } else if (!(plan.estimate.steps <= kMostSteps)) {
      p.fault("", fmt::format("the film covers {:.3g} s, {:.3g} steps, at most {:.0e}: look at film.time_scale, film.fps, {}", duration,
                              plan.estimate.steps, kMostSteps, model.sets_the_step));
    }
  }
  plan.misfits = [vents, spacing = model.spacing, obstacles = model.obstacles, place = p.place("model"), size = p.place("spacing")](const World& world) {
    std::vector<Fault> faults;
    if (spacing > 0) refuse_giant_particles(vents, spacing, size, *world.terrain, faults);
    refuse_specks(world, spacing, size, faults);
    const bool solids = (world.obstacles && !world.obstacles->empty()) || (world.bodies && !world.bodies->empty());
    if (!obstacles && solids) faults.push_back({place, "the classic model knows the terrain only: [[obstacle]] and [[body]] go with model = \"modern\""});
    refuse_blocked_vents(vents, place_vents(vents, *world.terrain, faults), world, spacing, faults);
    return faults;
  };
  plan.build = [make = model.make, spacing = model.spacing, misfits = plan.misfits, vents](const World& world) {
    if (const std::vector<Fault> faults = misfits(world); !faults.empty()) throw InputError(faults);
    return make(place_whole_vents(vents, *world.terrain, spacing), world);
  };
  return plan;
}

}  // namespace effuse::flow
