#include "samples/study/outcome.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <nlohmann/json.hpp>

#include "geometry/base/error.h"
#include "geometry/base/parallel.h"
#include "samples/study/plot.h"

namespace effuse::study {

namespace {

using nlohmann::ordered_json;

/// A number JSON can hold, or its name.
ordered_json number(double v) {
  if (std::isfinite(v)) return v;
  return std::isnan(v) ? "nan" : v > 0 ? "inf" : "-inf";
}

double number_from(const ordered_json& j) {
  if (j.is_number()) return j.get<double>();
  const std::string name = j.get<std::string>();
  constexpr double kInfinity = std::numeric_limits<double>::infinity();
  if (name == "nan") return std::numeric_limits<double>::quiet_NaN();
  if (name == "inf") return kInfinity;
  if (name == "-inf") return -kInfinity;
  throw std::runtime_error(fmt::format("'{}' is no number", name));
}

ordered_json numbers(const std::vector<double>& values) {
  ordered_json j = ordered_json::array();
  for (const double v : values) j.push_back(number(v));
  return j;
}

std::vector<double> numbers_from(const ordered_json& j) {
  std::vector<double> values;
  for (const ordered_json& entry : j) values.push_back(number_from(entry));
  return values;
}

ordered_json measure_json(const Measure& m) {
  return {{"what", m.what},           {"unit", m.unit},       {"measured", number(m.measured)},    {"reference", number(m.reference)},
          {"error", number(m.error)}, {"hold", number(m.hold)}, {"error_unit", m.unit_of_error}, {"passed", m.passed()}};
}

ordered_json cost_json(const CostPoint& p) {
  return {{"curve", p.curve},     {"setting", p.setting}, {"parameter", number(p.parameter)}, {"error", number(p.error)}, {"seconds", number(p.seconds)}, {"spread", number(p.spread)},
          {"repeats", p.repeats}, {"steps", p.steps},     {"memory_bytes", p.memory},         {"hash", fmt::format("{:016x}", p.hash)}};
}

/// Text as JSON holds it: bytes that are not UTF-8 become U+FFFD.
std::string dumped(const ordered_json& j) { return j.dump(1, ' ', false, ordered_json::error_handler_t::replace); }

}  // namespace

Tally tally(const std::vector<Outcome>& outcomes) {
  Tally t;
  for (const Outcome& outcome : outcomes) {
    ++t.cases;
    t.seconds += outcome.seconds;
    if (!outcome.failure.empty()) {
      ++t.failed;
      continue;
    }
    t.figures += outcome.result.measures.size();
    t.missed += static_cast<std::size_t>(std::count_if(outcome.result.measures.begin(), outcome.result.measures.end(), [](const Measure& m) { return !m.passed(); }));
  }
  return t;
}

std::string summary(const std::vector<Outcome>& outcomes) {
  const Tally t = tally(outcomes);
  std::string text = fmt::format("{} of {} figures hold", t.figures - t.missed, t.figures);
  if (t.missed > 0) text += fmt::format(", {} missed", t.missed);
  text += t.failed > 0 ? fmt::format(", {} of {} cases failed", t.failed, t.cases) : fmt::format(", {} {}", t.cases, t.cases == 1 ? "case" : "cases");
  return text + ", " + duration_text(t.seconds);
}

std::string figure_text(double value, const std::string& unit) {
  const bool long_but_plain = std::abs(value) >= 9999.5 && std::abs(value) < 1e6;
  return (long_but_plain ? fmt::format("{:.0f}", value) : fmt::format("{:.4g}", value)) + (unit.empty() ? "" : " ") + unit;
}

std::string error_text(double error, const Measure& measure) {
  return measure.unit_of_error.empty() ? fmt::format("{:.3g} %", 100 * error) : figure_text(error, measure.unit_of_error);
}

std::string verdict(const Measure& measure) {
  if (measure.passed()) return "passed";
  if (std::isnan(measure.error)) return "missed: not a number";
  const std::string times = measure.hold > 0 ? fmt::format(" ({:.3g} times the bar)", measure.error / measure.hold) : "";
  return fmt::format("missed by {}{}", error_text(measure.error - measure.hold, measure), times);
}

std::string duration_text(double seconds) {
  if (seconds < 0.0995) return fmt::format("{:.0f} ms", 1000 * seconds);
  if (seconds < 9.95) return fmt::format("{:.1f} s", seconds);
  const long whole = std::lround(seconds);
  return whole < 120 ? fmt::format("{} s", whole) : fmt::format("{} min {} s", whole / 60, whole % 60);
}

std::string outcome_json(const Outcome& outcome) {
  ordered_json j;
  j["format"] = 2;
  j["case"] = outcome.name;
  j["title"] = outcome.title;
  j["source"] = outcome.source;
  j["version"] = outcome.version;
  j["seconds"] = number(outcome.seconds);
  j["failure"] = outcome.failure;
  j["note"] = outcome.result.note;
  j["measures"] = ordered_json::array();
  for (const Measure& m : outcome.result.measures) j["measures"].push_back(measure_json(m));
  j["costs"] = ordered_json::array();
  for (const CostPoint& p : outcome.result.costs) j["costs"].push_back(cost_json(p));
  j["plots"] = ordered_json::array();
  for (const Plot& plot : outcome.result.plots) {
    ordered_json curves = ordered_json::array();
    for (const Curve& curve : plot.curves) curves.push_back({{"name", curve.name}, {"points", curve.points}, {"reference", curve.reference}, {"x", numbers(curve.x)}, {"y", numbers(curve.y)}});
    j["plots"].push_back({{"file", plot.file}, {"title", plot.title}, {"x_label", plot.x_label}, {"y_label", plot.y_label}, {"log_x", plot.log_x}, {"log_y", plot.log_y}, {"curves", curves}});
  }
  return dumped(j) + "\n";
}

Outcome read_outcome(const std::string& json, const std::string& file) {
  try {
    const ordered_json j = ordered_json::parse(json);
    if (j.at("format").get<int>() != 2) throw std::runtime_error("format is not 2");
    Outcome outcome;
    outcome.name = j.at("case").get<std::string>();
    outcome.title = j.at("title").get<std::string>();
    outcome.source = j.at("source").get<std::string>();
    outcome.version = j.at("version").get<std::string>();
    outcome.seconds = number_from(j.at("seconds"));
    outcome.failure = j.at("failure").get<std::string>();
    outcome.kept = true;
    outcome.result.note = j.at("note").get<std::string>();
    for (const ordered_json& m : j.at("measures"))
      outcome.result.measures.push_back({m.at("what").get<std::string>(), m.at("unit").get<std::string>(), number_from(m.at("measured")), number_from(m.at("reference")), number_from(m.at("error")),
                                         number_from(m.at("hold")), m.at("error_unit").get<std::string>()});
    for (const ordered_json& p : j.at("costs"))
      outcome.result.costs.push_back({p.at("curve").get<std::string>(), p.at("setting").get<std::string>(), number_from(p.at("parameter")), number_from(p.at("error")), number_from(p.at("seconds")), number_from(p.at("spread")),
                                      p.at("repeats").get<int>(), p.at("steps").get<std::uint64_t>(), p.at("memory_bytes").get<std::size_t>(), std::stoull(p.at("hash").get<std::string>(), nullptr, 16)});
    for (const ordered_json& p : j.at("plots")) {
      Plot plot{p.at("file").get<std::string>(), p.at("title").get<std::string>(), p.at("x_label").get<std::string>(), p.at("y_label").get<std::string>(), p.at("log_x").get<bool>(), p.at("log_y").get<bool>(), {}};
      for (const ordered_json& c : p.at("curves")) {
        Curve curve{c.at("name").get<std::string>(), numbers_from(c.at("x")), numbers_from(c.at("y")), c.at("points").get<bool>(), c.at("reference").get<bool>()};
        if (curve.x.size() != curve.y.size()) throw std::runtime_error("x and y of a curve differ in length");
        plot.curves.push_back(std::move(curve));
      }
      outcome.result.plots.push_back(std::move(plot));
    }
    return outcome;
  } catch (const std::exception& error) {
    throw InputError(Place{file}, fmt::format("is no result of a study's case: {}", error.what()));
  }
}

std::string table_csv(const std::vector<Outcome>& outcomes) {
  std::string out = "case,title,figure,unit,measured,reference,error,hold,error_unit,result,short_by,seconds,version,note,source\n";
  for (const Outcome& outcome : outcomes) {
    const std::string head = csv_cell(outcome.name) + "," + csv_cell(outcome.title);
    const std::string tail = fmt::format("{},{},{},{}\n", csv_number(outcome.seconds), csv_cell(outcome.version), csv_cell(outcome.failure.empty() ? outcome.result.note : outcome.failure), csv_cell(outcome.source));
    if (!outcome.failure.empty()) {
      out += head + ",,,,,,,,failed,," + tail;
      continue;
    }
    for (const Measure& m : outcome.result.measures)
      out += fmt::format("{},{},{},{},{},{},{},{},{},{}", head, csv_cell(m.what), csv_cell(m.unit), csv_number(m.measured), csv_number(m.reference), csv_number(m.error), csv_number(m.hold),
                         csv_cell(m.unit_of_error), m.passed() ? "passed" : "missed", m.passed() ? "" : csv_number(m.error - m.hold)) +
             "," + tail;
  }
  return out;
}

std::string costs_csv(const std::vector<Outcome>& outcomes) {
  std::string rows;
  for (const Outcome& outcome : outcomes)
    for (const CostPoint& p : outcome.result.costs)
      rows += fmt::format("{},{},{},{},{},{},{},{},{},{},{:016x},{}\n", csv_cell(outcome.name), csv_cell(p.curve), csv_cell(p.setting), csv_number(p.parameter), csv_number(p.error), csv_number(p.seconds), csv_number(p.spread), p.repeats,
                          p.steps, p.memory, p.hash, csv_cell(outcome.version));
  return rows.empty() ? "" : "case,curve,setting,parameter,error,seconds,spread,repeats,steps,memory_bytes,hash,version\n" + rows;
}

std::string table_json(const std::string& study, const std::string& version, const std::vector<Outcome>& outcomes, const std::vector<std::string>& not_run) {
  const Tally t = tally(outcomes);
  ordered_json j;
  j["study"] = study;
  j["version"] = version;
  j["threads"] = thread_count();
  j["ok"] = t.missed == 0 && t.failed == 0;
  j["figures"] = t.figures;
  j["missed"] = t.missed;
  j["failed"] = t.failed;
  j["seconds"] = number(t.seconds);
  j["not_run"] = not_run;
  j["cases"] = ordered_json::array();
  for (const Outcome& outcome : outcomes) {
    ordered_json c{{"case", outcome.name},       {"title", outcome.title},     {"source", outcome.source}, {"version", outcome.version}, {"seconds", number(outcome.seconds)},
                   {"failure", outcome.failure}, {"note", outcome.result.note}};
    c["measures"] = ordered_json::array();
    for (const Measure& m : outcome.result.measures) c["measures"].push_back(measure_json(m));
    c["plots"] = ordered_json::array();
    for (const Plot& plot : outcome.result.plots) c["plots"].push_back(plot.file);
    j["cases"].push_back(c);
  }
  return dumped(j);
}

std::string table_text(const std::vector<Outcome>& outcomes) {
  std::vector<std::vector<std::string>> rows = {{"case", "figure", "measured", "reference", "error", "hold to", "result"}};
  for (const Outcome& outcome : outcomes) {
    std::string failure = outcome.failure;
    std::replace(failure.begin(), failure.end(), '\n', ' ');
    if (!failure.empty()) rows.push_back({outcome.name, "failed: " + failure});
    else
      for (const Measure& m : outcome.result.measures)
        rows.push_back({outcome.name, m.what, figure_text(m.measured, m.unit), figure_text(m.reference, m.unit), error_text(m.error, m), error_text(m.hold, m), verdict(m)});
  }
  // In characters, not bytes; a failure's sentence widens no column.
  const auto length = [](const std::string& text) { return static_cast<std::size_t>(std::count_if(text.begin(), text.end(), [](char c) { return (c & 0xc0) != 0x80; })); };
  std::vector<std::size_t> width(rows[0].size(), 0);
  for (const auto& row : rows)
    for (std::size_t k = 0; k < row.size() && row.size() == rows[0].size(); ++k) width[k] = std::max(width[k], length(row[k]));
  std::string out;
  for (const auto& row : rows) {
    std::string line;
    for (std::size_t k = 0; k < row.size(); ++k) {
      line += row[k];
      if (k + 1 < row.size()) line += std::string(width[k] - std::min(width[k], length(row[k])) + 2, ' ');
    }
    out += line + "\n";
  }
  return out;
}

}  // namespace effuse::study
