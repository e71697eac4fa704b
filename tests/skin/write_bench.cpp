#include <benchmark/benchmark.h>
#include <unistd.h>

#include <filesystem>
#include <string>
#include <string_view>

#include "geometry/base/files.h"
#include "geometry/base/hash.h"
#include "skin/color/lava_color.h"
#include "skin/write/write_flipbook.h"
#include "skin/write/write_mesh.h"
#include "skin/write/write_usda.h"
#include "skin/write/write_vtp.h"
#include "tests/skin/sample_lava.h"

/// A frame of lava in each format: triangles a second, and the file's bytes a triangle.
namespace effuse::skin {
namespace {

namespace fs = std::filesystem;

template <class Write>
void frame(benchmark::State& state, const char* extension, Write&& write) {
  geometry::TriMesh mesh = testing_meshes::tube(60, 3, static_cast<int>(state.range(0)) / 200, 100);
  color_lava(mesh);
  const fs::path file = fs::temp_directory_path() / ("effuse_bench_" + std::to_string(::getpid()) + extension);
  for (auto _ : state) write(file, mesh);
  StateHash hash;
  const std::string bytes = read_file(file);
  hash.add(std::string_view(bytes));
  state.SetLabel(hash.hex());
  const double triangles = static_cast<double>(mesh.triangles.size());
  state.counters["triangles/s"] = benchmark::Counter(triangles * static_cast<double>(state.iterations()), benchmark::Counter::kIsRate);
  state.counters["bytes/triangle"] = static_cast<double>(fs::file_size(file)) / triangles;
  fs::remove(file);
}

void BM_WritePly(benchmark::State& state) {
  frame(state, ".ply", [](const fs::path& file, const geometry::TriMesh& mesh) { write_ply(file, mesh); });
}
void BM_WriteGlb(benchmark::State& state) {
  frame(state, ".glb", [](const fs::path& file, const geometry::TriMesh& mesh) { write_glb(file, mesh); });
}
void BM_WriteVtp(benchmark::State& state) {
  frame(state, ".vtp", [](const fs::path& file, const geometry::TriMesh& mesh) { write_vtp(file, mesh, 1); });
}
void BM_WriteVtpRaw(benchmark::State& state) {
  frame(state, ".vtp", [](const fs::path& file, const geometry::TriMesh& mesh) { write_vtp(file, mesh, 1, {}, false); });
}
void BM_WriteUsda(benchmark::State& state) {
  frame(state, ".usda", [](const fs::path& file, const geometry::TriMesh& mesh) { write_usda_frame(file, mesh, "skin", {}); });
}
/// Ten frames.
void BM_WriteFlipbook(benchmark::State& state) {
  frame(state, ".glb", [](const fs::path& file, const geometry::TriMesh& mesh) {
    Flipbook book("film");
    for (int k = 0; k < 10; ++k) book.add_frame("skin", k, mesh);
    book.finish(file, 10);
  });
}

BENCHMARK(BM_WritePly)->Arg(50000)->Unit(benchmark::kMillisecond)->UseRealTime();
BENCHMARK(BM_WriteGlb)->Arg(50000)->Unit(benchmark::kMillisecond)->UseRealTime();
BENCHMARK(BM_WriteVtp)->Arg(50000)->Unit(benchmark::kMillisecond)->UseRealTime();
BENCHMARK(BM_WriteVtpRaw)->Arg(50000)->Unit(benchmark::kMillisecond)->UseRealTime();
BENCHMARK(BM_WriteUsda)->Arg(50000)->Unit(benchmark::kMillisecond)->UseRealTime();
BENCHMARK(BM_WriteFlipbook)->Arg(50000)->Unit(benchmark::kMillisecond)->UseRealTime();

}  // namespace
}  // namespace effuse::skin
