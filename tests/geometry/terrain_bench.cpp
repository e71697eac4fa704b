#include <benchmark/benchmark.h>

#include <algorithm>
#include <cmath>
#include <vector>

#include "geometry/base/hash.h"
#include "geometry/base/parallel.h"
#include "geometry/base/random.h"
#include "geometry/terrain/terrain.h"
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

void run(benchmark::State& state, const Terrain& terrain, Real layer, Real reach, std::size_t n) {
  const ThreadLimit one(1);
  const std::vector<Vec3> points = points_over(fields::maunga_whau(), layer, n);
  std::vector<Contact> contacts(n);
  for (auto _ : state) {
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

void mesh_contacts(benchmark::State& state) {
  run(state, Terrain::from_mesh(fields::maunga_whau().mesh()), static_cast<Real>(state.range(0)), static_cast<Real>(state.range(1)) / 100, 10000);
}
BENCHMARK(mesh_contacts)->Args({3, 100})->Args({3, 1000000})->Unit(benchmark::kMillisecond);

}  // namespace
}  // namespace effuse::geometry
