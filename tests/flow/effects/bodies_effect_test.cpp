#include "flow/effects/bodies_effect.h"

#include <gtest/gtest.h>

#include <cmath>

#include "flow/reference/rigid_motion.h"
#include "flow/effects/registry.h"
#include "flow/scene/simulation.h"
#include "geometry/terrain/plane.h"
#include "importers/scene/scene_file.h"

namespace effuse::flow {
namespace {

/// A scene of boxes and balls on level ground, and what it is built from.
struct World1 {
  Scene scene;
  geometry::Terrain terrain = geometry::Terrain::from_height_field(geometry::make_plane(Vec2(100, 100)));
  std::vector<PlacedObstacle> obstacles;
  std::vector<PlacedBody> bodies;
  std::vector<PlacedJoint> joints;
  std::unique_ptr<Simulation> simulation;

  explicit World1(const std::string& text) : World1(importers::read_scene_text("[film]\nframes = 9999\n[terrain]\nplane = { size = [100, 100] }\n" + text, "test.toml")) {}
  explicit World1(const Node& node) {
    Parameters root(node);
    scene = read_scene(root, effect_kinds());
    root.table("preview", "");  // another room's
    if (!root.has("preview")) root.finish();
    std::vector<Fault> faults;
    for (const PlannedObstacle& plan : scene.obstacles) place_obstacle(plan, mesh_of(plan), terrain, obstacles, faults);
    for (const PlannedBody& plan : scene.bodies) place_body(plan, mesh_of(plan), terrain, bodies, faults);
    for (const PlannedJoint& plan : scene.joints) place_joint(plan, obstacles, bodies, terrain, joints, faults);
    if (!faults.empty()) throw InputError(faults);
    simulation = std::make_unique<Simulation>(scene, World{&terrain, 1, &obstacles, &bodies, &joints, scene.body_settings});
  }
  void frames(int n) {
    for (int k = 0; k < n; ++k) simulation->advance([] { return true; });
  }
  geometry::RigidPose pose(std::size_t body) const { return simulation->effects()[0]->body_poses().at(body); }
  double figure(const std::string& name) const {
    for (const auto& [key, value] : simulation->effects()[0]->figures())
      if (key == name) return value;
    return std::nan("");
  }
};

TEST(BodiesEffect, APendulumOfASceneSwingsAtItsPeriod) {
  // A bar of 1 m hung at its end, let go at 40 degrees: back there after a period, to what gravity does in a frame.
  const Real amplitude = 40 * kPi / 180;
  World1 world("[bodies]\nsleep_speed = 0\n[[body]]\nname = \"bar\"\nbox = [0.1, 0.1, 1]\nposition = [" + std::to_string(-0.5 * std::sin(amplitude)) + ", 0, " + std::to_string(9 - 0.5 * std::cos(amplitude)) +
               "]\nrotation = [0, \"40 deg\", 0]\ndensity = 1000\n[[joint]]\nkind = \"hinge\"\nbodies = [\"world\", \"bar\"]\npoint = [0, 0, 9]\naxis = [0, 1, 0]\n");
  const Real I = (1 + 0.01) / 12 + 0.25;  // of a unit mass, about the pin
  const reference::Pendulum pendulum{std::sqrt(kGravity * 0.5 / I), amplitude};
  Real before = -amplitude, first = 0, last = 0;
  int crossings = 0;
  for (int frame = 1; frame <= 24 * 30; ++frame) {
    world.frames(1);
    const Vec3 x = world.pose(0).position;
    const Real angle = std::atan2(x.x(), 9 - x.z());
    if (before < 0 && angle >= 0) {
      last = (frame - angle / (angle - before)) / 24.0;
      if (crossings++ == 0) first = last;
    }
    before = angle;
  }
  ASSERT_GT(crossings, 10);
  EXPECT_NEAR((last - first) / (crossings - 1) / pendulum.period(), 1, 1e-3);
  EXPECT_LT(world.figure("largest_joint_error"), 1e-3);
}

TEST(BodiesEffect, ABodyFollowsTheObstacleItHangsFrom) {
  World1 world(R"([[obstacle]]
name = "crane"
box = [1, 1, 0.2]
motion = "linear"
[[obstacle.key]]
time = 1
position = [0, 0, 10]
[[obstacle.key]]
time = 5
position = [8, 0, 10]
[[body]]
name = "load"
ball = 0.5
position = [0, 0, 7]
density = 1000
[[joint]]
kind = "ball"
bodies = ["crane", "load"]
of = "crane"
point = [0, 0, 0]
)");
  Real error = 0, lag = 0;
  for (int frame = 1; frame <= 8 * 24; ++frame) {
    world.frames(1);
    const Vec3 hook = world.obstacles[0].track.at(frame / 24.0).position, load = world.pose(0).position;
    error = std::max(error, std::abs((load - hook).norm() - 3));
    lag = std::max(lag, hook.x() - load.x());
  }
  EXPECT_LT(error, 3e-3) << "0.1 % of the length";
  EXPECT_GT(lag, 0.5) << "it trails behind as the crane sets off";
  EXPECT_GT(world.pose(0).position.x(), 5);
}

TEST(BodiesEffect, AMotorTurnsAndFixedBodiesKeepTogether) {
  World1 world(R"([[body]]
name = "rotor"
box = [4, 0.2, 0.2]
position = [0, 0, 5]
density = 500
[[body]]
name = "weight"
ball = 0.3
position = [2.3, 0, 5]
density = 500
[[joint]]
kind = "hinge"
bodies = ["world", "rotor"]
point = [0, 0, 5]
axis = [0, 0, 1]
motor = { speed = "90 deg/s", torque = "50 kN m" }
[[joint]]
kind = "fixed"
bodies = ["rotor", "weight"]
point = [2, 0, 5]
)");
  world.frames(24);
  EXPECT_NEAR(std::atan2(world.pose(0).world(Vec3(1, 0, 0)).y(), world.pose(0).world(Vec3(1, 0, 0)).x()), kPi / 2, 0.03);
  EXPECT_NEAR((world.pose(1).position - world.pose(0).world(Vec3(2.3, 0, 0))).norm(), 0, 1e-4);
}

TEST(BodiesEffect, PenaltyOfASceneRestsAtMgOverK) {
  World1 world("[bodies]\ncontact = \"penalty\"\npenalty_frequency = \"20 Hz\"\nsleep_speed = 0\n[[body]]\nball = 0.5\nposition = [0, 0, 0.5]\ndensity = 1000\n");
  world.frames(72);
  const Real omega = 2 * kPi * 20;
  EXPECT_NEAR(0.5 - world.pose(0).position.z(), kGravity / (omega * omega), 1e-3 * kGravity / (omega * omega));
}

TEST(BodiesEffect, ALightChainHoldsTheWreckingArmsBallAsItStrikes) {
  // 24 t on links of 84 kg, into 15 blocks of a tonne, and on: steps of four substeps alone pull it apart by 18 cm, and then end.
  World1 world(importers::read_scene_file(std::string(EFFUSE_SOURCE_DIR) + "/samples/scenes/wrecking-arm.toml"));
  const auto block = [&](std::size_t k) { return world.pose(13 + k).position; };
  world.frames(72);
  const Vec3 stood = block(7);
  world.frames(58);
  EXPECT_LT(world.figure("largest_joint_error"), 1e-3 * 0.5);
  EXPECT_GT(world.figure("body_retries"), 0) << "nothing pulls at it: this tests nothing";
  EXPECT_LT(world.figure("body_retries"), 100);
  EXPECT_GT((block(7) - stood).norm(), 1) << "it strikes";
}

TEST(BodiesEffect, GoesOnFromACheckpointToTheSameBits) {
  const std::string text = "[[body]]\nbox = [1, 1, 1]\nposition = [0, 0, 0.6]\ncopies = 5\nstep = [0.2, 0, 1]\ndensity = 500\n[[joint]]\nbodies = [\"box.1\", \"box.2\"]\npoint = [0, 0, 1.1]\n";
  World1 world(text), other(text);
  world.frames(20);
  other.simulation->restore(world.simulation->checkpoint("key"), "key", "checkpoint");
  EXPECT_EQ(other.simulation->state_hash(), world.simulation->state_hash());
  world.frames(20);
  other.frames(20);
  EXPECT_EQ(other.simulation->state_hash(), world.simulation->state_hash());
  EXPECT_EQ(other.figure("body_steps"), world.figure("body_steps"));
}

}  // namespace
}  // namespace effuse::flow
