#include <benchmark/benchmark.h>

#include <cmath>

#include "flow/sph/column_grid.h"
#include "flow/sph/modern_lava.h"
#include "flow/sph/pair_kernels.h"
#include "flow/sph/pressure.h"
#include "flow/sph/viscosity.h"
#include "geometry/base/hash.h"
#include "geometry/base/parallel.h"
#include "geometry/base/random.h"

/// A viscous block of 46^3 particles that has begun to collapse on a plane: neighbour lists, each product over pairs on each
/// instruction set, the two solves by iterations, whole steps; at 20 and 30 tenths of a spacing of support, about 29
/// and 110 neighbours. MIPPS: million particle-iterations a second. Each line carries a hash of what it computed.
namespace effuse::flow::sph {
namespace {

constexpr int kSide = 46;
constexpr Real kSpacing = 1;

struct Block {
  std::vector<Vec3> x, v;
  std::vector<Real> q, mu;
  ColumnGrid grid;
  Neighbors neighbors;
  Walls walls;
  BoundaryTable boundary;
  ParticleSystem system;

  explicit Block(std::int64_t tenths) : boundary(WendlandC2(support_of(tenths)), kSpacing) {
    const Real support = support_of(tenths);
    for (int k = 0; k < kSide; ++k)
      for (int j = 0; j < kSide; ++j)
        for (int i = 0; i < kSide; ++i) {
          const std::uint64_t id = x.size();
          const auto random = [&](std::uint64_t stream) { return random_uniform(1, stream, id) - 0.5; };
          const Vec3 at(i + 0.2 * random(0), j + 0.2 * random(1), k + 0.5 + 0.2 * random(2));
          x.push_back(kSpacing * Vec3(at.x() + 0.05 * at.z(), at.y(), at.z() + 0.01 * at.x()));
        }
    // In the order in which the solver keeps them.
    grid.build(x, support);
    x.assign(grid.sorted_positions().begin(), grid.sorted_positions().end());
    grid.build(x, support);
    neighbors.find(grid, support);
    walls.first.push_back(0);
    for (std::uint64_t i = 0; i < x.size(); ++i) {
      v.push_back(0.1 * x[i].z() * Vec3(1 + random_normal(2, 0, i), random_normal(2, 1, i), -1 + random_normal(2, 2, i)));
      q.push_back(kGravity * (kSide * kSpacing - x[i].z()));
      mu.push_back(1000 * std::exp(2 * random_uniform(2, 3, i)));
      if (x[i].z() < support) walls.walls.push_back({.distance = x[i].z(), .reach = x[i].z()});
      walls.first.push_back(static_cast<Index>(walls.walls.size()));
    }
    system.x = x;
    system.neighbors = &neighbors;
    system.walls = &walls;
    system.boundary = &boundary;
    system.support = support;
    system.spacing = kSpacing;
  }
  static Real support_of(std::int64_t tenths) { return 0.1 * static_cast<Real>(tenths) * kSpacing; }
  std::size_t size() const { return x.size(); }
};

template <class T>
std::string hash_of(const std::vector<T>& values) {
  StateHash hash;
  hash.add(std::span<const T>(values));
  return hash.hex();
}

void report(benchmark::State& state, const Block& block, const std::string& hash, int iterations_each = 0) {
  using benchmark::Counter;
  const auto n = static_cast<double>(block.size());
  state.counters["per_particle"] = Counter(n, Counter::kIsIterationInvariantRate | Counter::kInvert);
  state.counters["neighbours"] = static_cast<double>(block.neighbors.pairs()) / n;
  if (iterations_each > 0) {
    state.counters["MIPPS"] = Counter(1e-6 * n * iterations_each, Counter::kIsIterationInvariantRate);
    state.counters["per_iteration"] = Counter(iterations_each, Counter::kIsIterationInvariantRate | Counter::kInvert);
  }
  state.SetLabel(std::to_string(block.size()) + " " + hash);
}

void Lists(benchmark::State& state) {
  const ThreadLimit limit(static_cast<int>(state.range(1)));
  const Block block(state.range(0));
  ColumnGrid grid;
  Neighbors neighbors;
  const auto find = [&] {
    grid.build(block.x, block.system.support);
    neighbors.find(grid, block.system.support);
  };
  find();  // memory is asked for once
  for (auto _ : state) find();
  StateHash hash;
  for (std::size_t i = 0; i < block.size(); ++i) hash.add(neighbors[i]);
  report(state, block, hash.hex());
  state.counters["bytes_per_particle"] = static_cast<double>(grid.memory() + neighbors.memory()) / static_cast<double>(block.size());
}

/// One product over pairs; range(2): Simd.
template <class Product>
void run_product(benchmark::State& state, Product&& product) {
  const ThreadLimit limit(static_cast<int>(state.range(1)));
  const auto simd = static_cast<Simd>(state.range(2));
  if (simd > best_simd()) return state.SkipWithError("not on this processor");
  const Block block(state.range(0));
  PairKernels pairs;
  pairs.build(block.system, simd);
  pairs.set_viscosity(block.mu);
  std::vector<Vec3> out(block.size(), Vec3::Zero());
  std::vector<Real> scalars(block.size());
  for (auto _ : state) parallel_ranges(block.size(), 512, [&](std::size_t begin, std::size_t end) { product(pairs, block, begin, end, out, scalars); });
  report(state, block, hash_of(out) + hash_of(scalars));
}
void PairsViscous(benchmark::State& state) {
  run_product(state, [](const PairKernels& pairs, const Block& b, auto begin, auto end, auto& out, auto&) { pairs.viscous(begin, end, b.v, out); });
}
void PairsDivergence(benchmark::State& state) {
  run_product(state, [](const PairKernels& pairs, const Block& b, auto begin, auto end, auto&, auto& out) { pairs.divergence(begin, end, b.v, out); });
}
void PairsGradient(benchmark::State& state) {
  run_product(state, [](const PairKernels& pairs, const Block& b, auto begin, auto end, auto& out, auto&) { pairs.gradient(begin, end, b.q, out); });
}
void PairsDensity(benchmark::State& state) {
  run_product(state, [](const PairKernels& pairs, const Block&, auto begin, auto end, auto& slope, auto& sum) { pairs.density(begin, end, sum, slope); });
}

constexpr int kIterations = 30;

void ViscositySolve(benchmark::State& state) {
  const ThreadLimit limit(static_cast<int>(state.range(1)));
  const Block block(state.range(0));
  ViscositySolver solver;
  std::vector<Vec3> v;
  for (auto _ : state) {
    state.PauseTiming();
    v.assign(block.size(), Vec3::Zero());
    state.ResumeTiming();
    solver.solve(block.system, 2600, block.mu, 0, 1, block.v, 0, kIterations, v);
  }
  report(state, block, hash_of(v), kIterations);
  state.counters["bytes_per_particle"] = static_cast<double>(solver.memory()) / static_cast<double>(block.size());
}

void PressureSolve(benchmark::State& state) {
  const ThreadLimit limit(static_cast<int>(state.range(1)));
  const Block block(state.range(0));
  PressureSolver solver;
  const std::vector<Real> none(block.size(), 0.0);
  std::vector<Vec3> v;
  std::vector<Real> q;
  int iterations = 0;
  for (auto _ : state) {
    state.PauseTiming();
    v = block.v;
    q = block.q;
    state.ResumeTiming();
    iterations = solver.solve(block.system, none, none, 0.1, 1e-4, kIterations, v, q).iterations;
  }
  report(state, block, hash_of(v) + hash_of(q), iterations);
  state.counters["bytes_per_particle"] = static_cast<double>(solver.memory()) / static_cast<double>(block.size());
}

/// Steps of the whole solver, isothermal, from a block that has just been let go; the third to the tenth.
void ModernStep(benchmark::State& state) {
  const ThreadLimit limit(static_cast<int>(state.range(1)));
  const Block block(state.range(0));
  ModernOptions options;
  options.spacing = kSpacing;
  options.support = 0.1 * static_cast<Real>(state.range(0));
  options.heat.on = false;
  options.ground_speed = 0;
  const ContactSource plane = [](std::span<const Vec3> x, Real reach, std::span<geometry::Contact> out) {
    for (std::size_t i = 0; i < x.size(); ++i)
      out[i] = x[i].z() < reach ? geometry::Contact{Vec3(x[i].x(), x[i].y(), 0), Vec3::UnitZ(), x[i].z(), Vec3::Zero(), 0, 0} : geometry::Contact{};
  };
  ModernLava start(options, {}, {plane});
  start.add(block.x, std::vector<Vec3>(block.size(), Vec3::Zero()), std::vector<Real>(block.size(), 1400));
  for (int k = 0; k < 2; ++k) start.step(0.01);
  StateWriter saved;
  start.save(saved);
  constexpr int kSteps = 8;
  ModernReport last;
  double pressure = 0, viscosity = 0, density = 0;
  std::string hash;
  for (auto _ : state) {
    state.PauseTiming();
    StateReader in(saved.bytes(), "memory");
    start.load(in);
    pressure = viscosity = density = 0;
    state.ResumeTiming();
    for (int k = 0; k < kSteps; ++k) {
      last = start.step(0.01);
      pressure += last.pressure_iterations;
      viscosity += last.viscosity_iterations;
      density += last.density_iterations;
    }
    state.PauseTiming();
    StateHash h;
    start.add_to(h);
    hash = h.hex();
    state.ResumeTiming();
  }
  report(state, block, hash, kSteps);
  state.counters["pressure_its"] = pressure / kSteps;
  state.counters["viscosity_its"] = viscosity / kSteps;
  state.counters["density_its"] = density / kSteps;
  state.counters["bytes_per_particle"] = static_cast<double>(start.memory()) / static_cast<double>(block.size());
}

void each_support(benchmark::internal::Benchmark* b) {
  b->ArgNames({"support", "threads"})->ArgsProduct({{20, 30}, {1, 2}})->Unit(benchmark::kMillisecond)->UseRealTime()->MeasureProcessCPUTime();
}
void each_simd(benchmark::internal::Benchmark* b) {
  b->ArgNames({"support", "threads", "simd"})->ArgsProduct({{20, 30}, {1}, {0, 1, 2}})->Unit(benchmark::kMillisecond)->UseRealTime()->MeasureProcessCPUTime();
}
BENCHMARK(Lists)->Apply(each_support);
BENCHMARK(PairsViscous)->Apply(each_simd);
BENCHMARK(PairsDivergence)->Apply(each_simd);
BENCHMARK(PairsGradient)->Apply(each_simd);
BENCHMARK(PairsDensity)->Apply(each_simd);
BENCHMARK(ViscositySolve)->Apply(each_support);
BENCHMARK(PressureSolve)->Apply(each_support);
BENCHMARK(ModernStep)->Apply(each_support);

}  // namespace
}  // namespace effuse::flow::sph
