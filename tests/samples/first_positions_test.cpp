#include "samples/effuse/first_positions.h"

#include <gtest/gtest.h>

namespace effuse {
namespace {

importers::PointCloud cloud(std::vector<std::uint64_t> ids, const Vec3& moved) {
  importers::PointCloud c;
  for (const std::uint64_t id : ids) c.position.push_back(Vec3(static_cast<Real>(id), 0, 0) + moved);
  c.id = std::move(ids);
  return c;
}

TEST(FirstPositions, FollowIdsThroughFramesInAnyOrder) {
  FirstPositions first;
  importers::PointCloud one = cloud({3, 1}, Vec3::Zero()), two = cloud({1, 7, 3}, Vec3(0, 5, 0)), three = cloud({7, 3}, Vec3(0, 9, 0));
  ASSERT_TRUE(first.carry(one) && first.carry(two) && first.carry(three));
  EXPECT_EQ(one.rest, one.position);
  EXPECT_EQ(two.rest, (std::vector<Vec3>{Vec3(1, 0, 0), Vec3(7, 5, 0), Vec3(3, 0, 0)})) << "7 came in the second frame";
  EXPECT_EQ(three.rest, (std::vector<Vec3>{Vec3(7, 5, 0), Vec3(3, 0, 0)}));
}

TEST(FirstPositions, WithoutIdsOrWithOnesThatAreSharedThereAreNone) {
  FirstPositions first;
  importers::PointCloud none = cloud({1, 2}, Vec3::Zero()), twice = cloud({1, 2, 1}, Vec3::Zero()), empty;
  none.id.clear();
  EXPECT_FALSE(first.carry(none) || first.carry(twice) || first.carry(empty));
  EXPECT_TRUE(none.rest.empty() && twice.rest.empty());
  importers::PointCloud after = cloud({1}, Vec3(0, 2, 0));
  ASSERT_TRUE(first.carry(after));
  EXPECT_EQ(after.rest, after.position) << "the refused frame left nothing behind";
}

}  // namespace
}  // namespace effuse
