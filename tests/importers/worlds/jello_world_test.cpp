#include "importers/worlds/jello_world.h"

#include <gtest/gtest.h>

#include <string>

#include "tests/importers/test_files.h"

namespace effuse::importers {
namespace {

/// A small world written by hand: a field of 2^3 forces, points (i, j, k) at 0.1 (i, j, k), speed i along x.
std::string world_text(const std::string& head = "RK4\n0.001 5\n200 0.25 400 0.5\n0.002\n1\n0 0 2 -1\n2\n") {
  std::string text = head;
  for (int c = 0; c < 8; ++c) text += std::to_string(c) + " 0 0\n";
  for (int c = 0; c < 512; ++c) text += "0." + std::to_string(c / 64) + " 0." + std::to_string(c / 8 % 8) + " 0." + std::to_string(c % 8) + "\n";
  for (int c = 0; c < 512; ++c) text += std::to_string(c / 64) + " 0 0\n";
  return text;
}

TEST(JelloWorld, ReadsEveryLine) {
  const TestFolder folder;
  const JelloWorld w = read_jello_world(folder.write("world.w", world_text()));
  EXPECT_EQ(w.integrator, "RK4");
  EXPECT_EQ(w.dt, 0.001);
  EXPECT_EQ(w.steps_a_frame, 5);
  EXPECT_EQ(w.elastic, 200);
  EXPECT_EQ(w.elastic_damping, 0.25);
  EXPECT_EQ(w.collision, 400);
  EXPECT_EQ(w.collision_damping, 0.5);
  EXPECT_EQ(w.mass, 0.002);
  ASSERT_TRUE(w.plane);
  EXPECT_EQ(*w.plane, Eigen::Vector4d(0, 0, 2, -1));
  EXPECT_EQ(w.positions[8 * 8 * 3 + 8 * 2 + 1], Vec3(0.3, 0.2, 0.1));
  EXPECT_EQ(w.velocities.back(), Vec3(7, 0, 0));
  // Force c at corner (i, j, k) = bits of c: x forces 4, 2, 1 a side.
  EXPECT_EQ(w.field.at(Vec3(2, 2, 2)).x(), 7);
  EXPECT_EQ(w.field.at(Vec3(9, -9, -9)).x(), 4);
  EXPECT_EQ(w.field.at(Vec3(0, 0, 0)).x(), 3.5);
}

TEST(JelloWorld, SaysWhatIsWrongAndWhere) {
  const auto said = [](const std::string& text) {
    const TestFolder folder;
    return refusal([&] { read_jello_world(folder.write("bad.w", text)); });
  };
  EXPECT_TRUE(contains(said(""), "wanted Euler or RK4"));
  EXPECT_TRUE(contains(said("Verlet\n"), "bad.w:1: found the integrator 'Verlet', wanted Euler or RK4"));
  EXPECT_TRUE(contains(said(world_text("RK4\n0 5\n1 1 1 1\n1\n0\n0\n")), ":2: found the time step 0, wanted more than 0"));
  EXPECT_TRUE(contains(said(world_text("RK4\n0.1 2.5\n1 1 1 1\n1\n0\n0\n")), ":2: found the steps between frames 2.5"));
  EXPECT_TRUE(contains(said(world_text("RK4\n0.1 2\n-1 1 1 1\n1\n0\n0\n")), ":3: found kElastic -1"));
  EXPECT_TRUE(contains(said(world_text("RK4\n0.1 2\n1 1 1 1\n1\n1\n0 0 0 4\n0\n")), "no normal"));
  EXPECT_TRUE(contains(said(world_text("RK4\n0.1 2\n1 1 1 1\nnan\n0\n0\n")), ":4: found 'nan'"));
  EXPECT_TRUE(contains(said(world_text("RK4\n0.1 2\n1 1 1 1\n1\n0\n500\n")), "the file ends where"));
  EXPECT_TRUE(contains(said(world_text("RK4\n0.1 2\n1 1 1 1\n1\n0\n1\n")), "resolution 1"));
  EXPECT_TRUE(contains(said(world_text() + "1\n"), "found '1' after the last velocity"));
  const std::string whole = world_text();
  EXPECT_TRUE(contains(said(whole.substr(0, whole.size() - 4)), "the file ends where a velocity was wanted"));
}

}  // namespace
}  // namespace effuse::importers
