#include "flow/effects/elastic_effect.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <optional>

#include "flow/effects/effect_table.h"
#include "flow/effects/elastic_shape.h"
#include "flow/effects/met_things.h"
#include "flow/effects/pins.h"
#include "flow/scene/placing.h"
#include "geometry/base/error.h"
#include "geometry/base/parallel.h"
#include "geometry/base/zones.h"
#include "geometry/mesh/measure.h"

namespace effuse::flow {

namespace {

using fem::ElasticSolid;

constexpr Real kStep = 1. / 240;  // [s]: longer ones are stable, and dull
constexpr int kHalvings = 8;      // of a step that went bad

/// The table, read.
struct ElasticSettings {
  PlannedForm form;
  Real spacing = 0;
  fem::ElasticMaterial material;
  geometry::RigidPose pose;
  bool on_ground = true;
  Vec3 velocity = Vec3::Zero(), spin = Vec3::Zero(), gravity = Vec3(0, 0, -kGravity);
  std::vector<Pin> pins;
  std::string pinned_to;
  bool meets = true, meets_lava = true;
  Real lava_friction = 1, temperature = 0;
  Material heat;
  PenaltyResponse response;
  Real thickness = 0, step = kStep;
};

class ElasticEffect final : public Effect, private Deformable {
 public:
  ElasticEffect(const ElasticSettings& settings, const World& world, ElasticShape shape)
      : settings_(settings), terrain_(world.terrain), shape_(std::move(shape)), solid_(shape_.tets, shape_.material), things_(settings.meets ? world : World{}) {
    for (const auto& each : world.obstacles ? *world.obstacles : std::vector<PlacedObstacle>())
      if (each.name == settings.pinned_to) driver_ = each.track;
    solid_.gravity = settings.gravity;
    solid_.response = settings.response;
    const Vec3 middle = settings.pose.position;
    for (std::size_t i = 0; i < solid_.nodes(); ++i) {
      solid_.state().v[i] = settings.velocity + settings.spin.cross(solid_.state().x[i] - middle);
      if (is_pinned(settings.pins, solid_.state().x[i])) solid_.held()[i] = 1;
      if (solid_.held()[i]) solid_.state().v[i] = Vec3::Zero();
    }
    start_ = solid_.state().x;
    for (const Real m : solid_.mass()) mass_ += m;
  }

  std::string_view name() const override { return settings_.form.name; }
  void meet(const std::vector<Effect*>& others) override {
    if (settings_.meets) things_.meet(others);
  }
  Real time() const override { return time_; }

  /// By itself, or with the lava that presses on it.
  void step(Real t_end) override {
    if (leader_) leader_->step(t_end);
    else step_alone(t_end);
  }

  SoftSolid soft() override {
    if (!settings_.meets_lava) return {};
    find_surface();
    return {this, settings_.lava_friction, settings_.temperature, solid_.rest_volume(), settings_.heat, settings_.form.place};
  }
  void led_by(Effect& leader) override { leader_ = &leader; }

  std::vector<NamedMesh> meshes() const override {
    std::vector<NamedMesh> all;
    all.push_back({settings_.form.name, shape_.look(solid_, settings_.form.color)});
    return all;
  }

