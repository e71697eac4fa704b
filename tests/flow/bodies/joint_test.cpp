#include "flow/bodies/joint.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "flow/reference/rigid_motion.h"
#include "geometry/base/error.h"
#include "tests/flow/bodies/worlds.h"

namespace effuse::flow::bodies {
namespace {

using geometry::RigidPose;
using worlds::at;
using Kind = Joint::Kind;

Joint make(Kind kind, BodyId a, BodyId b, const Vec3& anchor, const Vec3& axis = Vec3::UnitY()) {
  Joint j;
  j.kind = kind;
  j.a = a;
  j.b = b;
  j.anchor = anchor;
  j.axis = axis;
  return j;
}

/// Something to hang others on.
BodyId nail(RigidBodies& world, const Vec3& x = Vec3::Zero()) { return world.add_static(Shape::sphere(0.01), {x, Quat::Identity()}); }

/// A bar of length 1, section 0.1, on a hinge at its end, let go at this angle from hanging.
struct Swing {
  Real period = 0, exact = 0, energy_drift = 0, joint_error = 0;
};
Swing swing(Real amplitude, Kind kind, Real dt, Real seconds) {
  RigidBodies world(worlds::awake());
  const BodyId hook = nail(world);
  const Quat q(Eigen::AngleAxisd(amplitude, -Vec3::UnitY()));
  const BodyId bar = world.add(Shape::box(Vec3(0.05, 0.05, 0.5)), 1000, {q * Vec3(0, 0, -0.5), q});
  world.join(make(kind, hook, bar, Vec3::Zero()));
  const Real m = world.mass(bar), I = m / 12 * (1 + 0.01) + m / 4;
  const reference::Pendulum pendulum{std::sqrt(m * kGravity * 0.5 / I), amplitude};
  const Real E = worlds::energy(world), depth = m * kGravity * 0.5 * (1 - std::cos(amplitude));
  Swing s;
  s.exact = pendulum.period();
  Real before = amplitude, first = 0, last = 0;
  int crossings = 0;
  while (world.time() < seconds) {
    const Real t = world.time();
    const BodyReport report = world.step(dt);
    const Vec3 x = world.centres()[bar];
    const Real angle = std::atan2(x.x(), -x.z());
    if (before < 0 && angle >= 0) {
      last = t + (world.time() - t) * -before / (angle - before);
      if (crossings++ == 0) first = last;
    }
    before = angle;
    s.energy_drift = std::max(s.energy_drift, std::abs(worlds::energy(world) - E) / depth);
    s.joint_error = std::max(s.joint_error, report.joint_error);
  }
  s.period = (last - first) / (crossings - 1);
  return s;
}

TEST(Joints, APendulumKeepsItsPeriodAndItsEnergy) {
  for (const Kind kind : {Kind::kHinge, Kind::kBall}) {
    const Swing s = swing(kPi / 3, kind, 1.0 / 120, 60);
    EXPECT_NEAR(s.period / s.exact, 1, 2e-5);  // the bar is 1e-3
    EXPECT_LT(s.energy_drift, 1e-3);
    EXPECT_LT(s.joint_error, 1e-6);
  }
  EXPECT_NEAR(swing(170 * kPi / 180, Kind::kHinge, 1.0 / 120, 60).period / swing(170 * kPi / 180, Kind::kHinge, 1.0 / 120, 1).exact, 1, 1e-3);
}

TEST(Joints, ThePeriodConvergesWithTheSquareOfTheStep) {
  const auto error = [](Real dt) {
    const Swing s = swing(kPi / 3, Kind::kHinge, dt, 40);
    return std::abs(s.period / s.exact - 1);
  };
  // Steps below options.step are looks of their own, four substeps each.
  const Real coarse = error(1.0 / 120), fine = error(1.0 / 240);
  EXPECT_NEAR(std::log2(coarse / fine), 2, 0.3) << coarse << " -> " << fine;
}

TEST(JointsSlow, AChainOfTwentyHingesHoldsTogetherHoweverItSwings) {
  for (const bool across : {false, true}) {
    RigidBodies world(worlds::awake());
    const auto link = Shape::box(Vec3(0.25, 0.05, 0.05));
    BodyId last = nail(world);
    for (int k = 0; k < 20; ++k) {
      const BodyId next = world.add(link, 1000, at(0.25 + 0.5 * k, 0, 0));
      world.join(make(Kind::kHinge, last, next, Vec3(0.5 * k, 0, 0), across && k % 2 ? Vec3(0, 1, 1) : Vec3(0, 1, 0)));
      last = next;
    }
    Real error = 0;
    const Real E = worlds::energy(world);
    Real most = -1e9;
    for (int k = 0; k < 10 * 120; ++k) {
      error = std::max(error, world.step(1.0 / 120).joint_error);
      most = std::max(most, worlds::energy(world) - E);
    }
    EXPECT_LT(error, 1e-3 * 0.5);  // of a link's length
    EXPECT_LT(most, 1e-3 * world.mass(1) * 20 * kGravity * 5) << "energy from nowhere";
  }
}

TEST(Joints, AHeavyBallOnALightChainHangsStill) {
  RigidBodies world(worlds::awake());
  BodyId last = nail(world);
  for (int k = 0; k < 10; ++k) {
    const BodyId next = world.add(Shape::box(Vec3(0.05, 0.05, 0.25)), 100, at(0, 0, -0.25 - 0.5 * k));
    world.join(make(Kind::kBall, last, next, Vec3(0, 0, -0.5 * k)));
    last = next;
  }
  const BodyId ball = world.add(Shape::sphere(1), 5000, at(0, 0, -6));
  world.join(make(Kind::kBall, last, ball, Vec3(0, 0, -5)));
  EXPECT_GT(world.mass(ball) / world.mass(1), 10000);
  worlds::run(world, 10);
  EXPECT_NEAR(world.centres()[ball].z(), -6, 1e-6);
  EXPECT_LT(world.kinetic_energy(), 1e-6);
}

TEST(Joints, ALightChainHoldsWhenAHeavyBallJerksIt) {
  // 12 links of 84 kg, a ball of 24 t: thrown up, so that the chain goes slack and the ball falls into it; or swung into a stack.
  for (const bool stack : {false, true}) {
    RigidBodies world(worlds::awake(), stack ? std::optional(worlds::plane()) : std::nullopt);
    const Real top = stack ? 8 : 0;
    const auto link = Shape::box(Vec3(0.07, 0.07, 0.275));
    BodyId last = Joint::kWorld;
    for (int k = 0; k < 12; ++k) {
      const BodyId next = world.add(link, 7800, at(0, 0, top - 0.25 - 0.5 * k));
      world.join(make(Kind::kBall, last, next, Vec3(0, 0, top - 0.5 * k)));
      last = next;
    }
    const BodyId ball = world.add(Shape::sphere(0.9), 7800, at(0, 0, top - 6.9), {}, stack ? Vec3(9, 0.5, 0) : Vec3(5, 0, 9));
    world.join(make(Kind::kFixed, last, ball, Vec3(0, 0, top - 6)));
    const auto block = Shape::box(Vec3::Constant(0.4));
    for (int k = 0; stack && k < 15; ++k) world.add(block, 2000, at(2.5, 0.85 * (k / 5 - 1), 0.4 + 0.8 * (k % 5)));
    Real error = 0;
    const Real E = worlds::energy(world);
    for (int k = 0; k < 5 * 120; ++k) {
      error = std::max(error, world.step(1.0 / 120).joint_error);
    }
    EXPECT_LT(error, 1e-3 * 0.5) << "of a link's length";
    EXPECT_LT(worlds::energy(world), E) << "a jerk takes energy, it gives none";
  }
}

TEST(Joints, OfEveryKindLeaveTheFreedomTheyNameAndNoOther) {
  for (const Kind kind : {Kind::kBall, Kind::kHinge, Kind::kSlider, Kind::kFixed, Kind::kDistance}) {
    SCOPED_TRACE(kJointNames[static_cast<int>(kind)]);
    RigidBodies world(worlds::weightless());
    const BodyId a = world.add(Shape::box(Vec3(0.5, 0.2, 0.1)), 1000, at(0, 0, 0), {}, Vec3(0, 0.1, 0.3), Vec3(1, 2, -3));
    const BodyId b = world.add(Shape::box(Vec3(0.2, 0.3, 0.4)), 500, at(1, 0, 0), {}, Vec3(1, -0.5, 0), Vec3(-2, 1, 2));
    Joint j = make(kind, a, b, Vec3(0.6, 0, 0), Vec3(1, 1, 0));
    j.anchor_b = Vec3(0.8, 0.1, 0);
    const JointId id = world.join(j);
    const Vec3 p = worlds::total_momentum(world), L = worlds::total_angular_momentum(world);
    world.step(1.0 / 120);  // the velocities did not fit the joint before
    const Real E = worlds::energy(world);
    Real error = 0, waver = 0, low = 1e9, high = -1e9;
    for (int k = 0; k < 600; ++k) {
      world.step(1.0 / 120);
      error = std::max(error, world.joint_error(id));
      waver = std::max(waver, std::abs(worlds::energy(world) / E - 1));
      low = std::min(low, world.joint_position(id));
      high = std::max(high, world.joint_position(id));
    }
    EXPECT_LT(error, 1e-5);
    EXPECT_LT(waver, 2e-3);
    EXPECT_LT((worlds::total_momentum(world) - p).norm(), 1e-11 * p.norm());
    EXPECT_LT((worlds::total_angular_momentum(world) - L).norm(), 1e-10 * L.norm());
    if (kind == Kind::kFixed) { EXPECT_EQ(high, 0); }
    if (kind == Kind::kDistance) { EXPECT_NEAR(low, high, 1e-5); }
    if (kind == Kind::kHinge) { EXPECT_GT(high - low, 1); }
    if (kind == Kind::kSlider) { EXPECT_GT(high - low, 0.5); }
    if (kind == Kind::kBall) { EXPECT_GT(high, 0.5); }
  }
}

TEST(Joints, LimitsAreKept) {
  RigidBodies world(worlds::awake());
  const BodyId hook = nail(world);
  const auto bar = Shape::box(Vec3(0.5, 0.05, 0.05));
  const auto add = [&](Real y) { return world.add(bar, 1000, at(0.5, y, 0)); };
  Joint hinge = make(Kind::kHinge, hook, add(0), Vec3::Zero());
  hinge.low = -0.2;
  hinge.high = 0.7;
  Joint slider = make(Kind::kSlider, hook, add(2), Vec3(0.5, 2, 0), Vec3::UnitZ());
  slider.low = -0.3;
  slider.high = 0;
  Joint cone = make(Kind::kBall, hook, add(4), Vec3(0, 4, 0), Vec3::UnitX());
  cone.high = 0.5;
  Joint rope = make(Kind::kDistance, hook, add(6), Vec3(0, 6, 0));
  rope.anchor_b = Vec3(0.5, 6, 0);
  rope.low = 0;
  rope.high = 2;
  const JointId ids[] = {world.join(hinge), world.join(slider), world.join(cone), world.join(rope)};
  const Real low[] = {-0.2, -0.3, 0, 0}, high[] = {0.7, 0, 0.5, 2};
  for (int k = 0; k < 600; ++k) {
    world.step(1.0 / 120);
    for (int i = 0; i < 4; ++i) {
      EXPECT_GT(world.joint_position(ids[i]), low[i] - 5e-3) << i;
      EXPECT_LT(world.joint_position(ids[i]), high[i] + 5e-3) << i;
    }
  }
  // About +y gravity turns +x down: the hinge ends at its upper limit, the slider at its lower.
  EXPECT_NEAR(world.joint_position(ids[0]), 0.7, 1e-3);
  EXPECT_NEAR(world.joint_position(ids[1]), -0.3, 1e-3);
  EXPECT_NEAR(world.joint_position(ids[2]), 0.5, 1e-3);
  EXPECT_GT(world.joint_position(ids[3]), 1.9);
}

TEST(Joints, AMotorTurnsAtItsSpeedUntilTheLoadIsTooGreat) {
  for (const bool strong : {true, false}) {
    RigidBodies world(worlds::awake());
    const BodyId hook = nail(world);
    const BodyId arm = world.add(Shape::box(Vec3(1, 0.1, 0.1)), 1000, at(1, 0, 0));
    Joint motor = make(Kind::kHinge, hook, arm, Vec3::Zero(), -Vec3::UnitY());  // turns +x up
    motor.motor_speed = 0.5;
    const Real needed = world.mass(arm) * kGravity * 1, I = world.mass(arm) * (4.0 / 3 + 0.01 / 3);
    motor.motor_strength = (strong ? 1.2 : 0.8) * needed;
    const JointId id = world.join(motor);
    worlds::run(world, 1);
    if (strong) {
      // What it has to spare takes the arm up to speed: v^2 / (2 acceleration) is lost.
      const Real lost = 0.25 / (2 * 0.2 * needed / I);
      EXPECT_NEAR(world.joint_position(id), 0.5 - lost, 0.01);
      EXPECT_NEAR(world.spin(arm).norm(), 0.5, 1e-3);
    } else {
      EXPECT_LT(world.joint_position(id), -0.3);
    }
  }
}

TEST(Joints, ASpringOfAnyStiffnessHangsWhereItShouldAndIsStable) {
  for (const Real stiffness : {1e2, 1e4, 1e8}) {
    RigidBodies world(worlds::awake());
    const BodyId hook = nail(world);
    const BodyId ball = world.add(Shape::sphere(0.1), 1000, at(0, 0, -1));
    Joint spring = make(Kind::kDistance, hook, ball, Vec3::Zero());
    spring.anchor_b = Vec3(0, 0, -1);
    spring.stiffness = stiffness;
    spring.damping = 2 * std::sqrt(stiffness * world.mass(ball));
    world.join(spring);
    worlds::run(world, 20);
    const Real sag = world.mass(ball) * kGravity / stiffness;
    EXPECT_NEAR(world.centres()[ball].z(), -1 - sag, 1e-3 * sag + 1e-7) << stiffness;
  }
}

TEST(Joints, ToTheWorldHoldAsThoseToAStaticBodyDoBitForBit) {
  // A chain of each kind of joint, hung from a nail and from the world, at the nail's place.
  std::vector<Vec3> ends;
  for (const bool world_itself : {false, true}) {
    RigidBodies world(worlds::awake());
    const BodyId hook = nail(world, Vec3(0, 0, world_itself ? 100 : 0));  // in both, so that bodies have the same numbers
    const auto bar = Shape::box(Vec3(0.25, 0.05, 0.05));
    BodyId last = world_itself ? Joint::kWorld : hook;
    for (int k = 0; k < 3; ++k) {
      const BodyId next = world.add(bar, 1000, at(0.25 + 0.5 * k, 0, 0));
      Joint j = make(k == 1 ? Kind::kBall : Kind::kHinge, last, next, Vec3(0.5 * k, 0, 0));
      if (k == 0) j.high = 0.4;
      world.join(j);
      last = next;
    }
    Joint rope = make(Kind::kDistance, world_itself ? Joint::kWorld : hook, last, Vec3::Zero());
    rope.anchor_b = Vec3(1.5, 0, 0);
    rope.low = 0;
    rope.high = 1.6;
    world.join(rope);
    worlds::run(world, 2);
    ends.push_back(world.centres()[last]);
    EXPECT_LT(world.joint_error(0), 1e-6);
    world.unjoin(0);
    worlds::run(world, 0.1);
  }
  EXPECT_EQ(ends[0], ends[1]);
}

TEST(Joints, AHingesSpringSwingsAtItsPeriodAndItsDamperStopsIt) {
  // A bar of length 1 about its end, without weight: I = m (1/3 + 0.01/12) about the pin.
  for (const Real damping : {0.0, 10.0}) {
    RigidBodies world(worlds::weightless());
    const BodyId bar = world.add(Shape::box(Vec3(0.5, 0.05, 0.05)), 1000, at(0.5, 0, 0));
    Joint hinge = make(Kind::kHinge, Joint::kWorld, bar, Vec3::Zero());
    hinge.stiffness = 100;
    hinge.damping = damping;
    const JointId id = world.join(hinge);
    const Real I = world.mass(bar) * (1.0 / 3 + 0.01 / 12), omega = std::sqrt(hinge.stiffness / I);
    world.add_impulse(bar, Vec3(0, 0, -1), Vec3(1, 0, 0));  // turns it by the positive sense about +y
    const Real decay = damping / (2 * I), swing = std::sqrt(omega * omega - decay * decay);
    Real crossing = 0, before = 0;
    while (crossing == 0 && world.time() < 10) {
      world.step(1.0 / 120);
      const Real now = world.joint_position(id);
      if (before > 0 && now <= 0) crossing = world.time() + now / (before - now) / 120;
      before = now;
    }
    // Implicit: of first order in the substep h = 1/480 s, off by less than omega h.
    EXPECT_NEAR(crossing * swing / kPi, 1, omega / 480) << damping;
    worlds::run(world, 20);
    if (damping > 0) { EXPECT_LT(world.kinetic_energy(), 1e-9); }
  }
}

TEST(Joints, ADamperAloneTakesASlidersSpeedAsTheExponentialSays) {
  RigidBodies world(worlds::weightless());
  const BodyId block = world.add(Shape::box(Vec3::Constant(0.1)), 1000, at(0, 0, 0));
  Joint slider = make(Kind::kSlider, Joint::kWorld, block, Vec3::Zero(), Vec3::UnitX());
  slider.damping = 16;  // of 8 kg: e-fold in half a second
  world.join(slider);
  world.add_impulse(block, Vec3(8, 0, 0), Vec3::Zero());
  worlds::run(world, 1);
  EXPECT_NEAR(world.momenta()[block].x() / 8, std::exp(-2.0), 1e-2 * std::exp(-2.0));
}

TEST(Sleep, ASlowMotorGoesOn) {
  RigidBodies world;
  const BodyId arm = world.add(Shape::box(Vec3(0.5, 0.05, 0.05)), 1000, at(0, 0, 0));
  Joint hinge = make(Kind::kHinge, Joint::kWorld, arm, Vec3::Zero(), Vec3::UnitZ());
  hinge.motor_speed = 0.02;  // its end at a centimetre a second, under sleep_speed
  hinge.motor_strength = 1e4;
  const JointId id = world.join(hinge);
  worlds::run(world, 5);
  EXPECT_NEAR(world.joint_position(id), 0.1, 1e-3);
}

TEST(Joints, ALoopThatIsHeldMoreThanOnceStaysWhole) {
  // A flat ring of four bars: hinges with parallel axes hold it three times more than they must.
  RigidBodies world(worlds::weightless());
  const auto bar = Shape::box(Vec3(0.5, 0.05, 0.05));
  const Quat upright(Eigen::AngleAxisd(kPi / 2, -Vec3::UnitY()));
  const BodyId ids[] = {world.add(bar, 1000, at(0.5, 0, 0)), world.add(bar, 1000, {Vec3(1, 0, 0.5), upright}), world.add(bar, 1000, at(0.5, 0, 1)),
                        world.add(bar, 1000, {Vec3(0, 0, 0.5), upright}, {}, Vec3(0, 0, 1), Vec3(0, 2, 0))};
  const Vec3 corners[] = {{1, 0, 0}, {1, 0, 1}, {0, 0, 1}, {0, 0, 0}};
  for (int k = 0; k < 4; ++k) world.join(make(Kind::kHinge, ids[k], ids[(k + 1) % 4], corners[k]));
  Real error = 0;
  for (int k = 0; k < 600; ++k) error = std::max(error, world.step(1.0 / 120).joint_error);
  EXPECT_LT(error, 1e-4);
  EXPECT_GT(world.kinetic_energy(), 1);
}

TEST(Joints, JoinedBodiesDoNotCollideUnlessTheyAreToAndPartWhenTheJointIsTakenAway) {
  RigidBodies world(worlds::weightless());
  const auto box = Shape::box(Vec3::Constant(0.5));
  const BodyId a = world.add(box, 1000, at(0, 0, 0)), b = world.add(box, 1000, at(0.9, 0, 0));
  const JointId id = world.join(make(Kind::kFixed, a, b, Vec3(0.45, 0, 0)));
  worlds::run(world, 0.5);
  EXPECT_TRUE(world.touches().empty());
  EXPECT_NEAR((world.centres()[b] - world.centres()[a]).norm(), 0.9, 1e-9);
  world.unjoin(id);
  worlds::run(world, 2);
  EXPECT_GT((world.centres()[b] - world.centres()[a]).norm(), 0.99);
}

TEST(Joints, RefuseWhatMakesNoSense) {
  RigidBodies world;
  const BodyId a = world.add(Shape::sphere(1), 1, at(0, 0, 0)), b = world.add(Shape::sphere(1), 1, at(3, 0, 0)), c = nail(world), d = nail(world);
  const auto refused = [&](auto&& change) {
    Joint j = make(Kind::kHinge, a, b, Vec3(1.5, 0, 0));
    change(j);
    EXPECT_THROW(world.join(j), InputError);
  };
  refused([&](Joint& j) { j.b = a; });
  refused([&](Joint& j) { j.a = c, j.b = d; });
  refused([](Joint& j) { j.axis.setZero(); });
  refused([](Joint& j) { j.low = 1, j.high = -1; });
  refused([](Joint& j) { j.low = 0.1, j.high = 1; });
  refused([](Joint& j) { j.high = 4; });
  refused([](Joint& j) { j.kind = Kind::kFixed, j.low = -1; });
  refused([](Joint& j) { j.kind = Kind::kBall, j.motor_strength = 1; });
  refused([](Joint& j) { j.kind = Kind::kBall, j.stiffness = 1; });
  refused([](Joint& j) { j.stiffness = 1, j.motor_strength = 1; });
  refused([](Joint& j) { j.kind = Kind::kDistance, j.anchor_b = Vec3::Zero(), j.damping = 1; });
  refused([&](Joint& j) { j.a = Joint::kWorld, j.b = d; });
  refused([](Joint& j) { j.a = j.b = Joint::kWorld; });
  refused([](Joint& j) { j.anchor.x() = std::nan(""); });
  refused([](Joint& j) { j.kind = Kind::kDistance, j.anchor_b = j.anchor; });
  EXPECT_NO_THROW(world.join(make(Kind::kHinge, a, b, Vec3(1.5, 0, 0))));
}

}  // namespace
}  // namespace effuse::flow::bodies
