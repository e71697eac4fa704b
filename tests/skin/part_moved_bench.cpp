// Frames in which a twentieth of the lava creeps on, made with what the frame before left and made alone, in one run: processor time.
//
//   full_ms, percent   a frame made alone; one made from the last over that, median of the frames
//   renewed            share of the level set's blocks that were computed
//
// The label is a hash of the last frame's mesh, which is the same both ways (else the benchmark says so and ends).

#include <benchmark/benchmark.h>

#include "tests/skin/bench_lava.h"

namespace effuse::skin {
namespace {

using bench::Lava;

enum class Where {
  kPatch,  // a square column at a corner, all of it
  kFront,  // the tenth with the greatest x, every second particle of it
};

std::vector<std::uint8_t> moving(const Lava& lava, Where where) {
  std::vector<std::uint8_t> moves(lava.x.size());
  const Vec3 low = lava.box.min(), size = lava.box.sizes();
  for (std::size_t i = 0; i < moves.size(); ++i) {
    const Vec3 at = (lava.x[i] - low).cwiseQuotient(size);
    moves[i] = where == Where::kPatch ? std::max(at.x(), at.y()) < std::sqrt(0.05) : at.x() > 0.9 && random_uniform(7, 0, i) < 0.5;
  }
  return moves;
}

void part_moved(benchmark::State& state, Where where, SurfaceKernel kernel) {
  Lava lava(static_cast<std::size_t>(state.range(0)), static_cast<int>(state.range(1)));
  lava.bare();
  LevelSetOptions options = bench::metre(1 / static_cast<Real>(state.range(2)));
  options.kernel = kernel;
  if (kernel == SurfaceKernel::kAnisotropic) options.smoothing = 0;
  const std::vector<std::uint8_t> moves = moving(lava, where);
  const auto advance = [&] {
    for (std::size_t i = 0; i < moves.size(); ++i)
      if (moves[i]) lava.x[i] += 0.02 * Vec3(1, 0.5, 0.2 * (random_uniform(8, 0, i) - 0.5));
    lava.points.position = lava.x;
  };

  SurfaceCache cache;
  LevelSetReport report;
  const auto frame = [&](SurfaceCache* last, geometry::TriMesh& mesh) {
    return bench::seconds_of([&] {
      const LevelSet surface = build_level_set(lava.points, lava.volume(), nullptr, options, last);
      mesh = mesh_level_set(surface, last);
      report = surface.report();
    });
  };
  geometry::TriMesh mesh, alone;
  frame(&cache, mesh);
  std::vector<double> full, share;
  for (auto _ : state) {
    advance();
    full.push_back(frame(nullptr, alone));
    const double seconds = frame(&cache, mesh);
    state.SetIterationTime(seconds);
    share.push_back(seconds / full.back());
    if (mesh.positions != alone.positions || mesh.triangles != alone.triangles) state.SkipWithError("the frame made from the last is another one");
  }
  state.SetLabel(std::to_string(bench::hash_of(mesh)));
  state.counters["full_ms"] = 1e3 * bench::median(full);
  state.counters["percent"] = 100 * bench::median(share);
  state.counters["renewed"] = static_cast<double>(report.renewed) / static_cast<double>(report.blocks);
  state.counters["moved"] = static_cast<double>(std::count(moves.begin(), moves.end(), 1)) / static_cast<double>(moves.size());
}
void patch_moved(benchmark::State& state) { part_moved(state, Where::kPatch, SurfaceKernel::kRound); }
void front_moved(benchmark::State& state) { part_moved(state, Where::kFront, SurfaceKernel::kRound); }
void patch_moved_anisotropic(benchmark::State& state) { part_moved(state, Where::kPatch, SurfaceKernel::kAnisotropic); }
void front_moved_anisotropic(benchmark::State& state) { part_moved(state, Where::kFront, SurfaceKernel::kAnisotropic); }

// Particles, layers (0: a cube), voxels a spacing.
void sizes(benchmark::internal::Benchmark* b) {
  for (const int n : {100000, 500000})
    for (const int layers : {0, 3})
      for (const int voxels : {4, 2}) b->Args({n, layers, voxels});
  b->Unit(benchmark::kMillisecond)->UseManualTime()->Iterations(15);
}
BENCHMARK(patch_moved)->Apply(sizes);
BENCHMARK(front_moved)->Apply(sizes);
BENCHMARK(patch_moved_anisotropic)->Apply(sizes);
BENCHMARK(front_moved_anisotropic)->Apply(sizes);

}  // namespace
}  // namespace effuse::skin
