// The skin's steps on ground, one after another. state.label: the result's hash, so that a gain which changed the answer shows.
// Beside OpenVDB: beside_open_vdb_bench.cpp; frames made from the last: part_moved_bench.cpp.

#include <benchmark/benchmark.h>

#include <cmath>
#include <filesystem>

#include "skin/detail/displace.h"
#include "skin/surface/level_set.h"
#include "tests/skin/bench_lava.h"

namespace effuse::skin {
namespace {

using bench::hash_of;
using bench::Lava;
using bench::metre;

/// Waves of half a metre under it.
geometry::Terrain ground(const Lava& lava) {
  const int n = 50;
  const Real side = lava.x.back().x() + 40;
  std::vector<Real> z;
  for (int j = 0; j < n; ++j)
    for (int i = 0; i < n; ++i) z.push_back(0.25 * (std::sin(0.7 * i) * std::sin(0.9 * j) - 1));
  return geometry::Terrain::from_height_field(geometry::HeightField(Vec2(-20, -20), Vec2(side / (n - 1), side / (n - 1)), n, n, z));
}

void finish(benchmark::State& state, const Lava& lava, std::uint64_t hash) {
  state.SetLabel(std::to_string(hash));
  state.counters["particles/s"] = benchmark::Counter(static_cast<double>(lava.x.size()), benchmark::Counter::kIsIterationInvariantRate);
}

void build_on_ground(benchmark::State& state) {
  const Lava lava(static_cast<std::size_t>(state.range(0)), static_cast<int>(state.range(1)));
  const geometry::Terrain terrain = ground(lava);
  std::uint64_t voxels = 0;
  for (auto _ : state) voxels = build_level_set(lava.points, static_cast<Real>(lava.x.size()), &terrain, metre()).active_voxels();
  finish(state, lava, voxels);
}

/// A built level set, then one step after it.
template <class Step>
void after_building(benchmark::State& state, Step&& step) {
  const Lava lava(static_cast<std::size_t>(state.range(0)), static_cast<int>(state.range(1)));
  const geometry::Terrain terrain = ground(lava);
  const LevelSet surface = build_level_set(lava.points, static_cast<Real>(lava.x.size()), &terrain, metre());
  std::uint64_t result = 0;
  for (auto _ : state) result = step(surface, terrain);
  finish(state, lava, result);
}

void mesh(benchmark::State& state) {
  after_building(state, [](const LevelSet& surface, const geometry::Terrain&) { return hash_of(mesh_level_set(surface)); });
}

void mesh_and_displace(benchmark::State& state) {
  after_building(state, [](const LevelSet& surface, const geometry::Terrain& terrain) {
    geometry::TriMesh skin = mesh_level_set(surface);
    DisplaceOptions options;
    options.spacing = 1;
    displace(skin, &terrain, options);
    return hash_of(skin);
  });
}

void vdb(benchmark::State& state) {
  after_building(state, [](const LevelSet& surface, const geometry::Terrain&) {
    const auto file = std::filesystem::temp_directory_path() / "effuse_skin_bench.vdb";
    write_vdb(file, surface, {});
    const auto size = std::filesystem::file_size(file);
    std::filesystem::remove(file);
    return static_cast<std::uint64_t>(size);
  });
}

// Particles, layers (0: a cube).
void sizes(benchmark::internal::Benchmark* b) {
  b->Args({100000, 0})->Args({100000, 3})->Unit(benchmark::kMillisecond)->UseRealTime()->MeasureProcessCPUTime();
}
BENCHMARK(build_on_ground)->Apply(sizes);
BENCHMARK(mesh)->Apply(sizes);
BENCHMARK(mesh_and_displace)->Apply(sizes);
BENCHMARK(vdb)->Apply(sizes);

}  // namespace
}  // namespace effuse::skin
