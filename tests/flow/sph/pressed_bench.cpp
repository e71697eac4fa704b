#include <benchmark/benchmark.h>

#include <cmath>
#include <vector>

#include "flow/sph/modern_lava.h"
#include "geometry/base/parallel.h"
#include "geometry/base/zones.h"
#include "tests/flow/sph/beside_solids.h"
#include "tests/flow/sph/lava_times.h"
#include "tests/flow/sph/sample_system.h"
#include "tests/flow/sph/soft_block.h"

/// What a solid that deforms costs the lava that presses on it, on one thread.
///
/// BlockAnswers: factoring a block's matrix of so many cells a side, and solving it once, as each iteration of the pressure does.
/// SoftBlockInLava: steps of a lump of lava with such a block in it; shares of a step that go into what the solid says of its step (fem.predict), its
/// own step (fem.step), and the two solves.
namespace effuse::flow::sph {
namespace {

void BlockAnswers(benchmark::State& state) {
  const ThreadLimit limit(1);
  const auto cells = static_cast<int>(state.range(0));
  SoftBlock block(Vec3::Zero(), Vec3::Ones(), cells, {1e6, 0.3, 1000, 0.01, 0});
  std::vector<Vec3> velocity, in(block.places().size(), Vec3(1, 0.5, -1)), out(in.size());
  BlockMatrix answer, again;
  block.predict(0.02, velocity, answer);
  std::vector<double> factoring, solving;
  again.assign(answer, 1);
  again.factor();
  for (auto _ : state) {
    double before = thread_seconds();
    again.assign(answer, 1);
    again.factor();
    factoring.push_back(thread_seconds() - before);
    before = thread_seconds();
    again.solve(in, out);
    solving.push_back(thread_seconds() - before);
  }
  state.counters["factor_ms"] = 1e3 * median(factoring);
  state.counters["solve_ms"] = 1e3 * median(solving);
  StateHash hash;
  hash.add(std::span<const Vec3>(out));
  state.SetLabel(std::to_string(in.size()) + " points " + hash.hex());
}
BENCHMARK(BlockAnswers)->ArgName("cells")->Arg(3)->Arg(6)->Arg(9)->Arg(13)->Arg(15)->Unit(benchmark::kMillisecond);

void SoftBlockInLava(benchmark::State& state) {
  const ThreadLimit limit(1);
  const auto cells = static_cast<int>(state.range(0));
  const Real dx = 0.25;
  const Vec3 low(1.6, 1.6, 1.6), high(3.4, 3.4, 3.4);
  SoftBlock block(low, high, std::max(cells, 1), {1e6, 0.3, 1000, 0.01, 0});
  geometry::Obstacles obstacles;
  SolidOptions solids;
  if (cells > 0) {
    obstacles.add(block.obstacle(1));
    obstacles.update();
    solids = {&obstacles, {}, {}};
    solids.deforming = {{0, &block}};
  }
  ModernLava lava(thick_lava(dx, 300, 0.02), {}, {ground_at(0)}, {}, solids);
  std::vector<Vec3> x;
  for (const Vec3& p : lattice_block(20, 20, 16, dx))
    if (((p - (low + high) / 2).cwiseAbs() - (high - low) / 2).maxCoeff() > 0.4 * dx) x.push_back(p);
  lava.add(x, std::vector<Vec3>(x.size(), Vec3::Zero()), std::vector<Real>(x.size(), 1400));
  for (int k = 0; k < 4; ++k) lava.step(0.02);
  Profile profile;
  const ProfileScope scope(profile);
  std::vector<double> times;
  for (auto _ : state) {
    const double before = thread_seconds();
    lava.step(0.02);
    times.push_back(thread_seconds() - before);
  }
  double step = 0;
  for (const ZoneRow& row : profile.zones())
    if (row.name == "sph.step") step = row.total_s;
  for (const ZoneRow& row : profile.zones())
    for (const char* name : {"fem.predict", "fem.step", "sph.pressure", "sph.viscosity"})
      if (row.name == name) state.counters[std::string(name) + "_percent"] = 100 * row.total_s / step;
  state.counters["step_ms"] = 1e3 * median(times);
  state.SetLabel(std::to_string(lava.size()) + " particles, " + std::to_string(cells > 0 ? block.places().size() : 0) + " points " + hex_of(lava));
}
// 0: the hole alone.
BENCHMARK(SoftBlockInLava)->ArgName("cells")->Arg(0)->Arg(3)->Arg(6)->Arg(9)->Arg(13)->Unit(benchmark::kMillisecond);

}  // namespace
}  // namespace effuse::flow::sph
