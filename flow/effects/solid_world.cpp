#include "flow/effects/solid_world.h"

#include <fmt/format.h>

#include <Eigen/Eigenvalues>
#include <algorithm>

#include "geometry/base/check.h"
#include "geometry/base/zones.h"

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
        continue;
      }
      ids_.push_back(bodies_->add(shape, each.density, each.pose, touch, each.velocity, each.spin));
      obstacles_.add({*mesh, RigidMotion(bodies_->body_pose(ids_.back())), each.temperature, static_cast<Index>(tracks_.size() + ids_.size())});
      before_.push_back(bodies_->body_pose(ids_.back()));
    }
    of_scene_ = ids_.size();
    wet_.resize(ids_.size());
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
    if (gone(b)) continue;
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
  for (std::size_t b = 0; b < ids_.size(); ++b)
    if (!gone(b)) go(tracks_.size() + b, RigidMotion(before_[b], bodies_->body_pose(ids_[b]), last_dt_));
  obstacles_.update();
}

void SolidWorld::tell(std::vector<Movable>& movable) const {
  movable.clear();
  for (std::size_t b = 0; b < ids_.size(); ++b) {
    const BodyId id = ids_[b];
    if (gone(b)) continue;
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
  const std::size_t count = ids_.size();
  std::vector<Vec3> given(count, Vec3::Zero());
  for (const Movable& m : movable) {
    const std::size_t b = m.surface - tracks_.size() - 1;
    CHECK_LT(b, count);
    const BodyId id = ids_[b];
    before_[b] = bodies_->body_pose(id);
    const Vec3 before = bodies_->momenta()[id] * m.inverse_mass, by_lava = m.velocity - dt * acceleration_[b] - before;
    // Over the whole step, as gravity: an impulse at its begin would let a floating body bob within the step.
    const Vec3 spun = m.spin - bodies_->spin(id);
    const Vec3 force = by_lava / m.inverse_mass / dt, torque = m.inverse_inertia.inverse() * spun / dt;
    if (look_[b]) {
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
  for (std::size_t i = 0; i < tracks_.size(); ++i)
    if (tracks_[i].keys().size() > 1) bodies_->move_to(driven_[i], tracks_[i].at(time_ + dt));
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
  std::vector<std::pair<std::string, double>> figures = {{"bodies", static_cast<double>(ids_.size())},
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

sph::SolidOptions SolidWorld::solids() {
  if (obstacles_.empty()) return {};
  sph::SolidOptions options{&obstacles_, {}, friction_};
  if (brittle_) options.friction_by = [this](Index surface) { return surface < friction_.size() ? friction_[surface] : 1; };
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
  for (std::size_t b = 0; b < of_scene_; ++b) all.push_back(bodies_->pose(ids_[b]));
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
  if (brittle_) brittle_->add_to(hash);
  hash.add(std::span<const Vec3>(acceleration_));
}

void SolidWorld::save(StateWriter& out) const {
  if (!has_bodies()) return;
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
  if (!has_bodies()) return;
  if (brittle_) {
    brittle_->load(in);
    admit_pieces();
    std::vector<Vec3> places;
    std::vector<Index> counts;
    in.array("body_wet_counts", counts);
    in.array("body_wet", places);
    std::size_t sum = 0;
    for (const Index n : counts) sum += n;
    if (counts.size() != ids_.size() || sum != places.size()) throw InputError(Place{}, "the checkpoint holds other rigid bodies");
    auto next = places.begin();
    for (std::size_t b = 0; b < counts.size(); ++b) {
      wet_[b].assign(next, next + counts[b]);
      next += counts[b];
    }
  }
  bodies_->load(in);
  std::vector<Vec3> acceleration;
  in.array("body_acceleration", acceleration);
  if (acceleration.size() != ids_.size()) throw InputError(Place{}, "the checkpoint holds other rigid bodies");
  acceleration_ = std::move(acceleration);
  archive(*this, in);
  for (std::size_t b = 0; b < ids_.size(); ++b) before_[b] = bodies_->body_pose(ids_[b]);
  last_dt_ = 0;
}

/// A body or piece that may break, in the lava's way.
void SolidWorld::admit(BodyId id, Index parent) {
  ids_.push_back(id);
  const bodies::BrittleBodies::Piece& piece = brittle_->pieces().at(id);
  geometry::TriMesh mesh = geometry::surface_of(*brittle_->material(piece.source).cells, piece.cells);
  // Obstacles stand in body axes.
  geometry::TriMesh turned = mesh;
  for (Vec3& p : turned.positions) p = bodies_->shape(id).body_from_given().world(p);
  look_.resize(ids_.size());
  look_.back() = std::make_shared<const geometry::TriMesh>(std::move(mesh));
  before_.push_back(bodies_->body_pose(id));
  obstacles_.add({geometry::CollisionMesh(turned), RigidMotion(before_.back()), temperature_.at(parent), static_cast<Index>(tracks_.size() + ids_.size())});
}

/// Takes in the pieces that have come and lets go of what they were.
void SolidWorld::admit_pieces() {
  for (BodyId id = ids_.back() + 1; id < bodies_->size(); ++id) {
    // One that came and broke in the same step has left its own pieces only; its number stays empty.
    const bodies::BrittleBodies::Birth& birth = brittle_->birth(id);
    const Index parent = origin_[static_cast<std::size_t>(std::find(ids_.begin(), ids_.end(), birth.parent) - ids_.begin())];
    origin_.push_back(parent);
    names_.push_back(fmt::format("a piece of {}", names_[tracks_.size() + parent]));
    temperature_.push_back(temperature_[parent]);
    friction_.push_back(friction_[tracks_.size() + parent + 1]);
    acceleration_.push_back(bodies_->options().gravity);
    wet_.emplace_back();
    if (brittle_->knows(id)) {
      admit(id, parent);
    } else {
      ids_.push_back(id);
      look_.emplace_back();
      before_.push_back(bodies_->body_pose(id));
      const geometry::CollisionMesh mesh(geometry::surface_of(*brittle_->material(birth.source).cells, birth.cells));
      obstacles_.remove(obstacles_.add({mesh, RigidMotion(before_.back()), 0, static_cast<Index>(tracks_.size() + ids_.size())}));
    }
  }
  for (std::size_t b = 0; b < ids_.size(); ++b)
    if (gone(b) && look_[b]) {
      look_[b] = nullptr;
      wet_[b].clear();
      obstacles_.remove(tracks_.size() + b);
    }
}

void SolidWorld::wet(std::span<const Vec3> x, Real spacing) {
  if (!brittle_) return;
  ZONE("solids.wet");
  for (std::vector<Vec3>& places : wet_) places.clear();
  Box3 near;
  for (std::size_t b = 0; b < ids_.size(); ++b)
    if (look_[b]) near.extend(geometry::placed_box(obstacles_[tracks_.size() + b].motion.to(), obstacles_[tracks_.size() + b].shape.bounds()));
  if (near.isEmpty()) return;
  near = Box3(near.min() - Vec3::Constant(spacing), near.max() + Vec3::Constant(spacing));
  std::vector<Vec3> asked;
  for (const Vec3& p : x)
    if (near.contains(p)) asked.push_back(p);
  constexpr int kMost = 4;
  std::vector<geometry::Contact> found(asked.size() * kMost);
  obstacles_.contacts(asked, spacing, kMost, found);
  for (const geometry::Contact& c : found) {
    if (!c.any() || c.surface <= tracks_.size()) continue;
    const std::size_t b = c.surface - tracks_.size() - 1;
    if (look_[b]) wet_[b].push_back(bodies_->pose(ids_[b]).body(c.point));
  }
}

/// Lava's force and torque about the centre, shared out over the places where it lies on the body.
void SolidWorld::spread(std::size_t b, const Vec3& force, const Vec3& torque) {
  const BodyId id = ids_[b];
  const std::vector<Vec3>& places = wet_[b];
  const RigidPose pose = bodies_->pose(id);
  const Vec3 centre = bodies_->centres()[id];
  Vec3 middle = Vec3::Zero();
  for (const Vec3& p : places) middle += pose.world(p);
  middle /= std::max<Real>(1, static_cast<Real>(places.size()));
  Mat3 J = Mat3::Zero();
  for (const Vec3& p : places) {
    const Vec3 r = pose.world(p) - middle;
    J += r.squaredNorm() * Mat3::Identity() - r * r.transpose();
  }
  // Places in a line, or too few, carry no moment.
  const Eigen::SelfAdjointEigenSolver<Mat3> axes(J);
  const bool wide = places.size() > 2 && axes.eigenvalues()[0] > 1e-6 * axes.eigenvalues()[2];
  if (!wide) {
    bodies_->add_force(id, force, centre);
    bodies_->add_torque(id, torque);
    return;
  }
  const Vec3 a = force / static_cast<Real>(places.size());
  const Vec3 turn = J.inverse() * (torque - (middle - centre).cross(force));
  for (const Vec3& p : places) {
    const Vec3 at = pose.world(p);
    brittle_->add_force(id, a + turn.cross(at - middle), at);
  }
}

std::vector<SolidPiece> SolidWorld::pieces() const {
  std::vector<SolidPiece> all;
  for (std::size_t b = 0; b < ids_.size(); ++b)
    if (look_[b]) all.push_back({static_cast<Index>(b), origin_[b], look_[b], bodies_->pose(ids_[b]), 0});
  return all;
}

std::unique_ptr<SolidWorld> make_solid_world(const World& world) {
  const auto of = [](const auto* list) { return list ? *list : std::decay_t<decltype(*list)>{}; };
  return std::make_unique<SolidWorld>(of(world.obstacles), of(world.bodies), world.terrain, body_options(world.body_settings), of(world.joints));
}

}  // namespace effuse::flow
