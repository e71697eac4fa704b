#include "geometry/base/zones.h"

#include <fmt/format.h>

#include <algorithm>
#include <cstring>

#include "geometry/base/check.h"

namespace effuse {

namespace {
thread_local Profile* t_profile = nullptr;  // one per thread: a zone needs no argument in every signature

double seconds(std::chrono::steady_clock::duration d) { return std::chrono::duration<double>(d).count(); }
}  // namespace

Profile* detail::current_profile() { return t_profile; }

ProfileScope::ProfileScope(Profile& profile) : outer_(t_profile) { t_profile = &profile; }
ProfileScope::~ProfileScope() { t_profile = outer_; }

void Profile::enter(const char* name) {
  std::size_t zone = 0;
  while (zone < zones_.size() && zones_[zone].name != name && std::strcmp(zones_[zone].name, name) != 0) ++zone;
  if (zone == zones_.size()) zones_.push_back({name, 0, 0, 0, 0});
  ++zones_[zone].open;
  open_.push_back({zone, std::chrono::steady_clock::now(), 0});
}

void Profile::leave() {
  CHECK(!open_.empty());
  const Open done = open_.back();
  open_.pop_back();
  const double spent = seconds(std::chrono::steady_clock::now() - done.since);
  Zone& zone = zones_[done.zone];
  zone.self_s += spent - done.inner_s;
  if (--zone.open == 0) zone.total_s += spent;
  ++zone.calls;
  if (!open_.empty()) open_.back().inner_s += spent;
}

void Profile::count(const char* name, std::uint64_t n) {
  for (CounterRow& row : counters_) {
    if (row.name == name) {
      row.value += n;
      return;
    }
  }
  counters_.push_back({name, n});
}

double Profile::elapsed_s() const { return seconds(std::chrono::steady_clock::now() - start_); }

std::vector<ZoneRow> Profile::zones() const {
  std::vector<ZoneRow> rows;
  for (const Zone& zone : zones_) rows.push_back({zone.name, zone.total_s, zone.self_s, zone.calls});
  std::stable_sort(rows.begin(), rows.end(), [](const ZoneRow& a, const ZoneRow& b) { return a.self_s > b.self_s; });
  return rows;
}

std::vector<CounterRow> Profile::counters() const {
  std::vector<CounterRow> rows = counters_;
  std::sort(rows.begin(), rows.end(), [](const CounterRow& a, const CounterRow& b) { return a.name < b.name; });
  return rows;
}

std::string Profile::table() const {
  const double elapsed = elapsed_s();
  std::string text = fmt::format("{:<26} {:>10} {:>7} {:>10} {:>10}\n", "zone", "self s", "share", "total s", "calls");
  double named = 0;
  for (const ZoneRow& row : zones()) {
    text += fmt::format("{:<26} {:>10.3f} {:>6.1f}% {:>10.3f} {:>10}\n", row.name, row.self_s, 100 * row.self_s / elapsed, row.total_s, row.calls);
    named += row.self_s;
  }
  text += fmt::format("{:<26} {:>10.3f} {:>6.1f}%\n", "(outside zones)", elapsed - named, 100 * (elapsed - named) / elapsed);
  text += fmt::format("{:<26} {:>10.3f}\n", "wall", elapsed);
  for (const CounterRow& row : counters()) text += fmt::format("{:<26} {:>10}\n", row.name, row.value);
  return text;
}

}  // namespace effuse
