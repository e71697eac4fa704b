#pragma once

#include <fmt/format.h>

#include <cmath>
#include <filesystem>
#include <functional>
#include <limits>
#include <string>
#include <vector>

#include "flow/sph/modern_lava.h"
#include "geometry/base/error.h"
#include "geometry/base/files.h"
#include "samples/study/drawing.h"
#include "samples/study/plot.h"

/// Hard cases: each keeps its bounds, and most would not without the guard that it names.
namespace effuse::stability {

/// The course of a case, drawn when it fails.
class Course {
 public:
  explicit Course(std::vector<std::string> names) {
    for (std::string& name : names) curves_.push_back({std::move(name), {}, {}, false, false});
  }
  void add(Real t, std::initializer_list<Real> values) {
    std::size_t k = 0;
    for (const Real value : values) {
      curves_.at(k).x.push_back(t);
      curves_.at(k++).y.push_back(value);
    }
  }
  /// why, and where the picture is.
  std::string failed(const std::string& name, const std::string& why) const {
    const std::filesystem::path file = std::filesystem::temp_directory_path() / "effuse-stability" / (name + ".svg");
    std::filesystem::create_directories(file.parent_path());
    write_file(file, study::svg_file(study::draw({name, name + ": " + why, "time [s]", "value over its bound", false, false, curves_})));
    return why + " (" + file.string() + ")";
  }

 private:
  std::vector<study::Curve> curves_;
};

struct HardCase {
  std::string name;
  std::string guard;  ///< what is switched off; "": nothing in particular keeps it
  /// What broke; "": it held. guarded: with everything on.
  std::function<std::string(bool guarded)> run;
};
/// For a test's name.
inline void PrintTo(const HardCase& c, std::ostream* out) { *out << c.name; }

/// What lava must keep, at each step.
struct LavaBounds {
  Real speed = 10;                                    ///< [m/s]
  Real energy = std::numeric_limits<Real>::infinity();  ///< of motion, mean over the mass [J/kg]
  Real coldest = 200, hottest = 2000;                 ///< [K]
  Real crowding = 10;                                 ///< rms of what a density is too large by, at the end
  std::function<Real(const Vec3&)> clearance = {};    ///< [m] of a place from what is solid; not below
  Real least_clearance = 0;                           ///< this
};

/// Steps for `seconds`; what broke.
inline std::string run_lava(const std::string& name, flow::sph::ModernLava& lava, Real seconds, Real step, const LavaBounds& bounds, int most_steps = 20000) {
  Course course({"fastest", "too dense", "into what is solid, spacings"});
  flow::sph::ModernReport report;
  const Real end = lava.time() + seconds;
  for (int k = 0; end - lava.time() > 1e-9 * end; ++k) {
    if (k == most_steps) return course.failed(name, fmt::format("{} steps and only at {:.3g} s", k, lava.time()));
    try {
      report = lava.step(std::min(step, end - lava.time()));
    } catch (const UnstableError& error) {
      return course.failed(name, error.what());
    }
    Real fastest = 0, least = 0, energy = 0;
    const std::span<const Real> pressures = lava.pressures();  // found anew each time it is asked for
    for (std::size_t i = 0; i < lava.size(); ++i) {
      const Vec3 &x = lava.positions()[i], &v = lava.velocities()[i];
      if (!x.allFinite() || !v.allFinite() || !std::isfinite(pressures[i]) || !std::isfinite(lava.temperatures()[i])) return course.failed(name, fmt::format("a state that is no number at {:.3g} s", lava.time()));
      fastest = std::max(fastest, v.norm());
      energy += v.squaredNorm() / (2 * static_cast<Real>(lava.size()));
      if (bounds.clearance) least = std::min(least, bounds.clearance(x) - bounds.least_clearance);
      if (lava.options().heat.on && !(lava.temperatures()[i] >= bounds.coldest && lava.temperatures()[i] <= bounds.hottest)) return course.failed(name, fmt::format("{:.6g} K at {:.3g} s", lava.temperatures()[i], lava.time()));
    }
    course.add(lava.time(), {fastest / bounds.speed, report.density_error / bounds.crowding, -least / lava.options().spacing});
    if (fastest > bounds.speed) return course.failed(name, fmt::format("{:.3g} m/s at {:.3g} s, bound {:.3g}", fastest, lava.time(), bounds.speed));
    if (energy > bounds.energy) return course.failed(name, fmt::format("{:.3g} J/kg at {:.3g} s, bound {:.3g}", energy, lava.time(), bounds.energy));
    if (least < 0) return course.failed(name, fmt::format("{:.2g} spacings into what is solid at {:.3g} s", -least / lava.options().spacing, lava.time()));
  }
  if (report.density_error > bounds.crowding) return course.failed(name, fmt::format("{:.2g} too dense, bound {:.2g}", report.density_error, bounds.crowding));
  return "";
}

std::vector<HardCase> lava_cases();
std::vector<HardCase> ground_cases();
std::vector<HardCase> solver_cases();

}  // namespace effuse::stability
