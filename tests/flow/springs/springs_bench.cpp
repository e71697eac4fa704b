#include <benchmark/benchmark.h>

#include <fmt/format.h>

#include "flow/springs/builders.h"
#include "flow/springs/spring_system.h"
#include "geometry/base/hash.h"

/// A step of the jello cube, squeezed, of 8^3 and 24^3 points under each scheme. Each line carries the hash of the state after it
/// and the time per spring.
namespace effuse::flow::springs {
namespace {

void Step(benchmark::State& state) {
  const auto scheme = static_cast<Scheme>(state.range(1));
  SpringBody body = jello_cube(static_cast<int>(state.range(0)), Vec3::Zero(), 1, 1.0 / 512, {200, 0.25, 0});
  for (Vec3& x : body.state.x) x.x() *= 0.95;
  SpringSystem system(body.network);
  SpringState y = body.state;
  StepStorage<SpringState> storage;
  integrate_step(scheme, system, 0, 1e-4, y, storage);  // allocates
  StateHash hash;
  hash.add(std::span<const Vec3>(y.x));
  for (auto _ : state) {
    state.PauseTiming();
    y = body.state;
    state.ResumeTiming();
    integrate_step(scheme, system, 0, 1e-4, y, storage);
  }
  state.counters["per_spring"] = benchmark::Counter(static_cast<double>(body.network.springs.size()), benchmark::Counter::kIsIterationInvariantRate | benchmark::Counter::kInvert);
  state.SetLabel(fmt::format("{} {}", kSchemeNames[static_cast<std::size_t>(scheme)], hash.hex()));
}
BENCHMARK(Step)->ArgsProduct({{8, 24}, {1, 3, 4}})->Unit(benchmark::kMillisecond)->UseRealTime();

}  // namespace
}  // namespace effuse::flow::springs
