#include "flow/effects/waves_effect.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <optional>

#include "flow/effects/effect_table.h"
#include "flow/effects/lava_in_water.h"
#include "flow/effects/water_look.h"
#include "flow/waves/wave_grid.h"
#include "geometry/base/error.h"
#include "geometry/base/parallel.h"

namespace effuse::flow {

namespace {

using waves::Border;
using waves::WaveGrid;
using waves::WaveOptions;
using waves::WaveScheme;

constexpr Real kSafety = 0.9;        // of the longest explicit step
constexpr Real kMostCells = 2e7;
constexpr Real kNone = std::numeric_limits<Real>::quiet_NaN();

/// A stone, or a paddle: volume that comes and goes.
struct WaveSource {
  Vec2 at;
  Real radius = 1, volume = 0, period = 0, start = 0, stop = 1e30;
};

struct WavesSettings {
  std::string name;
  Place place;
  Real level = 0;
  std::vector<Real> region;  ///< map x, y, x, y; empty: the terrain
  Real cell = 1, deepest = 0;
  Real damping = 0;
  Border border = Border::kAbsorbing;
  enum class Scheme { kAuto, kExplicit, kImplicit } scheme = Scheme::kAuto;
  Place step_place;
  Real step = 0;
  std::vector<WaveSource> sources;
  WaterLook look;
  Real temperature = 288.15, boiling = 0;
};

/// The grid of a table in the world, or a fault.
struct WaveLayout {
  WaveOptions options;
  std::vector<Real> depth;  ///< [m] at rest; 0: land
  Real level = 0;           ///< in the world's heights
};

std::optional<WaveLayout> lay_out(const WavesSettings& s, const World& world, std::vector<Fault>& faults) {
  const auto wrong = [&](const std::string& what) {
    faults.push_back({s.place, fmt::format("waves '{}': {}", s.name, what)});
    return std::nullopt;
  };
  const geometry::Terrain& terrain = *world.terrain;
  const Vec3 origin = terrain.georeference().origin;
  const Box3 ground = terrain.bounds();
  Vec2 low = ground.min().head<2>(), high = ground.max().head<2>();
  if (s.region.size() == 4) {
    low = Vec2(s.region[0], s.region[1]) - origin.head<2>();
    high = Vec2(s.region[2], s.region[3]) - origin.head<2>();
  }
  WaveLayout l;
  const Real nx = std::ceil((high.x() - low.x()) / s.cell - 1e-9), ny = std::ceil((high.y() - low.y()) / s.cell - 1e-9);
  if (!(nx * ny <= kMostCells)) return wrong(fmt::format("{:.3g} cells of {:g} m, at most {:.0g}: wider cells or a smaller region would do", nx * ny, s.cell, kMostCells));
  if (nx < 3 || ny < 3) return wrong(fmt::format("{:.0f} x {:.0f} cells of {:g} m, wanted at least 3 x 3: smaller cells would do", nx, ny, s.cell));
  WaveOptions& o = l.options;
  o.nx = static_cast<int>(nx);
  o.ny = static_cast<int>(ny);
  o.cell = s.cell;
  o.corner = low;
  o.damping = s.damping;
  o.border = s.border;
  l.level = s.level - origin.z();
  const std::size_t n = static_cast<std::size_t>(o.nx) * static_cast<std::size_t>(o.ny);
  l.depth.assign(n, 0);
  std::vector<std::uint8_t> bare(n, 0);  // no ground there
  parallel_for(n, [&](std::size_t c) {
    const Vec2 p = low + s.cell * Vec2(static_cast<Real>(c % static_cast<std::size_t>(o.nx)) + 0.5, static_cast<Real>(c / static_cast<std::size_t>(o.nx)) + 0.5);
    const std::optional<Real> z = terrain.height(p.x(), p.y());
    if (z) l.depth[c] = std::max(0.0, l.level - *z);
    else bare[c] = 1;
  });
  Real deepest = parallel_max(n, 0.0, [&](std::size_t c) { return l.depth[c]; });
  if (deepest <= 0 && std::count(bare.begin(), bare.end(), 1) == 0) return wrong(fmt::format("no ground of its region lies under its level, {:g} m: there is no water", s.level));
  if (s.deepest > 0) deepest = std::min(s.deepest, deepest > 0 ? deepest : s.deepest);
  else if (deepest <= 0) return wrong("there is no ground under its region: deepest would say how deep it is");
  for (std::size_t c = 0; c < n; ++c) l.depth[c] = bare[c] ? deepest : std::min(l.depth[c], deepest);

  // Of a scheme that was asked for; auto takes what fits.
  const Real courant = std::sqrt(2 * kGravity * deepest) * s.step / s.cell;
  if (s.scheme == WavesSettings::Scheme::kExplicit && courant > 1) {
    faults.push_back({s.step_place, fmt::format("waves '{}': steps of {:.3g} s have the Courant number {:.3g} in water {:.3g} m deep, and the explicit scheme stands at most 1, that is {:.3g} s: a shorter step, wider cells or scheme = \"implicit\" would do",
                                                s.name, s.step, courant, deepest, s.step / courant)});
    return std::nullopt;
  }
  o.scheme = s.scheme == WavesSettings::Scheme::kImplicit || (s.scheme == WavesSettings::Scheme::kAuto && courant > 1) ? WaveScheme::kImplicit : WaveScheme::kExplicit;
  return l;
}

std::vector<Real> speeds(const WaveLayout& l) {
  std::vector<Real> c2(l.depth.size());
  for (std::size_t c = 0; c < c2.size(); ++c) c2[c] = kGravity * l.depth[c];
  return c2;
}

class WavesEffect final : public Effect, private Water {
 public:
  WavesEffect(const WavesSettings& settings, WaveLayout layout, const geometry::Terrain& terrain)
      : settings_(settings), layout_(std::move(layout)), grid_(layout_.options, speeds(layout_)), look_(make_look()) {
    displaced_.assign(grid_.size(), 0);
    const Vec2 origin = terrain.georeference().origin.head<2>();
    for (WaveSource& source : settings_.sources) source.at -= origin;
    for (std::size_t c = 0; c < grid_.size(); ++c) wet_cells_ += grid_.water(c);
  }

