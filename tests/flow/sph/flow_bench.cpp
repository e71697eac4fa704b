#include <benchmark/benchmark.h>

#include <cmath>

#include "flow/sph/classic_lava.h"
#include "flow/sph/column_grid.h"
#include "geometry/base/hash.h"

/// A slab of lava four particles deep on a tilted plane: neighbours alone, and whole steps. Each line
/// carries the state's hash, so that a gain that changed the answer shows. A flat per_particle from
/// 5 k to 200 k is what sorting buys.
namespace effuse::flow::sph {
namespace {

ContactSource tilted_plane(const Vec3& normal) {
  return [normal](std::span<const Vec3> x, Real reach, std::span<geometry::Contact> out) {
    for (std::size_t i = 0; i < x.size(); ++i) {
      const Real d = x[i].dot(normal);
      out[i] = d < reach ? geometry::Contact{Vec3(x[i] - d * normal), normal, d, Vec3::Zero(), 0, 0} : geometry::Contact{};
    }
  };
}

std::vector<Vec3> slab(std::int64_t n) {
  const int side = static_cast<int>(std::sqrt(static_cast<double>(n) / 4));
  std::vector<Vec3> x;
  for (int k = 0; k < 4; ++k)
    for (int j = 0; j < side; ++j)
      for (int i = 0; i < side; ++i) x.push_back(Vec3(i, j, k + 0.6 - 0.2 * i));
  return x;
}

ClassicLava flowing_slab(std::int64_t n) {
  ClassicLava lava({}, {}, {tilted_plane(Vec3(0.2, 0, 1).normalized())});
  const std::vector<Vec3> x = slab(n);
  lava.add(x, std::vector<Vec3>(x.size(), Vec3::Zero()), std::vector<Real>(x.size(), 1400));
  for (int i = 0; i < 4; ++i) lava.step(1);
  return lava;
}

void report(benchmark::State& state, std::size_t particles, const std::string& hash) {
  state.counters["per_particle"] = benchmark::Counter(static_cast<double>(particles), benchmark::Counter::kIsIterationInvariantRate | benchmark::Counter::kInvert);
  state.SetLabel(hash);
}

void NeighborLists(benchmark::State& state) {
  const std::vector<Vec3> x = flowing_slab(state.range(0)).state().x;
  ColumnGrid grid;
  Neighbors neighbors;
  for (auto _ : state) {
    grid.build(x, 2);
    neighbors.find(grid, 2);
    benchmark::DoNotOptimize(neighbors.pairs());
  }
  StateHash hash;
  for (std::size_t i = 0; i < x.size(); ++i) hash.add(neighbors[i]);
  report(state, x.size(), hash.hex());
}

void ClassicStep(benchmark::State& state) {
  const ClassicLava start = flowing_slab(state.range(0));
  StateWriter saved;
  start.save(saved);
  ClassicLava lava = flowing_slab(state.range(0));
  std::string hash;
  for (auto _ : state) {
    state.PauseTiming();
    StateReader in(saved.bytes(), "memory");
    lava.load(in);
    state.ResumeTiming();
    for (int i = 0; i < 16; ++i) lava.step(1);
    state.PauseTiming();
    StateHash h;
    lava.add_to(h);
    hash = h.hex();
    state.ResumeTiming();
  }
  report(state, 16 * lava.size(), hash);
  state.counters["bytes_per_particle"] = static_cast<double>(lava.memory()) / static_cast<double>(lava.size());
}

BENCHMARK(NeighborLists)->Arg(5000)->Arg(20000)->Arg(80000)->Arg(200000)->Unit(benchmark::kMillisecond)->UseRealTime();
BENCHMARK(ClassicStep)->Arg(5000)->Arg(20000)->Arg(80000)->Arg(200000)->Unit(benchmark::kMillisecond)->UseRealTime();

}  // namespace
}  // namespace effuse::flow::sph
