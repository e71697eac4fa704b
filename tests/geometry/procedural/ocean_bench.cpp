#include <benchmark/benchmark.h>

#include "geometry/base/hash.h"
#include "geometry/base/parallel.h"
#include "geometry/procedural/ocean.h"

/// A wind sea of forty waves: its mesh of a frame, and the height over a place, which lava asks for. The label is a hash of what came out.
namespace effuse::geometry {
namespace {

Ocean sea() { return Ocean({}, wind_sea(9, 0.4, 40, 1)); }

void Mesh(benchmark::State& state) {
  const Ocean ocean = sea();
  const int n = static_cast<int>(state.range(0));
  TriMesh mesh;
  for (auto _ : state) mesh = ocean_mesh(ocean, Vec2(-100, -100), Vec2(100, 100), n, n, 12.5);
  StateHash hash;
  hash.add(std::span<const Vec3>(mesh.positions));
  state.counters["per_point_wave"] = benchmark::Counter(40.0 * static_cast<double>(mesh.positions.size()), benchmark::Counter::kIsIterationInvariantRate | benchmark::Counter::kInvert);
  state.SetLabel(hash.hex());
}
BENCHMARK(Mesh)->ArgName("side")->Arg(100)->Arg(400)->Unit(benchmark::kMillisecond)->UseRealTime();

void Height(benchmark::State& state) {
  const Ocean ocean = sea();
  Real x = 0, sum = 0;
  std::size_t asked = 0;
  for (auto _ : state) {
    sum += ocean.height(Vec2(x, 0.3 * x), 12.5);
    x = ++asked % 1000 == 0 ? 0 : x + 0.1;
  }
  benchmark::DoNotOptimize(sum);
  StateHash hash;
  for (int k = 0; k < 100; ++k) hash.add(ocean.height(Vec2(k, 0.3 * k), 12.5));
  state.SetLabel(hash.hex());
}
BENCHMARK(Height);

}  // namespace
}  // namespace effuse::geometry
