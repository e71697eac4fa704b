#include "flow/bodies/rigid_bodies.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "flow/bodies/rigid_bodies_internal.h"
#include "geometry/base/check.h"
#include "geometry/base/error.h"

namespace effuse::flow::bodies {

using geometry::RigidPose;

namespace {

constexpr std::string_view kModel = "rigid bodies 2";
constexpr Real kInfinity = std::numeric_limits<Real>::infinity();

RigidPose combined(const RigidPose& a, const RigidPose& b) { return {a.world(b.position), (a.orientation * b.orientation).normalized()}; }
RigidPose inverse(const RigidPose& p) { return {-(p.orientation.conjugate() * p.position), p.orientation.conjugate()}; }

}  // namespace

Real penalty_step_limit(const BodyOptions& o, Real springs) {
  const Real zeta = o.penalty_damping;
  return 2 * (std::sqrt(zeta * zeta + 1 / springs) - zeta) / (2 * kPi * o.penalty_frequency);
}

RigidBodies::RigidBodies(const BodyOptions& o, std::optional<geometry::Terrain> terrain) : impl_(std::make_unique<Impl>(o, std::move(terrain))) {
  CHECK(o.gravity.allFinite());
  CHECK(o.step > 0 && std::isfinite(o.step));
  CHECK_GE(o.substeps, 1);
  CHECK_GE(o.iterations, 1);
  CHECK_GE(o.max_looks, 1);
  CHECK(o.penalty_frequency > 0 && std::isfinite(o.penalty_frequency) && o.penalty_damping >= 0 && std::isfinite(o.penalty_damping) && o.penalty_springs > 0);
  CHECK(o.restitution_speed >= 0 && o.push_speed > 0 && o.margin > 0);
  CHECK(o.terrain_friction >= 0 && o.terrain_restitution >= 0 && o.terrain_restitution <= 1);
  CHECK(o.sleep_speed >= 0 && o.sleep_delay >= 0);
}
RigidBodies::~RigidBodies() = default;
RigidBodies::RigidBodies(RigidBodies&&) noexcept = default;
RigidBodies& RigidBodies::operator=(RigidBodies&&) noexcept = default;

BodyId RigidBodies::Impl::add(std::shared_ptr<const Shape> s, Role r, Real density, const RigidPose& pose, const Surface& material, const Vec3& v, const Vec3& w) {
  CHECK(s != nullptr);
  CHECK(pose.position.allFinite() && pose.orientation.coeffs().allFinite() && pose.orientation.norm() > 0);
  CHECK(v.allFinite() && w.allFinite());
  CHECK(material.friction >= 0 && material.restitution >= 0 && material.restitution <= 1 && material.rolling >= 0);
  const bool moves = r == Role::kDynamic;
  if (moves) CHECK(density > 0 && std::isfinite(density));
  if (moves && !s->solid()) throw InputError(Place{}, "a body that is to move must enclose a volume: this mesh has an open or crossing part");
  const RigidPose given{pose.position, pose.orientation.normalized()};
  const RigidPose body = combined(given, inverse(s->body_from_given()));
  const Real m = moves ? density * s->volume() : kInfinity;
  const Vec3 I = moves ? Vec3(density * s->moments()) : Vec3::Ones();
  shape.push_back(std::move(s));
  role.push_back(r);
  mass.push_back(m);
  moments.push_back(I);
  surface.push_back(material);
  x.push_back(body.position);
  q.push_back(body.orientation);
  p.push_back(moves ? Vec3(m * v) : Vec3::Zero());
  const Mat3 R = body.orientation.toRotationMatrix();
  L.push_back(moves ? Vec3(R * (I.cwiseProduct(R.transpose() * w))) : Vec3::Zero());
  rested.push_back(0);
  group.push_back(0);
  force.push_back(Vec3::Zero());
  torque.push_back(Vec3::Zero());
  target.push_back(body);
  driven_now.push_back(0);
  recorded.push_back(0);
  placed.emplace_back();
  placed_well.push_back(0);
  motion.emplace_back(body);
  path.emplace_back();
  return static_cast<BodyId>(size() - 1);
}

BodyId RigidBodies::add(std::shared_ptr<const Shape> shape, Real density, const RigidPose& pose, const Surface& surface, const Vec3& velocity, const Vec3& spin) {
  return impl_->add(std::move(shape), Role::kDynamic, density, pose, surface, velocity, spin);
}
BodyId RigidBodies::add_static(std::shared_ptr<const Shape> shape, const RigidPose& pose, const Surface& surface) {
  return impl_->add(std::move(shape), Role::kStatic, 1, pose, surface, Vec3::Zero(), Vec3::Zero());
}
BodyId RigidBodies::add_driven(std::shared_ptr<const Shape> shape, const RigidPose& pose, const Surface& surface) {
  return impl_->add(std::move(shape), Role::kDriven, 1, pose, surface, Vec3::Zero(), Vec3::Zero());
}

void RigidBodies::move_to(BodyId id, const RigidPose& pose) {
  Impl& m = *impl_;
  CHECK_LT(id, m.size());
  CHECK(m.role[id] == Role::kDriven);
  CHECK(pose.position.allFinite() && pose.orientation.coeffs().allFinite() && pose.orientation.norm() > 0);
  m.target[id] = combined({pose.position, pose.orientation.normalized()}, inverse(m.shape[id]->body_from_given()));
  m.driven_now[id] = 1;
}

JointId RigidBodies::join(const Joint& joint) {
  Impl& m = *impl_;
  for (const BodyId end : {joint.a, joint.b})
    if (end != Joint::kWorld) CHECK_LT(end, m.size());
  m.joints.push_back(make_joint_state(joint, m.solver_body(joint.a), m.solver_body(joint.b)));
  m.wake_group(joint.a);
  m.wake_group(joint.b);
  return static_cast<JointId>(m.joints.size() - 1);
}

void RigidBodies::set_motor(JointId joint, Real speed, Real strength) {
  Impl& m = *impl_;
  CHECK_LT(joint, m.joints.size());
  Joint& j = m.joints[joint].joint;
  CHECK(j.kind == Joint::Kind::kHinge || j.kind == Joint::Kind::kSlider);
  CHECK(std::isfinite(speed) && strength >= 0);
  if (j.motor_speed == speed && j.motor_strength == strength) return;
  j.motor_speed = speed;
  j.motor_strength = strength;
  m.wake_group(j.a);
  m.wake_group(j.b);
}

void RigidBodies::unjoin(JointId joint) {
  Impl& m = *impl_;
  CHECK_LT(joint, m.joints.size());
  if (m.joints[joint].broken) return;
  m.joints[joint].broken = true;
  m.wake_group(m.joints[joint].joint.a);
  m.wake_group(m.joints[joint].joint.b);
}

void RigidBodies::Impl::wake_group(Index i) {
  if (i == Joint::kWorld) return;
  const std::uint64_t g = group[i];
  rested[i] = 0;
  if (g == 0) return;
  for (Index k = 0; k < size(); ++k)
    if (group[k] == g) {
      group[k] = 0;
      rested[k] = 0;
    }
}

SolverBody RigidBodies::Impl::solver_body(Index i) const {
  SolverBody b;
  if (i == Joint::kWorld) return b;
  b.x = x[i];
  b.q = q[i];
  b.keeps_axes = shape[i]->kind() == Shape::Kind::kSphere;
  if (dynamic(i)) {
    b.p = p[i];
    b.L = L[i];
    b.im = 1 / mass[i];
    b.moments = moments[i];
    b.force = mass[i] * options.gravity + force[i];
    b.torque = torque[i];
  }
  b.refresh();
  return b;
}

void RigidBodies::add_force(BodyId id, const Vec3& f, const Vec3& at) {
  Impl& m = *impl_;
  CHECK_LT(id, m.size());
  CHECK(f.allFinite() && at.allFinite());
  if (!m.dynamic(id) || f.isZero(0)) return;
  m.force[id] += f;
  m.torque[id] += (at - m.x[id]).cross(f);
  m.wake_group(id);
}

void RigidBodies::add_torque(BodyId id, const Vec3& torque) {
  Impl& m = *impl_;
  CHECK_LT(id, m.size());
  CHECK(torque.allFinite());
  if (!m.dynamic(id) || torque.isZero(0)) return;
  m.torque[id] += torque;
  m.wake_group(id);
}

void RigidBodies::add_impulse(BodyId id, const Vec3& impulse, const Vec3& at) {
  Impl& m = *impl_;
  CHECK_LT(id, m.size());
  CHECK(impulse.allFinite() && at.allFinite());
  if (!m.dynamic(id) || impulse.isZero(0)) return;
  m.p[id] += impulse;
  m.L[id] += (at - m.x[id]).cross(impulse);
  m.wake_group(id);
}

Vec3 RigidBodies::velocity_at(BodyId id, const Vec3& at) const {
  const Impl& m = *impl_;
  CHECK_LT(id, m.size());
  if (m.role[id] == Role::kDriven) return m.motion[id].velocity_at(at, 1);
  return m.velocity(id) + m.spin(id).cross(at - m.x[id]);
}

Mat3 RigidBodies::inverse_mass_at(BodyId id, const Vec3& at) const {
  const Impl& m = *impl_;
  CHECK_LT(id, m.size());
  if (!m.dynamic(id)) return Mat3::Zero();
  const Vec3 r = at - m.x[id];
  Mat3 cross;
  cross << 0, -r.z(), r.y(), r.z(), 0, -r.x(), -r.y(), r.x(), 0;
  return Mat3::Identity() / m.mass[id] - cross * m.solver_body(id).iI * cross;
}

// ---- breaking --------------------------------------------------------------------------------------------------------

void RigidBodies::retire(BodyId id) {
  Impl& m = *impl_;
  CHECK_LT(id, m.size());
  CHECK(m.role[id] != Role::kGone);
  m.wake_group(id);
  for (const ContactPoint& c : m.points)
    if (c.b != kTerrain && (c.a == id || c.b == id)) m.wake_group(c.a == id ? c.b : c.a);
  std::erase_if(m.points, [&](const ContactPoint& c) { return c.a == id || c.b == id; });
  m.role[id] = Role::kGone;
  m.p[id].setZero();
  m.L[id].setZero();
  m.force[id].setZero();
  m.torque[id].setZero();
  m.recorded[id] = 0;
  if (m.broad && id < m.broad->size()) m.broad->remove(id);
}

void RigidBodies::hand_joints(BodyId from, const std::function<BodyId(const Vec3&)>& to) {
  Impl& m = *impl_;
  for (JointState& j : m.joints) {
    if (j.broken) continue;
    for (const bool first : {true, false}) {
      BodyId& id = first ? j.joint.a : j.joint.b;
      if (id != from) continue;
      Vec3& anchor = first ? j.anchor_a : j.anchor_b;
      Quat& frame = first ? j.frame_a : j.frame_b;
      const Vec3 at = m.x[from] + m.q[from] * anchor;
      const BodyId next = to(at);
      CHECK_LT(next, m.size());
      id = next;
      anchor = m.q[next].conjugate() * (at - m.x[next]);
      frame = (m.q[next].conjugate() * m.q[from] * frame).normalized();
    }
  }
}

void RigidBodies::record_loads(BodyId id, bool on) {
  CHECK_LT(id, size());
  impl_->recorded[id] = on;
}
std::span<const ContactLoad> RigidBodies::contact_loads() const { return impl_->loads; }
bool RigidBodies::is_gone(BodyId id) const { return impl_->role.at(id) == Role::kGone; }
const Surface& RigidBodies::surface(BodyId id) const { return impl_->surface.at(id); }
Vec3 RigidBodies::force(BodyId id) const { return impl_->force.at(id); }
Vec3 RigidBodies::torque(BodyId id) const { return impl_->torque.at(id); }

struct RigidBodies::Moment {
  Impl::Saved state;
  std::vector<Vec3> force, torque;
  std::vector<geometry::RigidPose> target;
  std::vector<std::uint8_t> driven_now;
};

std::shared_ptr<const RigidBodies::Moment> RigidBodies::moment() const {
  const Impl& m = *impl_;
  return std::make_shared<const Moment>(Moment{m.saved(), m.force, m.torque, m.target, m.driven_now});
}

void RigidBodies::go_back(const Moment& moment) {
  Impl& m = *impl_;
  CHECK_EQ(moment.force.size(), m.size());
  m.restore(moment.state);
  m.force = moment.force;
  m.torque = moment.torque;
  m.target = moment.target;
  m.driven_now = moment.driven_now;
}

// ---- questions -------------------------------------------------------------------------------------------------------

void RigidBodies::wake(BodyId id) {
  CHECK_LT(id, size());
  impl_->wake_group(id);
}
std::size_t RigidBodies::size() const { return impl_->size(); }
Real RigidBodies::time() const { return impl_->time; }
const BodyOptions& RigidBodies::options() const { return impl_->options; }
bool RigidBodies::is_dynamic(BodyId id) const { return impl_->role.at(id) == Role::kDynamic; }
bool RigidBodies::asleep(BodyId id) const { return impl_->group.at(id) != 0; }
const Shape& RigidBodies::shape(BodyId id) const { return *impl_->shape.at(id); }
Real RigidBodies::mass(BodyId id) const { return impl_->mass.at(id); }
RigidPose RigidBodies::pose(BodyId id) const { return combined(body_pose(id), impl_->shape.at(id)->body_from_given()); }
RigidPose RigidBodies::body_pose(BodyId id) const { return {impl_->x.at(id), impl_->q.at(id)}; }
Vec3 RigidBodies::spin(BodyId id) const {
  CHECK_LT(id, size());
  return impl_->spin(id);
}
std::span<const Vec3> RigidBodies::centres() const { return impl_->x; }
std::span<const Quat> RigidBodies::orientations() const { return impl_->q; }
std::span<const Vec3> RigidBodies::momenta() const { return impl_->p; }
std::span<const Vec3> RigidBodies::angular_momenta() const { return impl_->L; }

Real RigidBodies::kinetic_energy() const {
  const Impl& m = *impl_;
  Real sum = 0;
  for (Index i = 0; i < m.size(); ++i)
    if (m.dynamic(i)) sum += m.p[i].squaredNorm() / (2 * m.mass[i]) + m.spin(i).dot(m.L[i]) / 2;
  return sum;
}

Real RigidBodies::potential_energy() const {
  const Impl& m = *impl_;
  Real sum = 0;
  for (Index i = 0; i < m.size(); ++i)
    if (m.dynamic(i)) sum -= m.mass[i] * m.options.gravity.dot(m.x[i]);
  return sum;
}

Real RigidBodies::joint_error(JointId joint) const {
  const JointState& j = impl_->joints.at(joint);
  return bodies::joint_error(j, impl_->solver_body(j.joint.a), impl_->solver_body(j.joint.b));
}
Real RigidBodies::joint_position(JointId joint) const {
  const JointState& j = impl_->joints.at(joint);
  return bodies::joint_position(j, impl_->solver_body(j.joint.a), impl_->solver_body(j.joint.b));
}

std::vector<RigidBodies::Touch> RigidBodies::touches() const {
  static_assert(Touch::kTerrain == kTerrain);
  std::vector<Touch> out;
  for (const ContactPoint& c : impl_->points) {
    const Vec3 at = impl_->solver_body(c.a).place(c.on_a, 0);
    out.push_back({c.a, c.b, at, c.normal, c.separation, c.push});
  }
  return out;
}

// ---- checkpoints -----------------------------------------------------------------------------------------------------

template <class Self, class Archive>
void RigidBodies::Impl::archive(Self& m, Archive& io) {
  io.value("bodies_time", m.time);
  io.array("body_x", m.x);
  io.array("body_p", m.p);
  io.array("body_L", m.L);
  io.array("body_rested", m.rested);
  io.array("body_group", m.group);
  io.value("body_groups", m.groups);
}

void RigidBodies::add_to(StateHash& hash) const {
  const Impl& m = *impl_;
  hash.add(m.time);
  hash.add(std::span<const Vec3>(m.x));
  hash.add(std::span<const Vec3>(m.p));
  hash.add(std::span<const Vec3>(m.L));
  for (const Quat& q : m.q)
    for (int k = 0; k < 4; ++k) hash.add(q.coeffs()[k]);
  hash.add(std::span<const Real>(m.rested));
  hash.add(std::span<const std::uint64_t>(m.group));
  for (const ContactPoint& c : m.points) {
    hash.add(c.push);
    hash.add(std::span<const Vec3>(&c.drag, 1));
  }
  for (const JointState& j : m.joints) hash.add(std::span<const Real>(j.impulse));
}

void RigidBodies::save(StateWriter& out) const {
  const Impl& m = *impl_;
  out.text("model", kModel);
  Impl::archive(m, out);
  std::vector<Real> q;
  for (const Quat& r : m.q) q.insert(q.end(), {r.w(), r.x(), r.y(), r.z()});
  out.array("body_q", q);
  std::vector<Index> ends;
  std::vector<Vec3> vectors;
  std::vector<Real> numbers;
  for (const ContactPoint& c : m.points) {
    ends.insert(ends.end(), {c.a, c.b});
    vectors.insert(vectors.end(), {c.on_a, c.on_b, c.normal, c.drag, c.twist});
    numbers.insert(numbers.end(), {c.separation, c.push, c.of_a});
  }
  out.array("contact_bodies", ends);
  out.array("contact_vectors", vectors);
  out.array("contact_numbers", numbers);
  std::vector<Real> impulses;
  std::vector<std::uint8_t> broken;
  for (const JointState& j : m.joints) {
    impulses.insert(impulses.end(), j.impulse.begin(), j.impulse.end());
    impulses.insert(impulses.end(), {j.joint.motor_speed, j.joint.motor_strength});
    broken.push_back(j.broken);
  }
  out.array("joint_impulses", impulses);
  out.array("joint_broken", broken);
  // Ends move on to other bodies when theirs breaks.
  std::vector<Index> joined;
  std::vector<Real> frames;
  for (const JointState& j : m.joints) {
    joined.insert(joined.end(), {j.joint.a, j.joint.b});
    for (const Vec3& anchor : {j.anchor_a, j.anchor_b}) frames.insert(frames.end(), {anchor.x(), anchor.y(), anchor.z()});
    for (const Quat& frame : {j.frame_a, j.frame_b}) frames.insert(frames.end(), {frame.w(), frame.x(), frame.y(), frame.z()});
  }
  out.array("joint_bodies", joined);
  out.array("joint_frames", frames);
}

void RigidBodies::load(StateReader& in) {
  Impl& m = *impl_;
  const Impl::Saved before = m.saved();
  const auto refuse = [](const std::string& why) { throw InputError(Place{}, "the checkpoint of the rigid bodies " + why); };
  try {
    std::string model;
    in.text("model", model);
    if (model != kModel) refuse(fmt::format("holds '{:.40}', wanted '{}'", model, kModel));
    const std::size_t n = m.size();
    Impl::archive(m, in);
    std::vector<Real> q, numbers, impulses;
    std::vector<Index> ends;
    std::vector<Vec3> vectors;
    std::vector<std::uint8_t> broken;
    in.array("body_q", q);
    in.array("contact_bodies", ends);
    in.array("contact_vectors", vectors);
    in.array("contact_numbers", numbers);
    in.array("joint_impulses", impulses);
    in.array("joint_broken", broken);
    std::vector<Index> joined;
    std::vector<Real> frames;
    in.array("joint_bodies", joined);
    in.array("joint_frames", frames);
    const std::size_t count = ends.size() / 2;
    constexpr std::size_t kNumbers = JointState::kHolding + JointState::kExtras + 2;
    if (m.x.size() != n || m.p.size() != n || m.L.size() != n || m.rested.size() != n || m.group.size() != n || q.size() != 4 * n)
      refuse(fmt::format("has {} bodies, here are {}", m.x.size(), n));
    if (ends.size() != 2 * count || vectors.size() != 5 * count || numbers.size() != 3 * count) refuse("has contacts of different lengths");
    constexpr std::size_t kFrames = 14;
    if (broken.size() != m.joints.size() || joined.size() != 2 * broken.size() || frames.size() != kFrames * broken.size() || impulses.size() != kNumbers * m.joints.size())
      refuse(fmt::format("has {} joints, here are {}", broken.size(), m.joints.size()));
    for (std::size_t i = 0; i < n; ++i) m.q[i] = Quat(q[4 * i], q[4 * i + 1], q[4 * i + 2], q[4 * i + 3]);
    m.points.assign(count, {});
    for (std::size_t k = 0; k < count; ++k) {
      ContactPoint& c = m.points[k];
      c.a = ends[2 * k];
      c.b = ends[2 * k + 1];
      if (c.a >= n || (c.b >= n && c.b != kTerrain)) refuse("has a contact of a body that is not there");
      c.on_a = vectors[5 * k];
      c.on_b = vectors[5 * k + 1];
      c.normal = vectors[5 * k + 2];
      c.drag = vectors[5 * k + 3];
      c.twist = vectors[5 * k + 4];
      c.separation = numbers[3 * k];
      c.push = numbers[3 * k + 1];
      c.of_a = numbers[3 * k + 2];
    }
    for (std::size_t j = 0; j < m.joints.size(); ++j) {
      JointState& joint = m.joints[j];
      std::copy_n(impulses.begin() + static_cast<std::ptrdiff_t>(kNumbers * j), joint.impulse.size(), joint.impulse.begin());
      joint.joint.motor_speed = impulses[kNumbers * (j + 1) - 2];
      joint.joint.motor_strength = impulses[kNumbers * (j + 1) - 1];
      joint.broken = broken[j] != 0;
      joint.joint.a = joined[2 * j];
      joint.joint.b = joined[2 * j + 1];
      for (const BodyId end : {joint.joint.a, joint.joint.b})
        if (end >= n && end != Joint::kWorld) refuse("has a joint of a body that is not there");
      const Real* f = frames.data() + kFrames * j;
      joint.anchor_a = Vec3(f[0], f[1], f[2]);
      joint.anchor_b = Vec3(f[3], f[4], f[5]);
      joint.frame_a = Quat(f[6], f[7], f[8], f[9]);
      joint.frame_b = Quat(f[10], f[11], f[12], f[13]);
    }
  } catch (...) {
    m.restore(before);
    throw;
  }
  std::fill(m.placed_well.begin(), m.placed_well.end(), std::uint8_t{0});
}

std::size_t RigidBodies::memory() const {
  const Impl& m = *impl_;
  std::size_t bytes = m.points.capacity() * sizeof(ContactPoint) + m.joints.capacity() * sizeof(JointState) + m.solver.capacity() * sizeof(SolverBody);
  bytes += m.size() * (4 * sizeof(Vec3) + 3 * sizeof(Vec3) + sizeof(Quat) + sizeof(PlacedShape) + sizeof(geometry::RigidMotion) + 2 * sizeof(RigidPose));
  for (const PlacedShape& s : m.placed)
    for (const geometry::ConvexHull& hull : s.hulls) bytes += hull.vertices.capacity() * sizeof(Vec3) + hull.faces.capacity() * sizeof(geometry::ConvexHull::Face);
  return bytes;
}

}  // namespace effuse::flow::bodies
