// The skin beside OpenVDB's own way to it, in one run, at a voxel of half a particle's radius: processor time, and how far each mesh is
// from the body that the particles fill. Times of a shared machine mean little, ratios within a line do; --benchmark_repetitions=3 gives medians.
//
//   open_vdb_s, times          OpenVDB's processor time, and that over ours
//   volume, mean, most         our mesh: |volume / true - 1|, mean and largest distance from the body's faces, both ways [spacings]
//   vdb_volume, ...            OpenVDB's mesh
//
// The label is a hash of our result, so that a gain which changed it shows.

#include <benchmark/benchmark.h>
#include <openvdb/openvdb.h>
#include <openvdb/points/PointConversion.h>
#include <openvdb/points/PointRasterizeSDF.h>
#include <openvdb/tools/LevelSetFilter.h>
#include <openvdb/tools/VolumeToMesh.h>

#include "geometry/mesh/measure.h"
#include "geometry/query/mesh_tree.h"
#include "skin/surface/iso_mesh.h"
#include "skin/surface/rasterize.h"
#include "tests/skin/bench_lava.h"

namespace effuse::skin {
namespace {

using bench::kVoxel;
using bench::Lava;
using geometry::TriMesh;

/// Distance of a point from a box's faces.
Real distance(const Box3& box, const Vec3& p) {
  const Vec3 beyond = (box.min() - p).cwiseMax(p - box.max());
  return beyond.maxCoeff() > 0 ? beyond.cwiseMax(0).norm() : -beyond.maxCoeff();
}

struct Error {
  Real volume = 0, mean = 0, most = 0;
};

Error error_of(const TriMesh& mesh, const Box3& box) {
  Error e;
  e.volume = std::abs(std::abs(geometry::signed_volume(mesh)) / box.volume() - 1);
  // From the mesh, by area.
  Real area = 0, sum = 0;
  for (const auto& [a, b, c] : mesh.triangles) {
    const Vec3 &p = mesh.positions[a], &q = mesh.positions[b], &r = mesh.positions[c];
    const Real weight = (q - p).cross(r - p).norm() / 2, d = distance(box, (p + q + r) / 3);
    area += weight;
    sum += weight * d;
    e.most = std::max({e.most, d, distance(box, p), distance(box, q), distance(box, r)});
  }
  // To the mesh, from points of the faces.
  constexpr std::uint64_t kSamples = 20'000;
  const geometry::MeshTree tree(mesh.positions, mesh.triangles);
  const Vec3 size = box.sizes(), side(size.y() * size.z(), size.z() * size.x(), size.x() * size.y());
  Real to_mesh = 0;
  for (std::uint64_t i = 0; i < kSamples; ++i) {
    Real which = side.sum() * random_uniform(3, 0, i);
    int axis = 0;
    while (axis < 2 && which >= side[axis]) which -= side[axis++];
    Vec3 p = box.min() + Vec3(random_uniform(3, 1, i), random_uniform(3, 2, i), random_uniform(3, 3, i)).cwiseProduct(size);
    p[axis] = random_uniform(3, 4, i) < 0.5 ? box.min()[axis] : box.max()[axis];
    const Real d = tree.nearest(p)->distance;
    to_mesh += d / kSamples;
    e.most = std::max(e.most, d);
  }
  // And from its edges, where the greatest lie: too few of the points above are near one.
  for (int axis = 0; axis < 3; ++axis)
    for (int edge = 0; edge < 4; ++edge)
      for (Real along = 0; along <= size[axis]; along += 0.1) {
        Vec3 p;
        p[axis] = box.min()[axis] + along;
        p[(axis + 1) % 3] = edge % 2 ? box.max()[(axis + 1) % 3] : box.min()[(axis + 1) % 3];
        p[(axis + 2) % 3] = edge / 2 ? box.max()[(axis + 2) % 3] : box.min()[(axis + 2) % 3];
        e.most = std::max(e.most, tree.nearest(p)->distance);
      }
  e.mean = std::max(sum / area, to_mesh);
  return e;
}

openvdb::FloatGrid::Ptr smooth_spheres(const Lava& lava) {
  std::vector<openvdb::Vec3R> positions;
  for (const Vec3& p : lava.x) positions.emplace_back(p.x(), p.y(), p.z());
  const auto transform = openvdb::math::Transform::createLinearTransform(kVoxel);
  const openvdb::points::PointAttributeVector<openvdb::Vec3R> wrapper(positions);
  const auto index = openvdb::tools::createPointIndexGrid<openvdb::tools::PointIndexGrid>(wrapper, *transform);
  const auto grid =
      openvdb::points::createPointDataGrid<openvdb::points::NullCodec, openvdb::points::PointDataGrid>(*index, wrapper, *transform);
  const LevelSetOptions ours;
  return openvdb::points::rasterizeSmoothSpheres(*grid, ours.radius, ours.influence);
}

struct VdbMesh {
  std::vector<openvdb::Vec3s> points;
  std::vector<openvdb::Vec3I> triangles;
  std::vector<openvdb::Vec4I> quads;
};
VdbMesh vdb_mesh(const openvdb::FloatGrid& grid) {
  VdbMesh mesh;
  openvdb::tools::volumeToMesh(grid, mesh.points, mesh.triangles, mesh.quads, 0.0, 0.0);
  return mesh;
}
TriMesh ours(const VdbMesh& from) {
  TriMesh mesh;
  for (const openvdb::Vec3s& p : from.points)
    mesh.positions.emplace_back(static_cast<Real>(p.x()), static_cast<Real>(p.y()), static_cast<Real>(p.z()));
  for (const openvdb::Vec3I& t : from.triangles) mesh.triangles.push_back({t[0], t[1], t[2]});
  for (const openvdb::Vec4I& q : from.quads) {
    mesh.triangles.push_back({q[0], q[1], q[2]});
    mesh.triangles.push_back({q[0], q[2], q[3]});
  }
  return mesh;
}

void tell(benchmark::State& state, const Lava& lava, std::uint64_t hash, double seconds, double vdb_seconds, const TriMesh& mesh, const TriMesh& vdb) {
  state.SetLabel(std::to_string(hash));
  state.counters["particles/s"] = static_cast<double>(lava.x.size()) / seconds;
  state.counters["open_vdb_s"] = vdb_seconds;
  state.counters["times"] = vdb_seconds / seconds;
  const Error e = error_of(mesh, lava.box), v = error_of(vdb, lava.box);
  state.counters["volume"] = e.volume;
  state.counters["mean"] = e.mean;
  state.counters["most"] = e.most;
  state.counters["vdb_volume"] = v.volume;
  state.counters["vdb_mean"] = v.mean;
  state.counters["vdb_most"] = v.most;
}

/// Particles to a field, nothing smoothed or shifted.
void field(benchmark::State& state) {
  const Lava lava(static_cast<std::size_t>(state.range(0)), static_cast<int>(state.range(1)));
  openvdb::initialize();
  openvdb::FloatGrid::Ptr grid;
  const double vdb_seconds = bench::seconds_of([&] { grid = smooth_spheres(lava); });
  StateHash hash;
  TriMesh mesh;
  double seconds = 0;
  for (auto _ : state) {
    ParticleGrid particles;
    Blocks blocks;
    Field phi, weight;
    const RasterOptions options{.reach = 8, .spacing = 4, .outside = 5.6f};
    seconds = bench::seconds_of([&] {
      particles = ParticleGrid(lava.points, kVoxel, 4);
      blocks = blocks_around(particles, 8);
      rasterize(particles, blocks, options, phi, weight);
    });
    state.SetIterationTime(seconds);
    hash = {};
    hash.add(std::span<const float>(phi));
    mesh = iso_mesh(blocks, options.outside, phi);
    for (Vec3& p : mesh.positions) p = particles.origin() + kVoxel * p;
  }
  tell(state, lava, hash.value(), seconds, vdb_seconds, mesh, ours(vdb_mesh(*grid)));
}

/// Level set, smoothing, volume, mesh, normals; no ground, as OpenVDB's route has none. gaussian: the filter that most use, else the
/// cheapest, mean curvature.
void skin_beside(benchmark::State& state, bool gaussian, SurfaceKernel kernel) {
  Lava lava(static_cast<std::size_t>(state.range(0)), static_cast<int>(state.range(1)));
  lava.bare();
  openvdb::initialize();
  VdbMesh vdb;
  const double vdb_seconds = bench::seconds_of([&] {
    const auto grid = smooth_spheres(lava);
    openvdb::tools::LevelSetFilter<openvdb::FloatGrid> filter(*grid);
    if (gaussian) filter.gaussian(1);
    else filter.meanCurvature();
    vdb = vdb_mesh(*grid);
  });
  LevelSetOptions options = bench::metre(kVoxel);
  options.kernel = kernel;
  if (kernel == SurfaceKernel::kAnisotropic) options.smoothing = 0;
  TriMesh mesh;
  double seconds = 0;
  for (auto _ : state) {
    seconds = bench::seconds_of([&] { mesh = mesh_level_set(build_level_set(lava.points, lava.volume(), nullptr, options)); });
    state.SetIterationTime(seconds);
  }
  tell(state, lava, bench::hash_of(mesh), seconds, vdb_seconds, mesh, ours(vdb));
}
void whole_skin(benchmark::State& state) { skin_beside(state, false, SurfaceKernel::kRound); }
void whole_skin_beside_gaussian(benchmark::State& state) { skin_beside(state, true, SurfaceKernel::kRound); }
void whole_skin_anisotropic(benchmark::State& state) { skin_beside(state, false, SurfaceKernel::kAnisotropic); }

// Particles, layers (0: a cube). Once: OpenVDB's route takes seconds to a minute, and is timed as often as ours.
void one(benchmark::internal::Benchmark* b) { b->Args({100000, 0})->Unit(benchmark::kMillisecond)->UseManualTime()->Iterations(1); }
void two(benchmark::internal::Benchmark* b) {
  for (const int layers : {0, 3}) b->Args({100000, layers});
  b->Unit(benchmark::kMillisecond)->UseManualTime()->Iterations(1);
}
void six(benchmark::internal::Benchmark* b) {
  for (const int n : {20000, 100000, 500000})
    for (const int layers : {0, 3}) b->Args({n, layers});
  b->Unit(benchmark::kMillisecond)->UseManualTime()->Iterations(1);
}
BENCHMARK(field)->Apply(six);
BENCHMARK(whole_skin)->Apply(six);
BENCHMARK(whole_skin_beside_gaussian)->Apply(one);
BENCHMARK(whole_skin_anisotropic)->Apply(two);

}  // namespace
}  // namespace effuse::skin
