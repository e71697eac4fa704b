#include "flow/effects/springs_effect.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <optional>

#include "flow/effects/effect_table.h"
#include "flow/effects/met_things.h"
#include "flow/effects/pins.h"
#include "flow/scene/placing.h"
#include "flow/springs/builders.h"
#include "flow/springs/spring_system.h"
#include "geometry/base/error.h"
#include "geometry/base/parallel.h"
#include "geometry/mesh/measure.h"
#include "geometry/mesh/weld.h"

namespace effuse::flow {

namespace {

using springs::SpringBody;
using springs::SpringState;
using springs::SpringSystem;

constexpr Real kSafety = 0.5;      // share of the longest stable step that a step takes
constexpr int kHalvings = 10;      // of a step that went bad
constexpr Real kImplicitStep = 1. / 240;  // [s]: longer ones are stable, and dull
constexpr float kJellyColor[] = {0.55f, 0.08f, 0.05f}, kClothColor[] = {0.08f, 0.16f, 0.45f};  // linear light

/// The table, read.
struct SpringsSettings {
  std::string name;
  enum class Shape { kCube, kCloth, kSolid } shape = Shape::kCube;
  PlannedForm form;
  int points = 8;
  Real size = 1, spacing = 0, density = 0, mass = 0;
  springs::SpringMaterial material, bend;
  geometry::RigidPose pose;
  bool on_ground = true;
  Vec3 velocity = Vec3::Zero(), spin = Vec3::Zero();
  std::vector<Vec3> positions, velocities;
  std::vector<Pin> pins;
  std::string pinned_to;
  springs::Surroundings around;
  geometry::ForceGrid field;
  bool meets = true, meets_lava = true;
  Real lava_friction = 1;
  Real thickness = 0;
  Scheme scheme = Scheme::kSymplecticEuler;
  Real step = 0;
  Vec3 color = Vec3::Constant(-1);
};

class SpringsEffect final : public Effect, private Deformable {
 public:
  SpringsEffect(const SpringsSettings& settings, const World& world, SpringBody body)
      : settings_(settings), terrain_(world.terrain), body_(std::move(body)), state_(body_.state), things_(settings.meets ? world : World{}) {
    for (const auto& each : world.obstacles ? *world.obstacles : std::vector<PlacedObstacle>())
      if (each.name == settings.pinned_to) driver_ = each.track;
    for (std::size_t i = 0; i < state_.x.size(); ++i)
      if (is_pinned(settings.pins, state_.x[i])) body_.network.held[i] = 1;
    start_ = state_.x;
    make_system();
  }

  std::string_view name() const override { return settings_.name; }
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
    refuse_double_vertices();
    find_surface();
    SoftSolid soft;
    soft.solid = this;
    soft.friction = settings_.lava_friction;
    soft.place = settings_.form.place;
    return soft;
  }
  void led_by(Effect& leader) override { leader_ = &leader; }

  void step_alone(Real t_end) {
    const Real left = t_end - time_, wanted = settings_.step > 0 ? settings_.step : own_step_;
    const Real count = std::max(1.0, std::ceil(left / wanted * (1 - 1e-9)));
    Real dt = left / count;
    const SpringState before = state_;
    for (int halving = 0;; ++halving, dt /= 2) {
      if (advance(dt)) break;
      state_ = before;
      if (halving == kHalvings)
        throw UnstableError(fmt::format("springs '{}' at {:.6g} s: positions or velocities are no numbers any more, even with steps of {:.3g} s; take step below {:.3g} s, or scheme = \"implicit_euler\"",
                                        settings_.name, time_, dt, limit_));
      ++retries_;
    }
    time_ = count > 1 || dt < left ? time_ + dt : t_end;
    ++steps_;
    if (const std::size_t torn = tear_now(); torn > 0) {
      const std::vector<Vec3> load = system_->surroundings.load;
      make_system();
      system_->surroundings.load = load;
      if (leader_) find_surface();
    }
  }

