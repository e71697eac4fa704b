#include "samples/budget/rehearsal.h"

#include <algorithm>
#include <cmath>
#include <ctime>
#include <limits>
#include <map>

#include "flow/effects/registry.h"
#include "flow/scene/scene.h"
#include "flow/scene/simulation.h"
#include "geometry/base/check.h"
#include "geometry/base/error.h"
#include "geometry/base/parallel.h"
#include "geometry/base/units.h"

namespace effuse::budget {

namespace {

/// Processor time of this thread [s].
Real thread_time() {
  timespec now{};
  ::clock_gettime(CLOCK_THREAD_CPUTIME_ID, &now);
  return static_cast<Real>(now.tv_sec) + 1e-9 * static_cast<Real>(now.tv_nsec);
}

flow::Node number(Real value) {
  flow::Node node;
  node.kind = flow::Node::Kind::kReal;
  node.real = value;
  return node;
}

/// The scene with its lava alone. support: of the kernel, in spacings.
flow::Scene lava_alone(const flow::Node& scene, Real spacing, Real& support) {
  flow::Node node = scene;
  for (auto& [name, table] : node.entries)
    if (name == "lava") table.set("spacing", number(spacing));
  flow::Parameters root(node);
  flow::Scene alone = flow::read_scene(root, flow::effect_kinds());
  if (!root.faults().empty()) throw InputError(root.faults());
  std::erase_if(alone.effects, [](const flow::EffectPlan& plan) { return plan.kind != "lava"; });
  const flow::Node resolved = root.resolved();
  const flow::Node* lava = resolved.find("lava");
  const flow::Node* of_kernel = lava ? lava->find("support") : nullptr;
  support = !of_kernel ? 3 : of_kernel->kind == flow::Node::Kind::kReal ? of_kernel->real : of_kernel->kind == flow::Node::Kind::kInteger ? static_cast<Real>(of_kernel->integer) : parse_quantity(of_kernel->text, "");
  return alone;
}

}  // namespace

Real mean_neighbors(const geometry::Points& points, Real reach, std::size_t samples) {
  const std::size_t n = points.size(), count = std::min(n, samples);
  if (count == 0) return 0;
  const Real near = parallel_sum(
      count, 0.0,
      [&](std::size_t s) {
        const std::size_t i = s * n / count;
        Real others = -1;  // itself
        for (const Vec3& x : points.position) others += (x - points.position[i]).squaredNorm() < reach * reach;
        return others;
      },
      8);
  return near / static_cast<Real>(count);
}

Rehearsal rehearse(const flow::Node& scene, const flow::World& world, Real spacing, Real most_work) {
  const ThreadLimit one(1);
  Real support = 3;
  const flow::Scene alone = lava_alone(scene, spacing, support);
  flow::Simulation simulation(alone, world);
  const flow::Effect& lava = *simulation.effects().front();
  std::vector<flow::sph::PlanLine> vents;
  for (const flow::Opening& opening : lava.openings()) vents.push_back({opening.from.head<2>(), opening.to.head<2>()});

  Rehearsal rehearsal;
  rehearsal.spacing = spacing;
  Moment last;
  Real last_awake = 0, last_neighbors = 0, last_pressure = 0, last_viscosity = 0;
  bool within = true;
  while (within && simulation.frame() < alone.frames) {
    const Real before = thread_time();
    Real work = last.counts.particle_steps;
    within = simulation.advance([&] {
      work += static_cast<Real>(lava.flow().x.size());
      return work <= most_work;
    });
    Moment now = last;
    now.seconds += thread_time() - before;
    now.time = lava.time();
    std::map<std::string, Real> figures;
    for (const auto& [name, value] : lava.figures()) figures[name] = value;
    const geometry::Points points = lava.points();
    if (const auto front = flow::sph::find_front(points, vents)) now.front = front->distance;
    now.particles = static_cast<Real>(points.size());
    now.layers = points.size() > 0 ? lava.volume() / (flow::sph::covered_area(points) * spacing) : 0;
    now.bytes = static_cast<Real>(lava.memory());
    // The classic lava solves nothing, and never sleeps.
    const Real steps = figures["steps"], awake = figures.contains("awake") ? figures["awake"] : now.particles;
    const Real pressure = steps * (figures["pressure_iterations"] + figures["density_iterations"]), viscosity = steps * figures["viscosity_iterations"];
    const Real neighbors = mean_neighbors(points, support * spacing);
    const Real particles = (awake + last_awake) / 2, pairs = (awake * neighbors + last_awake * last_neighbors) / 2;
    const Real more = steps - last.counts.steps, more_pressure = pressure - last_pressure, more_viscosity = viscosity - last_viscosity;
    now.counts = Counts::each(last.counts, {more, more * particles, more * pairs, more_pressure * particles, more_pressure * pairs, more_viscosity * particles, more_viscosity * pairs}, std::plus<>());
    last_awake = awake, last_neighbors = neighbors, last_pressure = pressure, last_viscosity = viscosity;
    last = now;
    rehearsal.moments.push_back(now);
  }
  const geometry::Points points = lava.points();
  rehearsal.at_the_end.assign(points.position.begin(), points.position.end());
  rehearsal.whole = within;
  return rehearsal;
}

Real middle_layers(const Rehearsal& rehearsal) {
  std::vector<Real> layers;
  for (const Moment& m : rehearsal.moments)
    if (m.particles > 0 && m.particles >= 0.1 * rehearsal.moments.back().particles) layers.push_back(m.layers);
  if (layers.empty()) return 1;
  std::nth_element(layers.begin(), layers.begin() + static_cast<std::ptrdiff_t>(layers.size() / 2), layers.end());
  return layers[layers.size() / 2];
}

Real difference_of_fronts(const Rehearsal& one, const Rehearsal& other) {
  const std::size_t both = std::min(one.moments.size(), other.moments.size());
  Real off = 0, all = 0;
  for (std::size_t k = 0; k < both; ++k) {
    if (one.moments[k].time != other.moments[k].time) continue;  // the last of one that was cut off
    off += std::pow(one.moments[k].front - other.moments[k].front, 2);
    all += std::pow(other.moments[k].front, 2);
  }
  return all > 0 ? std::sqrt(off / all) : std::numeric_limits<Real>::infinity();
}

FrontDifferences front_differences(const Rehearsal& coarser, const Rehearsal& own, const Rehearsal& finer) {
  CHECK(coarser.whole && own.whole && finer.whole);
  Real all = 0;
  for (const Moment& m : finer.moments) all += m.front * m.front;
  CHECK_GT(all, 0);
  const auto along = [&](const Rehearsal& one, const Rehearsal& other) {
    Real sum = 0;
    for (std::size_t k = 0; k < finer.moments.size(); ++k) sum += (one.moments[k].front - other.moments[k].front) * finer.moments[k].front;
    return sum / all;
  };
  return {along(coarser, own), along(own, finer), difference_of_fronts(own, finer)};
}

}  // namespace effuse::budget
