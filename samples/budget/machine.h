#pragma once

#include <filesystem>
#include <string>

#include "samples/budget/rehearsal.h"

/// What this machine takes for what a run does.
namespace effuse::budget {

/// Seconds of one thread but where told otherwise.
struct Machine {
  std::string name;   ///< of the host and its processor; "": the figures that come with the program
  std::string when;   ///< "2026-11-23 02:30 UTC"; "": as above
  int threads = 2;    ///< that speedup was measured with
  Real speedup = 1.7; ///< of a step by that many threads
  Real step = 1.5e-5;                                          ///< a step
  Real particle_step = 6e-7, pair_step = 1.6e-8;               ///< a particle awake, or a pair, and step: neighbours, density, heat, contacts
  Real pressure_particle = 2e-8, pressure_pair = 1.5e-9;       ///< and iteration
  Real viscosity_particle = 5e-8, viscosity_pair = 3e-9;       ///< and iteration
  Real classic_pair = 1e-8;                                    ///< a pair and step of the classic lava, all of it
  Real skin_particle = 1.2e-4;                                 ///< twenty triangles and frame, but for asking the terrain: a particle of a sheet at voxels of half a spacing
  Real write_byte = 6e-9;                                      ///< of meshes and volumes
  Real picture_pixel = 1.2e-6;                                 ///< a pixel

  bool measured() const { return !name.empty(); }
  /// Processor time [s] of a solver's work.
  Real seconds(const Counts& counts, bool classic) const;
  /// Wall time [s] of that processor time on so many threads: what is parallel is shared out, the rest is not.
  Real on_threads(Real processor_seconds, int threads) const;
};

/// The figures that come with the program: of a Xeon at 2.1 GHz.
Machine usual_machine();

/// "host, AMD EPYC 7543, 2 threads": what figures are good for.
std::string name_of_this_machine();

/// Where figures of this machine are kept: $XDG_CACHE_HOME/effuse/machine.json, or ~/.cache/effuse/machine.json; empty where the
/// environment names neither.
std::filesystem::path machine_file();

/// The file's figures, when they are this machine's and of a version this program knows; else the usual ones, and in `why` a
/// sentence that says which.
Machine known_machine(std::string& why);

std::string machine_json(const Machine& machine);
/// Reads what machine_json wrote. Throws InputError naming file when it is something else: not JSON, of another version, a figure
/// missing, not finite or not above 0.
Machine read_machine(const std::string& json, const std::string& file);

/// Writes machine_file(), whole or not at all. Throws InputError when there is nowhere to write it.
void keep(const Machine& machine);

}  // namespace effuse::budget
