#include "flow/bodies/rigid_bodies.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "flow/reference/rigid_motion.h"
#include "geometry/base/error.h"
#include "geometry/base/parallel.h"
#include "geometry/base/random.h"
#include "geometry/procedural/primitives.h"
#include "tests/flow/bodies/worlds.h"
#include "tests/geometry/terrain/fields.h"

namespace effuse::flow::bodies {
namespace {

using geometry::RigidPose;
using worlds::at;

std::string hash_of(const RigidBodies& world) {
  StateHash hash;
  world.add_to(hash);
  return hash.hex();
}

/// Boxes, balls, a linkage and a mesh that fall together on a slope.
RigidBodies clutter(const BodyOptions& options = {}) {
  RigidBodies world(options, worlds::plane(0.2));
  const auto box = Shape::box(Vec3(0.5, 0.3, 0.2));
  const auto ball = Shape::sphere(0.3);
  const auto ring = Shape::mesh(geometry::make_torus(Vec3::Zero(), 0.5, 0.2, 16, 8));
  for (std::uint64_t k = 0; k < 30; ++k) {
    const RigidPose pose{Vec3(1.1 * static_cast<Real>(k % 3), 1.1 * static_cast<Real>(k / 3 % 2), 1 + 0.8 * static_cast<Real>(k / 6)),
                         Quat(1, random_normal(1, 0, k), random_normal(1, 1, k), 0).normalized()};
    world.add(k % 5 == 4 ? ring : k % 2 ? ball : box, 1000, pose, {0.5, 0.2, 0.01});
  }
  Joint joint;
  joint.kind = Joint::Kind::kHinge;
  joint.a = 0;
  joint.b = 1;
  joint.anchor = (world.centres()[0] + world.centres()[1]) / 2;
  world.join(joint);
  return world;
}

TEST(RigidBodies, FlyOnTheExactParabola) {
  RigidBodies world(worlds::awake());
  world.add(Shape::box(Vec3(0.5, 0.3, 0.2)), 1000, at(1, 2, 3), {}, Vec3(3, -2, 10), Vec3(1, 2, 3));
  worlds::run(world, 2);
  EXPECT_LT((world.centres()[0] - Vec3(1 + 6, 2 - 4, 3 + 20 - 2 * kGravity)).norm(), 1e-11);
  EXPECT_NEAR(world.time(), 2, 1e-12);
}

TEST(RigidBodies, DzhanibekovsBodyKeepsEnergyAndMomentumAndFlipsOnTime) {
  RigidBodies world(worlds::weightless());
  const Vec3 spin(0.01, 5, 0.01);
  world.add(Shape::box(Vec3(0.5, 0.2, 0.05)), 1000, at(0, 0, 0), {}, Vec3(1, 0, 0), spin);
  // Exact, in axes of rising moments: those of this box lie along x, y, z.
  const Vec3 I = 1000 * world.shape(0).moments();
  ASSERT_LT(I.x(), I.y());
  ASSERT_LT(I.y(), I.z());
  const reference::FreeTop top{I, spin};
  const Real E = world.kinetic_energy();
  const Vec3 L = world.angular_momenta()[0];
  Real worst = 0;
  Real flip = 0, before = spin.y();
  int flips = 0;
  for (int k = 0; k < 100 * 2 * kPi / 5 * 120; ++k) {
    world.step(1.0 / 120);
    worst = std::max(worst, std::abs(world.kinetic_energy() / E - 1));
    const Real now = (world.orientations()[0].conjugate() * world.spin(0)).y();
    if (before * now < 0 && flips++ == 0) flip = world.time() - now / (now - before) / 120;
    before = now;
  }
  EXPECT_LT(worst, 1e-5);  // the bar is 1e-3
  EXPECT_EQ(world.angular_momenta()[0], L);
  EXPECT_GT(flips, 20);
  // The exact one crosses zero where spin().y() does, after half of its way from K.
  Real t = 0;
  while (top.spin(t).y() > 0) t += 1e-4;
  EXPECT_NEAR(flip, t, 2e-3);
}

TEST(RigidBodies, AnswerForImpulsesForcesAndVelocitiesAtAnyPoint) {
  RigidBodies world(worlds::weightless());
  const auto shape = Shape::box(Vec3(0.5, 0.3, 0.2));
  const BodyId a = world.add(shape, 1000, {Vec3(1, 2, 3), Quat(1, 2, 3, 4).normalized()}, {}, Vec3(1, 0, 0), Vec3(0, 1, 0));
  const BodyId wall = world.add_static(shape, at(10, 0, 0));
  const Vec3 point(1.2, 2.5, 2.9), impulse(30, -20, 10);
  const Vec3 before = world.velocity_at(a, point);
  EXPECT_LT((before - (Vec3(1, 0, 0) + Vec3(0, 1, 0).cross(point - Vec3(1, 2, 3)))).norm(), 1e-13);
  const Vec3 expected = world.inverse_mass_at(a, point) * impulse;
  world.add_impulse(a, impulse, point);
  EXPECT_LT((world.velocity_at(a, point) - before - expected).norm(), 1e-13);
  EXPECT_EQ(world.inverse_mass_at(wall, point), Mat3::Zero());
  world.add_impulse(wall, impulse, point);
  EXPECT_EQ(world.velocity_at(wall, point), Vec3::Zero());

  const Vec3 p = world.momenta()[a];
  world.add_force(a, Vec3(120, 0, 0), world.centres()[a]);
  world.add_torque(a, Vec3(0, 0, 12));
  const Vec3 L = world.angular_momenta()[a];
  world.step(1.0 / 60);
  EXPECT_LT((world.momenta()[a] - p - Vec3(2, 0, 0)).norm(), 1e-12);
  EXPECT_LT((world.angular_momenta()[a] - L - Vec3(0, 0, 0.2)).norm(), 1e-12);
  world.step(1.0 / 60);  // and no more
  EXPECT_LT((world.momenta()[a] - p - Vec3(2, 0, 0)).norm(), 1e-12);
}

TEST(RigidBodies, KeepThePoseTheShapeWasGivenIn) {
  // A mesh off its own origin: pose() is of its frame, not of the centre of mass.
  RigidBodies world(worlds::weightless());
  const geometry::TriMesh mesh = geometry::make_box(Vec3(1, 2, 3), Vec3(2, 4, 6));
  const RigidPose pose{Vec3(-5, 0, 2), Quat(1, 0.5, -0.2, 0.1).normalized()};
  for (const auto& shape : {Shape::mesh(mesh), Shape::hull(mesh)}) {
    const BodyId id = world.add(shape, 1000, pose);
    EXPECT_LT((world.pose(id).position - pose.position).norm(), 1e-13);
    EXPECT_LT(world.pose(id).orientation.angularDistance(pose.orientation), 1e-7);
    EXPECT_LT((world.centres()[id] - pose.world(Vec3(1.5, 3, 4.5))).norm(), 1e-13);
    EXPECT_NEAR(world.mass(id), 6000, 1e-9);
  }
  const BodyId driven = world.add_driven(Shape::mesh(mesh), {});
  world.move_to(driven, pose);
  world.step(0.1);
  EXPECT_LT((world.pose(driven).position - pose.position).norm(), 1e-12);
  EXPECT_TRUE(std::isinf(world.mass(driven)));
}

TEST(RigidBodies, GiveTheSameBitsOnAnyNumberOfThreads) {
  std::string one;
  for (const int threads : {1, 2, 4}) {
    const ThreadLimit limit(threads);
    RigidBodies world = clutter();
    worlds::run(world, 2);
    if (threads == 1) one = hash_of(world);
    EXPECT_EQ(hash_of(world), one) << threads;
  }
}

TEST(RigidBodies, GoOnFromACheckpointAsIfNothingHadBeen) {
  RigidBodies world = clutter();
  worlds::run(world, 1.5);
  StateWriter writer;
  world.save(writer);
  RigidBodies other = clutter();
  StateReader reader(writer.bytes(), "checkpoint");
  other.load(reader);
  EXPECT_TRUE(reader.done());
  EXPECT_EQ(hash_of(other), hash_of(world));
  worlds::run(world, 1);
  worlds::run(other, 1);
  EXPECT_EQ(hash_of(other), hash_of(world));
}

TEST(RigidBodies, RefuseACheckpointOfAnotherWorldAndStayAsTheyWere) {
  RigidBodies world = clutter(), other = clutter();
  other.add(Shape::sphere(1), 1, at(50, 0, 0));
  worlds::run(world, 0.5);
  StateWriter writer;
  world.save(writer);
  const std::string before = hash_of(other);
  for (const std::size_t length : {writer.bytes().size(), writer.bytes().size() / 2, std::size_t{3}}) {
    StateReader reader(std::string_view(writer.bytes()).substr(0, length), "checkpoint");
    EXPECT_THROW(other.load(reader), InputError);
    EXPECT_EQ(hash_of(other), before);
  }
}

TEST(RigidBodies, AStepThatCannotBeMadeIsUnstableAndChangesNothing) {
  RigidBodies world = clutter();
  worlds::run(world, 0.5);
  const BodyId rocket = world.add(Shape::sphere(1), 1, at(100, 0, 300));
  const std::string before = hash_of(world);
  world.add_force(rocket, Vec3(1e300, 0, 0), Vec3(100, 0, 300));
  EXPECT_THROW(world.step(1.0 / 60), UnstableError);
  EXPECT_EQ(hash_of(world), before);
}

TEST(RigidBodies, LookMoreOftenForFastBodiesUnlessTheyFallIntoTheVoid) {
  RigidBodies world({}, worlds::plane());
  const BodyId stone = world.add(Shape::sphere(0.1), 1000, at(0, 0, 0.5), {}, Vec3(30, 0, 0));
  EXPECT_GT(world.step(1.0 / 60).looks, 8);
  EXPECT_EQ(world.step(10.0 / 1000).looks, 7);  // 0.3 m and a little, by half a radius
  world.add_impulse(stone, world.mass(stone) * Vec3(1e4, 0, 0), world.centres()[stone]);
  EXPECT_EQ(world.step(1.0 / 60).looks, world.options().max_looks);
  worlds::run(world, 1, 1.0 / 60);  // off the edge of the plane
  ASSERT_GT(world.centres()[stone].x(), 2000);
  EXPECT_EQ(world.step(1.0 / 60).looks, 2);
}

TEST(RigidBodies, RefuseToMoveWhatHasNoMass) {
  RigidBodies world;
  const auto sheet = Shape::mesh(geometry::make_grid(Vec3::Zero(), Vec2(1, 1), 2, 2));
  EXPECT_THROW(world.add(sheet, 1000, {}), InputError);
  EXPECT_NO_THROW(world.add_static(sheet, {}));
  EXPECT_NO_THROW(world.step(0.01));
}

TEST(Sleep, ComesOverAPileAndATouchWakesIt) {
  RigidBodies world({}, worlds::plane());
  const auto box = Shape::box(Vec3::Constant(0.5));
  for (int k = 0; k < 4; ++k) world.add(box, 1000, at(0, 0, 0.5 + k));
  const BodyId lone = world.add(box, 1000, at(10, 0, 0.5));
  worlds::run(world, 3);
  for (BodyId i = 0; i < world.size(); ++i) EXPECT_TRUE(world.asleep(i)) << i;
  const std::string before = hash_of(world);
  EXPECT_EQ(world.step(1.0 / 120).awake, 0u);
  const std::vector<Vec3> x(world.centres().begin(), world.centres().end());

  const BodyId ball = world.add(Shape::sphere(0.3), 1000, at(0.3, 0, 5));
  bool woke = false;
  for (int k = 0; k < 120; ++k) {
    world.step(1.0 / 120);
    if (!world.asleep(0)) woke = true;
  }
  EXPECT_TRUE(woke) << "a ball that falls on the stack wakes all of it";
  EXPECT_TRUE(world.asleep(lone));
  EXPECT_EQ(world.centres()[lone], x[lone]);
  worlds::run(world, 20);
  for (BodyId i = 0; i < ball; ++i) EXPECT_TRUE(world.asleep(i)) << i;
  EXPECT_NEAR(world.centres()[3].z(), 3.5, 0.02);

  world.add_impulse(lone, Vec3(500, 0, 0), world.centres()[lone]);
  EXPECT_FALSE(world.asleep(lone));
  EXPECT_TRUE(world.asleep(0));
}

TEST(Sleep, ADrivenBodyWakesWhatItTouchesAndAGentleLoadTipsASleepingPlank) {
  RigidBodies world({}, worlds::plane());
  world.add_static(Shape::box(Vec3(0.5, 0.5, 0.5)), at(0, 0, 0.5));
  const BodyId plank = world.add(Shape::box(Vec3(2, 0.3, 0.05)), 500, at(0.2, 0, 1.05));
  worlds::run(world, 2);
  ASSERT_TRUE(world.asleep(plank));
  const BodyId load = world.add(Shape::box(Vec3::Constant(0.25)), 3000, at(1.9, 0, 1.3505));  // half a millimetre above it
  worlds::run(world, 2);
  EXPECT_LT(world.centres()[load].z(), 0.6) << "the plank tips under it";

  RigidBodies other({}, worlds::plane());
  const BodyId stone = other.add(Shape::box(Vec3::Constant(0.5)), 1000, at(0, 0, 0.5));
  const BodyId pusher = other.add_driven(Shape::box(Vec3(0.1, 1, 1)), at(-2, 0, 1.5));
  worlds::run(other, 2);
  ASSERT_TRUE(other.asleep(stone));
  for (int k = 1; k <= 240; ++k) {
    other.move_to(pusher, at(-2 + k / 120.0, 0, 1.5));
    other.step(1.0 / 120);
  }
  EXPECT_NEAR(other.centres()[stone].x(), 0.6, 0.02);
}

/// A thousand boulders on Maunga Whau for ten seconds, none of them under the ground.
TEST(BouldersSlow, AThousandDroppedOnMaungaWhauStayOnIt) {
  const geometry::HeightField field = geometry::fields::maunga_whau();
  const geometry::Terrain terrain = geometry::Terrain::from_height_field(field);
  RigidBodies world({}, terrain);
  std::vector<std::shared_ptr<const Shape>> shapes;
  for (std::uint64_t k = 0; k < 1000; ++k) {
    const auto random = [&](std::uint64_t stream) { return random_uniform(20, stream, k); };
    const Real x = 200 + 6.0 * static_cast<Real>(k % 32), y = 300 + 6.0 * static_cast<Real>(k / 32);
    if (k % 3 == 0) {
      shapes.push_back(Shape::box(Vec3(0.5 + random(0), 0.5 + random(1), 0.5 + random(2))));
    } else if (k % 3 == 1) {
      shapes.push_back(Shape::sphere(0.5 + random(0)));
    } else {
      geometry::TriMesh stone = geometry::make_sphere(Vec3::Zero(), 1.2, 1);
      for (std::size_t i = 0; i < stone.positions.size(); ++i) stone.positions[i] *= 0.7 + 0.5 * random_uniform(21, k, i);
      shapes.push_back(Shape::hull(stone));
    }
    world.add(shapes.back(), 2600, {Vec3(x, y, field.height(x, y) + 4 + 10 * random(3)), Quat(random(4) - 0.5, random(5) - 0.5, random(6) - 0.5, random(7) - 0.5).normalized()},
              {0.6, 0.1, 0.05});
  }
  for (int k = 0; k < 1200; ++k) {
    world.step(1.0 / 120);
    if (k % 120 != 119) continue;
    Real deepest = 0;
    for (BodyId i = 0; i < world.size(); ++i) {
      const Vec3 x = world.centres()[i];
      const Mat3 R = world.orientations()[i].toRotationMatrix();
      if (shapes[i]->kind() == Shape::Kind::kSphere) {
        deepest = std::max(deepest, shapes[i]->radius() - terrain.signed_distance(x));
      } else {
        for (const Vec3& v : shapes[i]->hull().vertices) deepest = std::max(deepest, -terrain.signed_distance(x + R * v));
      }
    }
    // A boulder of 2 m: 5 cm while they strike each other.
    EXPECT_LT(deepest, 0.05) << "after " << world.time() << " s";
  }
}

}  // namespace
}  // namespace effuse::flow::bodies
