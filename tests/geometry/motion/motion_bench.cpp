#include <benchmark/benchmark.h>

#include <cmath>

#include "geometry/base/hash.h"
#include "geometry/motion/skeleton_clip.h"
#include "geometry/motion/walk.h"
#include "tests/geometry/motion/sample_walk.h"

/// What a figure costs before the first frame: poses of a clip, the best place to leave one clip for another, a walk of twelve seconds over
/// waves of ground. The label is a hash of what came out.
namespace effuse::geometry {
namespace {

void add(StateHash& hash, const std::vector<RigidPose>& poses) {
  for (const RigidPose& p : poses) hash.add(std::span<const Vec3>(&p.position, 1));
}

void ForwardKinematics(benchmark::State& state) {
  const SkeletonClip clip = sample_walk();
  StateHash hash;
  add(hash, forward_kinematics(clip.joints, clip.at(1.234)));
  Real t = 0;
  for (auto _ : state) {
    benchmark::DoNotOptimize(forward_kinematics(clip.joints, clip.at(t)));
    t = t > 3 ? 0 : t + 0.01;
  }
  state.counters["per_joint"] = benchmark::Counter(static_cast<double>(clip.joints.size()), benchmark::Counter::kIsIterationInvariantRate | benchmark::Counter::kInvert);
  state.SetLabel(hash.hex());
}
BENCHMARK(ForwardKinematics);

void BestTransition(benchmark::State& state) {
  const SkeletonClip a = sample_walk(1.3, 1.1, 3.3), b = sample_walk(1.6, 0.9, 3.3);
  Transition best;
  for (auto _ : state) best = best_transition(a, b, 0.2);
  StateHash hash;
  hash.add(best.from);
  hash.add(best.to);
  hash.add(best.distance);
  state.counters["pairs"] = static_cast<double>(a.frames.size() * b.frames.size());
  state.SetLabel(hash.hex());
}
BENCHMARK(BestTransition)->Unit(benchmark::kMillisecond);

void WalkAlong(benchmark::State& state) {
  const SkeletonClip clip = repeated(sample_walk(), 14);
  WalkOptions o;
  o.path = {Vec2(0, 0), Vec2(5, 1), Vec2(10, -1), Vec2(16, 0)};
  o.duration = 12;
  Walk walk;
  for (auto _ : state) walk = walk_along(clip, [](const Vec2& p) { return 0.2 * std::sin(p.x()) + 0.1 * std::cos(2 * p.y()); }, o);
  StateHash hash;
  for (const auto& poses : walk.poses) add(hash, poses);
  state.counters["samples"] = static_cast<double>(walk.poses.size());
  state.counters["slide_mm"] = 1e3 * walk.slide;
  state.SetLabel(hash.hex());
}
BENCHMARK(WalkAlong)->Unit(benchmark::kMillisecond);

}  // namespace
}  // namespace effuse::geometry
