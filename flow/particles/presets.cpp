#include "flow/particles/presets.h"

namespace effuse::flow::particles {

namespace {

struct Seen {
  bool volume, glows;
  Vec3 color;
  Real opacity;
};

Preset make(std::string name, std::string what, Forces forces, EmitterOptions emitter, const Seen& seen) {
  Preset p;
  p.volume = seen.volume;
  p.glows = seen.glows;
  p.color = seen.color;
  p.opacity = seen.opacity;
  p.name = std::move(name);
  p.what = std::move(what);
  p.cloud.forces = std::move(forces);
  p.emitter = std::move(emitter);
  return p;
}

std::vector<Preset> make_presets() {
  std::vector<Preset> all;
  Forces f;
  EmitterOptions e;

  f = {};
  f.response = 0.1;  // 1 m/s over g
  f.turbulence = 0.4;
  f.eddy_size = 3;
  e = {};
  e.speed = 0;
  e.size = 0.003;
  e.size_spread = 0.3;
  e.temperature = 270;
  all.push_back(make("snow", "flakes that drift and lie where they land", f, e, {false, false, Vec3(0.95, 0.96, 0.98), 1}));
  all.back().cloud.on_contact = OnContact::kStick;

  f = {};
  f.response = 0.003;  // 30 um: 0.03 m/s
  f.turbulence = 0.5;
  f.eddy_size = 2;
  e = {};
  e.speed = 0.5;
  e.spread = kPi / 2;
  e.lifetime = 20;
  e.lifetime_spread = 0.3;
  e.size = 0.05;
  e.size_spread = 0.3;
  all.push_back(make("dust", "hangs in the air and goes with it", f, e, {true, false, Vec3(0.62, 0.54, 0.44), 0.12}));
  all.back().cloud.growth = 0.1;

  f = {};
  f.response = 0.4;  // half a millimetre: 4 m/s
  e = {};
  e.speed = 2;
  e.spread = 0.2;
  e.size = 0.0005;
  e.size_spread = 0.2;
  all.push_back(make("sand", "grains that fall, bounce little and come to rest", f, e, {false, false, Vec3(0.80, 0.68, 0.46), 1}));
  all.back().cloud.restitution = 0.1;
  all.back().cloud.friction = 0.6;

  f = {};
  f.response = 1.5;
  e = {};
  e.speed = 12;
  e.speed_spread = 0.4;
  e.spread = 0.5;
  e.lifetime = 3;
  e.lifetime_spread = 0.4;
  e.size = 0.02;
  e.size_spread = 0.4;
  e.temperature = 1350;
  e.temperature_spread = 0.03;
  all.push_back(make("sparks", "glowing clots thrown from a vent, cooling as they fly", f, e, {false, true, Vec3(0.2, 0.17, 0.15), 1}));
  all.back().cloud.cooling = 4;

  f = {};
  f.response = 0.1;
  f.buoyancy = 3;  // rises at 2 m/s
  f.turbulence = 1;
  f.eddy_size = 0.6;
  e = {};
  e.speed = 0.5;
  e.spread = 0.5;
  e.lifetime = 1.4;
  e.lifetime_spread = 0.3;
  e.size = 0.12;
  e.size_spread = 0.3;
  e.temperature = 1500;
  all.push_back(make("fire", "tongues that rise, cool and go out", f, e, {true, true, Vec3(0.1, 0.1, 0.1), 0.22}));
  all.back().cloud.cooling = 1.8;

  f = {};
  f.response = 0.3;
  f.buoyancy = 1.4;  // rises at 1.2 m/s
  f.turbulence = 0.8;
  f.eddy_size = 2;
  e = {};
  e.speed = 0.5;
  e.spread = 0.4;
  e.lifetime = 15;
  e.lifetime_spread = 0.3;
  e.size = 0.3;
  e.size_spread = 0.3;
  e.temperature = 500;
  all.push_back(make("smoke", "rises, spreads and thins", f, e, {true, false, Vec3(0.33, 0.31, 0.3), 0.35}));
  all.back().cloud.growth = 0.3;
  all.back().cloud.cooling = 3;

  f = {};
  f.response = 0.15;
  f.buoyancy = 2;
  f.turbulence = 1;
  f.eddy_size = 1.5;
  e = {};
  e.speed = 1.5;
  e.spread = 0.6;
  e.lifetime = 4;
  e.lifetime_spread = 0.4;
  e.size = 0.2;
  e.size_spread = 0.3;
  e.temperature = 373;
  all.push_back(make("steam", "white puffs where lava meets water, soon gone", f, e, {true, false, Vec3(0.95, 0.96, 0.97), 0.3}));
  all.back().cloud.growth = 0.6;
  all.back().cloud.cooling = 2;
  return all;
}

}  // namespace

const std::vector<Preset>& presets() {
  static const std::vector<Preset> all = make_presets();
  return all;
}

}  // namespace effuse::flow::particles
