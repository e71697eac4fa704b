#include "flow/bodies/joint_solver.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "geometry/base/check.h"
#include "geometry/base/error.h"

namespace effuse::flow::bodies {
namespace {

constexpr Real kInfinity = std::numeric_limits<Real>::infinity();
constexpr Real kGive = 1e-9;  ///< share on the diagonal: far below any error that counts, far above rounding

using Kind = Joint::Kind;

int rows_of(const Joint& j) {
  switch (j.kind) {
    case Kind::kBall: return 3;
    case Kind::kHinge:
    case Kind::kSlider: return 5;
    case Kind::kFixed: return 6;
    case Kind::kDistance: return j.stiffness > 0 || j.low > 0 || j.high < kInfinity ? 0 : 1;
  }
  return 0;
}

/// Where the two sides of a joint are in the world.
struct Sides {
  Vec3 a, b;   // anchors
  Mat3 A, B;   // frames, axis in column 0
};
Sides sides(const JointState& j, const SolverBody& a, const SolverBody& b, int k) {
  const Quat qa = a.orientation(k), qb = b.orientation(k);
  return {a.centre(k) + qa * j.anchor_a, b.centre(k) + qb * j.anchor_b, (qa * j.frame_a).toRotationMatrix(), (qb * j.frame_b).toRotationMatrix()};
}

/// The turn from frame A to frame B, as a vector in the world.
Vec3 turn_between(const Mat3& A, const Mat3& B) {
  const Eigen::AngleAxisd turn(Mat3(B * A.transpose()));
  return turn.angle() * turn.axis();
}

Real hinge_angle(const Sides& s) { return std::atan2(s.B.col(1).dot(s.A.col(2)), s.B.col(1).dot(s.A.col(1))); }
Real cone_tilt(const Sides& s) { return std::atan2(s.A.col(0).cross(s.B.col(0)).norm(), s.A.col(0).dot(s.B.col(0))); }

Real position(const JointState& j, const Sides& s) {
  switch (j.joint.kind) {
    case Kind::kHinge: return hinge_angle(s);
    case Kind::kSlider: return s.A.col(0).dot(s.b - s.a);
    case Kind::kBall: return cone_tilt(s);
    case Kind::kDistance: return (s.b - s.a).norm();
    case Kind::kFixed: break;
  }
  return 0;
}

}  // namespace

JointState make_joint_state(const Joint& joint, const SolverBody& a, const SolverBody& b) {
  const auto refuse = [&](const std::string& why) {
    const auto name = [](BodyId id) { return id == Joint::kWorld ? std::string("world") : fmt::format("{}", id); };
    throw InputError(Place{}, fmt::format("{} joint of bodies {} and {}: {}", kJointNames[static_cast<int>(joint.kind)], name(joint.a), name(joint.b), why));
  };
  if (joint.a == joint.b) refuse("joins a body to itself");
  if (!a.moved_by_impulses() && !b.moved_by_impulses()) refuse("neither can move");
  if (!joint.anchor.allFinite() || !joint.axis.allFinite() || !(joint.axis.norm() > 0)) refuse("anchor and axis must be finite, and the axis not 0");
  if (std::isnan(joint.low) || std::isnan(joint.high) || joint.low > joint.high) refuse(fmt::format("limits {} .. {}", joint.low, joint.high));
  const bool limited = joint.low > -kInfinity || joint.high < kInfinity;
  if (limited && joint.kind == Kind::kFixed) refuse("has no limits");
  if (limited && joint.kind == Kind::kBall && !(joint.high > 0 && joint.high < kPi)) refuse("a cone's half angle lies between 0 and pi");
  if (limited && (joint.kind == Kind::kHinge || joint.kind == Kind::kSlider) && !(joint.low <= 0 && joint.high >= 0)) refuse("limits must contain 0, where it stands");
  if (joint.kind == Kind::kHinge && ((joint.low > -kInfinity && joint.low <= -kPi) || (joint.high < kInfinity && joint.high >= kPi)))
    refuse("limits of a hinge lie between -pi and pi");
  if (!std::isfinite(joint.motor_speed) || !(joint.motor_strength >= 0)) refuse("a motor needs a finite speed and a strength >= 0");
  if (joint.motor_strength > 0 && joint.kind != Kind::kHinge && joint.kind != Kind::kSlider) refuse("only hinges and sliders have motors");
  if (!(joint.stiffness >= 0) || !(joint.damping >= 0) || !std::isfinite(joint.stiffness) || !std::isfinite(joint.damping)) refuse("stiffness and damping must be >= 0");
  const bool spring = joint.stiffness > 0 || joint.damping > 0;
  if (spring && (joint.kind == Kind::kBall || joint.kind == Kind::kFixed)) refuse("only hinges, sliders and distance joints have springs");
  if (spring && joint.motor_strength > 0) refuse("has a motor or a spring, not both");
  if (joint.damping > 0 && joint.stiffness == 0 && joint.kind == Kind::kDistance) refuse("a rod has no damping: a stiffness makes it a spring");

  JointState s;
  s.joint = joint;
  const bool distance = joint.kind == Kind::kDistance;
  const Vec3 on_b = distance ? joint.anchor_b : joint.anchor;
  s.anchor_a = a.q.conjugate() * (joint.anchor - a.x);
  s.anchor_b = b.q.conjugate() * (on_b - b.x);
  const Quat frame = Quat::FromTwoVectors(Vec3::UnitX(), joint.axis).normalized();
  s.frame_a = a.q.conjugate() * frame;
  s.frame_b = b.q.conjugate() * frame;
  s.rest = (on_b - joint.anchor).norm();
  if (distance && !joint.anchor_b.allFinite()) refuse("anchors must be finite");
  if (distance && limited && joint.low > -kInfinity && joint.low < 0) refuse("lengths must be >= 0");
  if (distance && rows_of(joint) == 1 && !(s.rest > 0)) refuse("the ends of a rod must be apart: a ball joins them");
  return s;
}

Real joint_position(const JointState& joint, const SolverBody& a, const SolverBody& b) { return position(joint, sides(joint, a, b, 0)); }

Real joint_error(const JointState& j, const SolverBody& a, const SolverBody& b) {
  const Sides s = sides(j, a, b, 0);
  const Vec3 apart = s.b - s.a;
  switch (j.joint.kind) {
    case Kind::kBall: return apart.norm();
    case Kind::kHinge: return std::max(apart.norm(), cone_tilt(s));
    case Kind::kSlider: return std::max((apart - s.A.col(0) * s.A.col(0).dot(apart)).norm(), turn_between(s.A, s.B).norm());
    case Kind::kFixed: return std::max(apart.norm(), turn_between(s.A, s.B).norm());
    case Kind::kDistance: break;
  }
  const Real length = apart.norm();
  if (rows_of(j.joint) == 1) return std::abs(length - j.rest);
  return std::max({Real{0}, length - j.joint.high, j.joint.low - length});
}

JointSolver::JointSolver(Real h, std::span<const JointId> which, std::span<JointState> joints, std::span<SolverBody> bodies)
    : h_(h), which_(which.begin(), which.end()), joints_(joints), bodies_(bodies) {
  int rows = 0;
  for (const JointId id : which_) {
    const Joint& j = joints[id].joint;
    const int count = rows_of(j);
    if (count == 0) continue;
    blocks_.push_back({id, index(j.a), index(j.b), rows, count});
    rows += count;
  }
  rows_.resize(rows);
  ahead_.resize(rows);
  lambda_.setZero(rows);
  rhs_.setZero(rows);
  if (rows == 0) return;

  // Which joints share a body that can move: the pattern of J M^-1 J^T, lower half.
  std::vector<std::pair<Index, Index>> ends;  // body, block
  for (Index i = 0; i < blocks_.size(); ++i) {
    if (bodies[blocks_[i].a].moved_by_impulses()) ends.push_back({blocks_[i].a, i});
    if (bodies[blocks_[i].b].moved_by_impulses()) ends.push_back({blocks_[i].b, i});
  }
  std::sort(ends.begin(), ends.end());
  std::vector<std::pair<Index, Index>> pairs;
  for (std::size_t e = 0; e < ends.size(); ++e)
    for (std::size_t f = e; f < ends.size() && ends[f].first == ends[e].first; ++f) pairs.push_back({ends[f].second, ends[e].second});
  for (auto& [i, j] : pairs)
    if (i < j) std::swap(i, j);
  std::sort(pairs.begin(), pairs.end());
  pairs.erase(std::unique(pairs.begin(), pairs.end()), pairs.end());

  std::vector<Eigen::Triplet<Real>> pattern;
  for (const auto& [i, j] : pairs)
    for (int r = 0; r < blocks_[i].count; ++r)
      for (int s = 0; s < blocks_[j].count; ++s)
        if (i != j || r >= s) pattern.emplace_back(blocks_[i].first + r, blocks_[j].first + s, 1);
  A_.resize(rows, rows);
  A_.setFromTriplets(pattern.begin(), pattern.end());
  A_.makeCompressed();
  for (const auto& [i, j] : pairs) {
    Meeting m{i, j, {}};
    for (int r = 0; r < blocks_[i].count; ++r)
      for (int s = 0; s < blocks_[j].count; ++s)
        m.place.push_back(i == j && r < s ? -1 : static_cast<int>(&A_.coeffRef(blocks_[i].first + r, blocks_[j].first + s) - A_.valuePtr()));
    meetings_.push_back(std::move(m));
  }
  ldlt_.analyzePattern(A_);
}

void JointSolver::make_rows(const JointState& j, const SolverBody& A, const SolverBody& B, int k, Row* rows) const {
  const Sides s = sides(j, A, B, k);
  const Vec3 xa = A.centre(k), xb = B.centre(k), apart = s.b - s.a;
  const auto at_point = [&](const Vec3& l, const Vec3& at, Real error) { return Row{l, (at - xa).cross(l), (at - xb).cross(l), error}; };
  const auto angular = [](const Vec3& axis, Real error) { return Row{Vec3::Zero(), axis, axis, error}; };
  const Vec3 middle = (s.a + s.b) / 2;
  switch (j.joint.kind) {
    case Kind::kBall:
    case Kind::kHinge:
    case Kind::kFixed:
      for (int c = 0; c < 3; ++c) *rows++ = at_point(Vec3::Unit(c), middle, apart[c]);
      break;
    case Kind::kSlider:
      for (int c = 1; c < 3; ++c) *rows++ = at_point(s.A.col(c), s.b, s.A.col(c).dot(apart));
      break;
    case Kind::kDistance: {
      const Real length = apart.norm();
      const Vec3 u = length > 0 ? Vec3(apart / length) : Vec3::UnitZ();
      *rows++ = at_point(u, middle, length - j.rest);
      break;
    }
  }
  if (j.joint.kind == Kind::kHinge) {
    const Vec3 off = s.A.col(0).cross(s.B.col(0));
    for (int c = 1; c < 3; ++c) *rows++ = angular(s.A.col(c), s.A.col(c).dot(off));
  } else if (j.joint.kind == Kind::kFixed || j.joint.kind == Kind::kSlider) {
    const Vec3 off = turn_between(s.A, s.B);
    for (int c = 0; c < 3; ++c) *rows++ = angular(Vec3::Unit(c), off[c]);
  }
}

void JointSolver::make_extras(Index joint, int k) {
  const JointState& j = joints_[joint];
  const Index a = index(j.joint.a), b = index(j.joint.b);
  const SolverBody &A = bodies_[a], &B = bodies_[b];
  const Sides s = sides(j, A, B, k);
  const Real at = position(j, s);
  Row row{Vec3::Zero(), Vec3::Zero(), Vec3::Zero(), 0};  // of the position's rate
  switch (j.joint.kind) {
    case Kind::kHinge: row.on_a = row.on_b = s.A.col(0); break;
    case Kind::kBall: {
      const Vec3 axis = s.A.col(0).cross(s.B.col(0));
      const Real sine = axis.norm();
      row.on_a = row.on_b = sine > 1e-9 ? Vec3(axis / sine) : Vec3(s.A.col(1));
      break;
    }
    case Kind::kSlider:
    case Kind::kDistance: {
      const Vec3 apart = s.b - s.a;
      const bool slides = j.joint.kind == Kind::kSlider;
      row.l = slides ? Vec3(s.A.col(0)) : apart.norm() > 0 ? Vec3(apart.normalized()) : Vec3::UnitZ();
      row.on_a = (s.b - A.centre(k)).cross(row.l);
      row.on_b = (s.b - B.centre(k)).cross(row.l);
      break;
    }
    case Kind::kFixed: return;
  }
  const Real K = (A.im + B.im) * row.l.squaredNorm() + row.on_a.dot(A.iI * row.on_a) + row.on_b.dot(B.iI * row.on_b);
  if (!(K > 0)) return;
  const auto add = [&](int slot) -> Extra& {
    Extra e{joint, slot, a, b, row, 0, kInfinity};
    e.mass = 1 / K;
    extras_.push_back(e);
    return extras_.back();
  };
  if (j.joint.motor_strength > 0) {
    Extra& e = add(0);
    e.low = -j.joint.motor_strength * h_;
    e.high = -e.low;
    e.target = j.joint.motor_speed;
  }
  if (j.joint.stiffness > 0 || j.joint.damping > 0) {
    // Implicit: impulse = -h (k (C + h rate) + d rate).
    Extra& e = add(0);
    const Real kd = j.joint.damping + h_ * j.joint.stiffness;
    e.low = -kInfinity;
    e.soft = 1 / (h_ * kd);
    e.mass = 1 / (K + e.soft);
    e.target = -(at - j.rest) * j.joint.stiffness / kd;
  }
  const auto limit = [&](int slot, Real room, Real sign) {
    Extra& e = add(slot);
    e.row.l *= sign;
    e.row.on_a *= sign;
    e.row.on_b *= sign;
    e.limit = true;
    e.bias = room;
  };
  if (j.joint.low > -kInfinity) limit(1, at - j.joint.low, 1);
  if (j.joint.high < kInfinity) limit(2, j.joint.high - at, -1);
}

void JointSolver::prepare(int k) {
  extras_.clear();
  for (const JointId id : which_) make_extras(id, k);
  for (const Block& block : blocks_) make_rows(joints_[block.joint], bodies_[block.a], bodies_[block.b], k, &rows_[block.first]);
  if (!blocks_.empty()) fill();
}

void JointSolver::fill() {
  std::fill_n(A_.valuePtr(), A_.nonZeros(), Real{0});
  // Of every body two joints share (or a joint and itself): sign sign (l . l' / m + on . I^-1 on').
  const auto add_body = [&](const Meeting& m, Index body, bool i_is_b, bool j_is_b) {
    const SolverBody& X = bodies_[body];
    if (!X.moved_by_impulses()) return;
    const Block &bi = blocks_[m.i], &bj = blocks_[m.j];
    const Real sign = i_is_b == j_is_b ? 1 : -1;
    for (int s = 0; s < bj.count; ++s) {
      const Row& row_j = rows_[bj.first + s];
      const Vec3 l = X.im * row_j.l, turn = X.iI * (j_is_b ? row_j.on_b : row_j.on_a);
      for (int r = 0; r < bi.count; ++r) {
        const int place = m.place[r * bj.count + s];
        if (place < 0) continue;
        const Row& row_i = rows_[bi.first + r];
        A_.valuePtr()[place] += sign * (row_i.l.dot(l) + (i_is_b ? row_i.on_b : row_i.on_a).dot(turn));
      }
    }
  };
  for (const Meeting& m : meetings_) {
    const Block &bi = blocks_[m.i], &bj = blocks_[m.j];
    if (bi.a == bj.a) add_body(m, bi.a, false, false);
    if (bi.a == bj.b) add_body(m, bi.a, false, true);
    if (bi.b == bj.a) add_body(m, bi.b, true, false);
    if (bi.b == bj.b) add_body(m, bi.b, true, true);
  }
  for (int r = 0; r < A_.rows(); ++r) A_.coeffRef(r, r) *= 1 + kGive;
  ldlt_.factorize(A_);
}

void JointSolver::warm_start() {
  for (const Block& block : blocks_)
    for (int r = 0; r < block.count; ++r) {
      const Real impulse = joints_[block.joint].impulse[r];
      push(rows_[block.first + r], block.a, block.b, impulse);
    }
  for (const Extra& e : extras_) push(e.row, e.a, e.b, joints_[e.joint].impulse[JointState::kHolding + e.slot]);
}

void JointSolver::solve_extras(bool push_out) {
  for (const Extra& e : extras_) {
    Real& total = joints_[e.joint].impulse[JointState::kHolding + e.slot];
    Real target = e.target;
    if (e.limit) target = e.bias > 0 ? -e.bias / h_ : push_out ? -0.2 * e.bias / h_ : 0;
    const Real now = rate(e.row, bodies_[e.a], bodies_[e.b]);
    const Real wanted = std::clamp(total - e.mass * (now - target + e.soft * total), e.low, e.high);
    push(e.row, e.a, e.b, wanted - total);
    total = wanted;
  }
}

void JointSolver::solve_holding(bool push_out) {
  if (blocks_.empty()) return;
  for (const Block& block : blocks_)
    for (int r = 0; r < block.count; ++r) {
      const Row& row = rows_[block.first + r];
      rhs_[block.first + r] = -rate(row, bodies_[block.a], bodies_[block.b]) - (push_out ? row.error / h_ : 0);
    }
  lambda_ = ldlt_.solve(rhs_);
  for (const Block& block : blocks_)
    for (int r = 0; r < block.count; ++r) {
      push(rows_[block.first + r], block.a, block.b, lambda_[block.first + r]);
      joints_[block.joint].impulse[r] += lambda_[block.first + r];
    }
}

Real JointSolver::refine(int k, Real tolerance) {
  Real worst = 0;
  for (const Block& block : blocks_) {
    make_rows(joints_[block.joint], bodies_[block.a], bodies_[block.b], k, &ahead_[block.first]);
    for (int r = block.first; r < block.first + block.count; ++r) {
      worst = std::max(worst, std::abs(ahead_[r].error));
      rhs_[r] = -ahead_[r].error / h_;
    }
  }
  if (!(worst > tolerance)) return worst;
  lambda_ = ldlt_.solve(rhs_);
  for (const Block& block : blocks_)
    for (int r = 0; r < block.count; ++r) {
      push(rows_[block.first + r], block.a, block.b, lambda_[block.first + r]);
      joints_[block.joint].impulse[r] += lambda_[block.first + r];
    }
  return worst;
}

}  // namespace effuse::flow::bodies
