#include "flow/effects/plants_effect.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <optional>

#include "flow/effects/effect_table.h"
#include "flow/plants/plant_fire.h"
#include "flow/plants/plant_look.h"
#include "geometry/base/error.h"
#include "geometry/base/parallel.h"
#include "geometry/base/random.h"
#include "geometry/base/zones.h"
#include "geometry/procedural/primitives.h"

namespace effuse::flow {

namespace {

using geometry::Plant;
using geometry::TriMesh;
using plants::PlantFire;
using plants::Standing;

constexpr std::uint64_t kPlaceStream = 0x914ce, kSizeStream = 0x51e, kKindStream = 0x41d;
constexpr Real kMostPlants = 200000;
constexpr std::size_t kMostModules = 300000;  // of one plant's word
constexpr Real kPatch = 3;                    // lava is taken together by cells of so many spacings
constexpr Real kColdest = 500;                // [K] of lava that can dry leaves
constexpr Real kFlameHot = 1300;              // [K]

/// The table, read.
struct PlantsSettings {
  std::string name;
  Place place;
  geometry::LSystem system;
  geometry::TurtleOptions turtle;
  int generations = 5, variants = 4, sides = 3;
  Real height = 1, spread = 0.25;
  std::vector<Vec2> places;
  Vec2 at = Vec2::Zero();
  Real radius = 0, density = 0, slope = 0;
  geometry::Sway sway;
  plants::Fuel fuel;
  bool burns = true, flames = true;
  std::uint64_t seed = 0;
};

/// Of a square lattice over the circle, each cell one plant somewhere in its middle eight tenths: as dense as asked, and none in another.
std::vector<Vec2> scattered(const PlantsSettings& s, std::uint64_t seed) {
  std::vector<Vec2> all;
  const Real cell = 1 / std::sqrt(s.density);
  const auto n = static_cast<std::int64_t>(std::ceil(s.radius / cell));
  for (std::int64_t i = -n; i < n; ++i)
    for (std::int64_t j = -n; j < n; ++j) {
      const auto id = static_cast<std::uint64_t>((i + n) * 2 * n + (j + n));
      const Vec2 p = cell * Vec2(static_cast<Real>(i) + 0.1 + 0.8 * random_uniform(seed, kPlaceStream, 2 * id), static_cast<Real>(j) + 0.1 + 0.8 * random_uniform(seed, kPlaceStream, 2 * id + 1));
      if (p.norm() <= s.radius) all.push_back(s.at + p);
    }
  return all;
}

/// Plants of the table, each as high as its variant is; faults: what does not fit.
struct Grown {
  std::vector<Plant> variants;
  std::vector<Standing> standing;
  std::size_t beside = 0, steep = 0;  // places left out: no ground; too steep
};

std::optional<Grown> grow_all(const PlantsSettings& s, const World& world, std::vector<Fault>& faults) {
  Grown grown;
  const std::uint64_t seed = world.seed + 1000003 * s.seed;
  try {
    for (int k = 0; k < s.variants; ++k) {
      grown.variants.push_back(geometry::grow(geometry::derive(s.system, s.generations, seed + static_cast<std::uint64_t>(k), kMostModules), s.turtle));
      if (!(grown.variants.back().height() > 0)) throw InputError(s.place, fmt::format("plants '{}': the word after {} generations has no limb that goes up; more generations, or another axiom, would do", s.name, s.generations));
    }
  } catch (const InputError& error) {
    for (const Fault& fault : error.faults()) faults.push_back({s.place, fault.place.file.empty() || fault.place.line == 0 ? fault.message : to_string(fault)});
    return std::nullopt;
  }
  const Vec2 origin = world.terrain->georeference().origin.head<2>();
  const std::vector<Vec2> places = s.places.empty() ? scattered(s, seed) : s.places;
  for (std::size_t k = 0; k < places.size(); ++k) {
    const Vec2 p = places[k] - origin;
    const std::optional<Real> z = world.terrain->height(p.x(), p.y());
    if (!z) {
      ++grown.beside;
      if (!s.places.empty()) faults.push_back({s.place, fmt::format("plants '{}': there is no ground at {:.10g}, {:.10g}", s.name, places[k].x(), places[k].y())});
      continue;
    }
    const geometry::Contact ground = world.terrain->contact(Vec3(p.x(), p.y(), *z));
    if (s.places.empty() && ground.any() && ground.normal.z() < std::cos(s.slope)) {
      ++grown.steep;
      continue;
    }
    Standing one;
    one.variant = static_cast<std::uint32_t>(random_bits(seed, kKindStream, k) % static_cast<std::uint64_t>(s.variants));
    one.foot = Vec3(p.x(), p.y(), *z);
    one.turn = 2 * kPi * random_uniform(seed, kSizeStream, 2 * k);
    one.scale = s.height * (1 + s.spread * (2 * random_uniform(seed, kSizeStream, 2 * k + 1) - 1)) / grown.variants[one.variant].height();
    grown.standing.push_back(one);
  }
  if (grown.standing.empty() && faults.empty())
    faults.push_back({s.place, fmt::format("plants '{}': not one stands: {} of {} places have no ground, {} are steeper than slope_limit", s.name, grown.beside, places.size(), grown.steep)});
  if (!faults.empty()) return std::nullopt;
  return grown;
}

class PlantsEffect final : public Effect {
 public:
  PlantsEffect(const PlantsSettings& settings, Grown grown)
      : settings_(settings), grown_(std::move(grown)), fire_(feet(grown_), heights(grown_), radii(grown_), settings.fuel) {}

