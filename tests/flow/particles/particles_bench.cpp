#include <benchmark/benchmark.h>

#include <cmath>

#include "flow/particles/particle_cloud.h"
#include "geometry/terrain/terrain.h"

/// A step of a million sparks with drag and wind: alone, in eddies, in eddies over hills that the
/// first of them have fallen on, and born all over 600 m of eddies a metre wide. Times are the
/// processor's, of all threads together. The label is the state's hash.
namespace effuse::flow::particles {
namespace {

enum Among { kNothing, kEddies, kEddiesAndHills, kWideEddies };

geometry::Terrain hills() {
  constexpr int kPosts = 401;
  std::vector<Real> z;
  for (int j = 0; j < kPosts; ++j)
    for (int i = 0; i < kPosts; ++i) z.push_back(-3 + std::sin(0.1 * i) * std::cos(0.13 * j));
  return geometry::Terrain::from_height_field(geometry::HeightField(Vec2(-10, -10), Vec2(0.05, 0.05), kPosts, kPosts, z));
}

void Step(benchmark::State& state) {
  CloudOptions o;
  o.forces.response = 1;
  o.forces.wind = Vec3(2, 0, 0);
  if (state.range(1) >= kEddies) o.forces.turbulence = 1;
  EmitterOptions e;
  e.rate = static_cast<Real>(state.range(0));
  e.stop = 1;
  e.spread = 1;
  e.lifetime = 1e6;
  if (state.range(1) == kWideEddies) {
    e.shape = EmitterShape::kDisk;
    e.radius = 300;
  }
  const geometry::Terrain ground = hills();
  ParticleCloud::Contacts contacts;
  if (state.range(1) == kEddiesAndHills) contacts = [&](std::span<const Vec3> x, Real reach, std::span<geometry::Contact> out) { ground.contacts(x, reach, out); };
  ParticleCloud cloud(o, {e}, contacts);
  cloud.step(1);
  StateHash hash;
  cloud.add_to(hash);
  for (auto _ : state) cloud.step(1e-3);
  state.counters["per_particle"] = benchmark::Counter(static_cast<double>(cloud.size()), benchmark::Counter::kIsIterationInvariantRate | benchmark::Counter::kInvert);
  state.SetLabel(hash.hex());
}
BENCHMARK(Step)->ArgNames({"particles", "among"})->Args({1000000, kNothing})->Args({1000000, kEddies})->Args({1000000, kEddiesAndHills})->Args({1000000, kWideEddies})->Unit(benchmark::kMillisecond)->MeasureProcessCPUTime();

}  // namespace
}  // namespace effuse::flow::particles
