#include "flow/effects/solid_world.h"

#include <fmt/format.h>

#include <algorithm>

#include "geometry/base/check.h"

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
                       const std::vector<PlacedJoint>& joints)
    : friction_(1, 1.0) {
  for (const PlacedObstacle& each : obstacles) {
    names_.push_back(fmt::format("obstacle '{}'", each.name));
    tracks_.push_back(each.track);
    friction_.push_back(each.friction);
    obstacles_.add({each.shape, RigidMotion(each.track.at(0)), each.temperature, static_cast<Index>(tracks_.size())});
  }
  if (!bodies.empty()) {
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
        shape = each.ball > 0 ? Shape::sphere(each.ball) : each.hull ? Shape::hull(each.mesh) : Shape::mesh(each.mesh);
        mesh = shape->kind() == Shape::Kind::kMesh ? shape->collision_mesh() : geometry::CollisionMesh(shape->surface());
      }
      ids_.push_back(bodies_->add(shape, each.density, each.pose, {.friction = each.friction, .restitution = each.restitution, .rolling = each.rolling}, each.velocity, each.spin));
      friction_.push_back(each.lava_friction);
      obstacles_.add({*mesh, RigidMotion(bodies_->body_pose(ids_.back())), each.temperature, static_cast<Index>(tracks_.size() + ids_.size())});
      before_.push_back(bodies_->body_pose(ids_.back()));
    }
    acceleration_.assign(ids_.size(), options.gravity);
    const auto end = [&](const JointEnd& e) { return e.kind == JointEnd::Kind::kBody ? ids_.at(e.index) : e.kind == JointEnd::Kind::kObstacle ? driven_.at(e.index) : bodies::Joint::kWorld; };
    for (const PlacedJoint& each : joints) bodies_->join(joint_of(each, end(each.ends[0]), end(each.ends[1])));
  }
  obstacles_.update();
}

void SolidWorld::go(std::size_t i, const RigidMotion& motion) {
  const RigidMotion& now = obstacles_[i].motion;
  if (motion.moves() || now.moves() || motion.to().position != now.to().position || motion.to().orientation.coeffs() != now.to().orientation.coeffs()) obstacles_.move(i, motion);
}

void SolidWorld::stand(Real time, Real dt) {
  time_ = time;
  for (std::size_t i = 0; i < tracks_.size(); ++i) go(i, tracks_[i].between(time, time + dt).turned_back());
  for (std::size_t b = 0; b < ids_.size(); ++b) {
    const RigidPose now = bodies_->body_pose(ids_[b]);
    RigidPose next = now;
    next.position += dt * velocity(b);
    next.orientation = geometry::rotation_by(dt * bodies_->spin(ids_[b])) * now.orientation;
    go(tracks_.size() + b, RigidMotion(now, next, dt).turned_back());
  }
  obstacles_.update();
}

void SolidWorld::move(Real from, Real to) {
  for (std::size_t i = 0; i < tracks_.size(); ++i) go(i, tracks_[i].between(from, to));
  for (std::size_t b = 0; b < ids_.size(); ++b) go(tracks_.size() + b, RigidMotion(before_[b], bodies_->body_pose(ids_[b]), last_dt_));
  obstacles_.update();
}

