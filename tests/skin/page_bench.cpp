#include <benchmark/benchmark.h>

#include "geometry/base/hash.h"
#include "skin/color/lava_color.h"
#include "skin/page/page_bytes.h"
#include "skin/page/pack_mesh.h"
#include "skin/page/text85.h"
#include "tests/skin/sample_lava.h"

/// What a frame of 20,000 triangles costs on its way into the page, step by step. The label: bytes of the step's outcome, and a hash of them.
namespace effuse::skin {
namespace {

geometry::TriMesh lava() {
  geometry::TriMesh mesh = testing_meshes::tube(120, 3, 250, 40);
  color_lava(mesh);
  return mesh;
}

void label(benchmark::State& state, const std::string& bytes, std::size_t triangles) {
  StateHash hash;
  hash.add(std::string_view(bytes));
  state.SetItemsProcessed(state.iterations() * static_cast<std::int64_t>(triangles));
  state.SetLabel(std::to_string(bytes.size()) + " bytes, " + hash.hex());
}

void page_attributes(benchmark::State& state) {
  const geometry::TriMesh mesh = lava();
  PageBytes bytes;
  for (auto _ : state) bytes = lava_bytes(mesh);
  std::string all;
  for (const BytePlane& plane : bytes.planes) all.append(plane.values.begin(), plane.values.end());
  label(state, all, mesh.triangles.size());
}
BENCHMARK(page_attributes)->Unit(benchmark::kMillisecond);

void page_pack(benchmark::State& state) {
  const geometry::TriMesh mesh = lava();
  const PageBytes bytes = lava_bytes(mesh);
  PackedMesh packed;
  for (auto _ : state) packed = pack_mesh(mesh, bytes.planes);
  label(state, packed.bytes, mesh.triangles.size());
}
BENCHMARK(page_pack)->Unit(benchmark::kMillisecond);

void page_deflate(benchmark::State& state) {
  const geometry::TriMesh mesh = lava();
  const PackedMesh packed = pack_mesh(mesh, lava_bytes(mesh).planes);
  std::string text;
  for (auto _ : state) text = text85(deflate_raw(packed.bytes));
  label(state, text, mesh.triangles.size());
}
BENCHMARK(page_deflate)->Unit(benchmark::kMillisecond);

}  // namespace
}  // namespace effuse::skin