  std::size_t memory() const override { return solid_.memory() + shape_.memory() + 4 * solid_.nodes() * sizeof(Vec3) + surface_.point.capacity() * 16 + surface_.triangles.capacity() * 12; }
  void add_to(StateHash& hash) const override {
    hash.add(time_);
    if (!owed_.impulses().empty()) hash.add(std::span<const Vec3>(owed_.impulses()));
    solid_.add_to(hash);
  }
  void save(StateWriter& out) const override {
    out.value("time", time_);
    out.value("steps", steps_);
    out.value("retries", retries_);
    out.value("split", split_);
    out.value("unsolved", unsolved_);
    if (leader_) out.array("owed", owed_.impulses());
    things_.save(out);
    solid_.save(out);
  }
  void load(StateReader& in) override {
    in.value("time", time_);
    in.value("steps", steps_);
    in.value("retries", retries_);
    in.value("split", split_);
    in.value("unsolved", unsolved_);
    if (leader_) in.array("owed", owed_.impulses());
    things_.load(in);
    solid_.load_state(in);
    if (!owed_.impulses().empty() && owed_.impulses().size() != solid_.nodes()) throw InputError(Place{"checkpoint"}, fmt::format("elastic '{}': impulses on {} nodes, wanted {}", name(), owed_.impulses().size(), solid_.nodes()));
    if (settings_.material.strength > 0 && leader_) find_surface();
  }
  std::vector<std::pair<std::string, double>> figures() const override {
    Real kinetic = 0;
    for (std::size_t i = 0; i < solid_.nodes(); ++i) kinetic += solid_.mass()[i] * solid_.state().v[i].squaredNorm() / 2;
    return {{"nodes", static_cast<double>(solid_.nodes())},
            {"tetrahedra", static_cast<double>(solid_.tets().size())},
            {"mass_kg", mass_},
            {"pieces", static_cast<double>(pieces_of(solid_))},
            {"nodes_split", static_cast<double>(split_)},
            {"volume_change", solid_.volume() / solid_.rest_volume() - 1},
            {"steps", static_cast<double>(steps_)},
            {"retries", static_cast<double>(retries_)},
            {"unsolved_steps", static_cast<double>(unsolved_)},
            {"kinetic_energy_j", kinetic},
            {"elastic_energy_j", solid_.elastic_energy(solid_.state().x)}};
  }
  std::string status() const override {
    return fmt::format("{} tetrahedra{}, dt {:.3g} s", solid_.tets().size(), split_ > 0 ? fmt::format(" in {} pieces", pieces_of(solid_)) : "", settings_.step);
  }

 private:
  // As lava has it.
  std::span<const Vec3> places() const override { return solid_.state().x; }
  std::span<const Vec3> velocities() const override { return solid_.state().v; }
  std::span<const Real> masses() const override { return solid_.mass(); }
  std::span<const std::uint8_t> held() const override { return solid_.held(); }
  const HungSurface& surface() const override { return surface_; }
  std::uint64_t surface_version() const override { return surface_version_; }
  void predict(Real dt, std::vector<Vec3>& velocity, BlockMatrix& answer) override {
    prepare(dt);
    solid_.load = owed_.as_forces(dt);
    solid_.predict(dt, velocity, answer);
    solid_.load.clear();
  }
  void go(Real to, std::span<const Vec3> forces) override {
    solid_.load = owed_.as_forces(to - time_, forces);
    owed_.clear();
    while (time_ < to) step_alone(to);
    solid_.load.clear();
    if (settings_.material.strength > 0) find_surface();
  }
  void push(Index node, const Vec3& impulse) override {
    if (!solid_.held()[node]) owed_.add(node, impulse, solid_.nodes());
  }

  /// What lava meets: the mesh that shows it, or what its tetrahedra show. Of a brittle one faces come, and where a crack has just begun two
  /// nodes are at one place: anew each time.
  void find_surface() {
    std::vector<Index> first = {0}, point;
    std::vector<Real> weight;
    std::vector<Vec3> places = solid_.state().x;
    std::vector<geometry::Triangle> triangles = shape_.surface.triangles;
    if (shape_.surface.positions.empty()) {
      triangles = solid_.surface().triangles;
      for (Index i = 0; i < places.size(); ++i) {
        point.push_back(i);
        first.push_back(static_cast<Index>(point.size()));
      }
      weight.assign(point.size(), 1);
    } else {
      places = shape_.surface.positions;
      for (std::size_t q = 0; q < places.size(); ++q) {
        for (std::size_t k = 0; k < 4; ++k) {
          point.push_back(solid_.tets()[shape_.tet_of[q]][k]);
          weight.push_back(shape_.weight[q][k]);
        }
        first.push_back(static_cast<Index>(point.size()));
      }
    }
    surface_ = hang(places, triangles, first, point, weight);
    ++surface_version_;
  }

  void step_alone(Real t_end) {
    ZONE("elastic.step");
    const Real left = t_end - time_, count = std::max(1.0, std::ceil(left / settings_.step * (1 - 1e-9)));
    Real dt = left / count;
    const fem::SolidState before = solid_.state();
    for (int halving = 0;; ++halving, dt /= 2) {
      if (advance(dt)) break;
      if (solid_.nodes() == before.x.size()) solid_.state() = before;
      if (halving == kHalvings || solid_.nodes() != before.x.size())
        throw UnstableError(fmt::format("elastic '{}' at {:.6g} s: the solve of a step does not end in numbers, even with steps of {:.3g} s; a shorter step, or a smaller contact_stiffness, would do", name(), time_, dt));
      ++retries_;
    }
    time_ = count > 1 || dt < left ? time_ + dt : t_end;
    ++steps_;
  }

