#include "flow/sph/ground.h"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>

#include "flow/sph/boundary.h"
#include "geometry/base/parallel.h"
#include "geometry/base/random.h"
#include "geometry/base/state_io.h"
#include "geometry/terrain/terrain.h"

namespace effuse::flow::sph {
namespace {

using geometry::Contact;
constexpr Real kInfinity = std::numeric_limits<Real>::infinity();

ContactSource plane(const Vec3& point, const Vec3& normal) {
  return [=](std::span<const Vec3> x, Real reach, std::span<Contact> out) {
    for (std::size_t i = 0; i < x.size(); ++i) {
      const Real d = (x[i] - point).dot(normal);
      out[i] = d < reach ? Contact{Vec3(x[i] - d * normal), normal, d, Vec3::Zero(), 0, 0} : Contact{};
    }
  };
}

ContactSource ball(const Vec3& centre, Real radius) {
  return [=](std::span<const Vec3> x, Real reach, std::span<Contact> out) {
    for (std::size_t i = 0; i < x.size(); ++i) {
      const Vec3 d = x[i] - centre;
      const Vec3 n = d.normalized();
      out[i] = d.norm() - radius < reach ? Contact{Vec3(centre + radius * n), n, d.norm() - radius, Vec3(1, 0, 0), 700, 1} : Contact{};
    }
  };
}

/// Bumps two or three spacings high, on posts two spacings apart: as rough as ground gets.
geometry::Terrain bumps() {
  const int n = 40;
  std::vector<Real> z;
  for (int j = 0; j < n; ++j)
    for (int i = 0; i < n; ++i) z.push_back(3 * std::sin(0.9 * i) * std::cos(0.7 * j) + random_uniform(5, 0, z.size()));
  return geometry::Terrain::from_height_field(geometry::HeightField(Vec2(0, 0), Vec2(2, 2), n, n, z));
}

ContactSource source_of(const geometry::Terrain& terrain) {
  return [terrain](std::span<const Vec3> x, Real reach, std::span<Contact> out) { terrain.contacts(x, reach, out); };
}

std::vector<Vec3> scatter(std::size_t n, const Vec3& low, const Vec3& high, std::uint64_t seed = 1) {
  std::vector<Vec3> x;
  for (std::size_t i = 0; i < n; ++i)
    x.push_back(low + Vec3(random_uniform(seed, 0, i), random_uniform(seed, 1, i), random_uniform(seed, 2, i)).cwiseProduct(high - low));
  return x;
}

constexpr auto kAll = [](std::size_t) { return true; };

struct Look {
  Real look;
  bool fewer;  // whether it must save questions
};
class GroundLook : public testing::TestWithParam<Look> {};

TEST_P(GroundLook, NoContactIsMissedOnAWalkOverBumpsAndABall) {
  // Particles wander over bumps and around a ball, half a spacing a step at most. Each time the contacts are those
  // that asking everybody about everything finds, and no bound is above the true distance.
  const Real reach = 2;
  const geometry::Terrain terrain = bumps();
  const ContactSource rocks = ball(Vec3(40, 40, 6), 5);
  std::size_t questions = 0;
  const ContactSource counted = [&, asks = source_of(terrain)](std::span<const Vec3> x, Real r, std::span<Contact> out) {
    questions += x.size();
    asks(x, r, out);
  };
  Ground ground({reach, GetParam().look, 0.25, 8}, {counted, rocks});
  std::vector<Vec3> x = scatter(250, Vec3(15, 15, 3), Vec3(65, 65, 14)), v(x.size(), Vec3::Zero());
  const std::size_t n = x.size();
  ground.born(n);
  std::vector<Contact> on_bumps(n), on_ball(n);
  std::size_t steps = 40, contacts = 0, near_misses = 0;
  for (std::size_t step = 0; step < steps; ++step) {
    ground.find(x);
    terrain.contacts(x, kInfinity, on_bumps);
    rocks(x, kInfinity, on_ball);
    for (std::size_t i = 0; i < n; ++i) {
      std::vector<Contact> wanted;
      for (const Contact& c : {on_bumps[i], on_ball[i]})
        if (c.distance < reach) wanted.push_back(c);
      const Real nearest = std::min(on_bumps[i].distance, on_ball[i].distance);
      std::size_t k = 0;
      ground.for_each_contact(i, x[i], [&](const Contact& c, Real d) {
        ASSERT_LT(k, wanted.size()) << "a contact too many, particle " << i << " step " << step;
        EXPECT_NEAR(d, wanted[k].distance, 1e-9);
        EXPECT_LT((c.normal - wanted[k].normal).norm(), 1e-9);
        ++k;
      });
      ASSERT_EQ(k, wanted.size()) << "missed, particle " << i << " step " << step;
      ASSERT_LE(ground.bound(i), nearest + 1e-9) << i;
      contacts += k;
      near_misses += nearest > reach && nearest < reach + 0.5;
    }
    const std::vector<Vec3> before = x;
    for (std::size_t i = 0; i < n; ++i) {
      const std::uint64_t at = step * n + i;
      const Vec3 drift = 0.2 * Vec3(40 - x[i].x(), 40 - x[i].y(), 2 - x[i].z()).normalized();
      x[i] += drift + 0.3 * Vec3(2 * random_uniform(9, 0, at) - 1, 2 * random_uniform(9, 1, at) - 1, 2 * random_uniform(9, 2, at) - 1).normalized();
    }
    ground.moved(before, x);
    ground.project(x, v, kAll);
    terrain.contacts(x, kInfinity, on_bumps);
    rocks(x, kInfinity, on_ball);
    for (std::size_t i = 0; i < n; ++i) ASSERT_LE(ground.bound(i), std::min(on_bumps[i].distance, on_ball[i].distance) + 1e-9) << "after the projection, " << i;
  }
  ASSERT_GT(contacts, 1000u);
  ASSERT_GT(near_misses, 100u) << "some just out of reach";
  if (GetParam().fewer) {
    EXPECT_LT(static_cast<Real>(questions), 0.8 * static_cast<Real>(steps * n));
  }
}
INSTANTIATE_TEST_SUITE_P(Distances, GroundLook, testing::Values(Look{2, false}, Look{0, true}, Look{8, true}));

TEST(Ground, ProjectionLeavesNobodyInsideBumps) {
  const geometry::Terrain terrain = bumps();
  std::vector<Vec3> x = scatter(5000, Vec3(2, 2, -5), Vec3(74, 74, 6)), v(x.size());
  for (std::size_t i = 0; i < v.size(); ++i) v[i] = Vec3(random_normal(3, 0, i), random_normal(3, 1, i), -3 + random_normal(3, 2, i));
  const std::vector<Vec3> start = x;
  const std::vector<Vec3> speed = v;
  Ground ground({2, 4, 0.25, 8}, {source_of(terrain)});
  ground.born(x.size());
  const Ground::Projection done = ground.project(x, v, kAll);
  ASSERT_GT(done.pushed, 1000u);
  // A pit with walls on all sides, narrower than the clearance, may hold a few; they are told of.
  EXPECT_LE(done.unsettled, 5u);
  std::size_t inside = 0, moved = 0;
  for (std::size_t i = 0; i < x.size(); ++i) {
    inside += terrain.signed_distance(x[i]) < 0.1;
    moved += x[i] != start[i];
    if (x[i] == start[i]) {
      ASSERT_EQ(v[i], speed[i]) << "who is not near is left alone";
    }
  }
  EXPECT_EQ(moved, done.pushed);
  EXPECT_LE(inside, done.unsettled);
}

TEST(Ground, ProjectionTakesTheSpeedIntoTheSurfaceAndNoOther) {
  const ContactSource still = plane(Vec3::Zero(), Vec3::UnitZ());
  const ContactSource rising = [still](std::span<const Vec3> x, Real reach, std::span<Contact> out) {
    still(x, reach, out);
    for (Contact& c : out) c.surface_velocity = Vec3(5, 0, 2);
  };
  Ground ground({2, 2, 0.25, 8}, {rising});
  std::vector<Vec3> x = {Vec3(0, 0, -0.5), Vec3(1, 0, -0.5), Vec3(2, 0, 0.3)};
  std::vector<Vec3> v = {Vec3(1, 1, -3), Vec3(1, 1, 4), Vec3(1, 1, -3)};
  ground.born(3);
  const Ground::Projection done = ground.project(x, v, kAll);
  EXPECT_EQ(done.pushed, 2u);
  EXPECT_EQ(done.unsettled, 0u);
  EXPECT_EQ(x[0], Vec3(0, 0, 0.25));
  EXPECT_EQ(v[0], Vec3(1, 1, 2)) << "as fast as the surface, and free along it";
  EXPECT_EQ(v[1], Vec3(1, 1, 4)) << "leaves by itself";
  EXPECT_EQ(x[2], Vec3(2, 0, 0.3));
  EXPECT_EQ(v[2], Vec3(1, 1, -3));
}

TEST(Ground, ProjectionPushesWhoIsOutsideButNearerThanTheClearance) {
  for (const int rounds : {1, 8}) {
    Ground ground({2, 2, 0.25, rounds}, {plane(Vec3::Zero(), Vec3::UnitZ())});
    std::vector<Vec3> x = {Vec3(0, 0, 0.1), Vec3(1, 0, 0.26)}, v(2, Vec3::Zero());
    ground.born(2);
    ground.find(x);
    ASSERT_EQ(ground.bound(0), 0.1);
    EXPECT_EQ(ground.project(x, v, kAll).pushed, 1u);
    EXPECT_EQ(x[0].z(), 0.25);
    EXPECT_EQ(ground.bound(0), 0.25) << "where it was pushed to";
    EXPECT_EQ(x[1].z(), 0.26);
  }
}

TEST(Ground, ProjectionComesOutOfAGorgeWhereOnePushLeadsIntoTheOtherWall) {
  // Two slopes of 60 degrees that meet in the line x = 0, a gorge with an angle of 60 degrees.
  const std::vector<ContactSource> gorge = {plane(Vec3::Zero(), Vec3(std::sqrt(3.0) / 2, 0, 0.5)), plane(Vec3::Zero(), Vec3(-std::sqrt(3.0) / 2, 0, 0.5))};
  const auto count_inside = [&](int rounds) {
    Ground ground({2, 2, 0.25, rounds}, gorge);
    std::vector<Vec3> x = scatter(500, Vec3(-1, -1, -1), Vec3(1, 1, 1)), v(x.size(), Vec3::Zero());
    ground.born(x.size());
    const Ground::Projection done = ground.project(x, v, kAll);
    std::size_t inside = 0;
    Real worst = kInfinity;
    for (const Vec3& p : x) {
      const Real d = p.z() / 2 - std::abs(p.x()) * std::sqrt(3.0) / 2;
      inside += d < 0;
      worst = std::min(worst, d);
    }
    if (rounds > 1) {
      EXPECT_EQ(done.unsettled, 0u);
      EXPECT_GE(worst, 0.125 - 1e-12);
    }
    return inside;
  };
  EXPECT_GT(count_inside(1), 20u);
  EXPECT_EQ(count_inside(8), 0u);
}

TEST(Ground, ACleftTooNarrowIsTold) {
  Ground ground({2, 2, 0.25, 8}, {plane(Vec3::Zero(), Vec3::UnitX()), plane(Vec3(0.2, 0, 0), -Vec3::UnitX())});
  std::vector<Vec3> x = {Vec3(0.1, 0, 0), Vec3(0.1, 3, 0)}, v(2, Vec3::Zero());
  ground.born(2);
  const Ground::Projection done = ground.project(x, v, [](std::size_t i) { return i == 1; });
  EXPECT_EQ(done.pushed, 1u);
  EXPECT_EQ(done.unsettled, 1u);
  EXPECT_EQ(x[0], Vec3(0.1, 0, 0)) << "not free";
  EXPECT_EQ(ground.bound(1), -kInfinity) << "and is asked about again";
}

TEST(Ground, WhatTheGroundItselfMovesIsPartOfTheBound) {
  Real level = 0;
  Ground ground({1, 4, 0.25, 8}, {[&](std::span<const Vec3> x, Real reach, std::span<Contact> out) { plane(Vec3(0, 0, level), Vec3::UnitZ())(x, reach, out); }});
  std::vector<Vec3> x = {Vec3(0, 0, 3)}, v(1, Vec3::Zero());
  ground.born();
  ground.find(x);
  EXPECT_EQ(ground.bound(0), 3);
  std::size_t contacts = 0;
  for (int step = 0; step < 9; ++step) {
    level += 0.3;
    ground.moved(x, x, 0.3);
    ground.find(x);
    ground.for_each_contact(0, x[0], [&](const Contact&, Real d) {
      ++contacts;
      EXPECT_NEAR(d, 3 - level, 1e-12);
    });
    EXPECT_LE(ground.bound(0), 3 - level + 1e-12);
  }
  EXPECT_EQ(contacts, 3u) << "at 0.9, 0.6 and 0.3 m";
  level = 3.5;
  ground.moved(x, x, 0.8);
  ground.project(x, v, kAll);
  EXPECT_EQ(x[0].z(), 3.75);
}

TEST(Ground, OnlyThoseAskedForHaveContacts) {
  Ground ground({2, 2, 0.25, 8}, {plane(Vec3::Zero(), Vec3::UnitZ())});
  const std::vector<Vec3> x(10, Vec3(0, 0, 1));
  ground.born(10);
  ground.find(x, [](std::size_t i) { return i % 3 == 0; });
  for (std::size_t i = 0; i < 10; ++i) {
    int contacts = 0;
    ground.for_each_contact(i, x[i], [&](const Contact&, Real) { ++contacts; });
    EXPECT_EQ(contacts, i % 3 == 0 ? 1 : 0) << i;
    EXPECT_EQ(ground.bound(i), i % 3 == 0 ? 1 : -kInfinity);
  }
}

TEST(Ground, AContactStandsForItsTangentPlaneUntilTheNextQuestion) {
  Ground ground({2, 2, 0.25, 8}, {plane(Vec3::Zero(), Vec3(0.6, 0, 0.8))});
  ground.born();
  ground.find(std::vector<Vec3>{Vec3(0, 0, 1)});
  int seen = 0;
  ground.for_each_contact(0, Vec3(1, 7, 1.5), [&](const Contact&, Real d) {
    EXPECT_NEAR(d, 1.8, 1e-15);
    ++seen;
  });
  ground.for_each_contact(0, Vec3(1, 7, 2), [&](const Contact&, Real) { ADD_FAILURE() << "2.2 m is out of reach"; });
  EXPECT_EQ(seen, 1);
}

TEST(Ground, WallListsAreTheContactsParticleByParticle) {
  const geometry::Terrain terrain = bumps();
  Ground ground({2, 4, 0.25, 8}, {source_of(terrain), ball(Vec3(40, 40, 6), 8)});
  std::vector<Vec3> x = scatter(9000, Vec3(25, 25, 0), Vec3(55, 55, 20));
  ground.born(x.size());
  ground.find(x);
  for (Vec3& p : x) p += Vec3(0.1, -0.1, 0.2);  // since the question
  Walls walls;
  ground.list_walls(x, walls);
  ASSERT_EQ(walls.first.size(), x.size() + 1);
  std::size_t two = 0, none = 0;
  for (std::size_t i = 0; i < x.size(); ++i) {
    std::size_t k = 0;
    ground.for_each_contact(i, x[i], [&](const Contact& c, Real d) {
      ASSERT_LT(k, walls[i].size());
      const Wall& wall = walls[i][k++];
      EXPECT_EQ(wall.normal, c.normal);
      EXPECT_EQ(wall.distance, d);
      EXPECT_EQ(wall.reach, d);
      EXPECT_EQ(wall.surface, c.surface);
      EXPECT_EQ(wall.velocity, c.surface_velocity);
      EXPECT_EQ(wall.temperature, c.surface_temperature);
    });
    ASSERT_EQ(walls[i].size(), k);
    two += k == 2;
    none += k == 0;
  }
  EXPECT_GT(two, 50u);
  EXPECT_GT(none, 1000u);
}

TEST(Ground, HasTheSameBitsOnOneTwoAndFourThreads) {
  const auto hash = [](int threads) {
    const ThreadLimit limit(threads);
    const geometry::Terrain terrain = bumps();
    Ground ground({2, 4, 0.25, 8}, {source_of(terrain), ball(Vec3(40, 40, 6), 8)});
    std::vector<Vec3> x = scatter(9000, Vec3(5, 5, -2), Vec3(70, 70, 8)), v = scatter(9000, Vec3(-1, -1, -5), Vec3(1, 1, 1), 2);
    ground.born(x.size());
    StateHash h;
    for (int step = 0; step < 3; ++step) {
      const std::vector<Vec3> before = x;
      for (std::size_t i = 0; i < x.size(); ++i) x[i] += 0.1 * v[i];
      ground.moved(before, x);
      ground.project(x, v, kAll);
      ground.find(x);
    }
    Walls walls;
    ground.list_walls(x, walls);
    h.add(std::span<const Vec3>(x));
    h.add(std::span<const Vec3>(v));
    h.add(std::span<const Index>(walls.first));
    for (const Wall& w : walls.walls) h.add(w.distance);
    HashArchive io{h};
    Ground::arrays(ground, io);
    return h.hex();
  };
  const std::string one = hash(1);
  EXPECT_EQ(hash(2), one);
  EXPECT_EQ(hash(4), one);
}

TEST(Ground, WhoIsOffTheGroundBeyondItsEdgeLeaves) {
  const auto inside = [](const Vec3& p) { return p.x() < 8; };
  const ContactSource table = [&](std::span<const Vec3> x, Real reach, std::span<Contact> out) {
    plane(Vec3::Zero(), Vec3::UnitZ())(x, reach, out);
    for (std::size_t i = 0; i < x.size(); ++i)
      if (!inside(x[i])) out[i] = Contact{};
  };
  Ground ground({2, 6, 0.25, 8}, {table}, inside);
  EXPECT_TRUE(ground.has_edge());
  //                               on it           above it        beyond         beyond, in the midst
  std::vector<Vec3> x = {Vec3(1, 0, 0.5), Vec3(2, 0, 9), Vec3(9, 0, 0.5), Vec3(9, 0, 0.5)};
  const std::vector<std::uint8_t> surface = {1, 1, 1, 0};
  ground.born(4);
  EXPECT_EQ(ground.who_stays(x, surface, 1).size(), 4u) << "nobody was asked about yet";
  ground.find(x);
  EXPECT_EQ(ground.who_stays(x, surface, 1), (std::vector<Index>{0, 1, 3}));

  // From beyond the edge the ground is as near as one step: no look ahead is trusted there.
  const std::vector<Vec3> before = x;
  x[2].x() = 7.9;
  ground.moved(before, x);
  ground.find(x);
  int contacts = 0;
  ground.for_each_contact(2, x[2], [&](const Contact&, Real d) {
    EXPECT_EQ(d, 0.5);
    ++contacts;
  });
  EXPECT_EQ(contacts, 1);
}

TEST(Ground, KeepReordersAndLoadingRestoresTheBounds) {
  Ground ground({2, 8, 0.25, 8}, {plane(Vec3::Zero(), Vec3::UnitZ())});
  std::vector<Vec3> x;
  for (int i = 0; i < 6; ++i) x.push_back(Vec3(0, 0, i));
  ground.born(6);
  ground.find(x);
  ground.keep(std::vector<Index>{5, 2, 3});
  EXPECT_EQ(ground.size(), 3u);
  EXPECT_EQ(ground.bound(0), 5);
  EXPECT_EQ(ground.bound(1), 2);
  ground.for_each_contact(1, x[2], [](const Contact&, Real) { ADD_FAILURE() << "of those that stood there before"; });

  StateWriter out;
  Ground::arrays(static_cast<const Ground&>(ground), out);
  Ground other({2, 8, 0.25, 8}, {plane(Vec3::Zero(), Vec3::UnitZ())});
  other.born(9);
  StateReader in(out.bytes(), "memory");
  Ground::arrays(other, in);
  EXPECT_THROW(other.check_loaded(4), InputError);
  other.check_loaded(3);
  EXPECT_EQ(other.bound(2), 3);
  const std::vector<Vec3> now = {x[5], x[2], x[3]};
  other.find(now);
  EXPECT_EQ(other.bound(1), 2);
}

TEST(ParticleArrays, SelectIsTheSerialLoop) {
  for (const std::size_t n : {0u, 1u, 4095u, 4096u, 4097u, 50000u}) {
    const auto wanted = [](std::size_t i) { return i / 6000 % 2 == 0 && random_uniform(1, 2, i) < 0.3; };  // whole chunks of none
    std::vector<Index> serial, parallel = {7, 7};
    for (std::size_t i = 0; i < n; ++i)
      if (wanted(i)) serial.push_back(static_cast<Index>(i));
    select(n, wanted, parallel);
    EXPECT_EQ(parallel, serial) << n;
    select(n, kAll, parallel);
    EXPECT_EQ(parallel.size(), n);
  }
}

}  // namespace
}  // namespace effuse::flow::sph
