#include <benchmark/benchmark.h>

#include <algorithm>
#include <cmath>
#include <map>
#include <vector>

#include "geometry/base/hash.h"
#include "geometry/base/parallel.h"
#include "geometry/base/random.h"
#include "geometry/collide/obstacles.h"
#include "geometry/collide/slide.h"
#include "geometry/procedural/primitives.h"

/// Contacts and steps of particles among obstacles, one thread. Points lie cell by cell, as sorted particles do, within a
/// band of 0.1 m on both sides of the surfaces. The label is a hash of the answers: a gain that changed them shows.
namespace effuse::geometry {
namespace {

constexpr Real kBand = 0.1, kReach = 0.1;

/// A torus of radii 3 m and 1 m of about so many triangles.
const CollisionMesh& torus(std::int64_t triangles) {
  static std::map<std::int64_t, CollisionMesh> made;
  const auto found = made.find(triangles);
  if (found != made.end()) return found->second;
  const int across = static_cast<int>(std::sqrt(static_cast<double>(triangles) / 4));
  return made.emplace(triangles, CollisionMesh(make_torus({0, 0, 0}, 3, 1, 2 * across, across))).first->second;
}

/// Points about copies of the torus that stand in a square, 10 m apart.
std::vector<Vec3> points_about(std::int64_t obstacles, std::size_t n) {
  const auto side = static_cast<std::int64_t>(std::ceil(std::sqrt(static_cast<double>(obstacles))));
  std::vector<Vec3> points(n);
  for (std::size_t k = 0; k < n; ++k) {
    const auto which = static_cast<std::int64_t>(random_bits(1, 0, k) % static_cast<std::uint64_t>(obstacles));
    const Real a = 2 * kPi * random_uniform(1, 1, k), b = 2 * kPi * random_uniform(1, 2, k), r = 1 + kBand * (2 * random_uniform(1, 3, k) - 1);
    points[k] = Vec3(10.0 * static_cast<Real>(which % side), 10.0 * static_cast<Real>(which / side), 0) +
                Vec3((3 + r * std::cos(b)) * std::cos(a), (3 + r * std::cos(b)) * std::sin(a), r * std::sin(b));
  }
  std::sort(points.begin(), points.end(), [](const Vec3& p, const Vec3& q) {
    const auto cell = [](const Vec3& x) { return std::array{std::floor(x.y() / 0.2), std::floor(x.x() / 0.2), std::floor(x.z() / 0.2)}; };
    return cell(p) < cell(q);
  });
  return points;
}

Obstacles square(std::int64_t triangles, std::int64_t obstacles, const Vec3& shift, bool moving) {
  const auto side = static_cast<std::int64_t>(std::ceil(std::sqrt(static_cast<double>(obstacles))));
  Obstacles all;
  for (std::int64_t k = 0; k < obstacles; ++k) {
    RigidPose from, to;
    from.position = to.position = shift + Vec3(10.0 * static_cast<Real>(k % side), 10.0 * static_cast<Real>(k / side), 0);
    if (moving) from.orientation = Quat(Eigen::AngleAxisd(0.01, Vec3::UnitZ()));
    all.add({torus(triangles), RigidMotion(from, to, moving ? 0.01 : 0), 0, static_cast<Index>(k + 1)});
  }
  all.update();
  return all;
}

std::string hash_of(std::span<const Contact> contacts) {
  StateHash hash;
  for (const Contact& contact : contacts) {
    hash.add(contact.distance);
    hash.add(std::span<const Vec3>(&contact.point, 1));
    hash.add(std::span<const Vec3>(&contact.normal, 1));
  }
  return hash.hex();
}

/// Arguments: triangles an obstacle, obstacles.
void obstacle_contacts(benchmark::State& state) {
  const ThreadLimit one(1);
  const std::vector<Vec3> points = points_about(state.range(1), 100000);
  const Obstacles obstacles = square(state.range(0), state.range(1), Vec3::Zero(), false);
  std::vector<Contact> contacts(points.size());
  for (auto _ : state) {
    obstacles.contacts(points, kReach, 1, contacts);
    benchmark::ClobberMemory();
  }
  state.SetItemsProcessed(static_cast<std::int64_t>(state.iterations() * points.size()));
  state.SetLabel(hash_of(contacts));
}
BENCHMARK(obstacle_contacts)->Args({1000, 1})->Args({10000, 1})->Args({100000, 1})->Args({1000000, 1})->Args({1000, 100})->Args({1000, 10000})
    ->Args({100000, 100})->Args({100000, 10000})->Unit(benchmark::kMillisecond);

/// Up to four a point, of one room seen from within beside its corners: what surroundings() costs over contacts(), that finds its nearest
/// face alone. Argument: 0 contacts, 1 surroundings.
void corner_contacts(benchmark::State& state) {
  const ThreadLimit one(1);
  TriMesh m = make_box(Vec3::Zero(), Vec3(8, 8, 8));
  std::erase_if(m.triangles, [&](const Triangle& t) { return std::all_of(t.begin(), t.end(), [&](Index v) { return m.positions[v].z() > 0; }); });
  Obstacles obstacles;
  obstacles.add({CollisionMesh(m), {}, 0, 1});
  obstacles.update();
  std::vector<Vec3> points(100000);
  for (std::size_t k = 0; k < points.size(); ++k) points[k] = 2 * Vec3(random_uniform(2, 0, k), random_uniform(2, 1, k), random_uniform(2, 2, k));
  std::vector<Contact> contacts(4 * points.size());
  for (auto _ : state) {
    if (state.range(0) == 0) obstacles.contacts(points, 1, 4, contacts);
    else obstacles.surroundings(points, 1, 4, contacts);
    benchmark::ClobberMemory();
  }
  state.SetItemsProcessed(static_cast<std::int64_t>(state.iterations() * points.size()));
  state.SetLabel(hash_of(contacts));
}
BENCHMARK(corner_contacts)->ArgName("surroundings")->Arg(0)->Arg(1)->Unit(benchmark::kMillisecond);

/// What surroundings() costs over contacts() on the torus, where each point has one. Argument: triangles.
void obstacle_surroundings(benchmark::State& state) {
  const ThreadLimit one(1);
  const std::vector<Vec3> points = points_about(1, 100000);
  const Obstacles obstacles = square(state.range(0), 1, Vec3::Zero(), false);
  std::vector<Contact> contacts(points.size());
  for (auto _ : state) {
    obstacles.surroundings(points, kReach, 1, contacts);
    benchmark::ClobberMemory();
  }
  state.SetItemsProcessed(static_cast<std::int64_t>(state.iterations() * points.size()));
  state.SetLabel(hash_of(contacts));
}
BENCHMARK(obstacle_surroundings)->Arg(1000)->Arg(100000)->Unit(benchmark::kMillisecond);

/// The same points, with all obstacles a kilometre away: what a scene pays for them.
void far_obstacle_contacts(benchmark::State& state) {
  const ThreadLimit one(1);
  const std::vector<Vec3> points = points_about(1, 100000);
  const Obstacles obstacles = square(1000, state.range(0), Vec3(1000, 0, 0), true);
  std::vector<Contact> contacts(points.size());
  for (auto _ : state) {
    obstacles.contacts(points, kReach, 1, contacts);
    benchmark::ClobberMemory();
  }
  state.SetItemsProcessed(static_cast<std::int64_t>(state.iterations() * points.size()));
}
BENCHMARK(far_obstacle_contacts)->Arg(1)->Arg(100)->Arg(10000)->Unit(benchmark::kMillisecond);

/// Points in the gaps between obstacles that stand all around, none within reach.
void between_obstacles(benchmark::State& state) {
  const ThreadLimit one(1);
  std::vector<Vec3> points = points_about(100, 100000);
  for (Vec3& x : points) x += Vec3(5, 5, 0) - 0.9 * (x - Vec3(10 * std::round(x.x() / 10), 10 * std::round(x.y() / 10), 0));
  const Obstacles obstacles = square(1000, 100, Vec3::Zero(), false);
  std::vector<Contact> contacts(points.size());
  for (auto _ : state) {
    obstacles.contacts(points, kReach, 1, contacts);
    benchmark::ClobberMemory();
  }
  state.SetItemsProcessed(static_cast<std::int64_t>(state.iterations() * points.size()));
}
BENCHMARK(between_obstacles)->Unit(benchmark::kMillisecond);

/// Steps of particles of 0.02 m that go 0.05 m: triangles, obstacles, whether they turn.
void obstacle_slide(benchmark::State& state) {
  const ThreadLimit one(1);
  std::vector<Vec3> start = points_about(state.range(1), 20000), v(start.size()), dx(start.size());
  const Obstacles obstacles = square(state.range(0), state.range(1), Vec3::Zero(), state.range(2) != 0);
  std::erase_if(start, [&](const Vec3& x) {
    Contact contact;
    return obstacles.contacts(x, 1, std::span(&contact, 1)) > 0 && contact.distance < 0;
  });
  dx.resize(start.size());
  v.resize(start.size());
  for (std::size_t k = 0; k < start.size(); ++k) dx[k] = 0.05 * Vec3(random_normal(2, 0, k), random_normal(2, 1, k), random_normal(2, 2, k)).normalized();
  const std::vector<Real> r{0.02};
  std::vector<Vec3> x;
  SlideReport report;
  for (auto _ : state) {
    x = start;
    v = dx;
    report = slide_all(obstacles, x, dx, v, r);
    benchmark::ClobberMemory();
  }
  StateHash hash;
  hash.add(std::span<const Vec3>(x));
  state.SetItemsProcessed(static_cast<std::int64_t>(state.iterations() * start.size()));
  state.SetLabel(hash.hex());
  state.counters["met"] = static_cast<double>(report.met) / static_cast<double>(start.size());
}
BENCHMARK(obstacle_slide)->Args({1000, 100, 0})->Args({1000, 100, 1})->Args({100000, 1, 0})->Args({100000, 1, 1})->Unit(benchmark::kMillisecond);

/// All obstacles moved: broad phase brought up to date.
void obstacles_moved(benchmark::State& state) {
  Obstacles obstacles = square(1000, state.range(0), Vec3::Zero(), true);
  Real shift = 0;
  for (auto _ : state) {
    shift += 1e-3;
    for (std::size_t k = 0; k < obstacles.size(); ++k) {
      RigidPose to = obstacles[k].motion.to();
      const RigidPose from = to;
      to.position.x() += shift;
      obstacles.move(k, RigidMotion(from, to, 0.01));
    }
    obstacles.update();
  }
  state.SetItemsProcessed(static_cast<std::int64_t>(state.iterations() * static_cast<std::size_t>(state.range(0))));
}
BENCHMARK(obstacles_moved)->Arg(1)->Arg(100)->Arg(10000)->Unit(benchmark::kMicrosecond);

}  // namespace
}  // namespace effuse::geometry