  std::string_view name() const override { return settings_.name; }
  Real time() const override { return time_; }

  void meet(const std::vector<Effect*>& others) override {
    for (const Effect* other : others)
      if (other->spacing() > 0) lava_ = other;
  }

  void step(Real t_end) override {
    ZONE("plants.step");
    const Real left = t_end - time_;
    if (!settings_.burns || (!lava_ && !alight_)) {
      time_ = t_end;  // where it sways to is a function of time
      return;
    }
    const Real count = std::max(1.0, std::ceil(left / PlantFire::kStep * (1 - 1e-9))), dt = left / count;
    std::vector<plants::HotPatch> patches;
    if (lava_) {
      const geometry::Points points = lava_->points();
      if (points.temperature.size() == points.size() && points.size() > 0) patches = plants::hot_patches(points.position, points.temperature, points.surface, lava_->spacing(), kPatch * lava_->spacing(), kColdest);
    }
    alight_ = fire_.step(dt, patches);
    time_ = count > 1 ? time_ + dt : t_end;
    if (alight_) changed_ = time_;
    note_fires();
  }

  geometry::Points fires() const override {
    geometry::Points p;
    p.position = fire_at_;
    p.radius = fire_size_;
    p.temperature = fire_temperature_;
    p.velocity = fire_velocity_;
    return p;
  }

  std::vector<NamedMesh> meshes() const override {
    ZONE("plants.mesh");
    const std::size_t n = grown_.standing.size();
    std::vector<TriMesh> each(n), tongues(settings_.flames ? n : 0);
    parallel_for(n, [&](std::size_t p) {
      const Standing& one = grown_.standing[p];
      each[p] = plants::look_of(grown_.variants[one.variant], one, settings_.sway, settings_.sides, fire_, p, time_, settings_.fuel.air, settings_.fuel.ignition);
      if (settings_.flames) tongues[p] = plants::flames_of(grown_.variants[one.variant], one, fire_, p, time_);
    }, 1);
    // Without wind they are what they were, unless they burn.
    const Real since = settings_.sway.wind.norm() > 0 ? -1 : changed_;
    std::vector<NamedMesh> all;
    all.push_back({settings_.name, joined(each), since});
    if (settings_.flames && settings_.burns) all.push_back({settings_.name + "-flames", joined(tongues), changed_});
    return all;
  }

