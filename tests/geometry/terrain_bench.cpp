#include <benchmark/benchmark.h>

#include <algorithm>
#include <cmath>
#include <vector>

#include "geometry/base/hash.h"
#include "geometry/base/parallel.h"
#include "geometry/base/random.h"
#include "geometry/query/near_triangles.h"
#include "geometry/terrain/terrain.h"
#include "geometry/terrain/triangulate.h"
#include "tests/geometry/terrain/fields.h"

/// Contacts per second on Maunga Whau, one thread. Points lie cell by cell, as sorted particles do, at heights from
/// -0.5 m to `layer` m over the ground. The label is a hash of all contacts: a gain that changed the answer shows.
namespace effuse::geometry {
namespace {

std::vector<Vec3> points_over(const HeightField& field, Real layer, std::size_t n) {
  std::vector<Vec3> points(n);
  for (std::size_t k = 0; k < n; ++k) {
    const Real x = 600 * random_uniform(1, 0, k), y = 860 * random_uniform(1, 1, k);
    points[k] = {x, y, field.height(x, y) - 0.5 + (layer + 0.5) * random_uniform(1, 2, k)};
  }
  std::sort(points.begin(), points.end(), [](const Vec3& a, const Vec3& b) {
    const auto cell = [](const Vec3& p) { return std::pair(std::floor(p.y() / 10), std::floor(p.x() / 10)); };
    return cell(a) < cell(b);
  });
  return points;
}

void run(benchmark::State& state, const Terrain& terrain, Real layer, Real reach, std::size_t n, bool one_by_one = false) {
  const ThreadLimit one(1);
  const std::vector<Vec3> points = points_over(fields::maunga_whau(), layer, n);
  std::vector<Contact> contacts(n);
  for (auto _ : state) {
    if (one_by_one)
      for (std::size_t k = 0; k < n; ++k) contacts[k] = terrain.contact(points[k], reach);
    else
      terrain.contacts(points, reach, contacts);
    benchmark::ClobberMemory();
  }
  StateHash hash;
  std::size_t near = 0;
  for (const Contact& contact : contacts) {
    hash.add(contact.distance);
    hash.add(std::span<const Vec3>(&contact.point, 1));
    hash.add(std::span<const Vec3>(&contact.normal, 1));
    near += contact.any();
  }
  state.SetItemsProcessed(static_cast<std::int64_t>(state.iterations() * n));
  state.SetLabel(hash.hex());
  state.counters["near"] = static_cast<double>(near) / static_cast<double>(n);
}

/// Arguments: layer [m], reach [cm].
void height_field_contacts(benchmark::State& state) {
  run(state, Terrain::from_height_field(fields::maunga_whau()), static_cast<Real>(state.range(0)), static_cast<Real>(state.range(1)) / 100, 100000);
}
BENCHMARK(height_field_contacts)->Args({1, 100})->Args({3, 100})->Args({10, 100})->Args({3, 25})->Args({3, 1000000})->Unit(benchmark::kMillisecond);

/// By the mesh's cache, which many points make, and by its tree, point by point. The hash is the same: so are the contacts.
void mesh_contacts(benchmark::State& state) {
  run(state, Terrain::from_mesh(fields::maunga_whau().mesh()), static_cast<Real>(state.range(0)), static_cast<Real>(state.range(1)) / 100, 100000);
}
BENCHMARK(mesh_contacts)->Args({1, 100})->Args({3, 100})->Args({10, 100})->Args({3, 1000000})->Unit(benchmark::kMillisecond);

void mesh_contacts_by_tree(benchmark::State& state) {
  run(state, Terrain::from_mesh(fields::maunga_whau().mesh()), static_cast<Real>(state.range(0)), static_cast<Real>(state.range(1)) / 100, 100000, true);
}
BENCHMARK(mesh_contacts_by_tree)->Args({1, 100})->Args({3, 100})->Args({10, 100})->Unit(benchmark::kMillisecond);

/// Making the cache, for a reach in centimetres; the label says its size.
void mesh_cache(benchmark::State& state) {
  const ThreadLimit one(1);
  const TriMesh mesh = fields::maunga_whau().mesh();
  std::size_t bytes = 0;
  for (auto _ : state) bytes = NearTriangles::build(mesh.positions, mesh.triangles, static_cast<Real>(state.range(0)) / 100)->bytes();
  state.SetLabel(std::to_string(bytes / mesh.triangles.size()) + " bytes a triangle");
  state.SetItemsProcessed(static_cast<std::int64_t>(state.iterations() * mesh.triangles.size()));
}
BENCHMARK(mesh_cache)->Arg(25)->Arg(100)->Arg(400)->Unit(benchmark::kMillisecond);

/// Greedy insertion on a million posts of hills of many sizes, to an error in centimetres. The label: triangles, the error
/// measured, and a hash of the mesh.
void triangulation(benchmark::State& state) {
  const int n = static_cast<int>(state.range(0));
  std::vector<Real> z(static_cast<std::size_t>(n) * static_cast<std::size_t>(n));
  for (int j = 0; j < n; ++j)
    for (int i = 0; i < n; ++i) {
      Real h = 0.2 * random_uniform(1, 0, static_cast<std::uint64_t>(j) * static_cast<std::uint64_t>(n) + static_cast<std::uint64_t>(i));
      for (int octave = 0; octave < 9; ++octave) {
        const Real f = 0.006 * std::pow(1.9, octave);
        h += 150 * std::pow(0.45, octave) * std::sin(f * i + 1.3 * octave) * std::cos(0.83 * f * j + 0.7 * octave * octave);
      }
      z[static_cast<std::size_t>(j) * static_cast<std::size_t>(n) + static_cast<std::size_t>(i)] = h;
    }
  const HeightField field({0, 0}, {10, 10}, n, n, std::move(z));
  const Real error = static_cast<Real>(state.range(1)) / 100;
  TriMesh mesh;
  for (auto _ : state) mesh = triangulate(field, error);
  StateHash hash;
  hash.add(std::span<const Vec3>(mesh.positions));
  state.SetLabel(std::to_string(mesh.triangles.size()) + " triangles, " + std::to_string(vertical_error(field, mesh).at_posts) + " m off, " + hash.hex());
  state.counters["posts/s"] = benchmark::Counter(static_cast<double>(n) * n, benchmark::Counter::kIsIterationInvariantRate);
}
BENCHMARK(triangulation)->Args({100, 100})->Args({1000, 500})->Args({1000, 100})->Args({1000, 20})->Unit(benchmark::kMillisecond);

}  // namespace
}  // namespace effuse::geometry
