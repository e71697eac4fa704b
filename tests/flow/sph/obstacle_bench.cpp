#include <benchmark/benchmark.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <vector>

#include "flow/sph/modern_lava.h"
#include "geometry/base/parallel.h"
#include "geometry/base/zones.h"
#include "geometry/procedural/primitives.h"
#include "tests/flow/sph/lava_times.h"

/// What obstacles cost lava, on one thread, in processor time.
///
/// FarObstacles: steps of a slab of lava with so many obstacles that it does not reach beside the same without any, by turns; the
/// median step without, the median of their differences against it, and the share of the zone sph.solids in a step. They stand in rings around it, so that the box around all of them holds the lava.
/// HouseInLava: a house that stands in lava; share of the step that goes into its walls (sph.solids) and into what they find near.
namespace effuse::flow::sph {
namespace {

using geometry::CollisionMesh;
using geometry::Obstacles;
using geometry::RigidMotion;
using geometry::RigidPose;

constexpr Real kSpacing = 0.5;

ModernOptions options() {
  ModernOptions o;
  o.spacing = kSpacing;
  o.rheology = Rheology::newtonian(2000);
  o.heat.on = false;
  o.ground_speed = 0;
  o.gravity = kGravity * Vec3(0.2, 0, -0.98);
  return o;
}

const ContactSource kPlane = [](std::span<const Vec3> x, Real reach, std::span<geometry::Contact> out) {
  for (std::size_t i = 0; i < x.size(); ++i)
    out[i] = x[i].z() < reach ? geometry::Contact{Vec3(x[i].x(), x[i].y(), 0), Vec3::UnitZ(), x[i].z(), Vec3::Zero(), 0, 0} : geometry::Contact{};
};

/// side x side x 6 particles from (0, 0, 0) on.
void fill(ModernLava& lava, int side, const Obstacles* around = nullptr) {
  std::vector<Vec3> x;
  for (int k = 0; k < 6; ++k)
    for (int j = 0; j < side; ++j)
      for (int i = 0; i < side; ++i) {
        const Vec3 p = kSpacing * Vec3(i + 0.5, j + 0.5, k + 0.5);
        std::array<geometry::Contact, 1> found;
        if (around && around->contacts(p, 0.5 * kSpacing, found) > 0) continue;
        x.push_back(p);
      }
  lava.add(x, std::vector<Vec3>(x.size(), Vec3::Zero()), std::vector<Real>(x.size(), 1400));
}

/// Walls and a roof with eaves: two boxes and a prism, one mesh.
geometry::TriMesh house(const Vec3& low, const Vec3& high) {
  geometry::TriMesh m = geometry::make_box(low, high);
  const Real eaves = 0.6, ridge = high.z() + 2, y = (low.y() + high.y()) / 2;
  geometry::TriMesh roof;
  roof.positions = {{low.x() - eaves, low.y() - eaves, high.z()}, {high.x() + eaves, low.y() - eaves, high.z()}, {high.x() + eaves, high.y() + eaves, high.z()},
                    {low.x() - eaves, high.y() + eaves, high.z()}, {low.x() - eaves, y, ridge}, {high.x() + eaves, y, ridge}};
  roof.triangles = {{0, 2, 1}, {0, 3, 2}, {0, 1, 5}, {0, 5, 4}, {2, 3, 4}, {2, 4, 5}, {0, 4, 3}, {1, 2, 5}};
  geometry::append(m, roof);
  geometry::append(m, geometry::make_box(Vec3(low.x() + 1, y + 1, high.z() - 1), Vec3(low.x() + 2, y + 2, ridge + 1)));
  return m;
}

void FarObstacles(benchmark::State& state) {
  const ThreadLimit limit(1);
  Obstacles obstacles;
  const Vec3 middle(10, 10, 0);
  const CollisionMesh boulder(geometry::make_sphere(Vec3::Zero(), 1, 1));
  for (std::int64_t k = 0; k < state.range(0); ++k) {
    const Real angle = 2.4 * static_cast<Real>(k), far = 50 + 2 * std::sqrt(static_cast<Real>(k));
    obstacles.add({boulder, RigidMotion(RigidPose{Vec3(middle + far * Vec3(std::cos(angle), std::sin(angle), 0)), Quat::Identity()}), 0, 1});
  }
  obstacles.update();
  ModernLava without(options(), {}, {kPlane}), with(options(), {}, {kPlane}, {}, {&obstacles, {}, {}});
  fill(without, 40);
  fill(with, 40);
  for (int k = 0; k < 4; ++k) without.step(0.02), with.step(0.02);
  std::vector<double> plain, extra;
  Profile profile;
  const ProfileScope scope(profile);
  const auto timed = [](ModernLava& lava) {
    const double before = thread_seconds();
    lava.step(0.02);
    return thread_seconds() - before;
  };
  bool turn = false;
  for (auto _ : state) {
    // By turns, and who is first by turns: what else the machine does meets both.
    turn = !turn;
    const double first = timed(turn ? without : with), second = timed(turn ? with : without);
    plain.push_back(turn ? first : second);
    extra.push_back(turn ? second - first : first - second);
    state.SetIterationTime(plain.back() + extra.back());
  }
  // Both lavas step under one profile; only one has obstacles.
  double step = 0, solids = 0;
  for (const ZoneRow& row : profile.zones()) {
    if (row.name == "sph.step") step = row.total_s;
    if (row.name == "sph.solids") solids = row.total_s;
  }
  state.counters["solids_percent"] = 100 * solids / (step / 2);
  state.counters["step_ms"] = 1e3 * median(plain);
  state.counters["extra_percent"] = 100 * median(extra) / median(plain);
  state.SetLabel(std::to_string(with.size()) + " " + hex_of(with) + (hex_of(with) == hex_of(without) ? " same" : " differs"));
}
BENCHMARK(FarObstacles)->ArgName("obstacles")->Arg(0)->Arg(1)->Arg(100)->Arg(10000)->UseManualTime()->Unit(benchmark::kMillisecond);

void HouseInLava(benchmark::State& state) {
  const ThreadLimit limit(1);
  Obstacles obstacles;
  obstacles.add({CollisionMesh(house(Vec3(7, 6, -1), Vec3(13, 14, 2.5))), {}, 300, 1});
  obstacles.update();
  ModernLava lava(options(), {}, {kPlane}, {}, {&obstacles, {}, {}});
  fill(lava, 40, &obstacles);
  for (int k = 0; k < 4; ++k) lava.step(0.02);
  Profile profile;
  const ProfileScope scope(profile);
  for (auto _ : state) lava.step(0.02);
  double step = 0, solids = 0, edges = 0;
  for (const ZoneRow& row : profile.zones()) {
    if (row.name == "sph.step") step = row.total_s;
    if (row.name == "sph.solids") solids = row.total_s;
    if (row.name == "sph.solids.edges") edges = row.total_s;
  }
  state.counters["solids_percent"] = 100 * solids / step;
  state.counters["edges_percent"] = 100 * edges / step;
  state.SetLabel(std::to_string(lava.size()) + " " + hex_of(lava));
}
BENCHMARK(HouseInLava)->Unit(benchmark::kMillisecond);

}  // namespace
}  // namespace effuse::flow::sph
