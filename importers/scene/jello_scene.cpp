#include "importers/scene/jello_scene.h"

namespace effuse::importers {

using flow::Node;

namespace {

constexpr int kFrames = 300;

/// Makes values, all at one place: the world's file.
struct Maker {
  Place place;

  Node table() const {
    Node node;
    node.place = place;
    return node;
  }
  Node array() const {
    Node node = table();
    node.kind = Node::Kind::kArray;
    return node;
  }
  Node number(double value) const {
    Node node = table();
    node.kind = Node::Kind::kReal;
    node.real = value;
    return node;
  }
  Node whole(int value) const {
    Node node = table();
    node.kind = Node::Kind::kInteger;
    node.integer = value;
    return node;
  }
  Node text(std::string value) const {
    Node node = table();
    node.kind = Node::Kind::kText;
    node.text = std::move(value);
    return node;
  }
  Node flag(bool value) const {
    Node node = table();
    node.kind = Node::Kind::kFlag;
    node.flag = value;
    return node;
  }
  Node row(std::initializer_list<double> values) const {
    Node node = array();
    for (const double value : values) node.items.push_back(number(value));
    return node;
  }
  Node rows(const std::vector<Vec3>& vectors) const {
    Node node = array();
    for (const Vec3& v : vectors) node.items.push_back(row({v.x(), v.y(), v.z()}));
    return node;
  }
};

}  // namespace

Node jello_scene(const JelloWorld& world, const std::filesystem::path& file) {
  const Maker make{Place{file.string()}};
  constexpr double kRoom = JelloWorld::kRoom;
  Node root = make.table();
  root.set("name", make.text(file.stem().string()));
  Node& film = root.set("film", make.table());
  film.set("frames", make.whole(kFrames));
  film.set("fps", make.number(1 / (world.dt * world.steps_a_frame)));
  Node& plane = root.set("terrain", make.table()).set("plane", make.table());
  plane.set("size", make.row({2 * kRoom, 2 * kRoom}));
  plane.set("height", make.number(-kRoom));

  Node& all = root.set("springs", make.array());
  Node& cube = all.items.emplace_back(make.table());
  cube.set("shape", make.text("cube"));
  cube.set("name", make.text("jello"));
  cube.set("points", make.whole(JelloWorld::kSide));
  cube.set("size", make.number(1));
  // 512 points: to and from one point's mass without rounding.
  cube.set("mass", make.number(world.mass * JelloWorld::kSide * JelloWorld::kSide * JelloWorld::kSide));
  cube.set("stiffness", make.number(world.elastic));
  cube.set("damping", make.number(world.elastic_damping));
  cube.set("contact_stiffness", make.number(world.collision));
  cube.set("contact_damping", make.number(world.collision_damping));
  cube.set("gravity", make.row({0, 0, 0}));
  cube.set("meets_ground", make.flag(false));
  cube.set("scheme", make.text(world.integrator == "Euler" ? "euler" : "rk4"));
  cube.set("step", make.number(world.dt));
  cube.set("positions", make.rows(world.positions));
  cube.set("velocities", make.rows(world.velocities));
  Node& walls = cube.set("walls", make.array());
  for (int axis = 0; axis < 3; ++axis)
    for (const double side : {1.0, -1.0}) {
      const Vec3 normal = side * Vec3::Unit(axis);
      walls.items.push_back(make.row({normal.x(), normal.y(), normal.z(), kRoom}));
    }
  if (world.plane) {
    int above = 0;
    for (const Vec3& x : world.positions) above += world.plane->head<3>().dot(x) + (*world.plane)[3] > 0 ? 1 : -1;
    const Eigen::Vector4d p = above < 0 ? Eigen::Vector4d(-*world.plane) : *world.plane;
    walls.items.push_back(make.row({p[0], p[1], p[2], p[3]}));
  }
  if (world.field.resolution > 0) {
    Node& field = cube.set("force_field", make.table());
    field.set("low", make.row({-kRoom, -kRoom, -kRoom}));
    field.set("high", make.row({kRoom, kRoom, kRoom}));
    field.set("resolution", make.whole(world.field.resolution));
    field.set("values", make.rows(world.field.values));
  }
  return root;
}

}  // namespace effuse::importers