  /// Before a step of dt: where held nodes go, and what the others may touch.
  void prepare(Real dt) {
    std::vector<Vec3>& v = solid_.state().v;
    const std::vector<Vec3>& x = solid_.state().x;
    if (driver_) {
      // Held points go where the obstacle carries them, straight within a step.
      const geometry::RigidPose home = driver_->at(0), to = driver_->at(time_ + dt);
      for (std::size_t i = 0; i < start_.size(); ++i)
        if (solid_.held()[i]) v[i] = (to.world(home.orientation.conjugate() * (start_[i] - home.position)) - x[i]) / dt;
    }
    if (settings_.meets) find_contacts(dt);
  }

  bool advance(Real dt) {
    prepare(dt);
    const std::vector<Vec3>&x = solid_.state().x, &v = solid_.state().v;
    const fem::StepReport report = solid_.step(dt);
    split_ += report.split;
    unsolved_ += report.converged ? 0 : 1;
    return parallel_reduce(
        solid_.nodes(), true, [&](std::size_t i) { return x[i].allFinite() && v[i].allFinite(); }, [](bool a, bool b) { return a && b; });
  }

  /// Planes of all that a point can reach in the step.
  void find_contacts(Real dt) {
    std::vector<PlaneContact>& contacts = solid_.contacts;
    const std::vector<Vec3>& x = solid_.state().x;
    contacts.clear();
    const Real fastest = parallel_max(x.size(), 0.0, [&](std::size_t i) { return solid_.state().v[i].norm(); });
    const Real reach = settings_.thickness + 2 * (fastest + settings_.gravity.norm() * dt) * dt + shape_.spacing / 2;
    things_.move(time_, dt);
    things_.add_planes(terrain_, x, reach, settings_.thickness, contacts);
  }

