// The skin's steps, and OpenVDB's own rasteriser on the same particles in the same run: quote ratios, the machine is
// shared. state.label: the result's hash, so that a gain which changed the answer shows.

#include <benchmark/benchmark.h>
#include <openvdb/openvdb.h>
#include <openvdb/points/PointConversion.h>
#include <openvdb/points/PointRasterizeSDF.h>
#include <openvdb/tools/LevelSetFilter.h>
#include <openvdb/tools/VolumeToMesh.h>

#include <cmath>
#include <filesystem>

#include "geometry/base/hash.h"
#include "geometry/base/random.h"
#include "skin/detail/displace.h"
#include "skin/surface/level_set.h"
#include "skin/surface/rasterize.h"

namespace effuse::skin {
namespace {

/// About n particles, spacing 1, each moved by up to 0.1 in each direction: a cube, or a sheet of that many layers.
struct Lava {
  std::vector<Vec3> x, velocity;
  std::vector<Real> radius, temperature, crust;
  geometry::Points points;

  explicit Lava(std::size_t n, int layers) {
    const Real size = static_cast<Real>(n);
    const int height = layers > 0 ? layers : static_cast<int>(std::lround(std::cbrt(size))),
              across = static_cast<int>(std::lround(std::sqrt(size / height)));
    for (int i = 0; i < across; ++i)
      for (int j = 0; j < across; ++j)
        for (int k = 0; k < height; ++k) {
          const auto off = [&](std::uint64_t axis) { return 0.2 * random_uniform(1, axis, x.size()) - 0.1; };
          x.emplace_back(i + off(0), j + off(1), k + 0.5 + off(2));
        }
    radius.assign(x.size(), 0.5);
    temperature.assign(x.size(), 1400);
    crust.assign(x.size(), 0.5);
    velocity.assign(x.size(), Vec3(1, 0, 0));
    points.position = x;
    points.radius = radius;
    points.temperature = temperature;
    points.crust = crust;
    points.velocity = velocity;
  }
  Lava(const Lava&) = delete;
  /// Positions and radii only.
  void bare() { points.temperature = points.crust = {}, points.velocity = {}; }
};

/// Waves of half a metre under it.
geometry::Terrain ground(const Lava& lava) {
  const int n = 50;
  const Real side = lava.x.back().x() + 40;
  std::vector<Real> z;
  for (int j = 0; j < n; ++j)
    for (int i = 0; i < n; ++i) z.push_back(0.25 * (std::sin(0.7 * i) * std::sin(0.9 * j) - 1));
  return geometry::Terrain::from_height_field(geometry::HeightField(Vec2(-20, -20), Vec2(side / (n - 1), side / (n - 1)), n, n, z));
}

LevelSetOptions metre() {
  LevelSetOptions options;
  options.spacing = 1;
  return options;
}

void finish(benchmark::State& state, const Lava& lava, std::uint64_t hash) {
  state.SetLabel(std::to_string(hash));
  state.counters["particles/s"] = benchmark::Counter(static_cast<double>(lava.x.size()), benchmark::Counter::kIsIterationInvariantRate);
}

constexpr Real kVoxel = 0.25;  // half a particle's radius

openvdb::FloatGrid::Ptr smooth_spheres(const Lava& lava) {
  std::vector<openvdb::Vec3R> positions;
  for (const Vec3& p : lava.x) positions.emplace_back(p.x(), p.y(), p.z());
  const auto transform = openvdb::math::Transform::createLinearTransform(kVoxel);
  const openvdb::points::PointAttributeVector<openvdb::Vec3R> wrapper(positions);
  const auto index = openvdb::tools::createPointIndexGrid<openvdb::tools::PointIndexGrid>(wrapper, *transform);
  const auto grid =
      openvdb::points::createPointDataGrid<openvdb::points::NullCodec, openvdb::points::PointDataGrid>(*index, wrapper, *transform);
  return openvdb::points::rasterizeSmoothSpheres(*grid, 0.6, 2.0);
}

void open_vdb_smooth_spheres(benchmark::State& state) {
  const Lava lava(static_cast<std::size_t>(state.range(0)), static_cast<int>(state.range(1)));
  openvdb::initialize();
  std::uint64_t voxels = 0;
  for (auto _ : state) voxels = smooth_spheres(lava)->activeVoxelCount();
  finish(state, lava, voxels);
}

/// OpenVDB's own way to a smooth skin; its cheapest filter (mean curvature), or the one most use (gaussian).
void open_vdb_route(benchmark::State& state, bool gaussian) {
  const Lava lava(static_cast<std::size_t>(state.range(0)), static_cast<int>(state.range(1)));
  openvdb::initialize();
  std::uint64_t quads_made = 0;
  for (auto _ : state) {
    const auto grid = smooth_spheres(lava);
    openvdb::tools::LevelSetFilter<openvdb::FloatGrid> filter(*grid);
    if (gaussian) filter.gaussian(1);
    else filter.meanCurvature();
    std::vector<openvdb::Vec3s> points;
    std::vector<openvdb::Vec3I> triangles;
    std::vector<openvdb::Vec4I> quads;
    openvdb::tools::volumeToMesh(*grid, points, triangles, quads, 0.0, 0.0);
    quads_made = quads.size();
  }
  finish(state, lava, quads_made);
}
void open_vdb_route_mean_curvature(benchmark::State& state) { open_vdb_route(state, false); }
void open_vdb_route_gaussian(benchmark::State& state) { open_vdb_route(state, true); }

void particles_to_field(benchmark::State& state) {
  const Lava lava(static_cast<std::size_t>(state.range(0)), static_cast<int>(state.range(1)));
  StateHash hash;
  for (auto _ : state) {
    const ParticleGrid particles(lava.points, kVoxel, 4);
    const Blocks blocks = blocks_around(particles, 8);
    Field phi, weight;
    rasterize(particles, blocks, {.reach = 8, .spacing = 4, .outside = 5.6f}, phi, weight);
    hash = {};
    hash.add(std::span<const float>(phi));
  }
  finish(state, lava, hash.value());
}

void build_on_ground(benchmark::State& state) {
  const Lava lava(static_cast<std::size_t>(state.range(0)), static_cast<int>(state.range(1)));
  const geometry::Terrain terrain = ground(lava);
  std::uint64_t voxels = 0;
  for (auto _ : state) voxels = build_level_set(lava.points, static_cast<Real>(lava.x.size()), &terrain, metre()).active_voxels();
  finish(state, lava, voxels);
}

std::uint64_t hash_of(const geometry::TriMesh& mesh) {
  StateHash hash;
  hash.add(std::span<const Vec3>(mesh.positions));
  return hash.value();
}

/// Level set, smoothing, volume, mesh, normals; no ground, as OpenVDB's route has none.
void whole_skin(benchmark::State& state) {
  Lava lava(static_cast<std::size_t>(state.range(0)), static_cast<int>(state.range(1)));
  lava.bare();
  LevelSetOptions options = metre();
  options.voxel = kVoxel;
  std::uint64_t hash = 0;
  for (auto _ : state) hash = hash_of(mesh_level_set(build_level_set(lava.points, static_cast<Real>(lava.x.size()), nullptr, options)));
  finish(state, lava, hash);
}

/// A built level set, then one step after it.
template <class Step>
void after_building(benchmark::State& state, Step&& step) {
  const Lava lava(static_cast<std::size_t>(state.range(0)), static_cast<int>(state.range(1)));
  const geometry::Terrain terrain = ground(lava);
  const LevelSet surface = build_level_set(lava.points, static_cast<Real>(lava.x.size()), &terrain, metre());
  std::uint64_t result = 0;
  for (auto _ : state) result = step(surface, terrain);
  finish(state, lava, result);
}

void mesh(benchmark::State& state) {
  after_building(state, [](const LevelSet& surface, const geometry::Terrain&) { return hash_of(mesh_level_set(surface)); });
}

void mesh_and_displace(benchmark::State& state) {
  after_building(state, [](const LevelSet& surface, const geometry::Terrain& terrain) {
    geometry::TriMesh skin = mesh_level_set(surface);
    DisplaceOptions options;
    options.spacing = 1;
    displace(skin, &terrain, options);
    return hash_of(skin);
  });
}

void vdb(benchmark::State& state) {
  after_building(state, [](const LevelSet& surface, const geometry::Terrain&) {
    const auto file = std::filesystem::temp_directory_path() / "effuse_skin_bench.vdb";
    write_vdb(file, surface, {});
    const auto size = std::filesystem::file_size(file);
    std::filesystem::remove(file);
    return static_cast<std::uint64_t>(size);
  });
}

// Particles, layers (0: a cube).
void sizes(benchmark::internal::Benchmark* b) {
  b->Args({100000, 0})->Args({100000, 3})->Unit(benchmark::kMillisecond)->UseRealTime()->MeasureProcessCPUTime();
}
void three_sizes(benchmark::internal::Benchmark* b) {
  for (const int n : {20000, 100000, 500000})
    for (const int layers : {0, 3}) b->Args({n, layers});
  b->Unit(benchmark::kMillisecond)->UseRealTime()->MeasureProcessCPUTime();
}
BENCHMARK(open_vdb_smooth_spheres)->Apply(three_sizes);
BENCHMARK(particles_to_field)->Apply(three_sizes);
BENCHMARK(open_vdb_route_mean_curvature)->Apply(three_sizes);
BENCHMARK(open_vdb_route_gaussian)->Args({100000, 0})->Unit(benchmark::kMillisecond)->UseRealTime()->MeasureProcessCPUTime();
BENCHMARK(whole_skin)->Apply(three_sizes);
BENCHMARK(build_on_ground)->Apply(sizes);
BENCHMARK(mesh)->Apply(sizes);
BENCHMARK(mesh_and_displace)->Apply(sizes);
BENCHMARK(vdb)->Apply(sizes);

}  // namespace
}  // namespace effuse::skin
