#pragma once

#include <cstdint>
#include <functional>
#include <string>
#include <vector>

/// Cases that compare effuse with an exact, converged or measured reference; run by tests and by `effuse study`.
namespace effuse::study {

/// One line or set of points of a plot; x and y of equal length. Values that are not finite are points that blew up.
struct Curve {
  std::string name;
  std::vector<double> x, y;
  bool points = false;     ///< drawn as marks, not as a line
  bool reference = false;  ///< what the others are held to: drawn first, in black
};

struct Plot {
  std::string file;   ///< of the SVG and PNG and CSV, without folder and ending: "bm1_front"
  std::string title, x_label, y_label;  ///< labels with their unit: "time [s]"
  bool log_x = false, log_y = false;
  std::vector<Curve> curves;
};

/// One figure beside its bar.
struct Measure {
  std::string what;        ///< "front at 550 s"
  std::string unit;        ///< of measured and reference: "m"
  double measured = 0;
  double reference = 0;
  double error = 0;        ///< what is held to the bar: a share (0.03 is 3 %) unless `unit_of_error` says otherwise
  double hold = 0;         ///< the bar: error <= hold passes
  std::string unit_of_error = "";  ///< "": a share, shown in percent
  bool passed() const { return error <= hold; }  // not a number: not passed
};

/// A picture that a case made: its file's name, without folder, and its bytes.
struct Picture {
  std::string file;  ///< "skin-kinds.jpg"
  std::string bytes;
};

/// One run at one setting: what it cost, and how wrong it was against an exact or converged reference.
struct CostPoint {
  std::string curve;        ///< points of one curve belong together: "rk4"
  std::string setting;      ///< "dt = 1 ms"
  double parameter = 0;     ///< what the setting is a number of: a step, a spacing, a tolerance
  double error = 0;         ///< not finite: it blew up
  double seconds = 0, spread = 0;  ///< of processor time, median of the repeats, and half their range
  int repeats = 0;
  std::uint64_t steps = 0;
  std::size_t memory = 0;   ///< bytes of the solver's state
  std::uint64_t hash = 0;   ///< of the state at the end
};

struct CaseResult {
  std::vector<Measure> measures;
  std::vector<Plot> plots;   ///< the first one is the case's own: measured beside reference
  std::vector<Picture> pictures;  ///< for the study's folder pictures/; not kept in the result's JSON
  std::vector<CostPoint> costs;   ///< for NAME-costs.csv
  std::string note;          ///< resolution, method, what was left out; one or two sentences
};

struct Case {
  std::string name;     ///< "bm1": file names and the command line use it
  std::string title;    ///< "BM1 viscous dam break"
  std::string source;   ///< of the reference
  bool quick = false;   ///< a few seconds at most: run in the quick tests
  std::function<CaseResult()> run;
  std::function<CaseResult()> run_full = {};  ///< the real thing where `run` is a short version, for `--full`; empty: there is no other
};

/// All cases of the validation set, in the order of the page.
std::vector<Case> validation_cases();
/// All cases of the skin: its surface beside solids, its relief, its colour, its pictures.
std::vector<Case> skin_cases();

// What accuracy costs in time; each in its own file under cost/.
std::vector<Case> integrator_cases();  ///< scheme and step: oscillator, pendulum, orbit, jello
std::vector<Case> lava_cases();        ///< spacing, stiffness, tolerances, support, step
std::vector<Case> heat_cases();        ///< cells of the crust
std::vector<Case> terrain_cases();     ///< triangles of the ground
std::vector<Case> solver_cases();      ///< waves, bodies, elastic solids

// By subject; each in its own file under validation/.
void add_operator_cases(std::vector<Case>& cases);   // operators alone
void add_channel_cases(std::vector<Case>& cases);    // rest, Poiseuille, Couette, film, Bingham
void add_spreading_cases(std::vector<Case>& cases);  // BM1, Huppert, BM2
void add_heat_cases(std::vector<Case>& cases);       // erf, Stefan, radiation, crust
void add_cooling_cases(std::vector<Case>& cases);    // BM3
void add_rheology_cases(std::vector<Case>& cases);   // GRD08
void add_terrain_cases(std::vector<Case>& cases);    // volume and energy on Maunga Whau
void add_work_cases(std::vector<Case>& cases);       // seconds at equal error, classic against modern

}  // namespace effuse::study