  ElasticSettings settings_;
  const geometry::Terrain* terrain_;
  ElasticShape shape_;
  ElasticSolid solid_;
  std::vector<Vec3> start_;
  MetThings things_;
  std::optional<geometry::PoseTrack> driver_;
  Effect* leader_ = nullptr;  // lava that steps this with itself
  HungSurface surface_;       // only where there is such
  OwedImpulses owed_;
  std::uint64_t surface_version_ = 0;
  Real time_ = 0, mass_ = 0;
  std::uint64_t steps_ = 0, retries_ = 0, split_ = 0, unsolved_ = 0;
};

ElasticSettings read(Parameters& p) {
  ElasticSettings s;
  read_form(p, "closed mesh, relative to the scene file", s.form);
  const std::string& name = s.form.name;
  check_effect_name(p, name);
  s.spacing = p.number("spacing", "m", std::nullopt, Parameters::positive(), "of its tetrahedra: the resolution");
  fem::ElasticMaterial& m = s.material;
  m.youngs_modulus = p.number("youngs_modulus", "Pa", std::nullopt, Parameters::positive(), "stiffness: jelly 10 kPa, rubber 5 MPa, wood 10 GPa, concrete 30 GPa");
  m.poisson_ratio = p.number("poisson_ratio", "", 0.3, {-0.9, 0.49}, "how much it bulges where it is pressed: cork 0, most 0.3, rubber 0.49 (linear elements stiffen towards 0.5)");
  m.density = p.number("density", "kg/m3", std::nullopt, Parameters::positive(), "");
  m.damping = p.number("damping", "s", 0.002, Parameters::not_negative(), "of its oscillations: an angular frequency w loses the share w damping of its amplitude in a radian, halved");
  m.strength = p.number("strength", "Pa", 0, Parameters::not_negative(), "tension at which it breaks; 0: never");
  s.pose = read_pose(p, false, {});
  s.on_ground = p.flag("on_ground", false, "its height counts from the terrain at x, y");
  s.velocity = read_vector(p, "velocity", "m/s", s.velocity, "at the start");
  s.spin = read_vector(p, "spin", "rad/s", s.spin, "at the start, about its position");
  s.pins = read_pins(p);
  s.pinned_to = p.text("pinned_to", "", "obstacle that carries the held points");
  s.gravity = read_vector(p, "gravity", "m/s2", s.gravity, "");
  s.meets = p.flag("meets_ground", true, "and obstacles; other solids that deform it does not meet");
  s.meets_lava = p.flag("meets_lava", true, "(modern lava): each pushes the other; false: neither knows of the other");
  s.lava_friction = p.number("lava_friction", "", s.lava_friction, {0, 1}, "of lava on it: 1 no slip, 0 free slip");
  s.temperature = p.number("temperature", "K", s.temperature, {0, 5000}, "of its surface; 0: the ground's");
  s.heat = read_material(p, m.density > 0 ? m.density : 1);
  const Real stiffness = 10 * m.youngs_modulus * s.spacing, mass = m.density * std::pow(s.spacing, 3) / 4;
  s.response.stiffness = p.number("contact_stiffness", "N/m", stiffness, Parameters::not_negative(), "of ground and obstacles, on each node; absent: ten times youngs_modulus times spacing");
  s.response.damping = p.number("contact_damping", "N s/m", 0.4 * std::sqrt(std::max(0.0, s.response.stiffness) * mass), Parameters::not_negative(), "of the same; absent: a fifth of what stops a node");
  s.response.friction = p.number("friction", "", 0.5, Parameters::not_negative(), "Coulomb's number of ground and obstacles");
  s.thickness = p.number("thickness", "m", 0, Parameters::not_negative(), "that it keeps from ground and obstacles");
  s.step = p.number("step", "s", s.step, {1e-7, 1}, "of the implicit solve: any is stable, long ones are dull");
  return s;
}

/// The shape of a table where it starts, or faults: what does not fit.
std::optional<ElasticShape> make_shape(const ElasticSettings& s, const World& world, std::vector<Fault>& faults) {
  const Place place = s.form.place;
  const std::string what = fmt::format("elastic '{}'", s.form.name);
  if (!has_shape(s.form)) return std::nullopt;  // told already
  try {
    ElasticShape shape;
    if (s.form.box.minCoeff() > 0) {
      shape = box_shape(s.form.box, s.spacing, s.material, s.pose, what);
    } else {
      const geometry::TriMesh mesh = s.form.file.empty() ? mesh_of(s.form) : upright(world.mesh(s.form), s.form.scale, s.form.y_up);
      shape = mesh_shape(mesh, s.spacing, s.material, s.pose, what);
    }
    const std::size_t before = faults.size();
    check_start(shape.tets.nodes, s.pins, s.meets ? world.terrain : nullptr, what, place, faults);
    check_driver(s.pinned_to, world, what, place, faults);
    if (faults.size() > before) return std::nullopt;
    return shape;
  } catch (const InputError& error) {
    for (const Fault& fault : error.faults()) faults.push_back(fault.place.line > 0 ? fault : Fault{place, fault.message});
    return std::nullopt;
  }
}

/// The table in the scene's own coordinates; none: it has no place there.
std::optional<ElasticSettings> in_scene(ElasticSettings s, const World& world, std::vector<Fault>& faults) {
  if (!put_in_scene(s.pose, s.on_ground, world, fmt::format("elastic '{}'", s.form.name), s.form.place, faults)) return std::nullopt;
  s.pins = in_scene(std::move(s.pins), world.terrain);
  return s;
}

}  // namespace

EffectPlan read_elastic(Parameters& parameters, Real duration) {
  ElasticSettings settings = read(parameters);
  settings.form.place = parameters.place("");
  EffectPlan plan;
  plan.name = settings.form.name;
  // A file's size nobody knows yet: as a thousand cubes of the lattice.
  const Real volume = settings.form.ball > 0 ? 4.19 * std::pow(settings.form.ball, 3) : settings.form.box.prod();
  const Real cubes = volume > 0 && settings.spacing > 0 ? volume / std::pow(settings.spacing, 3) : 1000;
  const Real tets = cubes * (settings.form.box.minCoeff() > 0 ? 5 : 12);
  plan.estimate.bytes = 3000 * tets;
  plan.estimate.steps = std::ceil(duration / settings.step);
  plan.estimate.seconds = plan.estimate.steps * tets * 1e-5;
  plan.misfits = [settings](const World& world) {
    std::vector<Fault> faults;
    if (const auto local = in_scene(settings, world, faults)) make_shape(*local, world, faults);
    return faults;
  };
  plan.build = [settings](const World& world) -> std::unique_ptr<Effect> {
    std::vector<Fault> faults;
    const auto local = in_scene(settings, world, faults);
    std::optional<ElasticShape> shape;
    if (local) shape = make_shape(*local, world, faults);
    if (!shape) throw InputError(faults);
    return std::make_unique<ElasticEffect>(*local, world, std::move(*shape));
  };
  return plan;
}

}  // namespace effuse::flow
