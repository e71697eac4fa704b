#include "skin/surface/particle_grid.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cstring>

#include "geometry/base/parallel.h"
#include "tests/skin/surface/shapes.h"

namespace effuse::skin {
namespace {

using testing_shapes::Cloud;

Cloud ball() {
  return testing_shapes::fill(testing_shapes::cube(5), 1, [](const Vec3& x) { return x.norm() < 5; });
}

void expect_same(const ParticleGrid& one, const ParticleGrid& other) {
  ASSERT_EQ(one.size(), other.size());
  EXPECT_EQ(one.origin(), other.origin());
  EXPECT_EQ(one.x(), other.x());
  EXPECT_EQ(one.radius(), other.radius());
  ASSERT_EQ(one.columns().size(), other.columns().size());
  for (const ParticleGrid::Column& c : one.columns()) EXPECT_EQ(one.column(c.x, c.y), &c);
  for (std::size_t c = 0; c < one.columns().size(); ++c) EXPECT_EQ(std::memcmp(&one.columns()[c], &other.columns()[c], sizeof(ParticleGrid::Column)), 0) << c;
  ASSERT_EQ(one.carried().width, other.carried().width);
  EXPECT_EQ(std::memcmp(one.values(0), other.values(0), one.size() * static_cast<std::size_t>(one.carried().width) * sizeof(float)), 0);
}

TEST(ParticleGrid, HasEveryParticleOfABoxInItsRuns) {
  const Cloud cloud = ball();
  const ParticleGrid grid(cloud.points(), 0.25, 4);
  ASSERT_EQ(grid.size(), cloud.x.size());
  for (const ParticleGrid::Column& c : grid.columns())
    for (Index i = c.begin; i + 1 < c.end; ++i) EXPECT_LE(grid.x()[i].z(), grid.x()[i + 1].z());
  const Box3 box(Vec3(-12, -36, 4), Vec3(40, 8, 28));  // voxels
  std::size_t inside = 0, in_runs = 0;
  for (const Vec3& x : grid.x()) inside += box.contains(x);
  grid.runs(box.min(), box.max(), [&](Index from, Index to) {
    for (Index i = from; i < to; ++i) in_runs += box.contains(grid.x()[i]);
  });
  EXPECT_GT(inside, 50u);
  EXPECT_EQ(in_runs, inside);
}

TEST(ParticleGrid, MadeFromTheLastIsTheSameToTheBit) {
  Cloud cloud = ball();
  const auto made = [](const Cloud& c, const ParticleGrid* last) { return ParticleGrid(c.points(), 0.25, 4, last); };
  ParticleGrid last = made(cloud, nullptr);
  const auto next = [&](const char* what) {
    SCOPED_TRACE(what);
    const ParticleGrid anew = made(cloud, nullptr), kept = made(cloud, &last);
    expect_same(kept, anew);
    last = kept;
  };
  next("nothing");
  for (std::size_t i = 0; i < cloud.x.size(); i += 9) cloud.x[i].z() += 0.01;
  next("some moved");
  for (std::size_t i = 0; i < 20; ++i) cloud.x[i].x() += 1.7;
  next("some moved into other columns, and new ones");
  for (std::size_t i = 0; i < cloud.x.size(); i += 7) cloud.temperature[i] += 5, cloud.rest[i].x() -= 1;
  next("what they carry changed");
  cloud.radius[40] *= 0.9;
  next("a radius changed");
  std::swap(cloud.x[3], cloud.x[300]);
  next("two changed places");
  const auto erase = [&](std::size_t from, std::size_t to) {
    const auto cut = [&](auto& v) { v.erase(v.begin() + static_cast<std::ptrdiff_t>(from), v.begin() + static_cast<std::ptrdiff_t>(to)); };
    cut(cloud.x), cut(cloud.radius), cut(cloud.temperature), cut(cloud.crust), cut(cloud.age), cut(cloud.velocity), cut(cloud.rest), cut(cloud.rest2);
  };
  erase(cloud.x.size() - 30, cloud.x.size());
  next("the last ones gone");
  erase(10, 25);
  next("some in the midst gone, the others numbered anew");
  for (int k = 0; k < 12; ++k) cloud.add(Vec3(0.3 * k, 5.5, 0.1), 1);
  next("some born");
  cloud.x.push_back(cloud.x.front());
  cloud.radius.push_back(0.3);
  cloud.temperature.push_back(900), cloud.crust.push_back(0), cloud.age.push_back(0), cloud.velocity.emplace_back(0, 0, 0), cloud.rest.emplace_back(0, 0, 0), cloud.rest2.emplace_back(0, 0, 0);
  next("two at one place");
  next("and still");
  for (Vec3& x : cloud.x) x += Vec3(130, 0, 0);
  next("all moved, to another origin");
  const ParticleGrid coarse(cloud.points(), 0.5, 4, &last);
  expect_same(coarse, ParticleGrid(cloud.points(), 0.5, 4));
  expect_same(ParticleGrid(cloud.points(), 0.25, 6, &last), ParticleGrid(cloud.points(), 0.25, 6));
}

}  // namespace
}  // namespace effuse::skin