  std::vector<NamedMesh> meshes() const override {
    geometry::TriMesh mesh = body_.surface;
    mesh.positions = springs::surface_positions(body_, state_.x);
    mesh.triangles = whole_triangles();
    geometry::compute_normals(mesh);
    mesh.attributes.clear();
    geometry::VertexAttribute& velocity = mesh.attributes["velocity"];
    velocity.width = 3;
    for (const Vec3& v : springs::surface_positions(body_, state_.v))
      for (int c = 0; c < 3; ++c) velocity.values.push_back(static_cast<float>(v[c]));
    geometry::VertexAttribute& color = mesh.attributes["color"];
    color.width = 3;
    const float* usual = settings_.shape == SpringsSettings::Shape::kCloth ? kClothColor : kJellyColor;
    for (std::size_t k = 0; k < mesh.positions.size(); ++k)
      for (int c = 0; c < 3; ++c) color.values.push_back(settings_.color[0] < 0 ? usual[c] : static_cast<float>(std::pow(settings_.color[c], 2.2)));
    std::vector<NamedMesh> all;
    all.push_back({settings_.name, std::move(mesh)});
    return all;
  }

  std::size_t memory() const override {
    return system_->memory() + state_.x.capacity() * 12 * sizeof(Vec3) + body_.network.springs.capacity() * sizeof(springs::Spring) + body_.weight.capacity() * 64;
  }
  void add_to(StateHash& hash) const override {
    hash.add(time_);
    hash.add(std::span<const Vec3>(state_.x));
    hash.add(std::span<const Vec3>(state_.v));
    if (!owed_.impulses().empty()) hash.add(std::span<const Vec3>(owed_.impulses()));
    hash.add(body_.network.springs.size());
  }
  void save(StateWriter& out) const override {
    out.value("time", time_);
    out.value("steps", steps_);
    out.value("retries", retries_);
    out.array("x", state_.x);
    out.array("v", state_.v);
    out.array("torn", torn_);
    out.value("longest_stable_step", std::isfinite(limit_) ? limit_ : 0);
    if (leader_) out.array("owed", owed_.impulses());
    things_.save(out);
  }
  void load(StateReader& in) override {
    SpringState state;
    in.value("time", time_);
    in.value("steps", steps_);
    in.value("retries", retries_);
    in.array("x", state.x);
    in.array("v", state.v);
    in.array("torn", torn_);
    Real limit = 0;
    in.value("longest_stable_step", limit);
    if (leader_) in.array("owed", owed_.impulses());
    things_.load(in);
    if (!owed_.impulses().empty() && owed_.impulses().size() != state_.x.size()) throw InputError(Place{"checkpoint"}, fmt::format("springs '{}': impulses on {} points, the scene's have {}", settings_.name, owed_.impulses().size(), state_.x.size()));
    if (state.x.size() != state_.x.size() || state.v.size() != state_.v.size()) throw InputError(Place{"checkpoint"}, fmt::format("springs '{}': holds {} points, the scene's have {}", settings_.name, state.x.size(), state_.x.size()));
    state_ = std::move(state);
    std::erase_if(body_.network.springs, [&](const springs::Spring& s) { return std::binary_search(torn_.begin(), torn_.end(), pair_of(s.a, s.b)); });
    make_system();
    set_step(limit > 0 ? limit : std::numeric_limits<Real>::infinity());  // as it was found where it began, or tore last
    if (leader_) find_surface();
  }
  std::vector<std::pair<std::string, double>> figures() const override {
    return {{"points", static_cast<double>(state_.x.size())},
            {"springs", static_cast<double>(body_.network.springs.size())},
            {"torn", static_cast<double>(torn_.size())},
            {"steps", static_cast<double>(steps_)},
            {"retries", static_cast<double>(retries_)},
            {"longest_stable_step_s", std::isfinite(limit_) ? limit_ : 0},
            {"kinetic_energy_j", springs::kinetic_energy(body_.network, state_)},
            {"spring_energy_j", springs::spring_energy(body_.network, state_)}};
  }
  std::vector<std::string> remarks() const override {
    if (!(settings_.step > limit_) || settings_.scheme == Scheme::kImplicitEuler) return {};
    return {fmt::format("step, {:.3g} s, is longer than the longest stable one, {:.3g} s: springs that swing faster blow up", settings_.step, limit_)};
  }
  std::string status() const override {
    const Real dt = settings_.step > 0 ? settings_.step : own_step_;
    return fmt::format("{} points, {} springs, {}", state_.x.size(), body_.network.springs.size(), std::isfinite(dt) ? fmt::format("dt {:.3g} s", dt) : std::string("all held"));
  }

