#include <benchmark/benchmark.h>

#include <cmath>
#include <limits>

#include "flow/effects/lava_in_water.h"
#include "geometry/base/hash.h"
#include "geometry/base/random.h"

/// Lava that runs into water, a frame of it: the volume of what is under, spread over the water's cells. The label is a hash of the volumes.
namespace effuse::flow {
namespace {

void LavaUnder(benchmark::State& state) {
  const auto n = static_cast<std::size_t>(state.range(0));
  PlanCells cells;
  cells.cell = 0.5;
  cells.nx = cells.ny = 160;
  // Land on the left quarter; half of the lava is on it.
  std::vector<Real> level(160 * 160, 1);
  for (std::size_t c = 0; c < level.size(); ++c)
    if (c % 160 < 40) level[c] = std::numeric_limits<Real>::quiet_NaN();
  std::vector<Vec3> x(n), v(n, Vec3::Zero());
  for (std::size_t i = 0; i < n; ++i) x[i] = Vec3(40 * random_uniform(1, 0, i), 80 * random_uniform(1, 1, i), 2 * random_uniform(1, 2, i));
  FlowView lava;
  lava.x = x;
  lava.v = v;
  lava.spacing = 0.5;
  std::vector<Real> volume;
  for (auto _ : state) volume = lava_under(lava, cells, level);
  StateHash hash;
  hash.add(std::span<const Real>(volume));
  state.counters["per_particle"] = benchmark::Counter(static_cast<double>(n), benchmark::Counter::kIsIterationInvariantRate | benchmark::Counter::kInvert);
  state.SetLabel(hash.hex());
}
BENCHMARK(LavaUnder)->ArgName("particles")->Arg(10000)->Arg(100000)->Unit(benchmark::kMillisecond);

}  // namespace
}  // namespace effuse::flow
