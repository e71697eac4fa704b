#include <benchmark/benchmark.h>

#include <cmath>

#include "geometry/base/hash.h"
#include "geometry/procedural/primitives.h"
#include "geometry/remesh/decimate.h"

/// A wavy sphere of 82,000 triangles to a quarter; the label is a hash of what is left, and the mean square error of the dearest collapse in micrometres.
namespace effuse::geometry {
namespace {

void decimate_sphere(benchmark::State& state) {
  TriMesh fine = make_sphere(Vec3::Zero(), 10, 6);
  for (Vec3& p : fine.positions) p *= 1 + 0.01 * std::sin(3 * p.x()) * std::sin(4 * p.y() + p.z());
  Decimated result;
  StateHash hash;
  for (auto _ : state) {
    state.PauseTiming();
    TriMesh mesh = fine;
    state.ResumeTiming();
    result = decimate(mesh, fine.triangles.size() / 4);
    state.PauseTiming();
    hash = {};
    hash.add(std::span<const Vec3>(mesh.positions));
    state.ResumeTiming();
  }
  state.SetItemsProcessed(state.iterations() * static_cast<std::int64_t>((result.before - result.after) / 2));
  state.SetLabel(hash.hex() + ", " + std::to_string(std::lround(1e6 * result.error)) + " um");
}
BENCHMARK(decimate_sphere)->Unit(benchmark::kMillisecond);

}  // namespace
}  // namespace effuse::geometry
