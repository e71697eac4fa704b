#include "flow/effects/solid_world.h"

#include <fmt/format.h>

#include <algorithm>

#include "geometry/base/check.h"
#include "geometry/mesh/mass_properties.h"

namespace effuse::flow {

using bodies::BodyId;
using bodies::RigidBodies;
using bodies::Shape;
using geometry::RigidMotion;
using geometry::RigidPose;
using sph::Movable;

bodies::BodyOptions body_options(const BodySettings& s) {
  bodies::BodyOptions o;
  o.step = s.step;
  o.substeps = s.substeps;
  o.contact = s.penalty ? bodies::ContactModel::kPenalty : bodies::ContactModel::kConstraint;
  o.penalty_frequency = s.penalty_frequency;
  o.penalty_damping = s.penalty_damping;
  o.terrain_friction = s.ground_friction;
  o.terrain_restitution = s.ground_restitution;
  o.sleep_speed = s.sleep_speed;
  o.sleep_delay = s.sleep_delay;
  return o;
}

namespace {

/// Of the shape's solids [m^3]; 0: it is, or has parts that are, open.
Real solid_volume(const geometry::CollisionMesh& shape) {
  return shape.solid() ? std::max(geometry::mass_properties(shape.mesh()).volume, 0.0) : 0;
}

static_assert(std::equal(std::begin(bodies::kJointNames), std::end(bodies::kJointNames), kJointKindNames.begin(), kJointKindNames.end()));

/// Bodies of one form share it.
bool alike(const PlacedBody& a, const PlacedBody& b) { return a.hull == b.hull && a.ball == b.ball && a.mesh.positions == b.mesh.positions && a.mesh.triangles == b.mesh.triangles; }

bodies::Joint joint_of(const PlacedJoint& placed, BodyId a, BodyId b) {
  bodies::Joint j;
  j.kind = static_cast<bodies::Joint::Kind>(placed.kind);
  j.a = a;
  j.b = b;
  j.anchor = placed.point;
  j.anchor_b = placed.point_b;
  j.axis = placed.axis;
  j.low = placed.law.low;
  j.high = placed.law.high;
  j.motor_speed = placed.law.motor_speed;
  j.motor_strength = placed.law.motor_strength;
  j.stiffness = placed.law.stiffness;
  j.damping = placed.law.damping;
  j.collide = placed.law.collide;
  return j;
}

}  // namespace

SolidWorld::SolidWorld(const std::vector<PlacedObstacle>& obstacles, const std::vector<PlacedBody>& bodies, const geometry::Terrain* terrain, const bodies::BodyOptions& options,
                       const std::vector<PlacedJoint>& joints, bool births)
    : friction_(1, 1.0), effusivity_(1, 0.0) {
  for (const PlacedObstacle& each : obstacles) {
    names_.push_back(fmt::format("obstacle '{}'", each.name));
    if (each.track.keys().size() > 1) moving_.push_back({static_cast<Index>(tracks_.size())});
    tracks_.push_back(each.track);
    friction_.push_back(each.friction);
    obstacles_.add({each.shape, RigidMotion(each.track.at(0)), each.temperature, static_cast<Index>(tracks_.size())});
    add_heat(each.name, each.material, each.temperature, solid_volume(each.shape));
  }
  if (!bodies.empty() || births) {
    bodies_ = std::make_unique<RigidBodies>(options, terrain ? std::optional(*terrain) : std::nullopt);
    for (const PlacedObstacle& each : obstacles) {
      const auto shape = Shape::mesh(each.shape.mesh());
      driven_.push_back(each.track.keys().size() > 1 ? bodies_->add_driven(shape, each.track.at(0)) : bodies_->add_static(shape, each.track.at(0)));
    }
    std::shared_ptr<const Shape> shape;
    std::optional<geometry::CollisionMesh> mesh;
    for (std::size_t b = 0; b < bodies.size(); ++b) {
      const PlacedBody& each = bodies[b];
      names_.push_back(fmt::format("body '{}'", each.name));
      if (b == 0 || !alike(each, bodies[b - 1])) {
        shape = each.cells ? nullptr : each.ball > 0 ? Shape::sphere(each.ball) : each.hull ? Shape::hull(each.mesh) : Shape::mesh(each.mesh);
        if (shape) mesh = shape->kind() == Shape::Kind::kMesh ? shape->collision_mesh() : geometry::CollisionMesh(shape->surface());
      }
      origin_.push_back(static_cast<Index>(b));
      temperature_.push_back(each.temperature);
      friction_.push_back(each.lava_friction);
      look_.emplace_back();
      const bodies::Surface touch{.friction = each.friction, .restitution = each.restitution, .rolling = each.rolling};
      if (each.cells) {
        if (!brittle_) brittle_ = std::make_unique<bodies::BrittleBodies>(*bodies_);
        admit(brittle_->add({each.cells, each.strength, each.smallest}, each.density, each.pose, touch, each.velocity, each.spin), static_cast<Index>(b));
        add_heat(each.name, each.material, each.temperature, 0);  // its pieces come and go: what they are given is told, they stay as warm as they are
        continue;
      }
      ids_.push_back(bodies_->add(shape, each.density, each.pose, touch, each.velocity, each.spin));
      obstacles_.add({*mesh, RigidMotion(bodies_->body_pose(ids_.back())), each.temperature, static_cast<Index>(tracks_.size() + ids_.size())});
      before_.push_back(bodies_->body_pose(ids_.back()));
      add_heat(each.name, each.material, each.temperature, bodies_->mass(ids_.back()) / each.density);
    }
    of_scene_ = ids_.size();
    wet_.resize(ids_.size());
    acceleration_.assign(ids_.size(), options.gravity);
    const auto end = [&](const JointEnd& e) { return e.kind == JointEnd::Kind::kBody ? ids_.at(e.index) : e.kind == JointEnd::Kind::kObstacle ? driven_.at(e.index) : bodies::Joint::kWorld; };
    for (const PlacedJoint& each : joints) bodies_->join(joint_of(each, end(each.ends[0]), end(each.ends[1])));
  }
  obstacles_.update();
}

void SolidWorld::add_heat(std::string name, const Material& material, Real temperature, Real volume) {
  heated_names_.push_back(std::move(name));
  effusivity_.push_back(material.effusivity());
  first_temperature_.push_back(temperature);
  capacity_.push_back(material.conductivity > 0 && temperature > 0 ? material.density * material.heat_capacity * volume : 0);
  warmth_.push_back({0, 0, capacity_.back() > 0 ? temperature : 0});
}

void SolidWorld::warm(std::span<const Real> heat, std::span<const Real> hottest) {
  for (std::size_t k = 0; k < warmth_.size() && k + 1 < heat.size(); ++k) {
    if (heat[k + 1] == 0 && hottest[k + 1] == 0) continue;
    warmth_[k].given += heat[k + 1];
    warmth_[k].hottest = std::max(warmth_[k].hottest, hottest[k + 1]);
    set_mean(k);
  }
}

void SolidWorld::set_mean(std::size_t k) {
  if (capacity_[k] <= 0) return;
  warmth_[k].mean = first_temperature_[k] + warmth_[k].given / capacity_[k];
  obstacles_.set_temperature(k, warmth_[k].mean);
}

void SolidWorld::go(std::size_t i, const RigidMotion& motion) {
  const RigidMotion& now = obstacles_[i].motion;
  if (motion.moves() || now.moves() || motion.to().position != now.to().position || motion.to().orientation.coeffs() != now.to().orientation.coeffs()) obstacles_.move(i, motion);
}

const RigidMotion& SolidWorld::between(Moving& m, Real from, Real to) const {
  const bool known = m.to > m.from;
  if (known && from == m.from && to == m.to) return m.way;
  const geometry::PoseTrack& track = tracks_[m.obstacle];
  const RigidPose begin = known && from == m.to ? m.end : track.at(from), end = track.at(to);
  m = {m.obstacle, from, to, end, RigidMotion(begin, end, to - from)};
  return m.way;
}

void SolidWorld::stand(Real time, Real dt) {
  time_ = time;
  for (Moving& m : moving_) go(m.obstacle, between(m, time, time + dt).turned_back());
  for (std::size_t b = 0; b < ids_.size(); ++b) {
    if (gone(b)) continue;
    const RigidPose now = bodies_->body_pose(ids_[b]);
    RigidPose next = now;
    next.position += dt * velocity(b);
    next.orientation = geometry::rotation_by(dt * bodies_->spin(ids_[b])) * now.orientation;
    go(place(b), RigidMotion(now, next, dt).turned_back());
  }
  obstacles_.update();
}

void SolidWorld::move(Real from, Real to) {
  for (Moving& m : moving_) go(m.obstacle, between(m, from, to));
  for (std::size_t b = 0; b < ids_.size(); ++b)
    if (!gone(b)) go(place(b), RigidMotion(before_[b], bodies_->body_pose(ids_[b]), last_dt_));
  obstacles_.update();
}

void SolidWorld::tell(std::vector<Movable>& movable) const {
  movable.clear();
  for (std::size_t b = 0; b < ids_.size(); ++b) {
    const BodyId id = ids_[b];
    if (gone(b)) continue;
    Movable m;
    m.surface = static_cast<Index>(place(b) + 1);
    m.centre = bodies_->centres()[id];
    m.inverse_mass = 1 / bodies_->mass(id);
    const Mat3 R = bodies_->orientations()[id].toRotationMatrix();
    const Vec3 moments = bodies_->mass(id) / bodies_->shape(id).volume() * bodies_->shape(id).moments();
    m.inverse_inertia = R * moments.cwiseInverse().asDiagonal() * R.transpose();
    m.velocity = bodies_->momenta()[id] * m.inverse_mass;
    m.spin = bodies_->spin(id);
    m.acceleration = acceleration_[b];
    movable.push_back(m);
  }
}

void SolidWorld::take(std::span<const Movable> movable, Real dt) {
  const std::size_t count = ids_.size();
  std::vector<Vec3> given(count, Vec3::Zero());
  for (const Movable& m : movable) {
    const std::size_t b = body_of(m.surface);
    CHECK_LT(b, count);
    const BodyId id = ids_[b];
    before_[b] = bodies_->body_pose(id);
    const Vec3 before = bodies_->momenta()[id] * m.inverse_mass, by_lava = m.velocity - dt * acceleration_[b] - before;
    // Over the whole step, as gravity: an impulse at its begin would let a floating body bob within the step.
    const Vec3 spun = m.spin - bodies_->spin(id);
    const Vec3 force = by_lava / m.inverse_mass / dt, torque = m.inverse_inertia.inverse() * spun / dt;
    if (breaks(b)) {
      spread(b, force, torque);
    } else {
      bodies_->add_force(id, force, bodies_->centres()[id]);
      bodies_->add_torque(id, torque);
    }
    given[b] = before + by_lava;
  }
  step_bodies(dt);
  for (std::size_t b = 0; b < count; ++b)
    if (!gone(b)) acceleration_[b] = (bodies_->momenta()[ids_[b]] / bodies_->mass(ids_[b]) - given[b]) / dt;
  last_dt_ = dt;
}

/// Bodies and driven obstacles from time_ on.
void SolidWorld::step_bodies(Real dt) {
  for (const Moving& m : moving_) bodies_->move_to(driven_[m.obstacle], tracks_[m.obstacle].at(time_ + dt));
  if (brittle_) {
    const bodies::BrittleReport report = brittle_->step(dt);
    last_ = report.bodies;
    totals_.broken += static_cast<Real>(report.broken_bodies);
    totals_.redone += report.redone;
    if (report.broken_bodies > 0) admit_pieces();
  } else {
    last_ = bodies_->step(dt);
  }
  totals_.steps += 1;
  totals_.retries += last_.retries;
  totals_.stopped += static_cast<Real>(last_.stopped);
  totals_.penetration = std::max(totals_.penetration, last_.penetration);
  totals_.joint_error = std::max(totals_.joint_error, last_.joint_error);
}

void SolidWorld::step(Real time, Real dt) {
  time_ = time;
  if (has_bodies()) step_bodies(dt);
}

std::vector<std::pair<std::string, double>> SolidWorld::figures() const {
  if (!has_bodies()) return {};
  std::vector<std::pair<std::string, double>> figures = {{"bodies", static_cast<double>(count())},
          {"bodies_awake", static_cast<double>(last_.awake)},
          {"body_contacts", static_cast<double>(last_.contacts)},
          {"body_steps", totals_.steps},
          {"body_retries", totals_.retries},
          {"bodies_stopped", totals_.stopped},
          {"deepest_overlap_m", totals_.penetration},
          {"largest_joint_error", totals_.joint_error}};
  if (brittle_) {
    figures.emplace_back("bodies_broken", totals_.broken);
    figures.emplace_back("pieces", static_cast<double>(brittle_->pieces().size()));
    figures.emplace_back("steps_redone", totals_.redone);
  }
  return figures;
}

template <class Self, class Archive>
void SolidWorld::archive(Self& self, Archive& io) {
  auto& t = self.totals_;
  io.value("body_steps", t.steps);
  io.value("body_retries", t.retries);
  io.value("bodies_stopped", t.stopped);
  io.value("deepest_overlap", t.penetration);
  io.value("largest_joint_error", t.joint_error);
  io.value("bodies_broken", t.broken);
  io.value("steps_redone", t.redone);
  io.value("bodies_awake", self.last_.awake);
  io.value("body_contacts", self.last_.contacts);
}

void SolidWorld::add_soft(const std::string& name, const SoftSolid& soft) {
  CHECK(soft.solid && ids_.size() == of_scene_);
  const HungSurface& surface = soft.solid->surface();
  geometry::TriMesh mesh;
  surface.gather(soft.solid->places(), mesh.positions);
  mesh.triangles = surface.triangles;
  // Behind those that are there: its surface's number is its place's, and one.
  const auto shape = [&] {
    try {
      return geometry::CollisionMesh(mesh);
    } catch (const InputError& error) {
      throw InputError(soft.place, fmt::format("'{}' as lava would meet it: {}", name, error.faults().front().message));
    }
  };
  const std::size_t number = obstacles_.add({shape(), {}, soft.temperature, static_cast<Index>(obstacles_.size() + 1)});
  CHECK_EQ(number, tracks_.size() + of_scene_ + soft_.size());
  soft_.push_back({number, soft.solid, name});
  names_.push_back(fmt::format("'{}'", name));
  friction_.push_back(soft.friction);
  add_heat(name, soft.material, soft.temperature, soft.volume);
  obstacles_.update();
}

Real SolidWorld::distance_to_last(const Vec3& point, Real reach) const {
  const geometry::Obstacle& last = obstacles_[soft_.back().obstacle];
  const Vec3 local = last.motion.to().body(point);
  return last.shape.inside(local) ? 0 : last.shape.signed_distance(local, reach);
}

sph::SolidOptions SolidWorld::solids() {
  if (obstacles_.empty() && !has_bodies()) return {};
  sph::SolidOptions options{&obstacles_, {}, friction_};
  options.deforming = soft_;
  if (has_bodies()) options.friction_by = [this](Index surface) { return surface < friction_.size() ? friction_[surface] : 1; };
  options.effusivity = effusivity_;
  options.heated = [this](std::span<const Real> heat, std::span<const Real> hottest) { warm(heat, hottest); };
  if (has_bodies() || !moving_.empty()) {
    options.stand = [this](Real time, Real dt) { stand(time, dt); };
    options.move = [this](Real from, Real to) { move(from, to); };
  }
  if (!has_bodies()) return options;
  options.movable = [this](std::vector<Movable>& movable) { tell(movable); };
  options.moved = [this](std::span<const Movable> movable, Real dt) { take(movable, dt); };
  options.push = [this](Index surface, const Vec3& impulse, const Vec3& at) {
    if (is_body(surface)) bodies_->add_impulse(ids_[body_of(surface)], impulse, at);
  };
  return options;
}

std::vector<RigidPose> SolidWorld::poses() const {
  std::vector<RigidPose> all;
  for (std::size_t b = 0; b < of_scene_; ++b) all.push_back(bodies_->pose(ids_[b]));
  return all;
}

std::optional<SolidWorld::Near> SolidWorld::nearest(const Vec3& point, Real reach) const {
  geometry::Contact found;
  if (obstacles_.contacts(point, reach, std::span(&found, 1)) == 0) return std::nullopt;
  return Near{found.surface <= names_.size() ? names_[found.surface - 1] : "a piece that broke off", found.distance, found.surface_velocity.norm()};
}

std::size_t SolidWorld::count() const {
  std::size_t n = 0;
  for (const BodyId id : ids_) n += bodies_->is_gone(id) ? 0 : 1;
  return n;
}

Vec3 SolidWorld::velocity(std::size_t body) const { return bodies_->momenta()[ids_[body]] / bodies_->mass(ids_[body]); }

void SolidWorld::add_to(StateHash& hash) const {
  for (const Warmth& each : warmth_) hash.add(std::span<const Real>(&each.given, 1));
  if (!has_bodies()) return;
  bodies_->add_to(hash);
  if (brittle_) brittle_->add_to(hash);
  hash.add(std::span<const Vec3>(acceleration_));
}

void SolidWorld::save(StateWriter& out) const {
  if (!warmth_.empty()) out.array("warmth", warmth_);
  if (!has_bodies()) return;
  std::vector<Index> block_ids, block_corners;
  std::vector<Vec3> corners;
  std::vector<Real> block_numbers;
  std::vector<std::uint8_t> block_gone;
  for (const Block& block : blocks_) {
    block_ids.push_back(block.id);
    block_corners.push_back(static_cast<Index>(block.corners.size()));
    corners.insert(corners.end(), block.corners.begin(), block.corners.end());
    block_numbers.insert(block_numbers.end(), {block.mass, block.temperature});
    block_gone.push_back(bodies_->is_gone(block.id));
  }
  out.array("block_ids", block_ids);
  out.array("block_counts", block_corners);
  out.array("block_corners", corners);
  out.array("block_numbers", block_numbers);
  out.array("block_gone", block_gone);
  if (brittle_) {
    brittle_->save(out);
    std::vector<Vec3> places;
    std::vector<Index> counts;
    for (const std::vector<Vec3>& of_body : wet_) {
      counts.push_back(static_cast<Index>(of_body.size()));
      places.insert(places.end(), of_body.begin(), of_body.end());
    }
    out.array("body_wet_counts", counts);
    out.array("body_wet", places);
  }
  bodies_->save(out);
  out.array("body_acceleration", acceleration_);
  archive(*this, out);
}

void SolidWorld::load(StateReader& in) {
  if (!warmth_.empty()) {
    std::vector<Warmth> warmth;
    in.array("warmth", warmth);
    if (warmth.size() != warmth_.size()) throw InputError(Place{}, "the checkpoint holds other obstacles");
    warmth_ = std::move(warmth);
    for (std::size_t k = 0; k < warmth_.size(); ++k) set_mean(k);
  }
  if (!has_bodies()) return;
  const auto refuse = [] { throw InputError(Place{}, "the checkpoint holds other rigid bodies"); };
  std::vector<Index> block_ids, block_corners;
  std::vector<Vec3> corners;
  std::vector<Real> block_numbers;
  std::vector<std::uint8_t> block_gone;
  in.array("block_ids", block_ids);
  in.array("block_counts", block_corners);
  in.array("block_corners", corners);
  in.array("block_numbers", block_numbers);
  in.array("block_gone", block_gone);
  std::size_t all_corners = 0;
  for (const Index n : block_corners) all_corners += n;
  if (block_corners.size() != block_ids.size() || block_numbers.size() != 2 * block_ids.size() || block_gone.size() != block_ids.size() || all_corners != corners.size()) refuse();
  auto corner = corners.begin();
  for (std::size_t k = 0; k < block_ids.size(); ++k) {
    blocks_.push_back({block_ids[k], {corner, corner + block_corners[k]}, block_numbers[2 * k], block_numbers[2 * k + 1]});
    corner += block_corners[k];
  }
  std::size_t made = 0;
  const auto make_block = [&](BodyId id) {
    if (made == blocks_.size() || blocks_[made].id != id || add_block_body(blocks_[made], {}, Vec3::Zero(), Vec3::Zero()) != id) refuse();
    ++made;
  };
  if (brittle_) brittle_->load(in, make_block);
  while (made < blocks_.size()) make_block(static_cast<BodyId>(bodies_->size()));
  admit_pieces();
  for (std::size_t k = 0; k < blocks_.size(); ++k)
    if (block_gone[k]) bodies_->retire(blocks_[k].id);
  admit_pieces();
  if (brittle_) {
    std::vector<Vec3> places;
    std::vector<Index> counts;
    in.array("body_wet_counts", counts);
    in.array("body_wet", places);
    std::size_t sum = 0;
    for (const Index n : counts) sum += n;
    if (counts.size() != ids_.size() || sum != places.size()) refuse();
    auto next = places.begin();
    for (std::size_t b = 0; b < counts.size(); ++b) {
      wet_[b].assign(next, next + counts[b]);
      next += counts[b];
    }
  }
  bodies_->load(in);
  std::vector<Vec3> acceleration;
  in.array("body_acceleration", acceleration);
  if (acceleration.size() != ids_.size()) refuse();
  acceleration_ = std::move(acceleration);
  archive(*this, in);
  for (std::size_t b = 0; b < ids_.size(); ++b) before_[b] = bodies_->body_pose(ids_[b]);
  last_dt_ = 0;
}

std::unique_ptr<SolidWorld> make_solid_world(const World& world, bool births) {
  const auto of = [](const auto* list) { return list ? *list : std::decay_t<decltype(*list)>{}; };
  return std::make_unique<SolidWorld>(of(world.obstacles), of(world.bodies), world.terrain, body_options(world.body_settings), of(world.joints), births);
}

}  // namespace effuse::flow
