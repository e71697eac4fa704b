#include "flow/particles/particle_cloud.h"

#include <gtest/gtest.h>

#include <cmath>

#include "flow/particles/presets.h"
#include "geometry/base/error.h"
#include "geometry/base/parallel.h"

namespace effuse::flow::particles {
namespace {

/// The floor z = 0.
void floor_contacts(std::span<const Vec3> x, Real reach, std::span<geometry::Contact> out) {
  for (std::size_t i = 0; i < x.size(); ++i) out[i] = x[i].z() < reach ? geometry::Contact{Vec3(x[i].x(), x[i].y(), 0), Vec3::UnitZ(), x[i].z(), Vec3::Zero(), 0, 0} : geometry::Contact{};
}

EmitterOptions fountain() {
  EmitterOptions e;
  e.rate = 200;
  e.speed = 5;
  e.speed_spread = 0.2;
  e.spread = 0.4;
  e.at = Vec3(1, 2, 3);
  return e;
}

TEST(ParticleCloud, FollowsTheClosedFormWithDragAtAnyStep) {
  CloudOptions o;
  o.forces.response = 0.5;
  o.forces.wind = Vec3(3, -1, 0.5);
  o.forces.buoyancy = 0.2;
  EmitterOptions e = fountain();
  for (const Real dt : {0.7, 0.1, 0.013}) {
    ParticleCloud cloud(o, {e});
    for (int k = 0; k < 10; ++k) cloud.step(dt);
    const Emitter emitter(e);
    ASSERT_EQ(cloud.size(), emitter.born_by(cloud.time()));
    Real worst = 0;
    for (std::size_t i = 0; i < cloud.size(); ++i) {
      // v = w + g tau + (v0 - w - g tau) e^(-t / tau), integrated.
      const Newborn p = emitter.particle(cloud.ids()[i]);
      const Real t = cloud.time() - p.born, tau = 0.5;
      const Vec3 end = o.forces.wind + Vec3(0, 0, -kGravity * 0.8 * tau), x = p.x + end * t + tau * (1 - std::exp(-t / tau)) * (p.v - end);
      worst = std::max(worst, (cloud.positions()[i] - x).norm());
    }
    EXPECT_LT(worst, 1e-11) << dt;
  }
}

TEST(ParticleCloud, FallsAlongParabolasWithoutAir) {
  ParticleCloud cloud({}, {fountain()});
  for (int k = 0; k < 30; ++k) cloud.step(0.07);
  const Emitter emitter(fountain());
  for (std::size_t i = 0; i < cloud.size(); ++i) {
    const Newborn p = emitter.particle(cloud.ids()[i]);
    const Real t = cloud.time() - p.born;
    ASSERT_LT((cloud.positions()[i] - p.x - t * p.v - t * t / 2 * Vec3(0, 0, -kGravity)).norm(), 1e-11);
  }
}

TEST(ParticleCloud, CountsAddUpAndNobodyOutlivesHisLife) {
  CloudOptions o;
  o.room = Box3(Vec3(-50, -50, 0), Vec3(50, 50, 50));
  EmitterOptions e = fountain();
  e.lifetime = 1;
  e.lifetime_spread = 0.5;
  e.stop = 2.5;
  EmitterOptions second = e;
  second.rate = 50;
  second.start = 1;
  second.seed = 7;
  ParticleCloud cloud(o, {e, second}, floor_contacts);
  for (int k = 0; k < 100; ++k) {
    cloud.step(0.05);
    const auto& c = cloud.counts();
    ASSERT_EQ(c.born, c.aged + c.left + c.fallen + cloud.size());
    for (std::size_t i = 0; i < cloud.size(); ++i) {
      ASSERT_LT(cloud.age(i), cloud.lifetime(i));
      ASSERT_GE(cloud.age(i), 0);
    }
  }
  EXPECT_EQ(cloud.counts().born, 500u + 75u);
  EXPECT_EQ(cloud.size(), 0u);
}

TEST(ParticleCloud, BouncesSticksOrDiesOnTheGround) {
  EmitterOptions e;
  e.rate = 1;
  e.stop = 0.5;  // one particle
  e.at = Vec3(0, 0, 1);
  e.direction = Vec3::UnitX();
  e.speed = 2;
  e.size = 0.01;
  const auto run = [&](OnContact on_contact, int steps) {
    CloudOptions o;
    o.on_contact = on_contact;
    o.restitution = 0.5;
    o.friction = 0.1;
    ParticleCloud cloud(o, {e}, floor_contacts);
    for (int k = 0; k < steps; ++k) cloud.step(0.001);
    return cloud;
  };
  // It falls 0.99 m in 0.449 s, arriving with 4.407 m/s; up again with half of it, slowed along by 0.1 * 1.5 of it.
  const ParticleCloud bounced = run(OnContact::kBounce, 450);
  ASSERT_EQ(bounced.size(), 1u);
  EXPECT_NEAR(bounced.velocities()[0].z(), 0.5 * 4.407, 0.03);
  EXPECT_NEAR(bounced.velocities()[0].x(), 2 - 0.15 * 4.407, 0.01);
  const ParticleCloud stuck = run(OnContact::kStick, 2000);
  ASSERT_EQ(stuck.size(), 1u);
  EXPECT_NEAR(stuck.positions()[0].z(), 0.01, 1e-12);
  EXPECT_NEAR(stuck.positions()[0].x(), 2 * 0.449, 0.01);
  const ParticleCloud fallen = run(OnContact::kDie, 1000);
  EXPECT_EQ(fallen.size(), 0u);
  EXPECT_EQ(fallen.counts().fallen, 1u);
  // Every bounce comes to rest in the end, on the ground.
  const ParticleCloud rested = run(OnContact::kBounce, 8000);
  EXPECT_NEAR(rested.positions()[0].z(), 0.01, 1e-3);
  EXPECT_LT(rested.velocities()[0].norm(), 0.05);
}

TEST(ParticleCloud, AParticleOrbitsAnAttractorAtKeplersPeriod) {
  CloudOptions o;
  o.forces.gravity = 0;
  o.forces.attractors = {{Vec3::Zero(), 4, 0}};
  EmitterOptions e;
  e.rate = 1;
  e.stop = 0.5;
  e.at = Vec3(1, 0, 0);
  e.direction = Vec3::UnitY();
  e.speed = 2;  // circular: v^2 = strength / r; period 2 pi r / v = pi
  ParticleCloud cloud(o, {e});
  for (int k = 0; k < 10000; ++k) cloud.step(kPi / 10000);
  EXPECT_LT((cloud.positions()[0] - Vec3(1, 0, 0)).norm(), 1e-5);
}

TEST(ParticleCloud, EddiesAreAsStrongAsAskedAndHaveNoSources) {
  // A weightless particle of no response time takes on the air's speed: the field itself.
  CloudOptions o;
  o.forces.gravity = 0;
  o.forces.response = 1e-9;
  o.forces.turbulence = 2;
  o.forces.eddy_size = 0.7;
  const auto air = [&](const std::vector<Vec3>& at) {
    EmitterOptions e;
    e.shape = EmitterShape::kPoint;
    std::vector<EmitterOptions> emitters;
    for (const Vec3& p : at) {
      e.at = p;
      e.rate = 1;
      e.stop = 0.5;
      e.speed = 0;
      emitters.push_back(e);
    }
    ParticleCloud cloud(o, emitters);
    cloud.step(1e-6);
    return std::vector<Vec3>(cloud.velocities().begin(), cloud.velocities().end());
  };
  std::vector<Vec3> at;
  for (int k = 0; k < 3000; ++k) at.push_back(Vec3(0.37 * k, -0.71 * k, 0.53 * k));
  Real sum = 0;
  for (const Vec3& v : air(at)) sum += v.squaredNorm();
  EXPECT_NEAR(std::sqrt(sum / static_cast<Real>(at.size())), 2, 0.5);
  const Real h = 1e-4;
  for (int k = 0; k < 20; ++k) {
    const Vec3 p(1.3 * k, 0.7 * k, -0.9 * k);
    const std::vector<Vec3> v = air({p + h * Vec3::UnitX(), p - h * Vec3::UnitX(), p + h * Vec3::UnitY(), p - h * Vec3::UnitY(), p + h * Vec3::UnitZ(), p - h * Vec3::UnitZ()});
    EXPECT_NEAR((v[0].x() - v[1].x() + v[2].y() - v[3].y() + v[4].z() - v[5].z()) / (2 * h), 0, 1e-2);
  }
}

TEST(ParticleCloud, TheSameBitsOnAnyThreadsAndAfterLoading) {
  CloudOptions o;
  o.forces.response = 0.3;
  o.forces.turbulence = 1;
  EmitterOptions e = fountain();
  e.rate = 20000;
  e.lifetime = 0.5;
  e.lifetime_spread = 0.4;
  const auto hash_of = [](const ParticleCloud& cloud) {
    StateHash hash;
    cloud.add_to(hash);
    return hash.hex();
  };
  const auto run = [&](int threads) {
    ThreadLimit limit(threads);
    ParticleCloud cloud(o, {e}, floor_contacts);
    for (int k = 0; k < 20; ++k) cloud.step(0.04);
    return cloud;
  };
  ParticleCloud one = run(1);
  EXPECT_EQ(hash_of(one), hash_of(run(2)));
  ParticleCloud loaded(o, {e}, floor_contacts);
  StateWriter out;
  one.save(out);
  StateReader in(out.bytes(), "test");
  loaded.load(in);
  one.step(0.04);
  loaded.step(0.04);
  EXPECT_EQ(hash_of(one), hash_of(loaded));
}

TEST(ParticleCloud, EveryPresetLivesTenSecondsOverTheGround) {
  for (const Preset& preset : presets()) {
    EmitterOptions e = preset.emitter;
    e.rate = 200;
    e.at = Vec3(0, 0, 2);
    ParticleCloud cloud(preset.cloud, {e}, floor_contacts);
    for (int k = 0; k < 240; ++k) cloud.step(1.0 / 24);
    EXPECT_TRUE(cloud.finite()) << preset.name;
    EXPECT_GT(cloud.size(), 50u) << preset.name;
    for (const Vec3& x : cloud.positions()) {
      ASSERT_GT(x.z(), 0) << preset.name;
      ASSERT_LT(x.norm(), 100) << preset.name;
    }
  }
}

}  // namespace
}  // namespace effuse::flow::particles