 private:
  // As lava has it.
  std::span<const Vec3> places() const override { return state_.x; }
  std::span<const Vec3> velocities() const override { return state_.v; }
  std::span<const Real> masses() const override { return body_.network.mass; }
  std::span<const std::uint8_t> held() const override { return body_.network.held; }
  const HungSurface& surface() const override { return surface_; }
  std::uint64_t surface_version() const override { return surface_version_; }
  void predict(Real dt, std::vector<Vec3>& velocity, BlockMatrix& answer) override {
    prepare(dt);
    system_->surroundings.load = owed_.as_forces(dt);
    system_->predict(dt, state_, velocity, answer);
    system_->surroundings.load.clear();
  }
  void go(Real to, std::span<const Vec3> forces) override {
    system_->surroundings.load = owed_.as_forces(to - time_, forces);
    owed_.clear();
    while (time_ < to) step_alone(to);
    system_->surroundings.load.clear();
  }
  void push(Index point, const Vec3& impulse) override {
    if (!body_.network.held[point]) owed_.add(point, impulse, state_.x.size());
  }

  /// Those that no torn spring was a side of: of a cube and a cloth, whose vertices hang on a point each. All of a filled mesh.
  std::vector<geometry::Triangle> whole_triangles() const {
    std::vector<geometry::Triangle> triangles = body_.surface.triangles;
    if (torn_.empty() || settings_.shape == SpringsSettings::Shape::kSolid) return triangles;
    std::erase_if(triangles, [&](const geometry::Triangle& t) {
      for (std::size_t k = 0; k < 3; ++k)
        if (std::binary_search(torn_.begin(), torn_.end(), pair_of(body_.point[t[k]][0], body_.point[t[(k + 1) % 3]][0]))) return true;
      return false;
    });
    return triangles;
  }

  /// Lava would meet one of two that begin at one place and go their own ways.
  void refuse_double_vertices() const {
    const std::vector<Vec3> at = springs::surface_positions(body_, start_);
    const std::vector<Index> same = geometry::first_coincident(at);
    for (std::size_t q = 0; q < at.size(); ++q)
      if (body_.point[q] != body_.point[same[q]])
        throw InputError(settings_.form.place, fmt::format("springs '{}': two points begin at one place, ({:.6g}, {:.6g}, {:.6g}), wanted room between them, however little, or meets_lava = false", settings_.name, at[q].x(), at[q].y(), at[q].z()));
  }

  /// What lava meets: the surface that shows it, a cloth's from both sides.
  void find_surface() {
    std::vector<Index> first = {0}, point;
    std::vector<Real> weight;
    for (std::size_t q = 0; q < body_.point.size(); ++q) {
      for (std::size_t k = 0; k < body_.point[q].size(); ++k) {
        if (body_.weight[q][k] == 0) continue;
        point.push_back(body_.point[q][k]);
        weight.push_back(body_.weight[q][k]);
      }
      first.push_back(static_cast<Index>(point.size()));
    }
    surface_ = hang(springs::surface_positions(body_, start_), whole_triangles(), first, point, weight);
    ++surface_version_;
  }

  /// Two points as one number, the same both ways round.
  static std::uint64_t pair_of(Index a, Index b) { return static_cast<std::uint64_t>(std::min(a, b)) << 32 | std::max(a, b); }

  void make_system() {
    system_ = std::make_unique<SpringSystem>(body_.network);
    system_->surroundings = settings_.around;
    if (settings_.field.resolution > 0) system_->surroundings.field = &settings_.field;
    mean_rest_ = 0;
    for (const springs::Spring& each : body_.network.springs) mean_rest_ += each.rest / static_cast<Real>(body_.network.springs.size());
    set_step(springs::longest_stable_step(settings_.scheme, system_->spectrum(state_)));
  }
  void set_step(Real longest_stable) {
    limit_ = longest_stable;
    own_step_ = settings_.scheme == Scheme::kImplicitEuler ? kImplicitStep : kSafety * limit_;
  }

  /// Before a step of dt: where held points go, and what the others may touch.
  void prepare(Real dt) {
    if (driver_) {
      // Held points go where the obstacle carries them, straight within a step.
      const geometry::RigidPose home = driver_->at(0), to = driver_->at(time_ + dt);
      for (std::size_t i = 0; i < state_.x.size(); ++i)
        if (body_.network.held[i]) state_.v[i] = (to.world(home.orientation.conjugate() * (start_[i] - home.position)) - state_.x[i]) / dt;
    }
    if (settings_.meets) find_contacts(dt);
  }

