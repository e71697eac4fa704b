#include <benchmark/benchmark.h>

#include <numeric>

#include "flow/bodies/brittle_bodies.h"
#include "geometry/base/hash.h"
#include "geometry/procedural/primitives.h"

/// Cutting a body into cells, the stress of its bonds, and a wall that a ball goes through.
namespace effuse::flow::bodies {
namespace {

using geometry::FracturedBody;

FracturedBody cut(const geometry::TriMesh& mesh, std::size_t cells) { return geometry::fracture(mesh, geometry::cell_regions(mesh, {.cells = cells})); }

void CutBox(benchmark::State& state) {
  const geometry::TriMesh mesh = geometry::make_box(Vec3::Zero(), Vec3(4, 1, 3));
  for (auto _ : state) benchmark::DoNotOptimize(cut(mesh, static_cast<std::size_t>(state.range(0))));
}
BENCHMARK(CutBox)->Arg(40)->Arg(200)->Unit(benchmark::kMillisecond);

void CutTorus(benchmark::State& state) {
  const geometry::TriMesh mesh = geometry::make_torus(Vec3::Zero(), 2, 0.6, 32, 16);
  for (auto _ : state) benchmark::DoNotOptimize(cut(mesh, static_cast<std::size_t>(state.range(0))));
}
BENCHMARK(CutTorus)->Arg(20)->Unit(benchmark::kMillisecond);

void BondStresses(benchmark::State& state) {
  const FracturedBody body = cut(geometry::make_box(Vec3::Zero(), Vec3(4, 1, 3)), static_cast<std::size_t>(state.range(0)));
  std::vector<Index> all(body.cells.size());
  std::iota(all.begin(), all.end(), Index{0});
  std::vector<Wrench> loads(all.size());
  loads[0].force = Vec3(0, 1000, 0);
  take_rigid_part(body, all, 2000, Vec3::Zero(), loads);
  const bool anew = state.range(1) != 0;
  const std::vector<std::uint8_t> none(body.interfaces.size());
  const BondSolver kept(body, all, none);
  for (auto _ : state) benchmark::DoNotOptimize(anew ? BondSolver(body, all, none).stresses(loads) : kept.stresses(loads));
}
BENCHMARK(BondStresses)->ArgsProduct({{40, 200}, {0, 1}})->ArgNames({"cells", "factor"})->Unit(benchmark::kMicrosecond);

void BallThroughWall(benchmark::State& state) {
  const geometry::TriMesh mesh = geometry::make_box(Vec3(-1.5, -0.1, -1.5), Vec3(1.5, 0.1, 1.5));
  const auto cells = std::make_shared<const FracturedBody>(cut(mesh, static_cast<std::size_t>(state.range(0))));
  std::string hash;
  for (auto _ : state) {
    RigidBodies bodies(BodyOptions{.gravity = Vec3::Zero()});
    BrittleBodies brittle(bodies);
    brittle.add({cells, 1e6, 0}, 2000, {});
    bodies.add(Shape::sphere(0.4), 2700, {Vec3(0, -1, 0), Quat::Identity()}, {}, Vec3(0, 15, 0));
    for (int k = 0; k < 24; ++k) brittle.step(1.0 / 120);
    StateHash h;
    bodies.add_to(h);
    hash = h.hex();
  }
  state.SetLabel(hash);
}
BENCHMARK(BallThroughWall)->Arg(40)->Arg(150)->Unit(benchmark::kMillisecond);

}  // namespace
}  // namespace effuse::flow::bodies
