#pragma once

#include <span>
#include <string>
#include <utility>
#include <vector>

#include "samples/study/study.h"

/// For an error, the cheapest setting: from what a study wrote.
namespace effuse::study {

/// A case's runs, as NAME-costs.csv keeps them.
struct CaseCosts {
  std::string name;
  std::vector<CostPoint> points;
};

/// Reads what costs_csv() wrote, the cases in their order. Throws InputError naming file, with the line, when it is something else.
std::vector<CaseCosts> read_costs(const std::string& csv, const std::string& file);

/// A table in Markdown: a row a case, a column an error [share], in each cell the cheapest setting that was tried and is at least as good, with
/// its seconds of processor time. Curves of other runs compete for a row; where they are other errors of the same runs each has its own.
/// "-": none gets there. Rows in which nothing does are left out.
std::string cheapest_table(std::span<const CaseCosts> cases, std::span<const double> errors);

}  // namespace effuse::study
