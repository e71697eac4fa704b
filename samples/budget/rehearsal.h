#pragma once

#include <span>
#include <string>
#include <vector>

#include "flow/scene/effect.h"
#include "flow/scene/node.h"
#include "flow/sph/flow_map.h"
#include "geometry/mesh/points.h"
#include "samples/budget/front_error.h"

/// A scene's lava run with few large particles, to see where it goes and what it takes, before it is run in earnest.
namespace effuse::budget {

/// What a solver did until a moment. Particles are those awake; pairs those within a support of one another, each seen from both ends;
/// iterations those of the pressure's solves (both) and the viscosity's.
struct Counts {
  Real steps = 0;
  Real particle_steps = 0, pair_steps = 0;
  Real pressure_particles = 0, pressure_pairs = 0;    ///< times iterations
  Real viscosity_particles = 0, viscosity_pairs = 0;  ///< times iterations

  /// f applied to each of them and the other's.
  template <class F>
  static Counts each(const Counts& a, const Counts& b, F&& f) {
    return {f(a.steps, b.steps),
            f(a.particle_steps, b.particle_steps),
            f(a.pair_steps, b.pair_steps),
            f(a.pressure_particles, b.pressure_particles),
            f(a.pressure_pairs, b.pressure_pairs),
            f(a.viscosity_particles, b.viscosity_particles),
            f(a.viscosity_pairs, b.viscosity_pairs)};
  }
};

/// A frame's end.
struct Moment {
  Real time = 0;       ///< [s]
  Real front = 0;      ///< [m], flow::sph::find_front's distance; 0 without particles
  Real particles = 0;
  Real layers = 0;     ///< volume over covered area and spacing; 0 without particles
  Real bytes = 0;      ///< of the solver's state
  Counts counts;       ///< since the start
  Real seconds = 0;    ///< of processor time since the start, one thread
};

struct Rehearsal {
  Real spacing = 0;             ///< [m]
  std::vector<Moment> moments;  ///< one a frame
  std::vector<Vec3> at_the_end; ///< the particles of the last moment [m]
  bool whole = false;           ///< it came to the film's end
};

/// Mean number of others within reach [m] of a particle, over at most `samples` of them, evenly chosen.
Real mean_neighbors(const geometry::Points& points, Real reach, std::size_t samples = 128);

/// Runs the lava of a scene, and the solid things it meets, at a spacing: frame by frame, until the film ends or more than most_work
/// particles have been stepped. One thread: processor time means the same on any machine. scene: sound but for lava.spacing.
/// Throws InputError as reading and building the scene does, UnstableError as its steps do. The same on any machine and number of threads
/// but for seconds.
Rehearsal rehearse(const flow::Node& scene, const flow::World& world, Real spacing, Real most_work);

/// The middle one of the layers of those frames that have at least a tenth of the last one's particles; 1 when there are none.
Real middle_layers(const Rehearsal& rehearsal);

/// Root mean square of the difference of two rehearsals' fronts over the frames both have, over that of the second's. Infinite when
/// there is no front.
Real difference_of_fronts(const Rehearsal& one, const Rehearsal& other);

/// What the fronts of rehearsals of falling spacing differ by. All three came to the film's end (checked), and the last has a front (checked).
FrontDifferences front_differences(const Rehearsal& coarser, const Rehearsal& own, const Rehearsal& finer);

}  // namespace effuse::budget
