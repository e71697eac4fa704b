#include "flow/effects/ocean_effect.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <optional>

#include "flow/effects/effect_table.h"
#include "flow/effects/water_look.h"
#include "geometry/base/error.h"
#include "geometry/base/parallel.h"
#include "geometry/base/zones.h"
#include "geometry/procedural/ocean.h"

namespace effuse::flow {

namespace {

using geometry::Ocean;
using geometry::OceanWave;

constexpr Real kFar = 30;       // regions away: where the horizon's mesh ends
constexpr Real kWiden = 1.25;   // from quad to quad beyond the region
constexpr Real kWavePosts = 4;  // quads a wave must be long to be seen in them
constexpr Real kMostQuads = 4e6;

struct OceanSettings {
  std::string name;
  Place place;
  geometry::OceanOptions options;
  std::vector<OceanWave> waves;
  Real wind_speed = 0, wind_direction = 0;
  int components = 40;
  std::vector<Real> region;
  Real cell = 1;
  bool horizon = true;
  WaterLook look;
  Real temperature = 288.15, boiling = 0;
  std::uint64_t seed = 0;
};

/// Places of the mesh's posts along one axis: even over the region, then ever wider.
std::vector<Real> posts(Real low, Real high, Real cell, bool horizon) {
  const int n = std::max(1, static_cast<int>(std::ceil((high - low) / cell - 1e-9)));
  std::vector<Real> all;
  for (int k = 0; k <= n; ++k) all.push_back(low + (high - low) * k / n);
  if (!horizon) return all;
  std::vector<Real> before;
  for (Real step = kWiden * cell, x = 0; x < kFar * (high - low); step *= kWiden) {
    x += step;
    before.push_back(low - x);
    all.push_back(high + x);
  }
  all.insert(all.begin(), before.rbegin(), before.rend());
  return all;
}

std::optional<std::pair<Vec2, Vec2>> region_of(const OceanSettings& s, const World& world, std::vector<Fault>& faults) {
  const Vec3 origin = world.terrain->georeference().origin;
  const Box3 ground = world.terrain->bounds();
  Vec2 low = ground.min().head<2>(), high = ground.max().head<2>();
  if (s.region.size() == 4) {
    low = Vec2(s.region[0], s.region[1]) - origin.head<2>();
    high = Vec2(s.region[2], s.region[3]) - origin.head<2>();
  }
  const Vec2 quads = (high - low) / s.cell;
  if (quads.x() * quads.y() <= kMostQuads) return std::pair{low, high};
  faults.push_back({s.place, fmt::format("ocean '{}': {:.3g} quads of {:g} m, at most {:.0g}: a larger cell or a smaller region would do", s.name, quads.x() * quads.y(), s.cell, kMostQuads)});
  return std::nullopt;
}

class OceanEffect final : public Effect, private Water {
 public:
  OceanEffect(const OceanSettings& settings, const Vec2& low, const Vec2& high, std::vector<OceanWave> waves, const World& world)
      : settings_(settings), low_(low), high_(high), level_(settings.options.level - world.terrain->georeference().origin.z()), ocean_(at_level(settings.options, level_), std::move(waves)) {
    for (const OceanWave& wave : ocean_.waves()) highest_ += std::abs(wave.amplitude);
    make_mesh(*world.terrain);
  }

  std::string_view name() const override { return settings_.name; }
  Real time() const override { return time_; }
  void step(Real t_end) override { time_ = t_end; }
  const Water* water() const override { return this; }

  std::vector<NamedMesh> meshes() const override {
    ZONE("ocean.mesh");
    geometry::TriMesh mesh;
    mesh.triangles = triangles_;
    const std::size_t n = rest_.size();
    mesh.positions.resize(n);
    mesh.normals.resize(n);
    geometry::VertexAttribute& velocity = mesh.attributes["velocity"];
    velocity.width = 3;
    velocity.values.resize(3 * n);
    parallel_for(n, [&](std::size_t i) {
      const Ocean& ocean = wide_[i] == 0 ? ocean_ : long_waves_[wide_[i] - 1u];
      const Ocean::Sample s = ocean.at_rest_point(rest_[i], time_);
      mesh.positions[i] = s.position;
      mesh.normals[i] = s.normal;
      for (std::size_t c = 0; c < 3; ++c) velocity.values[3 * i + c] = static_cast<float>(s.velocity[static_cast<Eigen::Index>(c)]);
    });
    paint_water(mesh, settings_.look);
    std::vector<NamedMesh> all;
    all.push_back({settings_.name, std::move(mesh)});
    return all;
  }

