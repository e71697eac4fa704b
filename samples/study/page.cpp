#include "samples/study/page.h"

#include <fmt/format.h>

#include <cmath>

#include "geometry/base/parallel.h"
#include "samples/study/drawing.h"
#include "samples/study/plot.h"

namespace effuse::study {

namespace {

constexpr const char* kStyle = R"(:root{color-scheme:light dark;--page:#fff;--text:#202020;--quiet:#5c5c5c;--line:#d0d0d0;--band:#f5f5f5;--good:#00694d;--bad:#b00020;--link:#00588c}
@media (prefers-color-scheme:dark){:root{--page:#161616;--text:#e6e6e6;--quiet:#a6a6a6;--line:#3a3a3a;--band:#202020;--good:#4fd3a8;--bad:#ff8a93;--link:#7cc4f5}}
body{margin:0 auto;max-width:92rem;padding:1.5rem;background:var(--page);color:var(--text);font:16px/1.5 system-ui,'DejaVu Sans',sans-serif}
h1{font-size:1.6rem;margin:0 0 .3rem}h2{font-size:1.35rem;margin:3rem 0 .3rem}h3{font-size:1.15rem;margin:2.2rem 0 .3rem}details{margin:.6rem 0}summary{cursor:pointer;color:var(--quiet)}
p{margin:.3rem 0;max-width:60rem}.quiet{color:var(--quiet);font-size:.9rem}a{color:var(--link)}
.table{overflow-x:auto;margin:1.2rem 0}
table{border-collapse:collapse;font-size:.875rem}
th,td{padding:.3rem .65rem;text-align:left;vertical-align:top;border-bottom:1px solid var(--line)}
th{background:var(--band);white-space:nowrap}
td.n,th.n{text-align:right;white-space:nowrap;font-variant-numeric:tabular-nums}
td.figure{min-width:13rem}td.result{min-width:10rem}td.note{min-width:14rem;color:var(--quiet)}
.good{color:var(--good)}.bad{color:var(--bad);font-weight:600}
.plots{display:grid;grid-template-columns:repeat(auto-fit,minmax(min(100%,30rem),1fr));gap:1rem}
figure{margin:.6rem 0}figcaption{color:var(--quiet);font-size:.85rem}
svg.plot{width:100%;height:auto;max-width:47.5rem}
)";

std::string plots_of(const Outcome& outcome) {
  std::string out;
  for (const Plot& plot : outcome.result.plots)
    out += fmt::format("<figure>\n{}<figcaption>plots/{}.csv, .svg, .png</figcaption></figure>\n", svg_element(draw(plot), "plot-" + plot.file), escaped(plot.file));
  return out.empty() ? "" : "<div class=\"plots\">\n" + out + "</div>\n";
}

/// The rows of one case: its name, time, version and note beside all of its figures.
std::string rows_of(const Outcome& outcome) {
  const std::size_t rows = outcome.failure.empty() ? std::max<std::size_t>(outcome.result.measures.size(), 1) : 1;
  const std::string span = rows > 1 ? fmt::format(" rowspan=\"{}\"", rows) : "";
  const std::string first = fmt::format("<tr><td{}><a href=\"#case-{}\">{}</a></td>", span, escaped(outcome.name), escaped(outcome.title));
  const std::string last = fmt::format("<td{0} class=\"n\">{1}</td><td{0}>{2}</td><td{0} class=\"note\">{3}</td></tr>\n", span, escaped(duration_text(outcome.seconds)), escaped(outcome.version), escaped(outcome.result.note));
  if (!outcome.failure.empty()) return fmt::format("{}<td colspan=\"6\" class=\"bad\">✗ failed: {}</td>{}", first, escaped(outcome.failure), last);
  if (outcome.result.measures.empty()) return fmt::format("{}<td colspan=\"6\" class=\"quiet\">no figures</td>{}", first, last);
  std::string out;
  for (std::size_t k = 0; k < outcome.result.measures.size(); ++k) {
    const Measure& m = outcome.result.measures[k];
    out += k == 0 ? first : "<tr>";
    out += fmt::format("<td class=\"figure\">{}</td><td class=\"n\">{}</td><td class=\"n\">{}</td><td class=\"n\">{}</td><td class=\"n\">{}</td><td class=\"result {}\">{} {}</td>", escaped(m.what), escaped(figure_text(m.measured, m.unit)),
                       escaped(figure_text(m.reference, m.unit)), escaped(error_text(m.error, m)), escaped(error_text(m.hold, m)), m.passed() ? "good" : "bad", m.passed() ? "✓" : "✗", escaped(verdict(m)));
    out += k == 0 ? last : "</tr>\n";
  }
  return out;
}

/// What the runs cost, folded away.
std::string costs_of(const Outcome& outcome) {
  if (outcome.result.costs.empty()) return "";
  std::string out = fmt::format("<details><summary>{} runs: error, seconds, memory, steps, state</summary>\n<div class=\"table\"><table>\n<thead><tr><th>curve</th><th>setting</th><th class=\"n\">error</th><th class=\"n\">seconds</th>"
                                "<th class=\"n\">± (of)</th><th class=\"n\">steps</th><th class=\"n\">memory</th><th>state</th></tr></thead>\n<tbody>\n", outcome.result.costs.size());
  for (const CostPoint& p : outcome.result.costs)
    out += fmt::format("<tr><td>{}</td><td>{}</td><td class=\"n\">{}</td><td class=\"n\">{:.3g}</td><td class=\"n\">{:.1g} ({})</td><td class=\"n\">{}</td><td class=\"n\">{:.3g} MB</td><td>{:016x}</td></tr>\n", escaped(p.curve),
                       escaped(p.setting), std::isfinite(p.error) ? fmt::format("{:.3g}", p.error) : "blew up", p.seconds, p.spread, p.repeats, p.steps, static_cast<double>(p.memory) / 1e6, p.hash);
  return out + "</tbody></table></div></details>\n";
}

std::string chapter_of(const Chapter& chapter) {
  std::string out = fmt::format("<p>{}.</p>\n", escaped(summary(chapter.outcomes)));
  if (!chapter.not_run.empty()) {
    std::string names;
    for (const std::string& name : chapter.not_run) names += (names.empty() ? "" : ", ") + name;
    out += fmt::format("<p class=\"quiet\">Not run here: {}.</p>\n", escaped(names));
  }
  out += "<div class=\"table\"><table>\n<thead><tr><th>case</th><th>figure</th><th class=\"n\">measured</th><th class=\"n\">reference</th><th class=\"n\">error</th><th class=\"n\">hold to</th><th>result</th>"
         "<th class=\"n\">time</th><th>version</th><th>note</th></tr></thead>\n<tbody>\n";
  for (const Outcome& outcome : chapter.outcomes) out += rows_of(outcome);
  out += "</tbody></table></div>\n";
  for (const Outcome& outcome : chapter.outcomes) {
    out += fmt::format("<section id=\"case-{}\">\n<h3>{}</h3>\n<p class=\"quiet\">{} · reference: {}</p>\n", escaped(outcome.name), escaped(outcome.title), escaped(outcome.name), escaped(outcome.source));
    if (!outcome.failure.empty()) out += fmt::format("<p class=\"bad\">✗ failed: {}</p>\n", escaped(outcome.failure));
    if (!outcome.result.note.empty()) out += fmt::format("<p>{}</p>\n", escaped(outcome.result.note));
    out += plots_of(outcome) + costs_of(outcome) + "</section>\n";
  }
  return out;
}

}  // namespace

std::string page_of(const std::string& title, const std::string& version, const std::vector<Chapter>& chapters) {
  std::string out = fmt::format(
      "<!DOCTYPE html>\n<html lang=\"en\">\n<head>\n<meta charset=\"utf-8\">\n<meta name=\"viewport\" content=\"width=device-width, initial-scale=1\">\n"
      "<title>effuse: {}</title>\n<style>\n{}{}</style>\n</head>\n<body>\n<h1>effuse {}: {}</h1>\n",
      escaped(title), kStyle, svg_style(), escaped(version), escaped(title));
  out += fmt::format("<p class=\"quiet\">Each figure beside an exact, converged or measured reference. A figure passes when its error is at most what it is held to. Times on {} {}.</p>\n", thread_count(), thread_count() == 1 ? "thread" : "threads");
  if (chapters.size() > 1) {
    out += "<ul>\n";
    for (const Chapter& chapter : chapters) out += fmt::format("<li><a href=\"#study-{}\">{}</a>: {}</li>\n", escaped(chapter.name), escaped(chapter.name), escaped(chapter.what));
    out += "</ul>\n";
  }
  for (const Chapter& chapter : chapters) {
    if (chapters.size() > 1) out += fmt::format("<h2 id=\"study-{}\">{}</h2>\n<p>{}</p>\n", escaped(chapter.name), escaped(chapter.name), escaped(chapter.what));
    out += chapter_of(chapter);
  }
  return out + "</body>\n</html>\n";
}

}  // namespace effuse::study
