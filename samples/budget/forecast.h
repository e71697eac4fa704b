#pragma once

#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "flow/scene/accuracy.h"
#include "flow/scene/effect.h"
#include "flow/scene/node.h"
#include "samples/budget/front_error.h"
#include "samples/budget/machine.h"
#include "samples/budget/rehearsal.h"

/// A scene's budget: the settings that a wanted error of the lava's front asks for, and what they will come to.
namespace effuse::budget {

/// A key of the scene, and what was chosen for it, or what the scene itself says.
struct Setting {
  std::string key, value;   ///< "lava.spacing", "0.85 m"
  bool of_the_scene = false;  ///< stated there: it stands
};

/// What an error was told by: the flow's depth (FrontLaw), or rehearsals of that spacing and of a finer and a larger one (refined_error).
enum class ErrorBy { kDepth, kRehearsals };

struct Forecast {
  std::vector<Setting> settings;
  Real wanted = 0;            ///< error of the front [share]
  Real error = 0;             ///< predicted, with these settings
  ErrorBy told_by = ErrorBy::kDepth;
  Real spacing = 0;           ///< [m]
  Real front = 0;             ///< predicted at the film's end [m]
  Real particles = 0, mean_particles = 0;  ///< at the film's end, over the film
  Real solver_bytes = 0;      ///< at the film's end
  Counts counts;              ///< of the lava's solver, over the film
  bool classic = false;
  FrontLaw law;
  std::vector<Real> rehearsed;  ///< spacings, falling [m]
  Counts rehearsed_counts;    ///< of all rehearsals,
  Real rehearsed_seconds = 0; ///< and the processor time they took here: what this scene's ground and solids add to what a machine's figures say
  std::vector<Vec3> sample;   ///< a rehearsal's particles at its end [m]: how they lie tells what a skin of them is
  Real sample_spacing = 0;    ///< theirs [m]: the film's own where that was rehearsed
  bool whole = true;          ///< rehearsals came to the film's end
};

/// Chooses what the scene leaves open, rehearses the scene, and says what it will come to. The same on any machine.
///
///   scene   sound, or sound but for a missing lava.spacing; the chosen keys are set in it
///   wish    of the scene (read_accuracy)
///
/// 1. courant and the solves' tolerances by what is wanted (courant_for, tolerance_for; of the modern lava), skin.voxel of drafts 0.7.
/// 2. Two rehearsals, of spacings sqrt(2) apart, the finer with about kRehearsed particles at the end, fewer where the film asks for so many
///    steps that they would take longer than some seconds. Where the scene says its spacing: that one and the next finer, if those can be paid for (4.).
/// 3. The flow's depth by them (flow_depth), and the spacing by FrontLaw, to two digits, downwards; at most what makes kLeastParticles, at least what makes kMostParticles.
/// 4. Where a rehearsal sqrt(2) finer than that has at most kMostRehearsed particles and kRehearsalWork: that one, the spacing's own and the next coarser tell
///    the error (refined_error), if all three come to the film's end. Elsewhere FrontLaw tells it. A spacing that was chosen stays, also where they tell more than
///    was wanted: they are right to a factor of two themselves.
/// 5. The opening at that spacing, for a while, where it was not rehearsed: how many steps and iterations it takes, against the finer rehearsal's for the same time.
///
/// Steps, iterations and particles of the rest go as the finer rehearsal's did, times what the opening told. Throws InputError at the wish's
/// place where no rehearsal stays stable, or nothing comes out.
///
/// Accuracy of the error that is told by rehearsals: of ten scenes drawn at random after all constants were fixed, nine within 0.97 to 1.37 of what half their
/// spacing leaves, one (a plane of 6 degrees) told 3.2 times too large. By the depth: of the sixty scenes of refined_error 38 within a factor of two, 55 of four.
Forecast forecast(flow::Node& scene, const flow::AccuracyWish& wish, const flow::World& world);

inline constexpr Real kRehearsed = 3000;      ///< particles at the end of the finer rehearsal
inline constexpr Real kMostRehearsed = 8000;  ///< of one that tells the error
inline constexpr Real kRehearsalWork = 8e6;   ///< particles times steps, of it
inline constexpr Real kOpeningWork = 7e5;     ///< of the opening
inline constexpr Real kLeastParticles = 200, kMostParticles = 5e8;

}  // namespace effuse::budget