  std::size_t memory() const override { return triangles_.capacity() * sizeof(geometry::Triangle) + rest_.capacity() * (sizeof(Vec2) + 1); }
  void add_to(StateHash& hash) const override { hash.add(time_); }
  void save(StateWriter& out) const override { out.value("time", time_); }
  void load(StateReader& in) override { in.value("time", time_); }
  std::vector<std::pair<std::string, double>> figures() const override {
    const Real crest = parallel_max(rest_.size(), 0.0, [&](std::size_t i) { return wide_[i] == 0 ? ocean_.at_rest_point(rest_[i], time_).position.z() - level_ : 0.0; });
    return {{"waves", static_cast<double>(ocean_.waves().size())}, {"highest_m", crest}, {"triangles", static_cast<double>(triangles_.size())}};
  }
  std::string status() const override { return fmt::format("{} of {} waves", settings_.name, ocean_.waves().size()); }

 private:
  static geometry::OceanOptions at_level(geometry::OceanOptions options, Real level) {
    options.level = level;
    return options;
  }

  /// Posts, the quads that are not wholly in the ground, and for wide quads the ocean of the waves that they can show.
  void make_mesh(const geometry::Terrain& terrain) {
    const std::vector<Real> xs = posts(low_.x(), high_.x(), settings_.cell, settings_.horizon), ys = posts(low_.y(), high_.y(), settings_.cell, settings_.horizon);
    const auto gap = [](const std::vector<Real>& p, std::size_t k) { return std::max(k > 0 ? p[k] - p[k - 1] : 0, k + 1 < p.size() ? p[k + 1] - p[k] : 0); };
    geometry::OceanOptions options = at_level(settings_.options, level_);
    options.steepness = ocean_.steepness();
    std::vector<Real> gaps;
    for (Real g = 2 * settings_.cell; settings_.horizon && gaps.size() < 60; g *= 2) {
      std::vector<OceanWave> longer;
      for (const OceanWave& wave : ocean_.waves())
        if (wave.wavelength >= kWavePosts * g) longer.push_back(wave);
      gaps.push_back(g);
      long_waves_.emplace_back(options, longer);
      if (longer.empty()) break;
    }
    const std::size_t nx = xs.size(), ny = ys.size();
    std::vector<std::uint8_t> deep(nx * ny);  // under ground for good
    rest_.resize(nx * ny);
    wide_.assign(nx * ny, 0);
    for (std::size_t j = 0; j < ny; ++j)
      for (std::size_t i = 0; i < nx; ++i) {
        rest_[j * nx + i] = Vec2(xs[i], ys[j]);
        const Real g = std::max(gap(xs, i), gap(ys, j));
        std::size_t k = 0;
        while (k < gaps.size() && g > gaps[k] * (1 - 1e-9) / 1.5) ++k;
        wide_[j * nx + i] = static_cast<std::uint8_t>(std::min(k, long_waves_.size()));
      }
    parallel_for(rest_.size(), [&](std::size_t v) {
      const std::optional<Real> ground = terrain.height(rest_[v].x(), rest_[v].y());
      // A point of the surface may stand an amplitude to the side of where it rests.
      deep[v] = ground && *ground > level_ + 2 * highest_;
    });
    for (std::size_t j = 0; j + 1 < ny; ++j)
      for (std::size_t i = 0; i + 1 < nx; ++i) {
        const std::size_t a = j * nx + i, b = a + 1, c = b + nx, d = a + nx;
        if (deep[a] && deep[b] && deep[c] && deep[d]) continue;
        const auto at = [](std::size_t v) { return static_cast<Index>(v); };
        if ((i + j) % 2 == 0) triangles_.insert(triangles_.end(), {{at(a), at(b), at(c)}, {at(a), at(c), at(d)}});
        else triangles_.insert(triangles_.end(), {{at(a), at(b), at(d)}, {at(b), at(c), at(d)}});
      }
    drop_unused();
  }

  void drop_unused() {
    std::vector<Index> number(rest_.size(), ~Index{0});
    for (const geometry::Triangle& t : triangles_)
      for (const Index v : t) number[v] = 0;
    std::size_t kept = 0;
    for (std::size_t v = 0; v < rest_.size(); ++v) {
      if (number[v] != 0) continue;
      rest_[kept] = rest_[v];
      wide_[kept] = wide_[v];
      number[v] = static_cast<Index>(kept++);
    }
    rest_.resize(kept);
    wide_.resize(kept);
    for (geometry::Triangle& t : triangles_)
      for (Index& v : t) v = number[v];
  }

