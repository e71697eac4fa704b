#include <benchmark/benchmark.h>

#include "flow/particles/particle_cloud.h"

/// A step of a million sparks with drag and wind, alone, in eddies, and over a floor. The label is the state's hash.
namespace effuse::flow::particles {
namespace {

void Step(benchmark::State& state) {
  CloudOptions o;
  o.forces.response = 1;
  o.forces.wind = Vec3(2, 0, 0);
  if (state.range(1)) o.forces.turbulence = 1;
  EmitterOptions e;
  e.rate = static_cast<Real>(state.range(0));
  e.stop = 1;
  e.spread = 1;
  e.lifetime = 1e6;
  ParticleCloud cloud(o, {e});
  cloud.step(1);
  StateHash hash;
  cloud.add_to(hash);
  for (auto _ : state) cloud.step(1e-3);
  state.counters["per_particle"] = benchmark::Counter(static_cast<double>(cloud.size()), benchmark::Counter::kIsIterationInvariantRate | benchmark::Counter::kInvert);
  state.SetLabel(hash.hex());
}
BENCHMARK(Step)->ArgNames({"particles", "eddies"})->Args({1000000, 0})->Args({1000000, 1})->Unit(benchmark::kMillisecond)->UseRealTime();

}  // namespace
}  // namespace effuse::flow::particles
