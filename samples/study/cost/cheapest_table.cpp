#include "samples/study/cost/cheapest_table.h"

#include <fmt/format.h>

#include <algorithm>
#include <charconv>
#include <cmath>
#include <limits>

#include "geometry/base/error.h"
#include "samples/study/cost/cost.h"

namespace effuse::study {

namespace {

constexpr std::string_view kHeader = "case,curve,setting,parameter,error,seconds,spread,repeats,steps,memory_bytes,hash,version";
constexpr std::size_t kColumns = 12;

/// Fields of a line; quotes hold commas, two quotes are one.
std::vector<std::string> fields_of(std::string_view line) {
  std::vector<std::string> fields(1);
  bool quoted = false;
  for (std::size_t k = 0; k < line.size(); ++k) {
    const char c = line[k];
    if (quoted && c == '"' && k + 1 < line.size() && line[k + 1] == '"') fields.back() += line[++k];
    else if (c == '"') quoted = !quoted;
    else if (c == ',' && !quoted) fields.emplace_back();
    else fields.back() += c;
  }
  return fields;
}

double number(const std::string& text, const Place& place, const char* what) {
  if (text == "inf") return std::numeric_limits<double>::infinity();
  if (text == "nan" || text == "-nan") return std::numeric_limits<double>::quiet_NaN();
  double value = 0;
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), value);
  if (error != std::errc() || end != text.data() + text.size()) throw InputError(place, fmt::format("{} is '{}', wanted a number", what, text));
  return value;
}

std::string time_text(double s) {
  const double value = s >= 1 ? s : s >= 1e-3 ? 1e3 * s : 1e6 * s;
  return (value >= 9.95 ? fmt::format("{:.0f}", value) : fmt::format("{:.2g}", value)) + (s >= 1 ? " s" : s >= 1e-3 ? " ms" : " us");
}

std::string share_text(double e) { return e >= 1e-4 ? fmt::format("{:.3g} %", 100 * e) : fmt::format("{:.0e}", e); }

/// The runs that compete for a row, and its name.
struct Row {
  std::string name;
  std::vector<CostPoint> points;
};

std::vector<Row> rows_of(const CaseCosts& one) {
  const std::vector<std::string> curves = curves_of(one.points);
  // Other errors of the same runs: the same settings end in the same states.
  const auto runs = [&](const std::string& curve) {
    std::vector<std::pair<std::string, std::uint64_t>> all;
    for (const CostPoint& p : points_of(one.points, curve)) all.emplace_back(p.setting, p.hash);
    return all;
  };
  bool same = curves.size() > 1;
  for (const std::string& curve : curves) same &= runs(curve) == runs(curves.front());
  if (!same) return {{one.name, one.points}};
  std::vector<Row> rows;
  for (const std::string& curve : curves) rows.push_back({one.name + ", " + curve, points_of(one.points, curve)});
  return rows;
}

}  // namespace

std::vector<CaseCosts> read_costs(const std::string& csv, const std::string& file) {
  std::vector<CaseCosts> cases;
  int line_number = 0;
  for (std::size_t at = 0; at < csv.size();) {
    const std::size_t end = std::min(csv.find('\n', at), csv.size());
    std::string_view line = std::string_view(csv).substr(at, end - at);
    if (line.ends_with('\r')) line.remove_suffix(1);
    at = end + 1;
    ++line_number;
    const Place place{file, line_number};
    if (line_number == 1) {
      if (line != kHeader) throw InputError(place, fmt::format("found '{:.60}', wanted the costs that `effuse study` writes: {}", line, kHeader));
      continue;
    }
    if (line.empty()) continue;
    const std::vector<std::string> f = fields_of(line);
    if (f.size() != kColumns) throw InputError(place, fmt::format("{} fields, wanted {}", f.size(), kColumns));
    CostPoint point;
    point.curve = f[1];
    point.setting = f[2];
    point.parameter = number(f[3], place, "parameter");
    point.error = number(f[4], place, "error");
    point.seconds = number(f[5], place, "seconds");
    const auto [last, error] = std::from_chars(f[10].data(), f[10].data() + f[10].size(), point.hash, 16);
    if (error != std::errc() || last != f[10].data() + f[10].size()) throw InputError(place, fmt::format("hash is '{}', wanted hexadecimal digits", f[10]));
    if (cases.empty() || cases.back().name != f[0]) cases.push_back({f[0], {}});
    cases.back().points.push_back(std::move(point));
  }
  if (line_number == 0) throw InputError(Place{file}, "is empty, wanted the costs that `effuse study` writes");
  return cases;
}

std::string cheapest_table(std::span<const CaseCosts> cases, std::span<const double> errors) {
  std::string text = "| case |", rule = "|---|";
  for (const double error : errors) {
    text += fmt::format(" {} |", share_text(error));
    rule += "---|";
  }
  text += "\n" + rule + "\n";
  for (const CaseCosts& one : cases)
    for (const Row& row : rows_of(one)) {
      std::string line = fmt::format("| {} |", row.name);
      bool any = false;
      for (const double wanted : errors) {
        const CostPoint* best = nullptr;
        for (const CostPoint& p : row.points)
          if (p.error <= wanted && (!best || p.seconds < best->seconds)) best = &p;
        any |= best != nullptr;
        const bool alone = curves_of(row.points).size() == 1;
        line += best ? fmt::format(" {}{}: {} |", alone ? "" : best->curve + ", ", best->setting, time_text(best->seconds)) : " - |";
      }
      if (any) text += line + "\n";
    }
  return text;
}

}  // namespace effuse::study
