#pragma once

#include <string>
#include <vector>

#include "samples/study/study.h"

/// What came of the cases of a study, as files keep it and tables show it.
namespace effuse::study {

struct Outcome {
  std::string name, title, source;  ///< of the case
  std::string version;              ///< of effuse, when it ran
  double seconds = 0;               ///< wall time it took
  std::string failure;              ///< why it did not run to its end; "": it did
  bool kept = false;                ///< from an earlier call
  CaseResult result;
};

/// Sums over outcomes.
struct Tally {
  std::size_t cases = 0, failed = 0;    ///< cases in all; that did not run to their end
  std::size_t figures = 0, missed = 0;  ///< measures of those that did; above their bar
  double seconds = 0;
};
Tally tally(const std::vector<Outcome>& outcomes);

/// "21 of 23 figures hold, 2 missed, 1 of 9 cases failed, 43 s"
std::string summary(const std::vector<Outcome>& outcomes);

// Words of the table. Four digits or, below a million, all before the point; errors that are a share in percent.
std::string figure_text(double value, const std::string& unit);
std::string error_text(double error, const Measure& measure);
/// "passed", or "missed by 1.2 % (1.4 times the bar)", or "missed: not a number".
std::string verdict(const Measure& measure);
/// "40 ms", "0.4 s", "75 s", "4 min 10 s".
std::string duration_text(double seconds);

/// One outcome as JSON that reads back bit for bit; numbers that are not finite are "nan", "inf", "-inf".
std::string outcome_json(const Outcome& outcome);
/// Reads what outcome_json wrote. Throws InputError naming `file` when it is something else.
Outcome read_outcome(const std::string& json, const std::string& file);

/// The table with one row a figure (one for a case that failed), columns
/// case,title,figure,unit,measured,reference,error,hold,error_unit,result,short_by,seconds,version,note,source;
/// error_unit "" is a share; result passed, missed or failed; short_by = error - hold where missed.
std::string table_csv(const std::vector<Outcome>& outcomes);

/// What each run of each case cost, columns case,curve,setting,parameter,error,seconds,spread,repeats,steps,memory_bytes,hash,version; "" when
/// no case has any.
std::string costs_csv(const std::vector<Outcome>& outcomes);

/// The same as one JSON document: study, version, threads, summary's numbers, and of each case its measures and plot names.
std::string table_json(const std::string& study, const std::string& version, const std::vector<Outcome>& outcomes, const std::vector<std::string>& not_run);

/// The same for a terminal.
std::string table_text(const std::vector<Outcome>& outcomes);

}  // namespace effuse::study