  bool advance(Real dt) {
    prepare(dt);
    integrate_step(settings_.scheme, *system_, time_, dt, state_, storage_);
    return parallel_reduce(
        state_.x.size(), true, [&](std::size_t i) { return state_.x[i].allFinite() && state_.v[i].allFinite(); }, [](bool a, bool b) { return a && b; });
  }

  /// Planes of all that a point can reach in the step.
  void find_contacts(Real dt) {
    std::vector<PlaneContact>& contacts = system_->surroundings.contacts;
    contacts.clear();
    const Real fastest = parallel_max(state_.v.size(), 0.0, [&](std::size_t i) { return state_.v[i].norm(); });
    // As far as a point may move, and as deep as it may have sunk: solids of meshes are felt within reach only.
    const Real reach = settings_.thickness + 2 * fastest * dt + mean_rest_ / 2;
    things_.move(time_, dt);
    things_.add_planes(terrain_, state_.x, reach, settings_.thickness, contacts);
  }

  std::size_t tear_now() {
    if (settings_.material.tear_strain <= 0 && settings_.bend.tear_strain <= 0) return 0;
    const std::vector<springs::Spring> before = body_.network.springs;
    const std::size_t torn = springs::tear(body_.network, state_.x);
    if (torn == 0) return 0;
    std::size_t kept = 0;
    for (const springs::Spring& s : before) {
      if (kept < body_.network.springs.size() && s.a == body_.network.springs[kept].a && s.b == body_.network.springs[kept].b) ++kept;
      else torn_.push_back(pair_of(s.a, s.b));
    }
    std::sort(torn_.begin(), torn_.end());
    return torn;
  }

