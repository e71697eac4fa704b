#include <benchmark/benchmark.h>

#include "flow/smoke/smoke_grid.h"

/// A step of a plume in a cube of cells, with and without MacCormack's correction; and the projection alone. The label is the state's hash.
namespace effuse::flow::smoke {
namespace {

void Step(benchmark::State& state) {
  SmokeOptions o;
  const auto n = static_cast<int>(state.range(0));
  o.n = {n, n, n};
  o.sharp = state.range(1) != 0;
  o.swirl = 0.2;
  SmokeGrid grid(o);
  const SmokeSource source{Vec3(n / 2.0, n / 2.0, n / 8.0), n / 10.0, 1, 450, Vec3::Zero()};
  for (int k = 0; k < 5; ++k) {
    grid.add(source, 0.2);
    grid.step(0.2);
  }
  StateHash hash;
  grid.add_to(hash);
  int iterations = 0, steps = 0;
  for (auto _ : state) {
    grid.add(source, 0.2);
    iterations += grid.step(0.2).pressure.iterations;
    ++steps;
  }
  state.counters["per_cell"] = benchmark::Counter(static_cast<double>(grid.size()), benchmark::Counter::kIsIterationInvariantRate | benchmark::Counter::kInvert);
  state.counters["iterations"] = static_cast<double>(iterations) / steps;
  state.SetLabel(hash.hex());
}
BENCHMARK(Step)->ArgNames({"side", "sharp"})->Args({64, 0})->Args({64, 1})->Unit(benchmark::kMillisecond)->UseRealTime();

void Projection(benchmark::State& state) {
  const auto n = static_cast<int>(state.range(0));
  const std::size_t cells = static_cast<std::size_t>(n) * static_cast<std::size_t>(n) * static_cast<std::size_t>(n);
  Poisson poisson({n, n, n}, std::vector<std::uint8_t>(cells, 0), {true, true, true, true, false, true});
  std::vector<Real> b(cells, 0), p(cells);
  b[cells / 2] = 1;
  int iterations = 0;
  for (auto _ : state) {
    std::fill(p.begin(), p.end(), 0);
    iterations = poisson.solve(b, p, 1e-4).iterations;
  }
  state.counters["per_cell"] = benchmark::Counter(static_cast<double>(cells), benchmark::Counter::kIsIterationInvariantRate | benchmark::Counter::kInvert);
  state.counters["iterations"] = iterations;
}
BENCHMARK(Projection)->ArgName("side")->Arg(32)->Arg(64)->Arg(96)->Unit(benchmark::kMillisecond)->UseRealTime();

}  // namespace
}  // namespace effuse::flow::smoke
