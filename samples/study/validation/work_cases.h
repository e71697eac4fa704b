#pragma once

#include <cstddef>
#include <functional>
#include <memory>
#include <span>
#include <vector>

#include "flow/sph/classic_lava.h"
#include "geometry/base/types.h"
#include "samples/study/cost/frontier.h"

/// The classic solver where flows are periodic.
namespace effuse::study {

/// Classic lava on level ground at height 0, periodic in x or y or both, which the solver itself knows nothing of: each particle has images one
/// period away to all sides, and after each step they are what their original is. The images at the outer border go wrong within a step,
/// as far as two supports, one for the kick and one for the density; so a period of two supports makes what the originals do exact, with a
/// scheme of one evaluation a step.
class PeriodicClassic {
 public:
  /// Particles at rest at x, within [0, period) where that is not 0 (0: not periodic). Checked: periods of at least two supports, the scheme.
  PeriodicClassic(const flow::sph::ClassicOptions& options, const Vec2& period, std::span<const Vec3> x);

  /// Steps until time t [s]; after each step calls `watch`, if given, with its length [s]. Throws UnstableError as ClassicLava does.
  void run_until(Real t, const std::function<void(Real dt)>& watch = {});

  /// Originals, in the order they were given in; valid until the next step.
  std::span<const Vec3> positions() const { return x_; }
  std::span<const Vec3> velocities() const { return v_; }
  const flow::sph::ClassicLava& lava() const { return *lava_; }  ///< with the images
  long steps() const { return steps_; }
  /// Processor time of all steps, the originals' share of it [s]: the solver's work is proportional to the particles, and that of copying is
  /// left out.
  Real seconds() const { return seconds_; }

 private:
  void renew_images();

  Vec2 period_;
  std::vector<Vec3> offsets_;  // of the images; the first is 0, the originals' own
  std::unique_ptr<flow::sph::ClassicLava> lava_;
  std::vector<Vec3> x_, v_;
  std::vector<Index> place_;   // by id
  long steps_ = 0;
  Real seconds_ = 0;
};

}  // namespace effuse::study