  SpringsSettings settings_;
  const geometry::Terrain* terrain_;
  SpringBody body_;
  SpringState state_;
  std::vector<Vec3> start_;
  StepStorage<SpringState> storage_;
  std::unique_ptr<SpringSystem> system_;
  MetThings things_;
  std::optional<geometry::PoseTrack> driver_;
  std::vector<std::uint64_t> torn_;
  Effect* leader_ = nullptr;  // lava that steps this with itself
  HungSurface surface_;       // only where there is such
  OwedImpulses owed_;
  std::uint64_t surface_version_ = 0;
  Real time_ = 0, limit_ = 0, own_step_ = 0, mean_rest_ = 0;
  std::uint64_t steps_ = 0, retries_ = 0;
};

SpringsSettings read(Parameters& p) {
  SpringsSettings s;
  using Shape = SpringsSettings::Shape;
  s.shape = static_cast<Shape>(p.choice("shape", {"cube", "cloth", "solid"}, 0, "points in a cube; on a mesh's vertices; or in a lattice over a closed mesh's inside"));
  if (s.shape == Shape::kCube) {
    s.name = p.text("name", "springs", "for files");
    s.points = static_cast<int>(p.integer("points", s.points, 2, 60, "a side"));
    s.size = p.number("size", "m", s.size, Parameters::positive(), "of its sides at rest");
    s.color = read_vector(p, "color", "", s.color, "red, green and blue, 0 to 1 (sRGB)");
  } else {
    read_form(p, "mesh, relative to the scene file", s.form);
    s.name = s.form.name;
    s.color = s.form.color;
    if (s.shape == Shape::kSolid) s.spacing = p.number("spacing", "m", std::nullopt, Parameters::positive(), "of its points");
  }
  check_effect_name(p, s.name);
  s.mass = p.number("mass", "kg", 0, Parameters::not_negative(), "in all; or density");
  s.density = p.number("density", s.shape == Shape::kCloth ? "kg/m2" : "kg/m3", 0, Parameters::not_negative(), "of the solid, or of a cloth's area; or mass");
  if ((s.mass > 0) == (s.density > 0)) p.fault(s.mass > 0 ? "mass" : "density", s.mass > 0 ? "found with density, wanted one of the two" : "is missing, wanted density or mass above 0");
  s.material.stiffness = p.number("stiffness", "N/m", std::nullopt, Parameters::not_negative(), "of its springs");
  s.material.damping = p.number("damping", "N s/m", 0, Parameters::not_negative(), "along its springs");
  s.material.tear_strain = p.number("tear_strain", "", 0, Parameters::not_negative(), "torn when longer by this share; 0: never");
  s.bend = s.material;
  if (s.shape == Shape::kCloth) {
    s.bend.stiffness = p.number("bend_stiffness", "N/m", 0.05 * s.material.stiffness, Parameters::not_negative(), "of the springs across its edges");
    s.bend.tear_strain = 0;
  }
  s.pose = read_pose(p, false, {});
  s.on_ground = p.flag("on_ground", false, "its height counts from the terrain at x, y");
  s.velocity = read_vector(p, "velocity", "m/s", s.velocity, "at the start");
  s.spin = read_vector(p, "spin", "rad/s", s.spin, "at the start, about its position");
  s.pins = read_pins(p);
  s.pinned_to = p.text("pinned_to", "", "obstacle that carries the held points");
  for (const std::vector<Real>& x : p.number_lists("positions", "m", 3, false, "of every point at the start, instead of rest")) s.positions.push_back(Vec3(x[0], x[1], x[2]));
  for (const std::vector<Real>& v : p.number_lists("velocities", "m/s", 3, false, "of every point at the start")) s.velocities.push_back(Vec3(v[0], v[1], v[2]));
  s.around.gravity = read_vector(p, "gravity", "m/s2", Vec3(0, 0, -kGravity), "");
  s.around.drag = p.number("drag", "1/s", 0, Parameters::not_negative(), "of the air, per mass");
  s.around.wind = read_vector(p, "wind", "m/s", s.around.wind, "");
  for (const std::vector<Real>& w : p.number_lists("walls", "", 4, false, "[a, b, c, d]: penalty walls that keep a x + b y + c z + d >= 0")) {
    const Real length = Vec3(w[0], w[1], w[2]).norm();
    if (!(length > 0)) p.fault("walls", "has one whose a, b and c are all 0, so it has no normal");
    else s.around.walls.push_back({Vec3(w[0], w[1], w[2]) / length, w[3] / length});
  }
  s.meets = p.flag("meets_ground", true, "and obstacles; other solids that deform they do not meet");
  s.meets_lava = p.flag("meets_lava", true, "(modern lava): each pushes the other; false: neither knows of the other");
  s.lava_friction = p.number("lava_friction", "", s.lava_friction, {0, 1}, "of lava on it: 1 no slip, 0 free slip");
  s.around.response.stiffness = p.number("contact_stiffness", "N/m", 2 * s.material.stiffness, Parameters::not_negative(), "of walls, ground and obstacles");
  s.around.response.damping = p.number("contact_damping", "N s/m", s.material.damping, Parameters::not_negative(), "of the same");
  s.around.response.friction = p.number("friction", "", 0.5, Parameters::not_negative(), "Coulomb's number of ground and obstacles; walls have none");
  s.thickness = p.number("thickness", "m", 0, Parameters::not_negative(), "that it keeps from ground and obstacles");
  if (p.has("force_field")) {
    Parameters f = p.table("force_field", "forces on its points, trilinear on a grid, outside as at its border");
    s.field.low = read_vector(f, "low", "m", s.field.low, "corner of the grid");
    s.field.high = read_vector(f, "high", "m", s.field.high, "opposite corner");
    s.field.resolution = static_cast<int>(f.integer("resolution", std::nullopt, 2, 512, "corners a side"));
    for (const std::vector<Real>& v : f.number_lists("values", "N", 3, true, "corner (i, j, k) with k fastest")) s.field.values.push_back(Vec3(v[0], v[1], v[2]));
    const auto r = static_cast<std::size_t>(s.field.resolution);
    if (f.has("values") && s.field.values.size() != r * r * r) f.fault("values", fmt::format("holds {} forces, wanted resolution^3 = {}", s.field.values.size(), r * r * r));
    if (!((s.field.high - s.field.low).minCoeff() > 0)) f.fault("high", "must be above low along x, y and z");
  }
  s.scheme = static_cast<Scheme>(p.choice("scheme", std::vector<std::string>(std::begin(kSchemeNames), std::end(kSchemeNames)), 1, "time integration"));
  s.step = p.number("step", "s", 0, Parameters::not_negative(), "0: half the longest stable one; implicit: 1/240 s");
  return s;
}

/// The body of a table, or faults: what does not fit.
std::optional<SpringBody> make_body(const SpringsSettings& s, const World& world, std::vector<Fault>& faults) {
  using Shape = SpringsSettings::Shape;
  const Place place = s.form.place;
  if (s.shape != Shape::kCube && !has_shape(s.form)) return std::nullopt;  // told already
  try {
    SpringBody body;
    if (s.shape == Shape::kCube) {
      const Real points = static_cast<Real>(s.points) * s.points * s.points;
      body = springs::jello_cube(s.points, Vec3::Constant(-s.size / 2), s.size, (s.mass > 0 ? s.mass : s.density * s.size * s.size * s.size) / points, s.material);
    } else {
      const geometry::TriMesh mesh = s.form.file.empty() ? mesh_of(s.form) : upright(world.mesh(s.form), s.form.scale, s.form.y_up);
      const Real unit = s.density > 0 ? s.density : 1;
      body = s.shape == Shape::kCloth ? springs::cloth(mesh, unit, s.material, s.bend) : springs::filled(mesh, s.spacing, unit, s.material);
      if (s.mass > 0) {
        Real all = 0;
        for (const Real m : body.network.mass) all += m;
        for (Real& m : body.network.mass) m *= s.mass / all;
      }
    }
    for (std::size_t i = 0; i < body.state.x.size(); ++i) {
      const Vec3 r = s.pose.orientation * body.state.x[i];
      body.state.x[i] = s.pose.position + r;
      body.state.v[i] = s.velocity + s.spin.cross(r);
    }
    for (const auto& [given, what, into] : {std::tuple{&s.positions, "positions", &body.state.x}, std::tuple{&s.velocities, "velocities", &body.state.v}}) {
      if (given->empty()) continue;
      if (given->size() != body.state.x.size()) throw InputError(place, fmt::format("springs '{}': {} {}, wanted one for each of its {} points", s.name, given->size(), what, body.state.x.size()));
      *into = *given;
    }
    const std::string what = fmt::format("springs '{}'", s.name);
    const std::size_t before = faults.size();
    check_start(body.state.x, s.pins, s.meets ? world.terrain : nullptr, what, place, faults);
    check_driver(s.pinned_to, world, what, place, faults);
    if (faults.size() > before) return std::nullopt;
    return body;
  } catch (const InputError& error) {
    for (const Fault& fault : error.faults()) faults.push_back(fault.place.line > 0 ? fault : Fault{place, fault.message});
    return std::nullopt;
  }
}

/// The table in the scene's own coordinates; none: it has no place there.
std::optional<SpringsSettings> in_scene(SpringsSettings s, const World& world, std::vector<Fault>& faults) {
  if (!put_in_scene(s.pose, s.on_ground, world, fmt::format("springs '{}'", s.name), s.form.place, faults)) return std::nullopt;
  s.pins = in_scene(std::move(s.pins), world.terrain);
  if (!world.terrain) return s;
  const Vec3 origin = world.terrain->georeference().origin;
  for (Vec3& x : s.positions) x -= origin;
  for (auto& wall : s.around.walls) wall.offset += wall.normal.dot(origin);
  return s;
}

}  // namespace