  std::string_view name() const override { return settings_.name; }
  Real time() const override { return time_; }
  const Water* water() const override { return this; }

  void meet(const std::vector<Effect*>& others) override {
    for (const Effect* other : others)
      if (other->flow().spacing > 0) lava_ = other;
  }

  void step(Real t_end) override {
    const Real left = t_end - time_, wanted = longest();
    const Real count = std::max(1.0, std::ceil(left / wanted * (1 - 1e-9))), dt = left / count;
    pour(dt, left);
    if (!grid_.step(dt)) throw UnstableError(fmt::format("waves '{}' at {:.6g} s: the implicit step of {:.3g} s did not converge; a shorter step would do", settings_.name, time_, dt));
    time_ = count > 1 ? time_ + dt : t_end;
    ++steps_;
  }

  std::vector<NamedMesh> meshes() const override {
    std::vector<NamedMesh> all;
    all.push_back({settings_.name, look_.at(grid_.height(), grid_.rate())});
    return all;
  }

  std::vector<std::string> remarks() const override {
    const bool implicit = layout_.options.scheme == WaveScheme::kImplicit;
    std::string why = implicit ? fmt::format("the implicit scheme, steps of {:.3g} s, Courant number {:.3g}", longest(), grid_.courant(longest()))
                               : fmt::format("the explicit scheme, steps of {:.3g} s, Courant number {:.3g}", longest(), grid_.courant(longest()));
    if (implicit && settings_.scheme == WavesSettings::Scheme::kAuto) why += fmt::format(" (explicit steps would stand {:.3g} s)", grid_.longest_step());
    return {fmt::format("{} x {} cells, {} of them water, {}", layout_.options.nx, layout_.options.ny, wet_cells_, why)};
  }

