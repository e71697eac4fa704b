#include <benchmark/benchmark.h>

#include <span>

#include "geometry/base/hash.h"
#include "geometry/base/parallel.h"
#include "geometry/remesh/distance_bound.h"
#include "geometry/remesh/remesh.h"
#include "geometry/repair/repair.h"
#include "tests/geometry/terrain/fields.h"

/// Meshes of Maunga Whau, 10,320 triangles with every post: made sound, simplified, measured, proven. One thread. Labels hash the
/// mesh that came out, or say the figure found.
namespace effuse::geometry {
namespace {

std::string hash_of(const TriMesh& mesh) {
  StateHash hash;
  hash.add(std::span<const Vec3>(mesh.positions));
  return hash.hex() + ", " + std::to_string(mesh.triangles.size()) + " triangles";
}

void repair_sound_mesh(benchmark::State& state) {
  const ThreadLimit one(1);
  TriMesh mesh = fields::maunga_whau().mesh();
  for (auto _ : state) repair(mesh);
  state.SetItemsProcessed(static_cast<std::int64_t>(state.iterations() * mesh.triangles.size()));
  state.SetLabel(hash_of(mesh));
}
BENCHMARK(repair_sound_mesh)->Unit(benchmark::kMillisecond);

/// Argument: max_error [cm].
void simplify_to(benchmark::State& state) {
  const ThreadLimit one(1);
  const TriMesh mesh = fields::maunga_whau().mesh();
  Remeshed made;
  for (auto _ : state) made = simplify(mesh, static_cast<Real>(state.range(0)) / 100);
  state.SetItemsProcessed(static_cast<std::int64_t>(state.iterations() * mesh.positions.size()));
  state.SetLabel(hash_of(made.mesh));
  state.counters["largest"] = made.error.largest;
  state.counters["bound"] = made.bound;
}
BENCHMARK(simplify_to)->Arg(10)->Arg(50)->Arg(200)->Unit(benchmark::kMillisecond);

/// The proof beside the samples, both ways. Argument: the error of the simplified mesh [cm].
void measure(benchmark::State& state) {
  const ThreadLimit one(1);
  const TriMesh mesh = fields::maunga_whau().mesh(), few = simplify(mesh, static_cast<Real>(state.range(0)) / 100).mesh;
  Real largest = 0;
  for (auto _ : state) largest = hausdorff_distance(mesh, few).largest;
  state.counters["largest"] = largest;
}
BENCHMARK(measure)->Arg(10)->Arg(50)->Arg(200)->Unit(benchmark::kMillisecond);

void prove(benchmark::State& state) {
  const ThreadLimit one(1);
  const Real error = static_cast<Real>(state.range(0)) / 100;
  const TriMesh mesh = fields::maunga_whau().mesh(), few = simplify(mesh, error).mesh;
  Real bound = 0;
  for (auto _ : state) bound = std::max(distance_bound(mesh, few, error), distance_bound(few, mesh, error));
  state.counters["bound"] = bound;
}
BENCHMARK(prove)->Arg(10)->Arg(50)->Arg(200)->Unit(benchmark::kMillisecond);

void remesh_to(benchmark::State& state) {
  const ThreadLimit one(1);
  const TriMesh mesh = fields::maunga_whau().mesh();
  Remeshed made;
  for (auto _ : state) made = remesh(mesh, 8);
  state.SetItemsProcessed(static_cast<std::int64_t>(state.iterations() * made.mesh.triangles.size()));
  state.SetLabel(hash_of(made.mesh));
}
BENCHMARK(remesh_to)->Unit(benchmark::kMillisecond);

}  // namespace
}  // namespace effuse::geometry