EffectPlan read_springs(Parameters& parameters, Real duration) {
  SpringsSettings settings = read(parameters);
  settings.form.place = parameters.place("");
  EffectPlan plan;
  plan.name = settings.name;
  const Real n = settings.shape == SpringsSettings::Shape::kCube ? std::pow(settings.points, 3) : 1000;
  const Real per_point = settings.density > 0 ? settings.density / n : settings.mass / n;
  // Twenty springs a point, all pulling together: omega^2 about 20 k / m.
  const Real step = settings.step > 0 ? settings.step : settings.scheme == Scheme::kImplicitEuler ? kImplicitStep : kSafety * 2 / std::sqrt(20 * settings.material.stiffness / std::max(per_point, 1e-12) + 1e-12);
  plan.estimate.bytes = n * 2000;
  plan.estimate.steps = std::ceil(duration / step);
  plan.estimate.seconds = plan.estimate.steps * n * (settings.scheme == Scheme::kImplicitEuler ? 5e-5 : settings.scheme == Scheme::kRk4 ? 6e-7 : 1.5e-7);
  plan.misfits = [settings](const World& world) {
    std::vector<Fault> faults;
    if (const auto local = in_scene(settings, world, faults)) make_body(*local, world, faults);
    return faults;
  };
  plan.build = [settings](const World& world) -> std::unique_ptr<Effect> {
    std::vector<Fault> faults;
    const auto local = in_scene(settings, world, faults);
    std::optional<SpringBody> body;
    if (local) body = make_body(*local, world, faults);
    if (!body) throw InputError(faults);
    return std::make_unique<SpringsEffect>(*local, world, std::move(*body));
  };
  return plan;
}

}  // namespace effuse::flow