  std::size_t memory() const override { return grid_.memory() + (displaced_.capacity() + target_.capacity() + layout_.depth.capacity()) * sizeof(Real) + look_.memory(); }
  void add_to(StateHash& hash) const override {
    hash.add(time_);
    grid_.add_to(hash);
    hash.add(std::span<const Real>(displaced_));
  }
  void save(StateWriter& out) const override {
    out.value("time", time_);
    out.value("steps", steps_);
    grid_.save(out);
    out.array("displaced", displaced_);
  }
  void load(StateReader& in) override {
    std::vector<Real> displaced;
    in.value("time", time_);
    in.value("steps", steps_);
    grid_.load(in);
    in.array("displaced", displaced);
    if (displaced.size() != displaced_.size()) throw InputError(Place{"checkpoint"}, fmt::format("waves '{}': holds {} cells, the scene's has {}", settings_.name, displaced.size(), displaced_.size()));
    displaced_ = std::move(displaced);
    target_at_.reset();
  }
  std::vector<std::pair<std::string, double>> figures() const override {
    const std::span<const Real> h = grid_.height();
    return {{"cells", static_cast<double>(grid_.size())},
            {"water_cells", static_cast<double>(wet_cells_)},
            {"steps", static_cast<double>(steps_)},
            {"implicit", layout_.options.scheme == WaveScheme::kImplicit ? 1.0 : 0.0},
            {"volume_m3", grid_.volume()},
            {"displaced_m3", parallel_sum(displaced_.size(), 0.0, [&](std::size_t c) { return displaced_[c]; })},
            {"highest_m", parallel_max(h.size(), 0.0, [&](std::size_t c) { return std::abs(h[c]); })},
            {"energy_m4_s2", grid_.energy()}};
  }
  std::string status() const override {
    const std::span<const Real> h = grid_.height();
    return fmt::format("{} to {:.2g} m", settings_.name, parallel_max(h.size(), 0.0, [&](std::size_t c) { return std::abs(h[c]); }));
  }

 private:
  std::optional<Real> surface(const Vec2& p) const override {
    const std::optional<std::size_t> c = cell_of(p);
    if (!c || !grid_.water(*c)) return std::nullopt;
    return layout_.level + grid_.height_at(p);
  }
  void wet(std::span<const Vec3> x, std::span<std::uint8_t> out) const override {
    parallel_for(x.size(), [&](std::size_t i) {
      if (out[i]) return;
      const std::optional<Real> level = surface(x[i].head<2>());
      if (level && x[i].z() < *level) out[i] = 1;
    });
  }
  Real temperature() const override { return settings_.temperature; }
  Real boiling() const override { return settings_.boiling; }

  std::optional<std::size_t> cell_of(const Vec2& p) const {
    const WaveOptions& o = layout_.options;
    const Vec2 u = (p - o.corner) / o.cell;
    if (!(u.x() >= 0 && u.y() >= 0 && u.x() < o.nx && u.y() < o.ny)) return std::nullopt;
    return static_cast<std::size_t>(u.y()) * static_cast<std::size_t>(o.nx) + static_cast<std::size_t>(u.x());
  }
  Real longest() const {
    if (settings_.step > 0) return settings_.step;
    return layout_.options.scheme == WaveScheme::kImplicit ? 1.0 / 24 : kSafety * grid_.longest_step();
  }

  WaterSurface make_look() const {
    const WaveOptions& o = layout_.options;
    return WaterSurface(settings_.look, {o.corner, o.cell, o.nx, o.ny}, layout_.depth, layout_.level);
  }

  /// What lifts the water in a step: sources, and the lava that goes under on its way to the frame's end, evenly.
  void pour(Real dt, Real left) {
    for (const WaveSource& s : settings_.sources) {
      if (s.period <= 0) {
        if (time_ <= s.start && s.start < time_ + dt) grid_.add_volume(s.at, s.radius, s.volume);
        continue;
      }
      // A paddle: volume sin(2 pi t / period) has gone in by the time t.
      const auto given = [&](Real t) { return s.volume * std::sin(2 * kPi * (std::clamp(t, s.start, s.stop) - s.start) / s.period); };
      const Real more = given(time_ + dt) - given(time_);
      if (more != 0) grid_.add_volume(s.at, s.radius, more);
    }
    if (!lava_) return;
    if (!target_at_ || *target_at_ != lava_->time()) {
      const WaveOptions& o = layout_.options;
      std::vector<Real> level(grid_.size());
      for (std::size_t c = 0; c < level.size(); ++c) level[c] = grid_.water(c) ? layout_.level : kNone;
      target_ = lava_under(lava_->flow(), {o.corner, o.cell, o.nx, o.ny}, level);
      target_at_ = lava_->time();
    }
    const Real share = std::min(1.0, dt / left), area = layout_.options.cell * layout_.options.cell;
    const std::span<Real> h = grid_.height();
    for (std::size_t c = 0; c < h.size(); ++c) {
      const Real more = share * (target_[c] - displaced_[c]);
      if (more == 0) continue;
      h[c] += more / area;
      displaced_[c] += more;
    }
  }

