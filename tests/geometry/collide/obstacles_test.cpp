#include "geometry/collide/obstacles.h"

#include <gtest/gtest.h>

#include "geometry/base/hash.h"
#include "geometry/base/parallel.h"
#include "tests/geometry/collide/truth.h"

namespace effuse::geometry {
namespace {

struct Crowd {
  std::vector<Obstacle> each;
  Obstacles all;
};

/// n obstacles of three shapes, turned and moving, some of them reaching into one another.
Crowd crowd(std::size_t n) {
  const CollisionMesh shapes[3] = {CollisionMesh(make_box({-1, -0.5, -0.2}, {1, 0.5, 0.2})), CollisionMesh(make_torus({0, 0, 0}, 1, 0.3, 16, 8)),
                                   CollisionMesh(make_grid({-1, -1, 0}, {1, 1}, 2, 2))};
  Crowd crowd;
  for (std::size_t k = 0; k < n; ++k) {
    const RigidPose from = truth::random_pose(101, k, 8), to = truth::random_pose(103, k, 8);
    crowd.each.push_back({shapes[k % 3], k % 2 ? RigidMotion(from, to, 0.1) : RigidMotion(to), 300.0 + static_cast<Real>(k), static_cast<Index>(1 + k % 7)});
    crowd.all.add(crowd.each.back());
  }
  crowd.all.update();
  return crowd;
}

void expect_as_one_by_one(const Crowd& crowd, const std::vector<char>& there, const Vec3& p, Real reach, int per_point) {
  std::vector<Contact> expected;
  for (std::size_t k = 0; k < crowd.each.size(); ++k) {
    if (!there[k]) continue;
    const Obstacle& o = crowd.each[k];
    const auto found = o.shape.nearest(o.motion.to().body(p), reach);
    if (!found) continue;
    Contact contact{.point = o.motion.to().world(found->point), .normal = o.motion.to().orientation * found->normal, .distance = found->distance};
    contact.surface_velocity = o.motion.velocity_at(contact.point, 1);
    contact.surface_temperature = o.temperature;
    contact.surface = o.surface;
    expected.push_back(contact);
  }
  std::stable_sort(expected.begin(), expected.end(), [](const Contact& a, const Contact& b) { return a.distance != b.distance ? a.distance < b.distance : a.surface < b.surface; });
  std::vector<Contact> found(static_cast<std::size_t>(per_point));
  const int count = crowd.all.contacts(p, reach, found);
  ASSERT_EQ(count, std::min<int>(per_point, static_cast<int>(expected.size())));
  for (int k = 0; k < per_point; ++k) {
    ASSERT_EQ(found[k].any(), k < count);
    if (k >= count) continue;
    EXPECT_EQ(found[k].distance, expected[k].distance);
    EXPECT_EQ(found[k].point, expected[k].point);
    EXPECT_EQ(found[k].normal, expected[k].normal);
    EXPECT_EQ(found[k].surface, expected[k].surface);
    EXPECT_EQ(found[k].surface_temperature, expected[k].surface_temperature);
    EXPECT_EQ(found[k].surface_velocity, expected[k].surface_velocity);
  }
}

TEST(Obstacles, ContactsAreThoseOfEachAskedByItself) {
  const Crowd crowd = ::effuse::geometry::crowd(60);
  const std::vector<char> there(60, 1);
  for (std::uint64_t k = 0; k < 400; ++k) {
    const Vec3 p = 12 * random_uniform(105, 0, k) * truth::unit(106, k);
    for (const Real reach : {0.05, 1.0, std::numeric_limits<Real>::infinity()})
      for (const int per_point : {1, 3}) expect_as_one_by_one(crowd, there, p, reach, per_point);
  }
}

TEST(Obstacles, MovedAndRemovedOnesAreWhereTheyAre) {
  Crowd crowd = ::effuse::geometry::crowd(40);
  std::vector<char> there(40, 1);
  for (std::uint64_t round = 0; round < 6; ++round) {
    for (std::size_t k = round % 3; k < crowd.each.size(); k += 3) {
      if (!there[k]) continue;
      if (k % 5 == round % 5) {
        crowd.all.remove(k);
        there[k] = 0;
      } else {
        crowd.each[k].motion = RigidMotion(crowd.each[k].motion.to(), truth::random_pose(110 + round, k, 8), 0.1);
        crowd.all.move(k, crowd.each[k].motion);
      }
    }
    crowd.all.update();
    for (std::uint64_t k = 0; k < 60; ++k) expect_as_one_by_one(crowd, there, 10 * truth::unit(120 + round, k), 3, 2);
    std::vector<Index> meeting;
    const Box3 box(Vec3(-3, -2, -4), Vec3(2, 5, 1));
    crowd.all.meeting(box, meeting);
    std::vector<Index> expected;
    for (std::size_t k = 0; k < crowd.each.size(); ++k)
      if (there[k] && crowd.each[k].motion.swept_box(crowd.each[k].shape.bounds()).intersects(box)) expected.push_back(static_cast<Index>(k));
    EXPECT_EQ(meeting, expected);
  }
  for (std::size_t k = 0; k < there.size(); ++k) crowd.all.remove(k);
  crowd.all.update();
  EXPECT_TRUE(crowd.all.empty());
  Contact contact;
  EXPECT_EQ(crowd.all.contacts({0, 0, 0}, 100, std::span(&contact, 1)), 0);
}

// A tenth of a box a step: some stay within the room that the tree holds them with, some leave it, in every step.
TEST(Obstacles, ThoseThatCreepAreWhereTheyAreInEveryStep) {
  Crowd crowd = ::effuse::geometry::crowd(30);
  const std::vector<char> there(30, 1);
  for (std::uint64_t round = 0; round < 60; ++round) {
    for (std::size_t k = 0; k < crowd.each.size(); ++k) {
      const RigidPose from = crowd.each[k].motion.to();
      RigidPose to = from;
      to.position += 0.1 * random_uniform(140, 0, k) * truth::unit(141, k);
      crowd.each[k].motion = RigidMotion(from, to, 0.1);
      crowd.all.move(k, crowd.each[k].motion);
    }
    crowd.all.update();
    for (std::uint64_t k = 0; k < 30; ++k) expect_as_one_by_one(crowd, there, 10 * random_uniform(142, round, k) * truth::unit(143 + round, k), 0.7, 2);
  }
}

TEST(Obstacles, ThousandsOfContactsHaveTheSameBitsOnAnyNumberOfThreads) {
  const Crowd crowd = ::effuse::geometry::crowd(200);
  std::vector<Vec3> points;
  for (std::uint64_t k = 0; k < 3000; ++k) points.push_back(9 * random_uniform(131, 0, k) * truth::unit(132, k));
  std::string hashes[2];
  for (const int threads : {1, 4}) {
    const ThreadLimit limit(threads);
    std::vector<Contact> contacts(points.size() * 2);
    crowd.all.contacts(points, 0.5, 2, contacts);
    StateHash hash;
    for (const Contact& c : contacts) {
      hash.add(c.distance);
      hash.add(std::span<const Vec3>(&c.point, 1));
      hash.add(std::span<const Vec3>(&c.normal, 1));
      hash.add(c.surface);
    }
    hashes[threads > 1] = hash.hex();
  }
  EXPECT_EQ(hashes[0], hashes[1]);
}

TEST(Obstacles, NoneIsNearNobody) {
  const Obstacles none;
  EXPECT_TRUE(none.empty());
  std::vector<Contact> contacts(2);
  const std::vector<Vec3> points{{0, 0, 0}, {1, std::numeric_limits<Real>::quiet_NaN(), 0}};
  none.contacts(points, std::numeric_limits<Real>::infinity(), 1, contacts);
  EXPECT_FALSE(contacts[0].any());
  const Crowd some = crowd(3);
  some.all.contacts(points, std::numeric_limits<Real>::infinity(), 1, contacts);
  EXPECT_TRUE(contacts[0].any());
  EXPECT_FALSE(contacts[1].any()) << "not a number is nowhere";
}

TEST(Obstacles, AStackOfBoxesInARowIsFoundWhateverTheOrderTheyCameIn) {
  // Boxes that come in the order they stand in make the deepest tree.
  const CollisionMesh box(make_box({0, 0, 0}, {1, 1, 1}));
  Obstacles row;
  for (int k = 0; k < 3000; ++k) row.add({box, RigidMotion({Vec3(2.0 * k, 0, 0), Quat::Identity()}), 0, static_cast<Index>(k + 1)});
  row.update();
  for (int k = 0; k < 3000; k += 7) {
    Contact contact;
    ASSERT_EQ(row.contacts({2.0 * k + 0.5, 0.5, 1.25}, 0.5, std::span(&contact, 1)), 1);
    EXPECT_EQ(contact.surface, static_cast<Index>(k + 1));
    EXPECT_EQ(contact.distance, 0.25);
  }
}

}  // namespace
}  // namespace effuse::geometry
