#include "flow/effects/particles_table.h"

#include <fmt/format.h>

#include <algorithm>
#include <limits>

#include "flow/effects/effect_table.h"
#include "flow/particles/presets.h"

namespace effuse::flow {

using particles::EmitterOptions;
using particles::EmitterShape;
using particles::OnContact;
using particles::Preset;

namespace {

constexpr std::size_t kMostEmitters = 30;  // their number stands in the upper bits of an id, which files hold to 2^53
constexpr Parameters::Range kShare = {0, 1};
constexpr Parameters::Range kTemperature = {0, 1e5, true};
constexpr Parameters::Range kDeviation = {0, 1};

/// What all births of an emitter have, whatever they come from.
void read_births(Parameters& p, EmitterOptions& o) {
  o.rate = p.number("rate", "1/s", std::nullopt, {0, 1e8}, "of births");
  o.start = p.number("start", "s", 0, Parameters::not_negative(), "of births; at 0 they begin with the warm-up");
  o.stop = p.number("stop", "s", o.stop, Parameters::not_negative(), "of births");
  if (!(o.stop > o.start)) p.fault("stop", fmt::format("{:g} s is not after start, {:g} s", o.stop, o.start));
  o.direction = read_vector(p, "direction", "", o.direction, "they leave in; off a mesh: as if its triangles lay level, facing up");
  if (!(o.direction.norm() > 0)) {
    p.fault("direction", "has no length");
    o.direction = Vec3::UnitZ();
  }
  o.spread = p.number("spread", "rad", o.spread, {0, kPi}, "half the angle of the cone about it that they leave in");
  o.speed = p.number("speed", "m/s", o.speed, Parameters::not_negative(), "they leave with");
  o.speed_spread = p.number("speed_spread", "", o.speed_spread, kDeviation, "its relative deviation");
  o.carried = read_vector(p, "velocity", "m/s", o.carried, "of the emitter, added to theirs");
  o.lifetime = p.number("lifetime", "s", o.lifetime, Parameters::positive(), "then they are gone");
  o.lifetime_spread = p.number("lifetime_spread", "", o.lifetime_spread, kDeviation, "its relative deviation");
  o.size = p.number("size", "m", o.size, Parameters::positive(), "radius as they are born");
  o.size_spread = p.number("size_spread", "", o.size_spread, kDeviation, "its relative deviation");
  o.temperature = p.number("temperature", "K", o.temperature, kTemperature, "as they are born");
  o.temperature_spread = p.number("temperature_spread", "", o.temperature_spread, kDeviation, "its relative deviation");
}

PlannedEmitter read_emitter(Parameters& p, const EmitterOptions& usual, std::vector<Partner>& partners) {
  using Source = ParticleSource;
  PlannedEmitter e;
  e.options = usual;
  e.place = p.place("");
  e.from = static_cast<Source>(p.choice("from", {"point", "disk", "mesh", "curve", "lava", "vent", "water"}, 0,
                                        "a point, a disk, a mesh's surface, a line; the lava's surface, its vents; water where lava meets it"));
  EmitterOptions& o = e.options;
  switch (e.from) {
    case Source::kPoint:
    case Source::kDisk: {
      o.shape = e.from == Source::kPoint ? EmitterShape::kPoint : EmitterShape::kDisk;
      const std::vector<Real> at = p.numbers("at", "m", 3, true, "x, y in the terrain's map coordinates, and z");
      if (at.size() == 3) o.at = Vec3(at[0], at[1], at[2]);
      if (e.from == Source::kDisk) o.radius = p.number("radius", "m", std::nullopt, Parameters::positive(), "of the disk, which lies across direction");
      break;
    }
    case Source::kMesh:
      o.shape = EmitterShape::kMesh;
      read_form(p, "mesh to be born on, relative to the scene file", e.form);
      e.pose = read_pose(p, true, {});
      break;
    case Source::kCurve:
      o.shape = EmitterShape::kCurve;
      for (const std::vector<Real>& v : p.number_lists("line", "m", 3, true, "[x, y, z] of its corners, two at least")) o.curve.push_back(Vec3(v[0], v[1], v[2]));
      if (p.has("line") && o.curve.size() < 2) p.fault("line", "has fewer than two corners");
      break;
    case Source::kVent: o.shape = EmitterShape::kDisk; break;
    case Source::kLava:
    case Source::kWater:
      o.shape = EmitterShape::kPoints;
      e.hotter_than = p.number("hotter_than", "K", e.from == Source::kWater ? 473.15 : 900, kTemperature, "only where lava's surface is");
      e.full_area = p.number("full_area", "m2", 0, Parameters::not_negative(), "of such lava that has the whole rate, less of it less; 0: any has");
      if (e.from == Source::kWater) {
        e.water = p.text("water", "", "name of a [[waves]] or [ocean]; none: any");
        e.deepest = p.number("deepest", "m", 3, Parameters::positive(), "lava deeper than this sends none up");
      }
      break;
  }
  if (e.from <= Source::kCurve) e.on_ground = p.flag("on_ground", false, "heights count from the terrain under them");
  const std::string path = p.path() + ".";
  if (e.from >= Source::kLava)
    partners.push_back({p.place("from"), path + "from", "", {"lava"}, e.from == Source::kVent ? "they come out of lava's vents" : e.from == Source::kLava ? "they come off lava" : "they come where lava meets water"});
  if (e.from == Source::kWater) partners.push_back({p.place(e.water.empty() ? "from" : "water"), path + (e.water.empty() ? "from" : "water"), e.water, {"waves", "ocean"}, "they come where lava meets water"});
  read_births(p, o);
  return e;
}

}  // namespace

ParticlesSettings read_particles_table(Parameters& p) {
  ParticlesSettings s;
  std::vector<std::string> names = {"none"};
  for (const Preset& each : particles::presets()) names.push_back(each.name);
  const std::size_t chosen = p.choice("preset", names, 0, "a kind of particles: the defaults of all else");
  const Preset preset = chosen > 0 ? particles::presets()[chosen - 1] : Preset{};
  s.name = read_effect_name(p, chosen > 0 ? preset.name : "particles");
  s.cloud = preset.cloud;

  particles::Forces& f = s.cloud.forces;
  f.gravity = p.number("gravity", "m/s2", f.gravity, {}, "down");
  f.buoyancy = p.number("buoyancy", "", f.buoyancy, {}, "share of their weight that the air carries: 2 rises as fast as 0 falls");
  f.response = p.number("response", "s", f.response, Parameters::not_negative(), "in which they take on the air's speed; 0: they feel no air");
  f.wind = read_vector(p, "wind", "m/s", f.wind, "");
  f.turbulence = p.number("turbulence", "m/s", f.turbulence, Parameters::not_negative(), "of eddies in the air");
  f.eddy_size = p.number("eddy_size", "m", f.eddy_size, Parameters::positive(), "of those");
  if (f.response == 0 && (p.has("wind") || p.has("turbulence"))) p.fault("response", "is 0: they feel no air, so wind and turbulence would do nothing");
  for (Parameters& a : p.tables("attractor", "pulls by strength / distance^2")) {
    particles::Attractor pull;
    const std::vector<Real> at = a.numbers("at", "m", 3, true, "x, y, z in the terrain's map coordinates");
    if (at.size() == 3) pull.at = Vec3(at[0], at[1], at[2]);
    pull.strength = a.number("strength", "m3/s2", std::nullopt, {}, "below 0 it pushes");
    pull.softening = a.number("softening", "m", pull.softening, Parameters::positive(), "nearer than this it pulls no harder");
    f.attractors.push_back(pull);
  }
  s.meets = p.flag("meets_ground", true, "and obstacles");
  s.cloud.on_contact = static_cast<OnContact>(p.choice("on_contact", {"bounce", "stick", "die"}, static_cast<std::size_t>(s.cloud.on_contact), "with ground and obstacles"));
  s.cloud.restitution = p.number("restitution", "", s.cloud.restitution, kShare, "of the approaching speed that a bounce gives back");
  s.cloud.friction = p.number("friction", "", s.cloud.friction, Parameters::not_negative(), "Coulomb's number of a bounce");
  s.cloud.growth = p.number("growth", "1/s", s.cloud.growth, Parameters::not_negative(), "of the radius, in radii at birth");
  s.cloud.cooling = p.number("cooling", "s", s.cloud.cooling, Parameters::not_negative(), "in which their excess of temperature falls to 1/e; 0: they stay as hot");
  s.cloud.air_temperature = p.number("air_temperature", "K", s.cloud.air_temperature, kTemperature, "");
  if (const std::vector<Real> room = p.numbers("room", "m", 6, false, "[x, y, z, x, y, z], low and high corner in map coordinates: who leaves it is gone; none: the terrain and as much again"); room.size() == 6) {
    s.cloud.room = Box3(Vec3(room[0], room[1], room[2]), Vec3(room[3], room[4], room[5]));
    if (!((s.cloud.room->max() - s.cloud.room->min()).minCoeff() > 0)) p.fault("room", "must have its high corner above the low one along x, y and z");
  }
  s.step = p.number("step", "s", 1. / 48, Parameters::positive(), "at most");
  s.warm_up = p.number("warm_up", "s", 0, {0, 1e4}, "they have been coming for so long as the film begins");
  s.seed = static_cast<std::uint64_t>(p.integer("seed", 0, 0, std::numeric_limits<std::int64_t>::max(), "beside the scene's"));

  // As NamedCloud::Look has them, and flames beside clots.
  const std::size_t look = p.choice("look", {"grains", "sparks", "puffs", "flames"}, preset.glows ? (preset.volume ? 3 : 1) : preset.volume ? 2 : 0, "in pictures: opaque specks, glowing ones, soft balls that hide what is behind, or whose light adds up");
  using Look = NamedCloud::Look;
  s.look = look == 0 ? Look::kGrains : look == 2 ? Look::kPuffs : Look::kGlow;
  s.soft = look == 3;
  s.color = read_color(p, preset.color);
  s.opacity = p.number("opacity", "", preset.opacity, kShare, "through the middle of one as it is born");
  s.fade_in = p.number("fade_in", "", preset.volume ? 0.1 : 0, kShare, "share of its life in which one appears");
  s.fade_out = p.number("fade_out", "", preset.volume ? 0.6 : preset.glows ? 0.2 : 0, kShare, "share of its life in which one vanishes");
  s.points = s.spheres = s.volume = false;
  for (const std::size_t kind : p.choices("files", {"points", "spheres", "volume"}, preset.volume ? std::vector<std::size_t>{0, 2} : std::vector<std::size_t>{0}, "NAME.####.ply of points or of small spheres, NAME.####.vdb of density"))
    (kind == 0 ? s.points : kind == 1 ? s.spheres : s.volume) = true;
  if (s.points && s.spheres) p.fault("files", "has points and spheres, which would be one file: wanted one of them");
  s.voxel = p.number("voxel", "m", 0, Parameters::not_negative(), "of the volume; 0: half the mean radius");

  std::vector<Parameters> tables = p.tables("emitter", "lets them out");
  if (tables.empty()) p.fault("emitter", "is missing: [[particles.emitter]] says where they come from");
  if (tables.size() > kMostEmitters) p.fault("emitter", fmt::format("{} of them, wanted at most {}", tables.size(), kMostEmitters));
  for (Parameters& table : tables) s.emitters.push_back(read_emitter(table, preset.emitter, s.partners));
  return s;
}

}  // namespace effuse::flow
