#include <benchmark/benchmark.h>

#include "flow/waves/wave_grid.h"
#include "geometry/base/parallel.h"

/// Explicit steps on square grids, beside a copy of as many bytes: what memory alone would take. The label is the state's hash.
namespace effuse::flow::waves {
namespace {

void ExplicitStep(benchmark::State& state) {
  WaveOptions o;
  o.nx = o.ny = static_cast<int>(state.range(0));
  std::vector<Real> c2(state.range(1) ? static_cast<std::size_t>(o.nx) * static_cast<std::size_t>(o.ny) : 1, 1.0);
  WaveGrid w(o, c2);
  w.add_volume(Vec2(o.nx / 3.0, o.ny / 2.0), 5, 10);
  const Real dt = 0.9 * w.longest_step();
  w.step(dt);
  StateHash hash;
  w.add_to(hash);
  for (auto _ : state) w.step(dt);
  state.counters["cells_per_s"] = benchmark::Counter(static_cast<double>(w.size()), benchmark::Counter::kIsIterationInvariantRate);
  state.SetLabel(hash.hex());
}
BENCHMARK(ExplicitStep)->ArgNames({"side", "shore"})->ArgsProduct({{512, 2048}, {0, 1}})->UseRealTime();

/// Two arrays read and written: 32 bytes a cell, as a step with one speed moves.
void TwoArraysReadAndWritten(benchmark::State& state) {
  const auto n = static_cast<std::size_t>(state.range(0)) * static_cast<std::size_t>(state.range(0));
  std::vector<Real> a(n, 1), b(n, 2);
  for (auto _ : state) {
    parallel_ranges(n, 65536, [&](std::size_t begin, std::size_t end) {
      for (std::size_t i = begin; i < end; ++i) {
        b[i] += 1e-9 * a[i];
        a[i] += 1e-9 * b[i];
      }
    });
    benchmark::ClobberMemory();
  }
  state.counters["cells_per_s"] = benchmark::Counter(static_cast<double>(n), benchmark::Counter::kIsIterationInvariantRate);
}
BENCHMARK(TwoArraysReadAndWritten)->ArgName("side")->Arg(512)->Arg(2048)->UseRealTime();

}  // namespace
}  // namespace effuse::flow::waves
