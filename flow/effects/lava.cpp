#include "flow/effects/lava.h"

#include <fmt/format.h>

#include <algorithm>
#include <limits>
#include <string>

#include "flow/effects/classic_lava_effect.h"
#include "flow/effects/modern_lava_effect.h"
#include "geometry/base/error.h"

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

/// Lava that comes out in or right beside an obstacle has nowhere to go.
void refuse_blocked_vents(const std::vector<PlannedVent>& plans, const std::vector<sph::Vent>& vents, const World& world, Real spacing, std::vector<Fault>& faults) {
  if (!world.obstacles || spacing <= 0) return;
  std::size_t placed = 0;
  for (const PlannedVent& plan : plans) {
    if (!plan.located || placed == vents.size()) continue;
    const sph::Vent& vent = vents[placed++];
    for (const PlacedObstacle& each : *world.obstacles) {
      const geometry::RigidPose pose = each.track.at(vent.start);
      Real nearest = std::numeric_limits<Real>::infinity();
      for (const Vec3& site : vent.lattice(spacing)) nearest = std::min(nearest, each.shape.inside(pose.body(site)) ? 0 : each.shape.signed_distance(pose.body(site), 2 * spacing));
      if (nearest >= 2 * spacing) continue;
      faults.push_back({plan.place, fmt::format("obstacle '{}' is {} the vent when it opens, wanted at least two spacings, {:.3g} m, between them", each.name,
                                                nearest <= 0 ? std::string("over") : fmt::format("{:.2g} m from", nearest), 2 * spacing)});
    }
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
  plan.misfits = [vents, spacing = model.spacing, obstacles = model.obstacles, place = p.place("model")](const World& world) {
    std::vector<Fault> faults;
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
