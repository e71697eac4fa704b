#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <iterator>
#include <set>

#include "geometry/base/hash.h"
#include "geometry/base/parallel.h"
#include "geometry/base/random.h"
#include "geometry/terrain/triangulate.h"
#include "samples/study/cost/cost.h"
#include "samples/study/study.h"
#include "samples/study/validation/mountain.h"

/// What a decimated ground saves, and where the lava goes on it.
namespace effuse::study {

namespace {

using geometry::Terrain;

const std::vector<std::string> kFlow = {"lava.spacing=2.4 m", "lava.vent[0].stop=60 s", "film.fps=1", "film.time_scale=10", "film.frames=12"};

/// Squares of 10 m, the grid's own, that lava covers.
using Covered = std::set<std::pair<long, long>>;
Covered covered(std::span<const Vec3> x) {
  Covered squares;
  for (const Vec3& p : x) squares.insert({std::lround(p.x() / 10), std::lround(p.y() / 10)});
  return squares;
}

/// 1 - what both cover over what either does.
Real disagreement(const Covered& a, const Covered& b) {
  std::vector<std::pair<long, long>> both;
  std::set_intersection(a.begin(), a.end(), b.begin(), b.end(), std::back_inserter(both));
  return 1 - static_cast<Real>(both.size()) / static_cast<Real>(a.size() + b.size() - both.size());
}

struct Flow {
  Covered where;
  CostRun run;
};
Flow flow_on(const std::optional<Terrain>& ground, int seed = 1) {
  std::vector<std::string> changes = kFlow;
  changes.push_back(fmt::format("seed={}", seed));
  const auto loaded = load_scene("maunga-whau-modern.toml", changes, ground);
  Flow flow;
  const Real begin = processor_time();
  for (int frame = 0; frame < loaded->scene.frames; ++frame) loaded->simulation->advance([] { return true; });
  flow.run.seconds = processor_time() - begin;
  const flow::Effect& lava = *loaded->simulation->effects().front();
  const geometry::Points points = lava.points();
  flow.where = covered(points.position);
  flow.run.memory = lava.memory();
  for (const auto& [name, value] : lava.figures())
    if (name == "steps") flow.run.steps = static_cast<std::uint64_t>(value);
  StateHash hash;
  lava.add_to(hash);
  flow.run.hash = hash.value();
  return flow;
}

/// Seconds for a million contacts within 2 m of points that lie within 2 m of the ground.
Real contact_seconds(const Terrain& ground) {
  constexpr std::size_t kPoints = 100000;
  std::vector<Vec3> points;
  const Box3 box = ground.bounds();
  for (std::uint64_t k = 0; points.size() < kPoints; ++k) {
    const Real x = box.min().x() + random_uniform(1, 0, k) * box.sizes().x(), y = box.min().y() + random_uniform(1, 1, k) * box.sizes().y();
    const std::optional<Real> z = ground.height(x, y);
    if (z) points.emplace_back(x, y, *z + 2 * random_uniform(1, 2, k));
  }
  // Neighbours in space follow each other, as a solver's particles do.
  std::sort(points.begin(), points.end(), [](const Vec3& a, const Vec3& b) { return std::pair(std::floor(a.x() / 20), a.y()) < std::pair(std::floor(b.x() / 20), b.y()); });
  std::vector<geometry::Contact> contacts(points.size());
  Real best = 0;
  for (int k = 0; k < 3; ++k) {
    const Real begin = processor_time();
    ground.contacts(points, 2, contacts);
    const Real seconds = (processor_time() - begin) * 1e6 / static_cast<Real>(points.size());
    best = k == 0 ? seconds : std::min(best, seconds);
  }
  return best;
}

CaseResult decimation(bool full) {
  const ThreadLimit one(1);
  const auto original = load_scene("maunga-whau-modern.toml", kFlow);
  const Terrain& field = *original->terrain;
  const Flow reference = flow_on(field);
  const Real chance = disagreement(reference.where, flow_on(field, 2).where);
  CaseResult result;
  std::vector<Real> errors = {0, 0.5, 1, 2, 4, 8};
  if (full) errors = {0, 0.125, 0.25, 0.5, 1, 2, 4, 8, 16};
  std::vector<CostPoint> contacts, triangles;
  for (const Real error : errors) {
    const geometry::TriMesh mesh = geometry::triangulate(*field.height_field(), error);
    const Terrain ground = Terrain::from_mesh(mesh, field.georeference(), 288.15);
    const Real shown = std::max(error, 0.0625);  // zero has no place on an axis of powers
    const std::string setting = fmt::format("{:g} m, {} triangles", error, mesh.triangles.size());
    result.costs.push_back(cost_of("ground covered", setting, shown, [&] {
      Flow flow = flow_on(ground);
      flow.run.error = std::max(disagreement(flow.where, reference.where), 1e-3);
      return flow.run;
    }, 1));
    contacts.push_back({"mesh", setting, shown, contact_seconds(ground), 0, 0, 1, 0, 0, 0});
    triangles.push_back({"triangles", setting, shown, static_cast<Real>(mesh.triangles.size()), 0, 0, 1, 0, 0, 0});
  }
  const Real grid = contact_seconds(field);
  const auto at = [&](const std::vector<CostPoint>& points, Real error) { return std::find_if(points.begin(), points.end(), [&](const CostPoint& p) { return p.parameter == error; })->error; };
  result.measures.push_back({"ground covered differently by chance, another seed", "", chance, 0, chance, 0.25, ""});
  result.measures.push_back({"ground covered differently, mesh to 1 m over mesh to 8 m", "", at(result.costs, 1), at(result.costs, 8), at(result.costs, 1) / at(result.costs, 8), 0.6, "x"});
  result.measures.push_back({"triangles of a mesh to 1 m over those of every post", "", at(triangles, 1) / triangles.front().error, 0, at(triangles, 1) / triangles.front().error, 0.3, "x"});
  result.plots.push_back(convergence_plot("terrain_flow", fmt::format("Maunga Whau in triangles: to 1 m it takes {:.2g} % of them, and the lava covers {:.2g} % other ground", 100 * at(triangles, 1) / triangles.front().error, 100 * at(result.costs, 1)),
                                          "error of the ground [m] (1/16: every post)", "ground covered by one of both only, of either's", result.costs, {}));
  Plot cost = convergence_plot("terrain_contacts", fmt::format("A million contacts: {:.2g} s on the grid, {:.2g} s on a mesh of every post, {:.2g} s on one to 8 m", grid, contacts.front().error, contacts.back().error), "error of the ground [m] (1/16: every post)",
                               "seconds for a million contacts", contacts, {});
  cost.curves.push_back({"grid", {contacts.front().parameter, contacts.back().parameter}, {grid, grid}, false, true});
  result.plots.push_back(std::move(cost));
  result.plots.push_back(convergence_plot("terrain_triangles", "Triangles that a stated error of the ground takes", "error of the ground [m] (1/16: every post)", "triangles", triangles, {}));
  result.note = fmt::format("Two minutes of maunga-whau-modern.toml with particles of 2.4 m on greedy triangulations of its grid, against the grid itself; squares of 10 m. Contacts of points within 2 m of the ground; one thread. By chance, with another seed, {:.2g} % are covered differently. The grid is of whole metres on posts 10 m apart: between posts even a mesh that keeps them all is up to 2 m off its bilinear cells.", 100 * chance);
  return result;
}

}  // namespace

std::vector<Case> terrain_cases() {
  return {{"terrain-decimation", "Triangles of the ground against where the lava goes, and what its contacts cost", "the grid itself", true, [] { return decimation(false); }, [] { return decimation(true); }}};
}

}  // namespace effuse::study
