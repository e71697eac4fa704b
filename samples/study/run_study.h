#pragma once

#include <filesystem>
#include <functional>
#include <string>
#include <vector>

#include "samples/study/outcome.h"

namespace effuse::study {

struct StudyOptions {
  std::string name = "validation";  ///< of the study: of its page and tables
  std::string what = "";            ///< of the study, for its page: "the modern lava beside exact solutions"
  std::string version;              ///< of effuse: results of another one are never kept
  std::filesystem::path folder;
  bool full = false;                ///< the slow cases too, and the long version of those that have one
  bool resume = false;              ///< keep what the folder holds
  std::vector<std::string> only;    ///< these cases, quick or not; empty: all, or all quick ones
  double picture_scale = 2;         ///< of the PNGs: 1 is 760 pixels wide
};

struct StudyReport {
  std::vector<Outcome> outcomes;     ///< in the order of the cases
  std::vector<std::string> not_run;  ///< cases without one
};

/// Called before a case (outcome: nullptr) and after it; k counts from 1 to n.
using StudyProgress = std::function<void(std::size_t k, std::size_t n, const Case& which, const Outcome* outcome)>;

/// Runs cases and writes, each file whole or not at all, after every case:
///
///   NAME.html          the page (page.h)
///   NAME.csv, .json    its table (outcome.h)
///   NAME-costs.csv     what each run cost, if any tells
///   plots/FILE.svg, .png, .csv   of each plot of each case (plot.h)
///   pictures/FILE      of each picture of each case
///   cases/CASE.json    what --resume reads
///
/// A case that throws becomes an outcome with `failure`; the others go on. So does one whose result cannot be shown: plots
/// or pictures without a name of letters, digits, _ and -, plots of another case's name, or of curves with x and y of different length.
/// With resume, results of this version in the folder are kept and shown, chosen or not; failed ones run again. A result
/// outlives a change to the code that keeps the version: remove its file in cases/ to have it run anew.
/// Throws InputError, before anything is written, for a name that no case has and for a folder that cannot be made.
StudyReport run_study(const std::vector<Case>& cases, const StudyOptions& options, const StudyProgress& progress);

/// Throws InputError, with the nearest name or all names, when one of `wanted` is not among `known`. what: "case".
void require_known(const std::string& what, const std::vector<std::string>& wanted, const std::vector<std::string>& known);

}  // namespace effuse::study