  bool over(const Vec2& p) const { return settings_.horizon || ((p - low_).minCoeff() >= 0 && (high_ - p).minCoeff() >= 0); }
  std::optional<Real> surface(const Vec2& p) const override {
    if (!over(p)) return std::nullopt;
    return ocean_.height(p, time_);
  }
  void wet(std::span<const Vec3> x, std::span<std::uint8_t> out) const override {
    parallel_for(x.size(), [&](std::size_t i) {
      const Real above = x[i].z() - level_;
      if (out[i] || above >= highest_ || !over(x[i].head<2>())) return;
      if (above < -highest_ || x[i].z() < ocean_.height(x[i].head<2>(), time_)) out[i] = 1;
    });
  }
  Real temperature() const override { return settings_.temperature; }
  Real boiling() const override { return settings_.boiling; }

  OceanSettings settings_;
  Vec2 low_, high_;
  Real level_, highest_ = 0;
  Ocean ocean_;
  std::vector<Ocean> long_waves_;  // for quads of twice, four times .. a cell
  std::vector<geometry::Triangle> triangles_;
  std::vector<Vec2> rest_;
  std::vector<std::uint8_t> wide_;  // 0: all waves; k: those of long_waves_[k - 1]
  Real time_ = 0;
};

OceanSettings read(Parameters& p) {
  OceanSettings s;
  s.place = p.place("");
  s.name = read_effect_name(p, "ocean");
  s.options.level = p.number("level", "m", std::nullopt, {}, "of the sea at rest, over the map's zero");
  s.options.depth = p.number("depth", "m", s.options.depth, Parameters::positive(), "of the sea, for the speed of long waves");
  s.options.steepness = p.number("steepness", "", s.options.steepness, {0, 1}, "0: sines; 1: sharp crests, less where they would fold");
  for (Parameters& t : p.tables("wave", "instead of the wind's: one of the sum")) {
    OceanWave wave;
    wave.amplitude = t.number("amplitude", "m", std::nullopt, {}, "half from trough to crest");
    wave.wavelength = t.number("wavelength", "m", std::nullopt, Parameters::positive(), "");
    wave.direction = t.number("direction", "rad", 0, {}, "it runs towards, counter-clockwise from east");
    wave.phase = t.number("phase", "rad", 0, {}, "");
    s.waves.push_back(wave);
  }
  s.wind_speed = p.number("wind", "m/s", s.waves.empty() ? 6 : 0, {0, 100}, "that raised a sea of Pierson and Moskowitz's spectrum; beside waves of its own: none");
  s.wind_direction = p.number("wind_direction", "rad", 0, {}, "it blows towards, counter-clockwise from east");
  s.components = static_cast<int>(p.integer("components", s.components, 1, 1000, "waves of that sum"));
  s.region = p.numbers("region", "m", 4, false, "[x, y, x, y], two corners in map coordinates; none: the terrain");
  if (s.region.size() == 4 && !(s.region[2] > s.region[0] && s.region[3] > s.region[1])) {
    p.fault("region", "must have its second corner above the first along x and y");
    s.region.clear();
  }
  s.cell = p.number("cell", "m", std::nullopt, Parameters::positive(), "side of its mesh's quads");
  s.horizon = p.flag("horizon", true, "its mesh goes on beyond the region, coarser, out of sight");
  s.seed = static_cast<std::uint64_t>(p.integer("seed", 0, 0, 1'000'000'000, "of the wind's waves, beside the scene's"));
  read_water(p, s.look, s.temperature, s.boiling);
  return s;
}

}  // namespace

EffectPlan read_ocean(Parameters& parameters, Real duration) {
  const OceanSettings settings = read(parameters);
  EffectPlan plan;
  plan.name = settings.name;
  if (settings.region.size() == 4) plan.estimate.cells = (settings.region[2] - settings.region[0]) * (settings.region[3] - settings.region[1]) / (settings.cell * settings.cell);
  plan.estimate.bytes = 60 * plan.estimate.cells;
  plan.estimate.steps = 1;
  static_cast<void>(duration);
  plan.misfits = [settings](const World& world) {
    std::vector<Fault> faults;
    region_of(settings, world, faults);
    return faults;
  };
  plan.build = [settings](const World& world) -> std::unique_ptr<Effect> {
    std::vector<Fault> faults;
    const auto region = region_of(settings, world, faults);
    if (!region) throw InputError(faults);
    std::vector<OceanWave> waves = settings.waves;
    if (settings.wind_speed > 0)
      for (const OceanWave& wave : geometry::wind_sea(settings.wind_speed, settings.wind_direction, settings.components, world.seed + 1000 * settings.seed)) waves.push_back(wave);
    return std::make_unique<OceanEffect>(settings, region->first, region->second, std::move(waves), world);
  };
  return plan;
}

}  // namespace effuse::flow
