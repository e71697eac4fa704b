#include "flow/scene/joints.h"

#include <gtest/gtest.h>

#include <cmath>

#include "geometry/procedural/primitives.h"
#include "geometry/terrain/plane.h"
#include "importers/scene/scene_file.h"

namespace effuse::flow {
namespace {

const std::string kThings = R"(
[[obstacle]]
name = "arm"
box = [4, 1, 1]
position = [0, 0, 5]
rotation = ["0 deg", "0 deg", "90 deg"]

[[body]]
name = "link"
box = [1, 0.2, 0.2]
position = [1, 0, 3]
copies = 3
step = [1, 0, 0]
density = 1000

[[body]]
ball = 0.5
position = [8, 0, 3]
density = 1000
)";

struct Read {
  std::vector<PlannedObstacle> obstacles;
  std::vector<PlannedBody> bodies;
  std::vector<PlannedJoint> joints;
  std::vector<Fault> faults;
};

Read read(const std::string& joints) {
  const Node root = importers::read_scene_text(kThings + joints, "test.toml");
  Parameters all(root);
  Read r;
  r.obstacles = read_obstacles(all);
  r.bodies = read_bodies(all);
  r.joints = read_joints(all, r.obstacles, r.bodies);
  try {
    all.finish();
  } catch (const InputError& error) {
    r.faults = error.faults();
  }
  return r;
}

/// The joints of a scene in the world, on ground that rises by 1 in 10 towards +y.
std::vector<PlacedJoint> place(const Read& r, std::vector<Fault>& faults) {
  const geometry::Terrain terrain = geometry::Terrain::from_height_field(geometry::make_plane(Vec2(40, 40), std::atan(0.1), -kPi / 2), {Vec3(0, 0, 0), ""});
  std::vector<PlacedObstacle> obstacles;
  std::vector<PlacedBody> bodies;
  std::vector<PlacedJoint> joints;
  for (const PlannedObstacle& plan : r.obstacles) place_obstacle(plan, mesh_of(plan), terrain, obstacles, faults);
  for (const PlannedBody& plan : r.bodies) place_body(plan, mesh_of(plan), terrain, bodies, faults);
  for (const PlannedJoint& plan : r.joints) place_joint(plan, obstacles, bodies, terrain, joints, faults);
  return joints;
}

TEST(SceneJoints, HoldBodiesObstaclesAndTheWorldWhereTheTablesSay) {
  const Read r = read(R"(
[[joint]]
kind = "hinge"
bodies = ["world", "link.1"]
point = [0.5, 10, 2]
axis = [0, 2, 0]
limits = ["-30 deg", "1 rad"]
[joint.motor]
speed = "90 deg/s"
torque = "2 kN m"

[[joint]]
kind = "slider"
bodies = ["arm", "link.2"]
of = "arm"
point = [2, 0, 0]
axis = [1, 0, 0]
limits = ["-1 m", "20 cm"]
spring = { stiffness = "3 kN/m", damping = 5 }
collide = true

[[joint]]
kind = "ball"
bodies = ["link.3", "ball"]
point = [4, 0, 0]
on_ground = false
axis = [1, 0, 0]
cone = "40 deg"

[[joint]]
kind = "distance"
bodies = ["link.1", "ball"]
of = "link.1"
point = [0.5, 0, 0]
of_b = "ball"
point_b = [-0.5, 0, 0]
limits = ["0 m", "7 m"]
)");
  ASSERT_TRUE(r.faults.empty()) << r.faults[0].message;
  std::vector<Fault> faults;
  const std::vector<PlacedJoint> joints = place(r, faults);
  ASSERT_TRUE(faults.empty()) << faults[0].message;
  ASSERT_EQ(joints.size(), 4u);

  EXPECT_EQ(joints[0].kind, JointKind::kHinge);
  EXPECT_EQ(joints[0].ends[0], JointEnd{});
  EXPECT_EQ(joints[0].ends[1], (JointEnd{JointEnd::Kind::kBody, 0}));
  EXPECT_NEAR((joints[0].point - Vec3(0.5, 10, 3)).norm(), 0, 1e-12) << "two metres over the ground there";
  EXPECT_NEAR(joints[0].law.low, -kPi / 6, 1e-12);
  EXPECT_EQ(joints[0].law.high, 1);
  EXPECT_NEAR(joints[0].law.motor_speed, kPi / 2, 1e-12);
  EXPECT_NEAR(joints[0].law.motor_strength, 2000, 1e-9);

  EXPECT_EQ(joints[1].ends[0], (JointEnd{JointEnd::Kind::kObstacle, 0}));
  EXPECT_NEAR((joints[1].point - Vec3(0, 2, 5)).norm(), 0, 1e-12) << "the arm stands a quarter round";
  EXPECT_NEAR((joints[1].axis - Vec3(0, 1, 0)).norm(), 0, 1e-12);
  EXPECT_NEAR(joints[1].law.high, 0.2, 1e-12);
  EXPECT_NEAR(joints[1].law.stiffness, 3000, 1e-9);
  EXPECT_EQ(joints[1].law.damping, 5);
  EXPECT_TRUE(joints[1].law.collide);

  EXPECT_NEAR((joints[2].point - Vec3(4, 0, 0)).norm(), 0, 1e-12);
  EXPECT_NEAR(joints[2].law.high, 40 * kPi / 180, 1e-12);
  EXPECT_NEAR((joints[3].point - Vec3(1.5, 0, 3)).norm(), 0, 1e-12);
  EXPECT_NEAR((joints[3].point_b - Vec3(7.5, 0, 3)).norm(), 0, 1e-12);
}

TEST(SceneJoints, CopiesCountTheNumbersOfTheirNamesOn) {
  const Read r = read("[[joint]]\nkind = \"ball\"\nbodies = [\"link.1\", \"link.2\"]\ncopies = 2\nof = \"link.1\"\npoint = [0.5, 0, 0]\n");
  ASSERT_TRUE(r.faults.empty()) << r.faults[0].message;
  std::vector<Fault> faults;
  const std::vector<PlacedJoint> joints = place(r, faults);
  ASSERT_EQ(joints.size(), 2u);
  EXPECT_EQ(joints[1].names[0], "link.2");
  EXPECT_EQ(joints[1].names[1], "link.3");
  EXPECT_NEAR((joints[1].point - Vec3(2.5, 0, 3)).norm(), 0, 1e-12);
}

struct Wrong {
  const char *table, *part;
};
class SceneJointFault : public testing::TestWithParam<Wrong> {};

TEST_P(SceneJointFault, IsToldOnceAtTheJointsLine) {
  const Read r = read(std::string("[[joint]]\n") + GetParam().table);
  std::string all;
  for (const Fault& fault : r.faults) all += to_string(fault) + "\n";
  ASSERT_EQ(r.faults.size(), 1u) << all;
  EXPECT_NE(all.find(GetParam().part), std::string::npos) << all;
  EXPECT_GE(r.faults[0].place.line, 20) << all;
}

INSTANTIATE_TEST_SUITE_P(
    Of, SceneJointFault,
    testing::Values(Wrong{"bodies = [\"link.1\", \"bal\"]\npoint = [0, 0, 0]", "did you mean 'ball'?"}, Wrong{"bodies = [\"link.1\", \"wall\"]\npoint = [0, 0, 0]", "did you mean 'ball'?"},
                    Wrong{"bodies = [\"link.1\", \"excavator\"]\npoint = [0, 0, 0]", "there are: world, link.1, link.2, link.3, ball, arm"},
                    Wrong{"bodies = [\"link.1\", \"link.1\"]\npoint = [0, 0, 0]", "joins 'link.1' to itself"},
                    Wrong{"bodies = [\"world\", \"arm\"]\npoint = [0, 0, 0]", "neither of which a joint can move"},
                    Wrong{"bodies = [\"ball\"]\npoint = [0, 0, 0]", "found an array of 1, wanted an array of 2 texts"},
                    Wrong{"bodies = [1, 2]\npoint = [0, 0, 0]", "an array of other things"}, Wrong{"bodies = [\"link.1\", \"ball\"]", "point: is missing"},
                    Wrong{"kind = \"hing\"\nbodies = [\"link.1\", \"ball\"]\npoint = [0, 0, 0]", "did you mean 'hinge'?"},
                    Wrong{"kind = \"hinge\"\nbodies = [\"link.1\", \"ball\"]\npoint = [0, 0, 0]\naxis = [0, 0, 0]", "needs a direction"},
                    Wrong{"kind = \"hinge\"\nbodies = [\"link.1\", \"ball\"]\npoint = [0, 0, 0]\naxis = [0, 0, 1]\nlimits = [\"30 deg\", \"-30 deg\"]", "the other way round would do"},
                    Wrong{"kind = \"hinge\"\nbodies = [\"link.1\", \"ball\"]\npoint = [0, 0, 0]\naxis = [0, 0, 1]\nlimits = [\"10 deg\", \"30 deg\"]", "leave out 0"},
                    Wrong{"kind = \"hinge\"\nbodies = [\"link.1\", \"ball\"]\npoint = [0, 0, 0]\naxis = [0, 0, 1]\nlimits = [\"-10 deg\", \"200 deg\"]", "between -180 and 180 deg"},
                    Wrong{"kind = \"hinge\"\nbodies = [\"link.1\", \"ball\"]\npoint = [0, 0, 0]\naxis = [0, 0, 1]\nlimits = [\"-1 m\", 1]", "'-1 m' is a length"},
                    Wrong{"kind = \"fixed\"\nbodies = [\"link.1\", \"ball\"]\npoint = [0, 0, 0]\nlimits = [0, 1]", "nothing moves in a fixed joint"},
                    Wrong{"kind = \"fixed\"\nbodies = [\"link.1\", \"ball\"]\npoint = [0, 0, 0]\nmotor = { speed = 1, torque = 1 }", "a fixed joint has none"},
                    Wrong{"kind = \"hinge\"\nbodies = [\"link.1\", \"ball\"]\npoint = [0, 0, 0]\naxis = [0, 0, 1]\nmotor = { speed = 1 }", "torque: is missing"},
                    Wrong{"kind = \"hinge\"\nbodies = [\"link.1\", \"ball\"]\npoint = [0, 0, 0]\naxis = [0, 0, 1]\nmotor = { speed = 1, torque = 1 }\nspring = { stiffness = 1 }", "one or the other"},
                    Wrong{"bodies = [\"link.1\", \"ball\"]\npoint = [0, 0, 0]\nspring = { stiffness = 1 }", "a ball joint has none"},
                    Wrong{"bodies = [\"link.1\", \"ball\"]\npoint = [0, 0, 0]\nlimits = [0, 1]", "cone"},
                    Wrong{"kind = \"distance\"\nbodies = [\"link.1\", \"ball\"]\npoint = [0, 0, 0]\npoint_b = [1, 0, 0]\nlimits = [\"-1 m\", \"1 m\"]", "are lengths"},
                    Wrong{"bodies = [\"link.1\", \"ball\"]\npiont = [0, 0, 0]\npoint = [0, 0, 0]", "did you mean 'point'?"},
                    Wrong{"bodies = [\"link.1\", \"link.2\"]\npoint = [0, 0, 0]\ncopies = 2", "need of"},
                    Wrong{"bodies = [\"world\", \"ball\"]\nof = \"ball\"\npoint = [0, 0, 0]\ncopies = 2", "must end in .number"},
                    Wrong{"bodies = [\"link.1\", \"link.2\"]\nof = \"link.1\"\npoint = [0, 0, 0]\ncopies = 3", "no body or obstacle is called 'link.4'"}));

TEST(SceneJoints, ARodNeedsALengthAndARopeTheReach) {
  std::vector<Fault> faults;
  place(read("[[joint]]\nkind = \"distance\"\nbodies = [\"link.1\", \"ball\"]\npoint = [1, 2, 3]\npoint_b = [1, 2, 3]\n"), faults);
  ASSERT_EQ(faults.size(), 1u);
  EXPECT_NE(faults[0].message.find("kind = \"ball\" would do"), std::string::npos) << faults[0].message;
  faults.clear();
  place(read("[[joint]]\nkind = \"distance\"\nbodies = [\"link.1\", \"ball\"]\npoint = [1, 0, 3]\npoint_b = [8, 0, 3]\nlimits = [0, 5]\n"), faults);
  ASSERT_EQ(faults.size(), 1u);
  EXPECT_NE(faults[0].message.find("7 m apart, beyond its limits"), std::string::npos) << faults[0].message;
}

TEST(SceneJoints, TwoThingsOfOneNameCannotBeJoined) {
  const Read r = read("[[body]]\nball = 1\nposition = [0, 0, 9]\ndensity = 1\n[[joint]]\nbodies = [\"link.1\", \"ball\"]\npoint = [0, 0, 0]\n");
  ASSERT_EQ(r.faults.size(), 1u);
  EXPECT_NE(r.faults[0].message.find("2 things are called 'ball'"), std::string::npos) << r.faults[0].message;
}

}  // namespace
}  // namespace effuse::flow
