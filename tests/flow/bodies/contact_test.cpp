#include <gtest/gtest.h>

#include <algorithm>

#include "geometry/base/parallel.h"
#include "geometry/base/random.h"
#include "geometry/procedural/primitives.h"
#include "tests/flow/bodies/worlds.h"

namespace effuse::flow::bodies {
namespace {

using geometry::RigidPose;
using worlds::at;

/// A box on a slope of this angle after two seconds.
struct Slide {
  Real speed, way_in_second_second, gain_in_second_second;
};
Slide slide(Real mu, Real slope) {
  BodyOptions options = worlds::awake();
  options.terrain_friction = mu;
  RigidBodies world(options, worlds::plane(slope));
  const Vec3 up(std::sin(slope), 0, std::cos(slope)), down(std::cos(slope), 0, -std::sin(slope));
  const BodyId id = world.add(Shape::box(Vec3(0.5, 0.5, 0.25)), 1000, {0.25 * up, Quat(Eigen::AngleAxisd(slope, Vec3::UnitY()))}, {mu, 0, 0});
  const auto speed = [&] { return world.momenta()[id].dot(down) / world.mass(id); };
  worlds::run(world, 1);
  const Real v = speed();
  const Vec3 x = world.centres()[id];
  worlds::run(world, 1);
  return {speed(), (world.centres()[id] - x).dot(down), speed() - v};
}

TEST(Friction, HoldsABoxBelowTheAngleOfFrictionAndLetsItSlideAboveItAsCoulombSays) {
  for (const Real mu : {0.2, 0.5, 1.0})
    for (const Real turn : {0.0, 0.5}) {
      SCOPED_TRACE(testing::Message() << "mu " << mu << ", turned " << turn);
      // The bar is half a degree; a twentieth is held.
      const Real angle = std::atan(mu), little = 0.05 * kPi / 180;
      const Slide below = slide(mu, angle - little);
      EXPECT_LT(std::abs(below.speed), 1e-9);
      EXPECT_LT(std::abs(below.way_in_second_second), 1e-9) << "it creeps";
      const Real above = angle + little, gain = kGravity * (std::sin(above) - mu * std::cos(above));
      EXPECT_NEAR(slide(mu, above).gain_in_second_second, gain, 0.01 * gain);
      const Real far = angle + 10 * little;
      EXPECT_NEAR(slide(mu, far).gain_in_second_second, kGravity * (std::sin(far) - mu * std::cos(far)), 1e-4);
    }
}

TEST(Friction, StopsASlidingBoxWhereTheFormulaSaysInAnyDirection) {
  for (int k = 0; k < 6; ++k) {
    const Real turn = 0.3 + k * 0.6, v = 5, mu = 0.4;
    BodyOptions options = worlds::awake();
    options.terrain_friction = mu;
    RigidBodies world(options, worlds::plane());
    const Vec3 along(std::cos(turn), std::sin(turn), 0);
    world.add(Shape::box(Vec3(0.5, 0.4, 0.1)), 1000, at(0, 0, 0.1), {mu, 0, 0}, v * along);
    worlds::run(world, 4);
    const Vec3 x = world.centres()[0];
    const Real way = v * v / (2 * mu * kGravity);
    EXPECT_NEAR(x.dot(along), way, 0.01 * way);
    EXPECT_LT((x - x.dot(along) * along).head<2>().norm(), 0.005 * way) << "it veers";
  }
}

TEST(Friction, MakesASlidingBallRollAtFiveSeventhsOfItsSpeed) {
  RigidBodies world(worlds::awake(), worlds::plane());
  const BodyId id = world.add(Shape::sphere(0.5), 1000, at(0, 0, 0.5), {}, Vec3(7, 0, 0));
  worlds::run(world, 4);
  EXPECT_NEAR(world.momenta()[id].x() / world.mass(id), 5, 0.01);
  EXPECT_NEAR(world.spin(id).y(), 10, 0.02);
  EXPECT_NEAR(world.centres()[id].z(), 0.5, 1e-4);
}

TEST(Friction, RollingResistanceStopsABall) {
  RigidBodies world({}, worlds::plane());
  const Real arm = 0.02, r = 0.5, v = 2;
  const BodyId id = world.add(Shape::sphere(r), 1000, at(0, 0, r), {0.8, 0, arm}, Vec3(v, 0, 0), Vec3(0, v / r, 0));
  worlds::run(world, 12);
  EXPECT_TRUE(world.asleep(id));
  // A couple of m g arm takes the energy 7/10 m v^2 at m g arm / r a metre.
  const Real way = 0.7 * v * v * r / (kGravity * arm);
  EXPECT_NEAR(world.centres()[id].x(), way, 0.02 * way);
}

/// A stack of boxes with this edge, without sleep: penetration [edges] and kinetic energy [m g edge of one box] after the first two seconds,
/// and how far it has moved [edges].
struct Stack {
  Real penetration = 0, kinetic = 0, moved = 0;
};
Stack stack(int count, Real edge, Real seconds) {
  RigidBodies world(worlds::awake(), worlds::plane());
  const auto box = Shape::box(Vec3::Constant(edge / 2));
  for (int k = 0; k < count; ++k) world.add(box, 1000, at(0, 0, edge * (k + 0.5)));
  Stack s;
  for (int k = 0; k < seconds * 120; ++k) {
    const BodyReport report = world.step(1.0 / 120);
    if (k < 240) continue;
    s.penetration = std::max(s.penetration, report.penetration / edge);
    s.kinetic = std::max(s.kinetic, report.kinetic / (world.mass(0) * kGravity * edge));
  }
  for (int k = 0; k < count; ++k) s.moved = std::max(s.moved, (world.centres()[k] - Vec3(0, 0, edge * (k + 0.5))).norm() / edge);
  return s;
}

TEST(Contacts, AStackOfTenBoxesStandsForTwentySecondsWithoutSleep) {
  for (const Real edge : {0.1, 1.0}) {
    const Stack s = stack(10, edge, 20);
    EXPECT_LT(s.penetration, 0.01) << edge;
    EXPECT_LT(s.kinetic, 1e-2) << edge;
    EXPECT_LT(s.moved, 0.02) << edge;
  }
}

TEST(Contacts, HeavyOnLightStaysUp) {
  for (const Real ratio : {10.0, 100.0, 1000.0}) {
    RigidBodies world(worlds::awake(), worlds::plane());
    const auto box = Shape::box(Vec3::Constant(0.5));
    world.add(box, 100, at(0, 0, 0.5));
    world.add(box, 100 * ratio, at(0, 0, 1.5));
    worlds::run(world, 20);
    EXPECT_NEAR(world.centres()[1].z(), 1.5, 0.05) << ratio;
    EXPECT_LT(world.centres()[1].head<2>().norm(), 0.02) << ratio;
  }
}

TEST(Contacts, BoxesInFlightThatStrikeEachOtherKeepBothMomenta) {
  for (const auto model : {ContactModel::kConstraint, ContactModel::kPenalty}) {
    BodyOptions options = worlds::weightless();
    options.contact = model;
    RigidBodies world(options);
    const auto box = Shape::box(Vec3(0.5, 0.3, 0.2));
    const auto ball = Shape::sphere(0.4);
    const auto ring = Shape::mesh(geometry::make_torus(Vec3::Zero(), 0.5, 0.2, 16, 8));
    for (std::uint64_t k = 0; k < 27; ++k) {
      const Vec3 x(1.5 * static_cast<Real>(k % 3), 1.5 * static_cast<Real>(k / 3 % 3), 1.5 * static_cast<Real>(k / 9));
      const Vec3 v = 2 * (Vec3(1.5, 1.5, 1.5) - x) + 0.5 * Vec3(random_normal(1, 0, k), random_normal(1, 1, k), random_normal(1, 2, k));
      const auto& shape = k % 3 == 0 ? box : k % 3 == 1 ? ball : ring;
      world.add(shape, 1000 + 100 * static_cast<Real>(k), {x, Quat(1, random_normal(1, 3, k), 0.5, 0).normalized()}, {0.7, 0.3, 0}, v,
                Vec3(random_normal(1, 4, k), random_normal(1, 5, k), random_normal(1, 6, k)));
    }
    const Vec3 p = worlds::total_momentum(world), L = worlds::total_angular_momentum(world);
    Real scale = 0;
    for (const Vec3& one : world.momenta()) scale += one.norm();
    std::size_t contacts = 0;
    const Real before = world.kinetic_energy();
    for (int k = 0; k < 240; ++k) contacts += world.step(1.0 / 120).contacts;
    EXPECT_GT(contacts, 1000u);
    EXPECT_LT(world.kinetic_energy(), before);
    // Some 1e5 impulses, each rounded to 1e-16 of the sum.
    EXPECT_LT((worlds::total_momentum(world) - p).norm(), 1e-12 * scale);
    EXPECT_LT((worlds::total_angular_momentum(world) - L).norm(), 1e-11 * scale);
  }
}

TEST(Contacts, ABallReboundsByItsRestitution) {
  for (const Real e : {0.0, 0.5, 0.9, 1.0}) {
    RigidBodies world(worlds::awake(), worlds::plane());
    const BodyId id = world.add(Shape::sphere(0.1), 1000, at(0, 0, 1.1), {0.5, e, 0});
    Real highest = 0;
    bool struck = false;
    for (int k = 0; k < 110; ++k) {  // until after the first rebound
      world.step(1.0 / 120);
      const Real v = world.momenta()[id].z();
      struck = struck || (k > 10 && v >= 0);
      if (struck) highest = std::max(highest, world.centres()[id].z() - 0.1);
    }
    // The speed is right to what gravity does in one look: 8 cm/s of 4.4.
    EXPECT_NEAR(highest, e * e, 0.03) << e;
  }
}

TEST(Contacts, PenaltyHoldsABoxAtTheSpringsDepth) {
  BodyOptions options = worlds::awake();
  options.contact = ContactModel::kPenalty;
  options.penalty_frequency = 30;
  RigidBodies world(options, worlds::plane());
  world.add(Shape::sphere(0.5), 1000, at(0, 0, 0.5));
  worlds::run(world, 3);
  const Real omega = 2 * kPi * 30;
  EXPECT_NEAR(0.5 - world.centres()[0].z(), kGravity / (omega * omega), 0.02 * kGravity / (omega * omega));
  EXPECT_LT(world.kinetic_energy(), 1e-6);
}

/// A ball let go where it touches penalty springs, with substeps of this share of the limit: its depth in the end as a share of
/// m g / k, and the speed it still has [g / omega].
struct Rest {
  Real depth = 0, speed = 0;
};
Rest rest_on_springs(Real frequency, Real damping, Real share) {
  BodyOptions options = worlds::awake();
  options.contact = ContactModel::kPenalty;
  options.penalty_frequency = frequency;
  options.penalty_damping = damping;
  options.penalty_springs = 1e-3;  // no substeps of its own making
  options.substeps = 1;
  const Real dt = share * penalty_step_limit(options, 1);
  options.step = dt;
  RigidBodies world(options, worlds::plane());
  world.add(Shape::sphere(0.5), 1000, at(0, 0, 0.5));
  Real fastest = 0;
  const int steps = 2000;
  for (int k = 0; k < steps; ++k) {
    world.step(dt);
    if (k > 0.9 * steps) fastest = std::max(fastest, std::abs(world.momenta()[0].z()) / world.mass(0));
  }
  const Real omega = 2 * kPi * frequency;
  return {(0.5 - world.centres()[0].z()) * omega * omega / kGravity, fastest * omega / kGravity};
}

TEST(Contacts, PenaltyRestsAtMgOverKUpToItsStepLimitAndNotBeyond) {
  for (const Real frequency : {10.0, 60.0, 500.0})
    for (const Real damping : {0.1, 0.5, 1.0}) {
      SCOPED_TRACE(testing::Message() << frequency << " 1/s, damping " << damping);
      const Rest below = rest_on_springs(frequency, damping, 0.98), beyond = rest_on_springs(frequency, damping, 1.02);
      EXPECT_NEAR(below.depth, 1, 1e-3);
      EXPECT_LT(below.speed, 1e-6);
      EXPECT_GT(beyond.speed, 0.1) << "it comes to rest where the formula says that it cannot";
    }
}

TEST(Contacts, PenaltyGivesBackNoMoreThanItGot) {
  // An impact is met up to a substep late. Without a damper the spring gives back what it took, more or less by how late.
  Real most = 0, sum = 0;
  for (int k = 0; k < 40; ++k) {
    BodyOptions options = worlds::weightless();
    options.contact = ContactModel::kPenalty;
    options.penalty_damping = 0;
    RigidBodies world(options, worlds::plane());
    world.add(Shape::sphere(0.5), 1000, at(0, 0, 0.52 + 1e-4 * k), {}, Vec3(0, 0, -1));
    worlds::run(world, 0.2);
    const Real back = world.momenta()[0].z() / world.mass(0);
    most = std::max(most, back);
    sum += back / 40;
  }
  EXPECT_LT(most, 1.1);
  EXPECT_NEAR(sum, 1, 0.02);
}

TEST(Friction, WithPenaltyHoldsABoxOnASlopeWithoutCreep) {
  const Real slope = 0.3;
  BodyOptions options = worlds::awake();
  options.contact = ContactModel::kPenalty;
  RigidBodies world(options, worlds::plane(slope));
  const Vec3 up(std::sin(slope), 0, std::cos(slope)), down(std::cos(slope), 0, -std::sin(slope));
  const BodyId id = world.add(Shape::box(Vec3(0.5, 0.5, 0.25)), 1000, {0.25 * up, Quat(Eigen::AngleAxisd(slope, Vec3::UnitY()))});
  worlds::run(world, 1);
  const Vec3 x = world.centres()[id];
  worlds::run(world, 2);
  EXPECT_LT(std::abs((world.centres()[id] - x).dot(down)), 1e-6);
}

TEST(Contacts, PenaltyTakesAsManySubstepsAsItsSpringsNeed) {
  BodyOptions options = worlds::awake();
  options.contact = ContactModel::kPenalty;
  for (const Real frequency : {60.0, 1000.0}) {
    options.penalty_frequency = frequency;
    RigidBodies world(options, worlds::plane());
    for (int k = 0; k < 3; ++k) world.add(Shape::box(Vec3::Constant(0.5)), 1000, at(0, 0, 0.5 + k));
    const BodyReport report = world.step(1.0 / 120);
    EXPECT_LE(1.0 / 120 / report.substeps, penalty_step_limit(options, 4) * (1 + 1e-6));
    worlds::run(world, 2);
    EXPECT_LT(world.kinetic_energy(), 1e-6 * world.mass(0));
    // Each spring carries what lies above it: with the reduced mass of two equal boxes it is half as stiff as on the ground.
    const Real omega = 2 * kPi * frequency, one = kGravity / (omega * omega);
    EXPECT_NEAR(2.5 - world.centres()[2].z(), (3 + 2 * 2 + 2 * 1) * one, 0.02 * 9 * one);
  }
}

TEST(Contacts, ABallInAGrooveTouchesBothSides) {
  // Walls of 45 deg: the ball's centre stands r sqrt(2) above the bottom line.
  geometry::TriMesh groove;
  groove.positions = {{-5, -5, 5}, {-5, 5, 5}, {0, -5, 0}, {0, 5, 0}, {5, -5, 5}, {5, 5, 5}};
  groove.triangles = {{0, 2, 1}, {2, 3, 1}, {2, 4, 3}, {4, 5, 3}};
  RigidBodies on_terrain(worlds::awake(), geometry::Terrain::from_mesh(groove));
  on_terrain.add(Shape::sphere(0.5), 1000, at(0.1, 0, 1.2));
  RigidBodies on_mesh(worlds::awake());
  on_mesh.add(Shape::sphere(0.5), 1000, at(0.1, 0, 1.2));
  on_mesh.add_static(Shape::mesh(groove), {});
  for (RigidBodies* world : {&on_terrain, &on_mesh}) {
    worlds::run(*world, 5);
    EXPECT_NEAR(world->centres()[0].z(), 0.5 * std::sqrt(2.0), 2e-3);
    EXPECT_NEAR(world->centres()[0].x(), 0, 2e-3);
    EXPECT_LT(world->kinetic_energy(), 1e-3 * world->mass(0));
  }
}

TEST(Contacts, MeshesRestOnMeshesHullsAndTheGround) {
  RigidBodies world(worlds::awake(), worlds::plane());
  const auto cube = Shape::mesh(geometry::make_box(Vec3::Constant(-0.5), Vec3::Constant(0.5)));
  const auto torus = Shape::mesh(geometry::make_torus(Vec3::Zero(), 0.6, 0.2, 24, 12));
  world.add(cube, 1000, at(0, 0, 0.5));
  world.add(cube, 1000, at(0.1, 0, 1.5));
  world.add(Shape::box(Vec3::Constant(0.5)), 1000, at(0, 0.1, 2.5));
  world.add(torus, 1000, at(5, 0, 0.2));
  world.add(torus, 1000, at(5, 0, 0.6));
  world.add(Shape::sphere(0.2), 1000, at(5, 0, 0.2));  // in the hole
  worlds::run(world, 5);
  const Real z[] = {0.5, 1.5, 2.5, 0.2, 0.6, 0.2};
  for (BodyId i = 0; i < 6; ++i) EXPECT_NEAR(world.centres()[i].z(), z[i], 0.02) << i;
  EXPECT_LT(world.centres()[2].head<2>().norm(), 0.2);
  EXPECT_LT(world.kinetic_energy(), 1);
}

TEST(Contacts, ABoxSlidesOverFlatGroundOfFinePostsWithoutFrictionAsOverNone) {
  // Posts just before its front face lie in the ground's face, not on a peak that could stop it.
  const geometry::Terrain ground = geometry::Terrain::from_height_field(geometry::HeightField({-10, -10}, {0.3, 0.3}, 101, 41, std::vector<Real>(101 * 41, 0.0)));
  for (const Real turn : {0.0, 0.4}) {
    BodyOptions options = worlds::awake();
    options.terrain_friction = 0;
    RigidBodies world(options, ground);
    world.add(Shape::box(Vec3(0.5, 0.5, 0.5)), 500, {Vec3(-8, -4, 0.5), Quat(Eigen::AngleAxisd(turn, Vec3::UnitZ()))}, {0, 0, 0}, Vec3(4, 0, 0));
    worlds::run(world, 4);
    EXPECT_NEAR(world.momenta()[0].x() / world.mass(0), 4, 0.004);
    EXPECT_NEAR(world.centres()[0].x(), 8, 0.02);
    EXPECT_NEAR(world.centres()[0].z(), 0.5, 0.005);
  }
}

TEST(Contacts, ABoxLargerThanTheCellsRestsOnPeaksUnderItsFace) {
  // Posts 1 m apart, one of them a peak of half a metre: under the middle of a box 3.4 m wide.
  std::vector<Real> z(21 * 21, 0.0);
  z[10 * 21 + 10] = 0.5;
  const geometry::Terrain ground = geometry::Terrain::from_height_field(geometry::HeightField({-10, -10}, {1, 1}, 21, 21, z));
  RigidBodies world({}, ground);
  world.add(Shape::box(Vec3(1.7, 1.7, 0.3)), 1000, at(0, 0, 0.82));
  worlds::run(world, 6);
  // It lies on the peak and on one side or corner, so its middle is no lower than a little under the peak's height.
  EXPECT_GT(world.centres()[0].z(), 0.5 + 0.3 * 0.9 - 0.05);
  EXPECT_LT(world.centres()[0].z(), 0.9);
}

TEST(FastBodies, DoNotPassThroughPlatesOrTheGroundAtAnySpeed) {
  const auto plate = Shape::mesh(geometry::make_grid(Vec3(-5, -5, 0), Vec2(10, 10), 1, 1));
  const auto slab = Shape::box(Vec3(5, 5, 0.005));
  for (int surface = 0; surface < 3; ++surface)
    for (std::uint64_t k = 0; k < 30; ++k) {
      const Real speed = std::pow(10.0, 1 + 3 * random_uniform(3, 0, k));
      const Vec3 from(random_uniform(3, 1, k) - 0.5, random_uniform(3, 2, k) - 0.5, 2 + random_uniform(3, 3, k));
      const Vec3 to(random_uniform(3, 4, k) - 0.5, random_uniform(3, 5, k) - 0.5, 0);
      const bool from_below = surface < 2 && k % 2 == 1;
      Vec3 x = from, v = speed * (to - from).normalized();
      if (from_below) x.z() = -x.z(), v.z() = -v.z();
      RigidBodies world(worlds::weightless(), surface == 2 ? std::optional(worlds::plane()) : std::nullopt);
      const auto shape = k % 3 == 0 ? Shape::sphere(0.05) : k % 3 == 1 ? Shape::box(Vec3(0.1, 0.05, 0.02)) : Shape::mesh(geometry::make_box(Vec3::Constant(-0.05), Vec3::Constant(0.05)));
      const BodyId id = world.add(shape, 1000, {x, Quat(1, random_normal(3, 6, k), random_normal(3, 7, k), 0).normalized()}, {}, v, Vec3(5, -3, 20));
      if (surface == 0) world.add_static(plate, {});
      if (surface == 1) world.add_static(slab, {});
      for (int n = 0; n < 60; ++n) {
        world.step(1.0 / 60);
        if (world.centres()[id].head<2>().cwiseAbs().maxCoeff() > 4.9) break;  // it has left the plate
        ASSERT_GT(from_below ? -world.centres()[id].z() : world.centres()[id].z(), 0) << "surface " << surface << ", body " << k << ", " << speed << " m/s, step " << n;
      }
    }
}

TEST(FastBodies, AreStoppedByADrivenPlateThatComesTowardsThem) {
  RigidBodies world(worlds::weightless());
  const BodyId id = world.add(Shape::sphere(0.05), 1000, at(0, 0, 1), {}, Vec3(0, 0, -200));
  const BodyId plate = world.add_driven(Shape::box(Vec3(2, 2, 0.01)), at(0, 0, -1));
  for (int k = 1; k <= 30; ++k) {
    world.move_to(plate, at(0, 0, -1 + 0.5 * k));  // 30 m/s
    world.step(1.0 / 60);
    ASSERT_GT(world.centres()[id].z(), world.centres()[plate].z()) << k;
  }
}

TEST(DrivenBodies, CarryWhatLiesOnThemAndPushWhatIsInTheWay) {
  RigidBodies world(worlds::awake(), worlds::plane());
  const BodyId belt = world.add_driven(Shape::box(Vec3(2, 2, 0.1)), at(0, 0, 1));
  const BodyId load = world.add(Shape::box(Vec3::Constant(0.2)), 1000, at(0, 0, 1.3), {0.8, 0, 0});
  const BodyId wall = world.add_driven(Shape::box(Vec3(0.1, 1, 1)), at(10, 0, 1));
  const BodyId stone = world.add(Shape::box(Vec3::Constant(0.3)), 1000, at(10.5, 0, 0.3));
  for (int k = 1; k <= 240; ++k) {
    const Real t = k / 120.0;
    world.move_to(belt, at(0.25 * t * t, 0, 1));
    world.move_to(wall, at(10 + 0.5 * t, 0, 1));
    world.step(1.0 / 120);
  }
  EXPECT_NEAR(world.centres()[load].x(), 1, 0.01);
  EXPECT_NEAR(world.centres()[load].z(), 1.3, 1e-3);
  EXPECT_NEAR(world.velocity_at(load, world.centres()[load]).x(), 1, 0.02);
  EXPECT_NEAR(world.velocity_at(belt, Vec3(0, 0, 1)).x(), 1, 0.01);
  EXPECT_NEAR(world.centres()[stone].x(), 11.1 + 0.3, 0.01);
}

}  // namespace
}  // namespace effuse::flow::bodies
