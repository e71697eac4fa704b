#include "flow/effects/solid_world.h"

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

namespace {
/// Of the shape's solids [m^3]; 0: it is, or has parts that are, open.
Real solid_volume(const geometry::CollisionMesh& shape) {
  return shape.solid() ? std::max(geometry::mass_properties(shape.mesh()).volume, 0.0) : 0;
}
}  // namespace

SolidWorld::SolidWorld(const std::vector<PlacedObstacle>& obstacles, const std::vector<PlacedBody>& bodies, const geometry::Terrain* terrain, const bodies::BodyOptions& options)
    : friction_(1, 1.0), effusivity_(1, 0.0) {
  for (const PlacedObstacle& each : obstacles) {
    tracks_.push_back(each.track);
    friction_.push_back(each.friction);
    obstacles_.add({each.shape, RigidMotion(each.track.at(0)), each.temperature, static_cast<Index>(tracks_.size())});
    add_heat(each.name, each.material, each.temperature, solid_volume(each.shape));
  }
  if (!bodies.empty()) {
    bodies_ = std::make_unique<RigidBodies>(options, terrain ? std::optional(*terrain) : std::nullopt);
    for (const PlacedObstacle& each : obstacles) {
      const auto shape = Shape::mesh(each.shape.mesh());
      driven_.push_back(each.track.keys().size() > 1 ? bodies_->add_driven(shape, each.track.at(0)) : bodies_->add_static(shape, each.track.at(0)));
    }
    for (const PlacedBody& each : bodies) {
      const auto shape = each.hull ? Shape::hull(each.mesh) : Shape::mesh(each.mesh);
      ids_.push_back(bodies_->add(shape, each.density, each.pose, {.friction = each.friction, .restitution = each.restitution}, each.velocity, each.spin));
      friction_.push_back(each.lava_friction);
      const geometry::CollisionMesh mesh = shape->kind() == Shape::Kind::kMesh ? shape->collision_mesh() : geometry::CollisionMesh(shape->surface());
      obstacles_.add({mesh, RigidMotion(bodies_->body_pose(ids_.back())), each.temperature, static_cast<Index>(tracks_.size() + ids_.size())});
      before_.push_back(bodies_->body_pose(ids_.back()));
      add_heat(each.name, each.material, each.temperature, bodies_->mass(ids_.back()) / each.density);
    }
    acceleration_.assign(ids_.size(), options.gravity);
  }
  obstacles_.update();
}

void SolidWorld::add_heat(std::string name, const Material& material, Real temperature, Real volume) {
  names_.push_back(std::move(name));
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
  for (std::size_t i = 0; i < tracks_.size(); ++i)
    if (tracks_[i].keys().size() > 1) bodies_->move_to(driven_[i], tracks_[i].at(time_ + dt));
  bodies_->step(dt);
  for (std::size_t b = 0; b < ids_.size(); ++b) acceleration_[b] = (bodies_->momenta()[ids_[b]] / bodies_->mass(ids_[b]) - given[b]) / dt;
  last_dt_ = dt;
}

sph::SolidOptions SolidWorld::solids() {
  if (obstacles_.empty()) return {};
  sph::SolidOptions options{&obstacles_, {}, friction_};
  options.effusivity = effusivity_;
  options.heated = [this](std::span<const Real> heat, std::span<const Real> hottest) { warm(heat, hottest); };
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

Vec3 SolidWorld::velocity(std::size_t body) const { return bodies_->momenta()[ids_[body]] / bodies_->mass(ids_[body]); }

void SolidWorld::add_to(StateHash& hash) const {
  for (const Warmth& each : warmth_) hash.add(std::span<const Real>(&each.given, 1));
  if (!has_bodies()) return;
  bodies_->add_to(hash);
  hash.add(std::span<const Vec3>(acceleration_));
}

void SolidWorld::save(StateWriter& out) const {
  if (!warmth_.empty()) out.array("warmth", warmth_);
  if (!has_bodies()) return;
  bodies_->save(out);
  out.array("body_acceleration", acceleration_);
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
  bodies_->load(in);
  std::vector<Vec3> acceleration;
  in.array("body_acceleration", acceleration);
  if (acceleration.size() != ids_.size()) throw InputError(Place{}, "the checkpoint holds other rigid bodies");
  acceleration_ = std::move(acceleration);
  for (std::size_t b = 0; b < ids_.size(); ++b) before_[b] = bodies_->body_pose(ids_[b]);
  last_dt_ = 0;
}

}  // namespace effuse::flow
