#include <benchmark/benchmark.h>

#include "flow/fem/fill_with_tets.h"
#include "flow/plants/plant_fire.h"
#include "flow/plants/plant_look.h"
#include "geometry/procedural/primitives.h"

/// What finite elements in a ball, plants' fire and plants' meshes take.
namespace effuse::flow {
namespace {

void fill_a_ball(benchmark::State& state) {
  const geometry::TriMesh ball = geometry::make_sphere(Vec3::Zero(), 1, 4);
  std::size_t tets = 0;
  for (auto _ : state) tets = fem::fill_with_tets(ball, 2.0 / static_cast<double>(state.range(0)), "bench").mesh.tets.size();
  state.counters["tetrahedra"] = static_cast<double>(tets);
}
BENCHMARK(fill_a_ball)->Arg(5)->Arg(10)->Arg(20)->Unit(benchmark::kMillisecond);

void step_a_ball(benchmark::State& state) {
  const fem::TetFill fill = fem::fill_with_tets(geometry::make_sphere(Vec3::Zero(), 1, 4), 2.0 / static_cast<double>(state.range(0)), "bench");
  fem::ElasticSolid solid(fill.mesh, {.youngs_modulus = 1e4, .poisson_ratio = 0.4, .density = 1000});
  for (std::size_t i = 0; i < solid.nodes(); ++i) solid.state().v[i] = Vec3(solid.state().x[i].z(), 0, 0);
  const fem::SolidState start = solid.state();
  for (auto _ : state) {
    solid.state() = start;
    solid.step(1. / 240);
  }
  StateHash hash;
  solid.add_to(hash);
  state.SetLabel(hash.hex());
  state.counters["tetrahedra"] = static_cast<double>(solid.tets().size());
}
BENCHMARK(step_a_ball)->Arg(5)->Arg(10)->Unit(benchmark::kMillisecond);

void burn_a_forest(benchmark::State& state) {
  const auto n = static_cast<std::size_t>(state.range(0));
  std::vector<Vec3> feet;
  for (std::size_t k = 0; k < n; ++k) feet.push_back(Vec3(3 * static_cast<Real>(k % 30), 3 * static_cast<Real>(k / 30), 0));
  std::vector<plants::HotPatch> lava;
  for (int k = 0; k < 1000; ++k) lava.push_back({Vec3(-5 + 0.1 * (k % 40), 2 * (k / 40), 0), 1, 1300});
  plants::PlantFire fire(feet, std::vector<Real>(n, 6), std::vector<Real>(n, 1.5), {});
  for (auto _ : state) fire.step(0.04, lava);
  StateHash hash;
  fire.add_to(hash);
  state.SetLabel(hash.hex());
}
BENCHMARK(burn_a_forest)->Arg(100)->Arg(1000)->Iterations(50)->Unit(benchmark::kMillisecond);

void show_plants(benchmark::State& state) {
  const geometry::PlantKind& kind = geometry::plant_kinds()[static_cast<std::size_t>(state.range(0))];
  const geometry::Plant plant = geometry::grow(geometry::derive(kind.system, kind.generations, 1), kind.turtle);
  const plants::PlantFire fire({Vec3::Zero()}, {1}, {0.4}, {});
  geometry::Sway sway;
  sway.wind = Vec2(4, 0);
  sway.flexibility = 1e-3;
  std::size_t triangles = 0;
  for (auto _ : state) triangles = plants::look_of(plant, {}, sway, 3, fire, 0, 1, 288, 593).triangles.size();
  state.SetLabel(kind.name);
  state.counters["limbs"] = static_cast<double>(plant.limbs.size());
  state.counters["triangles"] = static_cast<double>(triangles);
}
BENCHMARK(show_plants)->DenseRange(0, 3)->Unit(benchmark::kMillisecond);

}  // namespace
}  // namespace effuse::flow
