#include "flow/effects/lava_vents.h"

#include <fmt/format.h>

#include <algorithm>
#include <optional>
#include <string>

namespace effuse::flow {

using sph::Vent;

namespace {

PlannedVent read_vent(Parameters& p, Real temperature) {
  PlannedVent planned;
  Vent& vent = planned.vent;
  const auto point = [&](const std::string& key, bool required, std::string_view what) {
    const std::vector<Real> xy = p.numbers(key, "m", 2, required, what);
    if (xy.size() == 2) return Vec2(xy[0], xy[1]);
    planned.located &= !required;
    return Vec2(0, 0);
  };
  planned.place = p.place("at");
  if (p.has("from") || p.has("to")) {
    planned.place = p.place("from");
    planned.from = point("from", true, "one end of a fissure, in the terrain's map coordinates");
    planned.to = point("to", true, "its other end");
    point("at", false, "not with a fissure");
    if (p.has("at"))
      p.fault("at",
              "found with 'from' and 'to', wanted one or the other: a crater vent is 'at' a point, a fissure runs 'from' one 'to' another");
  } else {
    planned.from = planned.to = point("at", true, "centre of a round vent, in the terrain's map coordinates");
  }
  vent.width = p.number("width", "m", std::nullopt, Parameters::positive(), "width of the fissure, or diameter of the round vent");
  const geometry::Curve<Real> rates = p.curve("rate", "m3/s", std::nullopt, Parameters::not_negative(), "volume let out a second; or by keys of simulated time");
  vent.rate = geometry::extremes(rates).second;
  if (rates.keys().size() > 1) vent.rates = rates;
  vent.temperature = p.number("temperature", "K", temperature, {500, 2500}, "of the lava that comes out; the preset's, if there is one");
  vent.start = p.number("start", "s", 0, Parameters::not_negative(), "when it opens (simulated time)");
  vent.stop = p.number("stop", "s", 1e9, Parameters::positive(), "when it closes");
  vent.ramp = p.number("ramp", "s", 0, Parameters::not_negative(), "time over which the rate grows after start and falls before stop");
  if (vent.rates && vent.ramp > 0) p.fault("ramp", "goes with one rate; keys say how the rate grows and falls");
  if (vent.stop <= vent.start) p.fault("stop", fmt::format("the vent closes at {} s, before it opens at {} s", vent.stop, vent.start));
  return planned;
}

/// Distance in plan of a point from a fissure [m].
Real distance(const Vec2& p, const Vec2& from, const Vec2& to) {
  const Vec2 along = to - from;
  const Real length2 = along.squaredNorm(), t = length2 > 0 ? std::clamp((p - from).dot(along) / length2, 0.0, 1.0) : 0;
  return (p - from - t * along).norm();
}

/// Distance in plan between the middles of two vents [m]; 0 where fissures cross.
Real distance(const PlannedVent& a, const PlannedVent& b) {
  const auto side = [](const Vec2& from, const Vec2& to, const Vec2& p) {
    const Vec2 u = to - from, v = p - from;
    return u.x() * v.y() - u.y() * v.x();
  };
  const bool cross = side(a.from, a.to, b.from) * side(a.from, a.to, b.to) < 0 && side(b.from, b.to, a.from) * side(b.from, b.to, a.to) < 0;
  return cross ? 0 : std::min({distance(a.from, b.from, b.to), distance(a.to, b.from, b.to), distance(b.from, a.from, a.to), distance(b.to, a.from, a.to)});
}

/// Two vents that are open at one time in one place would press their lava into each other.
void refuse_overlaps(const std::vector<PlannedVent>& vents, std::vector<Parameters>& tables) {
  for (std::size_t j = 0; j < vents.size(); ++j)
    for (std::size_t i = 0; i < j; ++i) {
      const PlannedVent &a = vents[i], &b = vents[j];
      if (!a.located || !b.located || a.vent.rate <= 0 || b.vent.rate <= 0) continue;
      if (a.vent.stop <= b.vent.start || b.vent.stop <= a.vent.start) continue;
      const Real apart = distance(a, b), wanted = (a.vent.width + b.vent.width) / 2;
      if (apart < wanted)
        tables[j].fault(tables[j].has("at") ? "at" : "from",
                        fmt::format("vents {} and {} are open at one time and {:.3g} m apart, wanted {:.3g} m (half of both widths): make them one, with both rates", i + 1, j + 1, apart, wanted));
    }
}

}  // namespace

std::vector<PlannedVent> read_vents(Parameters& lava, Real temperature) {
  std::vector<PlannedVent> vents;
  std::vector<Parameters> tables = lava.tables("vent", "where lava comes out; at least one");
  for (Parameters& vent : tables) vents.push_back(read_vent(vent, temperature));
  refuse_overlaps(vents, tables);
  if (vents.empty()) lava.fault("vent", "lava has no vent, wanted at least one table [[lava.vent]]");
  return vents;
}

Real let_out(const std::vector<PlannedVent>& vents, Real t) {
  Real volume = 0;
  for (const PlannedVent& v : vents) volume += v.vent.volume(t);
  return volume;
}

Real mean_let_out(const std::vector<PlannedVent>& vents, Real t) {
  constexpr int kSamples = 64;
  Real sum = 0;
  for (int k = 0; k < kSamples; ++k) sum += let_out(vents, t * (k + 0.5) / kSamples);
  return sum / kSamples;
}

Real most_sites(const std::vector<PlannedVent>& vents, Real spacing) {
  Real most = 0;
  for (const PlannedVent& v : vents)
    most = std::max(most, (std::max((v.to - v.from).norm(), v.vent.width) / spacing + 1) * (v.vent.width / spacing + 1));
  return most;
}

std::vector<Vent> place_vents(const std::vector<PlannedVent>& vents, const geometry::Terrain& terrain, std::vector<Fault>& faults) {
  const Vec2 origin = terrain.georeference().origin.head<2>();
  const Vec2 low = terrain.bounds().min().head<2>() + origin, high = terrain.bounds().max().head<2>() + origin;
  std::vector<Vent> placed;
  for (const PlannedVent& planned : vents) {
    if (!planned.located) continue;
    const auto ground = [&](const Vec2& map) {
      const Vec2 local = map - origin;
      const std::optional<Real> z = terrain.height(local.x(), local.y());
      if (!z) {
        // Small numbers on a map of large ones are likely degrees.
        const bool degrees = !terrain.georeference().crs.empty() && low.cwiseAbs().maxCoeff() > 1000 && map.cwiseAbs().maxCoeff() <= 180;
        faults.push_back({planned.place, fmt::format("the vent at {:.12g}, {:.12g} is not on the terrain, which runs from {:.12g}, {:.12g} to {:.12g}, {:.12g}{}", map.x(), map.y(), low.x(), low.y(), high.x(),
                                                     high.y(), degrees ? fmt::format("; if these are degrees: effuse info TERRAIN --at {:.12g},{:.12g} says where that is in metres", map.x(), map.y()) : "")});
      }
      return Vec3(local.x(), local.y(), z.value_or(0));
    };
    Vent vent = planned.vent;
    vent.from = ground(planned.from);
    vent.to = planned.to == planned.from ? vent.from : ground(planned.to);
    placed.push_back(vent);
  }
  return placed;
}

std::vector<Vent> place_whole_vents(const std::vector<PlannedVent>& vents, const geometry::Terrain& terrain, Real spacing) {
  std::vector<Fault> faults;
  std::vector<Vent> placed = place_vents(vents, terrain, faults);
  for (std::size_t v = 0; v < placed.size() && faults.empty(); ++v) {
    std::size_t beside = 0;
    const std::vector<Vec3> sites = placed[v].lattice(spacing);
    for (const Vec3& site : sites) beside += !terrain.height(site.x(), site.y());
    if (beside > 0)
      faults.push_back({vents[v].place, fmt::format("{} of the vent's {} sites are not on the terrain: it reaches over the edge or a hole, "
                                                    "wanted a narrower vent or one further in",
                                                    beside, sites.size())});
  }
  if (!faults.empty()) throw InputError(faults);
  return placed;
}

}  // namespace effuse::flow