  std::size_t memory() const override {
    std::size_t bytes = fire_.memory() + grown_.standing.capacity() * sizeof(Standing) + fire_at_.capacity() * 64;
    for (const Plant& plant : grown_.variants) bytes += plant.limbs.capacity() * sizeof(geometry::Limb) + plant.leaves.capacity() * sizeof(geometry::Leaf);
    return bytes;
  }
  void add_to(StateHash& hash) const override {
    hash.add(time_);
    hash.add(changed_);
    fire_.add_to(hash);
  }
  void save(StateWriter& out) const override {
    out.value("time", time_);
    out.value("changed", changed_);
    out.value("alight", static_cast<std::uint8_t>(alight_));
    fire_.save(out);
  }
  void load(StateReader& in) override {
    std::uint8_t alight = 0;
    in.value("time", time_);
    in.value("changed", changed_);
    in.value("alight", alight);
    alight_ = alight != 0;
    fire_.load(in);
    note_fires();
  }
  std::vector<std::pair<std::string, double>> figures() const override {
    return {{"plants", static_cast<double>(grown_.standing.size())},
            {"limbs", limbs()},
            {"places_without_ground", static_cast<double>(grown_.beside)},
            {"places_too_steep", static_cast<double>(grown_.steep)},
            {"burning", static_cast<double>(fire_.burning())},
            {"burnt_down", static_cast<double>(fire_.burnt_down())}};
  }
  std::string status() const override {
    const std::size_t burning = fire_.burning(), down = fire_.burnt_down();
    return fmt::format("{} plants{}{}", grown_.standing.size(), burning > 0 ? fmt::format(", {} burning", burning) : "", down > 0 ? fmt::format(", {} burnt", down) : "");
  }

 private:
  static std::vector<Vec3> feet(const Grown& g) {
    std::vector<Vec3> all;
    for (const Standing& one : g.standing) all.push_back(one.foot);
    return all;
  }
  static std::vector<Real> heights(const Grown& g) {
    std::vector<Real> all;
    for (const Standing& one : g.standing) all.push_back(one.scale * g.variants[one.variant].height());
    return all;
  }
  static std::vector<Real> radii(const Grown& g) {
    std::vector<Real> widest;
    for (const Plant& plant : g.variants) {
      Real r = 0.02;
      for (const geometry::Limb& limb : plant.limbs) r = std::max(r, limb.to.head<2>().norm());
      widest.push_back(r);
    }
    std::vector<Real> all;
    for (const Standing& one : g.standing) all.push_back(one.scale * widest[one.variant]);
    return all;
  }
  static TriMesh joined(std::vector<TriMesh>& parts) {
    TriMesh all;
    std::size_t vertices = 0, triangles = 0;
    for (const TriMesh& part : parts) vertices += part.positions.size(), triangles += part.triangles.size();
    all.positions.reserve(vertices);
    all.triangles.reserve(triangles);
    geometry::VertexAttribute color, glow;
    color.width = glow.width = 3;
    const bool normals = std::all_of(parts.begin(), parts.end(), [](const TriMesh& part) { return part.normals.size() == part.positions.size(); });
    for (TriMesh& part : parts) {
      const auto first = static_cast<Index>(all.positions.size());
      all.positions.insert(all.positions.end(), part.positions.begin(), part.positions.end());
      if (normals) all.normals.insert(all.normals.end(), part.normals.begin(), part.normals.end());
      for (const geometry::Triangle& t : part.triangles) all.triangles.push_back({first + t[0], first + t[1], first + t[2]});
      for (const auto& [into, from] : {std::pair{&color, "color"}, {&glow, "glow"}}) {
        const std::vector<float>& values = part.attributes[from].values;
        into->values.insert(into->values.end(), values.begin(), values.end());
      }
      part = {};
    }
    all.attributes["color"] = std::move(color);
    all.attributes["glow"] = std::move(glow);
    return all;
  }
  double limbs() const {
    double sum = 0;
    for (const Standing& one : grown_.standing) sum += static_cast<double>(grown_.variants[one.variant].limbs.size());
    return sum;
  }
  void note_fires() {
    fire_at_.clear(), fire_size_.clear(), fire_temperature_.clear(), fire_velocity_.clear();
    for (std::size_t p = 0; p < fire_.size(); ++p)
      for (int band = 0; band < PlantFire::kBands; ++band) {
        const Real flame = fire_.flame(p, band), half = fire_.height(p) / PlantFire::kBands * flame;
        if (half <= 0) continue;
        fire_at_.push_back(fire_.middle(p, band) + Vec3(0, 0, half / 2));
        fire_size_.push_back(half);
        fire_temperature_.push_back(kFlameHot);
        fire_velocity_.push_back(Vec3(0, 0, std::sqrt(2 * kGravity * half)));  // free rise of what is far lighter than air, about
      }
  }