  WavesSettings settings_;
  WaveLayout layout_;
  WaveGrid grid_;
  WaterSurface look_;
  const Effect* lava_ = nullptr;
  std::vector<Real> displaced_, target_;  // by lava [m^3]: so far, and at the frame's end
  std::optional<Real> target_at_;
  std::size_t wet_cells_ = 0;
  Real time_ = 0;
  std::uint64_t steps_ = 0;
};

WavesSettings read(Parameters& p) {
  WavesSettings s;
  s.place = p.place("");
  s.name = read_effect_name(p, "waves");
  s.level = p.number("level", "m", std::nullopt, {}, "of the water at rest, over the map's zero");
  s.region = p.numbers("region", "m", 4, false, "[x, y, x, y], two corners in map coordinates; none: the terrain");
  if (s.region.size() == 4 && !(s.region[2] > s.region[0] && s.region[3] > s.region[1])) {
    p.fault("region", "must have its second corner above the first along x and y");
    s.region.clear();
  }
  s.cell = p.number("cell", "m", std::nullopt, Parameters::positive(), "side of its cells");
  s.deepest = p.number("deepest", "m", 0, Parameters::not_negative(), "deeper water carries waves as if it were so deep; 0: as deep as it is. Where there is no ground it is as deep as anywhere");
  s.damping = p.number("damping", "1/s", 0, Parameters::not_negative(), "of the waves");
  s.border = static_cast<Border>(p.choice("border", {"periodic", "mirror", "absorbing"}, 2, "of the region: its sides meet, are walls, or let waves out"));
  s.scheme = static_cast<WavesSettings::Scheme>(p.choice("scheme", {"auto", "explicit", "implicit"}, 0, "auto: explicit, or implicit where step is beyond Courant number 1"));
  s.step = p.number("step", "s", 0, Parameters::not_negative(), "at most; 0: 0.9 of the longest explicit one, or 1/24 s of the implicit scheme");
  s.step_place = p.place(p.has("step") ? "step" : "");
  for (Parameters& t : p.tables("source", "makes waves: a stone, or with a period a paddle")) {
    WaveSource source;
    const std::vector<Real> at = t.numbers("at", "m", 2, true, "x, y in map coordinates");
    if (at.size() == 2) source.at = Vec2(at[0], at[1]);
    source.radius = t.number("radius", "m", std::nullopt, Parameters::positive(), "of the bump");
    source.volume = t.number("volume", "m3", std::nullopt, {}, "that comes; with a period: comes and goes");
    source.period = t.number("period", "s", 0, Parameters::not_negative(), "0: it comes once, at start");
    source.start = t.number("start", "s", 0, Parameters::not_negative(), "");
    source.stop = t.number("stop", "s", source.stop, Parameters::not_negative(), "of a paddle");
    s.sources.push_back(source);
  }
  read_water(p, s.look, s.temperature, s.boiling);
  return s;
}

}  // namespace

EffectPlan read_waves(Parameters& parameters, Real duration) {
  const WavesSettings settings = read(parameters);
  EffectPlan plan;
  plan.name = settings.name;
  // Without the terrain its region is not known: by the step that water 10 m deep would want.
  if (settings.region.size() == 4) plan.estimate.cells = (settings.region[2] - settings.region[0]) * (settings.region[3] - settings.region[1]) / (settings.cell * settings.cell);
  const Real deep = settings.deepest > 0 ? settings.deepest : 10, own = kSafety * settings.cell / std::sqrt(2 * kGravity * deep);
  const bool implicit = settings.scheme == WavesSettings::Scheme::kImplicit || settings.step * kSafety > own;
  plan.estimate.steps = settings.cell > 0 ? std::ceil(duration / (settings.step > 0 ? settings.step : implicit ? 1.0 / 24 : own)) : 0;
  plan.estimate.bytes = 300 * plan.estimate.cells;
  plan.estimate.seconds = plan.estimate.steps * plan.estimate.cells * (implicit ? 4e-7 : 5e-9);
  plan.misfits = [settings](const World& world) {
    std::vector<Fault> faults;
    lay_out(settings, world, faults);
    return faults;
  };
  plan.build = [settings](const World& world) -> std::unique_ptr<Effect> {
    std::vector<Fault> faults;
    std::optional<WaveLayout> layout = lay_out(settings, world, faults);
    if (!layout) throw InputError(faults);
    return std::make_unique<WavesEffect>(settings, std::move(*layout), *world.terrain);
  };
  return plan;
}

}  // namespace effuse::flow