void SolidWorld::tell(std::vector<Movable>& movable) const {
  movable.clear();
  for (std::size_t b = 0; b < ids_.size(); ++b) {
    const BodyId id = ids_[b];
    Movable m;
    m.surface = static_cast<Index>(tracks_.size() + b + 1);
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
  CHECK_EQ(movable.size(), ids_.size());
  std::vector<Vec3> given(ids_.size());
  for (std::size_t b = 0; b < ids_.size(); ++b) {
    const BodyId id = ids_[b];
    const Movable& m = movable[b];
    before_[b] = bodies_->body_pose(id);
    const Vec3 before = bodies_->momenta()[id] * m.inverse_mass, by_lava = m.velocity - dt * acceleration_[b] - before;
    // Over the whole step, as gravity: an impulse at its begin would let a floating body bob within the step.
    bodies_->add_force(id, by_lava / m.inverse_mass / dt, bodies_->centres()[id]);
    const Vec3 spun = m.spin - bodies_->spin(id);
    bodies_->add_torque(id, m.inverse_inertia.inverse() * spun / dt);
    given[b] = before + by_lava;
  }
  step_bodies(dt);
  for (std::size_t b = 0; b < ids_.size(); ++b) acceleration_[b] = (bodies_->momenta()[ids_[b]] / bodies_->mass(ids_[b]) - given[b]) / dt;
  last_dt_ = dt;
}

/// Bodies and driven obstacles from time_ on.
void SolidWorld::step_bodies(Real dt) {
  for (std::size_t i = 0; i < tracks_.size(); ++i)
    if (tracks_[i].keys().size() > 1) bodies_->move_to(driven_[i], tracks_[i].at(time_ + dt));
  last_ = bodies_->step(dt);
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
  return {{"bodies", static_cast<double>(ids_.size())},
          {"bodies_awake", static_cast<double>(last_.awake)},
          {"body_contacts", static_cast<double>(last_.contacts)},
          {"body_steps", totals_.steps},
          {"body_retries", totals_.retries},
          {"bodies_stopped", totals_.stopped},
          {"deepest_overlap_m", totals_.penetration},
          {"largest_joint_error", totals_.joint_error}};
}

template <class Self, class Archive>
void SolidWorld::archive(Self& self, Archive& io) {
  auto& t = self.totals_;
  io.value("body_steps", t.steps);
  io.value("body_retries", t.retries);
  io.value("bodies_stopped", t.stopped);
  io.value("deepest_overlap", t.penetration);
  io.value("largest_joint_error", t.joint_error);
  io.value("bodies_awake", self.last_.awake);
  io.value("body_contacts", self.last_.contacts);
}

sph::SolidOptions SolidWorld::solids() {
  if (obstacles_.empty()) return {};
  sph::SolidOptions options{&obstacles_, {}, friction_};
  bool moves = has_bodies();
  for (const geometry::PoseTrack& track : tracks_) moves = moves || track.keys().size() > 1;
  if (moves) {
    options.stand = [this](Real time, Real dt) { stand(time, dt); };
    options.move = [this](Real from, Real to) { move(from, to); };
  }
  if (!has_bodies()) return options;
  options.movable = [this](std::vector<Movable>& movable) { tell(movable); };
  options.moved = [this](std::span<const Movable> movable, Real dt) { take(movable, dt); };
  options.push = [this](Index surface, const Vec3& impulse, const Vec3& at) {
    if (surface > tracks_.size()) bodies_->add_impulse(ids_[surface - tracks_.size() - 1], impulse, at);
  };
  return options;
}

std::vector<RigidPose> SolidWorld::poses() const {
  std::vector<RigidPose> all;
  for (const BodyId id : ids_) all.push_back(bodies_->pose(id));
  return all;
}

std::optional<SolidWorld::Near> SolidWorld::nearest(const Vec3& point, Real reach) const {
  geometry::Contact found;
  if (obstacles_.contacts(point, reach, std::span(&found, 1)) == 0) return std::nullopt;
  return Near{names_.at(found.surface - 1), found.distance, found.surface_velocity.norm()};
}

Vec3 SolidWorld::velocity(std::size_t body) const { return bodies_->momenta()[ids_[body]] / bodies_->mass(ids_[body]); }

void SolidWorld::add_to(StateHash& hash) const {
  if (!has_bodies()) return;
  bodies_->add_to(hash);
  hash.add(std::span<const Vec3>(acceleration_));
}

void SolidWorld::save(StateWriter& out) const {
  if (!has_bodies()) return;
  bodies_->save(out);
  out.array("body_acceleration", acceleration_);
  archive(*this, out);
}

void SolidWorld::load(StateReader& in) {
  if (!has_bodies()) return;
  bodies_->load(in);
  std::vector<Vec3> acceleration;
  in.array("body_acceleration", acceleration);
  if (acceleration.size() != ids_.size()) throw InputError(Place{}, "the checkpoint holds other rigid bodies");
  acceleration_ = std::move(acceleration);
  archive(*this, in);
  for (std::size_t b = 0; b < ids_.size(); ++b) before_[b] = bodies_->body_pose(ids_[b]);
  last_dt_ = 0;
}

std::unique_ptr<SolidWorld> make_solid_world(const World& world) {
  const auto of = [](const auto* list) { return list ? *list : std::decay_t<decltype(*list)>{}; };
  return std::make_unique<SolidWorld>(of(world.obstacles), of(world.bodies), world.terrain, body_options(world.body_settings), of(world.joints));
}

}  // namespace effuse::flow