  PlantsSettings settings_;
  Grown grown_;
  PlantFire fire_;
  const Effect* lava_ = nullptr;
  Real time_ = 0, changed_ = 0;
  bool alight_ = false;
  std::vector<Vec3> fire_at_, fire_velocity_;
  std::vector<Real> fire_size_, fire_temperature_;
};

PlantsSettings read(Parameters& p) {
  PlantsSettings s;
  s.place = p.place("");
  const auto positive = Parameters::positive(), not_negative = Parameters::not_negative();
  s.name = read_effect_name(p, "plants");
  std::vector<std::string> kinds;
  for (const geometry::PlantKind& kind : geometry::plant_kinds()) kinds.push_back(kind.name);
  kinds.push_back("own");
  const std::size_t kind = p.choice("kind", kinds, 0, "of plant; own: by the L-system that axiom and rules say");
  if (kind + 1 < kinds.size()) {
    const geometry::PlantKind& known = geometry::plant_kinds()[kind];
    s.system = known.system;
    s.turtle = known.turtle;
    s.generations = known.generations;
  } else {
    s.system.axiom = p.text("axiom", std::nullopt, "the word it begins with: letters with numbers, brackets for branches; F limb, ~ leaf, + - & ^ \\ / turns in degrees, ! thickness");
    for (Parameters& rule : p.tables("rule", "what a letter becomes in a generation")) {
      geometry::LRule r;
      r.from = rule.text("from", std::nullopt, "the letter, with names for its numbers: A(l, w)");
      r.to = rule.text("to", std::nullopt, "what it becomes: F(l)[+(30)A(l*0.7, w/2)]");
      r.when = rule.text("when", "", "only where this holds: l > 0.1");
      r.weight = rule.number("weight", "", 1, positive, "among rules of one letter: how often");
      s.system.rules.push_back(std::move(r));
    }
    s.turtle.step = p.number("limb", "m", 0.1, positive, "length of F without a number, before it is scaled to height");
    s.turtle.angle = p.number("angle", "rad", s.turtle.angle, {-kPi, kPi}, "of turns without a number");
    s.turtle.thickness = p.number("thickness", "m", 0.05, positive, "of the stem, before it is scaled to height");
    s.turtle.thinning = p.number("thinning", "", s.turtle.thinning, {0, 1, true}, "of a branch against what it grows from");
    s.turtle.leaf = p.number("leaf", "m", 0.05, positive, "length of ~ without a number, before it is scaled to height");
  }
  s.generations = static_cast<int>(p.integer("generations", s.generations, 0, 40, "of the L-system: fewer are coarser and cheaper"));
  s.variants = static_cast<int>(p.integer("variants", s.variants, 1, 100, "plants that are grown; all others are these again, scaled and turned"));
  s.sides = static_cast<int>(p.integer("sides", s.sides, 3, 16, "of a limb"));
  s.seed = static_cast<std::uint64_t>(p.integer("seed", 0, 0, 1000000, "other plants, other places"));
  s.height = p.number("height", "m", std::nullopt, positive, "");
  s.spread = p.number("height_spread", "", s.spread, {0, 0.9}, "share by which they are higher or lower");
  for (const std::vector<Real>& at : p.number_lists("places", "m", 2, false, "[x, y] in the terrain's map coordinates, one a plant; or at, radius and density")) s.places.push_back(Vec2(at[0], at[1]));
  if (s.places.empty()) {
    const std::vector<Real> at = p.numbers("at", "m", 2, true, "x, y in the terrain's map coordinates: middle of the circle they are scattered in");
    if (at.size() == 2) s.at = Vec2(at[0], at[1]);
    s.radius = p.number("radius", "m", std::nullopt, positive, "of the circle");
    s.density = p.number("density", "1/m2", std::nullopt, positive, "plants on a square metre of the map");
    s.slope = p.number("slope_limit", "rad", 40 * kPi / 180, {0, kPi / 2}, "where the ground is steeper none stands");
    const Real count = s.density * kPi * s.radius * s.radius;
    if (count > kMostPlants) p.fault("density", fmt::format("makes {:.3g} plants, {:g} are the most", count, kMostPlants));
  }
  const std::vector<Real> wind = p.numbers("wind", "m/s", 2, false, "towards east and north");
  if (wind.size() == 2) s.sway.wind = Vec2(wind[0], wind[1]);
  s.sway.gust = p.number("gust", "", s.sway.gust, {0, 10}, "share of the wind that comes and goes");
  s.sway.period = p.number("gust_period", "s", s.sway.period, positive, "");
  s.sway.flexibility = p.number("flexibility", "", 1e-3, not_negative, "rad that the wind of 1 m/s bends a limb of 1 m and 1 m thick: a share of it the shorter and the more the thinner it is");
  s.burns = p.flag("burns", s.burns, "near lava; false: it never does");
  if (s.burns) {
    plants::Fuel& f = s.fuel;
    f.ignition = p.number("ignition", "K", f.ignition, {320, 2000}, "of leaves, by a flame or lava near");
    f.moisture = p.number("moisture", "", f.moisture, {0, 3}, "mass of water by that of dry leaves: hay 0.1, green 1");
    f.thickness = p.number("leaf_thickness", "m", f.thickness, {1e-5, 0.1}, "of what catches fire; leaf's mass by its area is 600 kg/m3 times this");
    f.burn_time = p.number("burn_time", "s", f.burn_time, positive, "from ignition till an eighth of the height has burnt");
    s.flames = p.flag("flames", s.flames, "drawn and written as a mesh of tongues (frames/NAME-flames.####.ply)");
  }
  return s;
}

}  // namespace

EffectPlan read_plants(Parameters& parameters, Real duration) {
  const PlantsSettings settings = read(parameters);
  EffectPlan plan;
  plan.name = settings.name;
  const Real count = settings.places.empty() ? std::min(kMostPlants, settings.density * kPi * settings.radius * settings.radius) : static_cast<Real>(settings.places.size());
  // Of a grown plant's 60 bytes a limb, a few thousand limbs; of each that stands its bands; and for a frame its mesh, 200 bytes a vertex.
  constexpr Real kLimbs = 1000, kVertices = 4000;
  plan.estimate.bytes = static_cast<Real>(settings.variants) * kLimbs * 150 + count * (300 + kVertices * 200);
  plan.estimate.steps = std::ceil(duration * 24);
  plan.estimate.seconds = plan.estimate.steps * count * kVertices * 0.6e-6;
  plan.misfits = [settings](const World& world) {
    std::vector<Fault> faults;
    grow_all(settings, world, faults);
    return faults;
  };
  plan.build = [settings](const World& world) -> std::unique_ptr<Effect> {
    std::vector<Fault> faults;
    std::optional<Grown> grown = grow_all(settings, world, faults);
    if (!grown) throw InputError(faults);
    return std::make_unique<PlantsEffect>(settings, std::move(*grown));
  };
  return plan;
}

}  // namespace effuse::flow
