#include "geometry/procedural/plant.h"

#include <algorithm>
#include <cmath>

#include "geometry/base/check.h"
#include "geometry/base/error.h"
#include "geometry/base/random.h"

namespace effuse::geometry {

namespace {

constexpr Real kDegree = kPi / 180;
constexpr std::uint64_t kSwayStream = 0x5a;
constexpr float kWood[] = {0.09f, 0.055f, 0.03f};    // linear light
constexpr float kGreen[] = {0.045f, 0.12f, 0.025f};

/// Heading, left and up are the columns' directions.
struct Turtle {
  Vec3 at = Vec3::Zero();
  Mat3 frame = (Mat3() << Vec3::UnitZ(), -Vec3::UnitX(), -Vec3::UnitY()).finished();
  Real thickness = 0;
  Index limb = Plant::kNone, branch = 0;

  Vec3 heading() const { return frame.col(0); }
  void turn(int axis, Real angle) { frame = Eigen::AngleAxisd(angle, frame.col(axis)).toRotationMatrix() * frame; }
};

}  // namespace

Real Plant::height() const {
  Real top = 0;
  for (const Limb& limb : limbs) top = std::max({top, limb.from.z(), limb.to.z()});
  return top;
}

Plant grow(const std::vector<LModule>& word, const TurtleOptions& options) {
  Plant plant;
  Turtle turtle;
  turtle.thickness = options.thickness;
  Index branches = 1;
  std::vector<Turtle> left_behind;
  for (const LModule& module : word) {
    const auto number = [&](Real usual) { return module.values.empty() ? usual : module.values[0]; };
    const auto angle = [&] { return module.values.empty() ? options.angle : module.values[0] * kDegree; };
    switch (module.symbol) {
      case 'F': {
        const Vec3 to = turtle.at + number(options.step) * turtle.heading();
        plant.limbs.push_back({turtle.at, to, turtle.thickness, turtle.thickness, turtle.limb, turtle.branch});
        turtle.limb = static_cast<Index>(plant.limbs.size() - 1);
        turtle.at = to;
        break;
      }
      case 'f':
        turtle.at += number(options.step) * turtle.heading();
        turtle.branch = branches++;
        break;
      case '+': turtle.turn(2, angle()); break;
      case '-': turtle.turn(2, -angle()); break;
      case '&': turtle.turn(1, angle()); break;
      case '^': turtle.turn(1, -angle()); break;
      case '\\': turtle.turn(0, angle()); break;
      case '/': turtle.turn(0, -angle()); break;
      case '|': turtle.turn(2, kPi); break;
      case '!': turtle.thickness = number(turtle.thickness * options.thinning); break;
      case '$': {
        const Vec3 left = Vec3::UnitZ().cross(turtle.heading());
        if (left.norm() < 1e-9) break;  // straight up: any left is level
        turtle.frame.col(1) = left.normalized();
        turtle.frame.col(2) = turtle.frame.col(0).cross(turtle.frame.col(1));
        break;
      }
      case '[':
        left_behind.push_back(turtle);
        turtle.thickness *= options.thinning;
        turtle.branch = branches++;
        break;
      case ']':
        if (left_behind.empty()) break;  // derive() has seen to it that they match
        turtle = left_behind.back();
        left_behind.pop_back();
        break;
      case '~': plant.leaves.push_back({turtle.at, turtle.heading(), turtle.frame.col(2), number(options.leaf), turtle.limb}); break;
      default: break;
    }
  }
  // Each limb ends as thick as the next of its branch begins.
  std::vector<Index> last(branches, Plant::kNone);
  for (std::size_t k = plant.limbs.size(); k-- > 0;) {
    Limb& limb = plant.limbs[k];
    limb.thick_to = last[limb.branch] == Plant::kNone ? options.thinning * limb.thick_from : plant.limbs[last[limb.branch]].thick_from;
    last[limb.branch] = static_cast<Index>(k);
  }
  return plant;
}

Plant swayed(const Plant& plant, const Sway& sway, Real t) {
  Plant bent = plant;
  const Real speed = sway.wind.norm();
  if (speed == 0) return bent;
  const Vec3 axis = Vec3::UnitZ().cross(Vec3(sway.wind.x(), sway.wind.y(), 0) / speed);
  std::vector<Mat3> turned(plant.limbs.size());
  const auto with = [&](Index parent, const Vec3& p) {
    return parent == Plant::kNone ? p : Vec3(bent.limbs[parent].from + turned[parent] * (p - plant.limbs[parent].from));
  };
  for (std::size_t k = 0; k < plant.limbs.size(); ++k) {
    const Limb& limb = plant.limbs[k];
    const Real phase = 2 * kPi * random_uniform(0, kSwayStream, limb.branch);
    const Real angle = sway.flexibility * speed / std::max(limb.thick_from, 1e-9) * (1 + sway.gust * std::sin(2 * kPi * t / sway.period + phase));
    const Mat3 parent = limb.parent == Plant::kNone ? Mat3(Mat3::Identity()) : turned[limb.parent];
    // Measured along the branch: a limb half as long bends half as much.
    const Real bend = std::clamp(angle * (limb.to - limb.from).norm(), -kPi / 2, kPi / 2);
    const Mat3 own = Eigen::AngleAxisd(bend, axis).toRotationMatrix() * parent;
    // Nothing is blown past the wind's own direction.
    const Vec3 heading = own * (limb.to - limb.from), before = parent * (limb.to - limb.from);
    turned[k] = heading.z() < 0 && before.z() >= 0 ? parent : own;
    bent.limbs[k].from = with(limb.parent, limb.from);
    bent.limbs[k].to = bent.limbs[k].from + turned[k] * (limb.to - limb.from);
  }
  for (Leaf& leaf : bent.leaves) {
    if (leaf.limb == Plant::kNone) continue;
    leaf.at = with(leaf.limb, leaf.at);
    leaf.along = turned[leaf.limb] * leaf.along;
    leaf.normal = turned[leaf.limb] * leaf.normal;
  }
  return bent;
}

TriMesh plant_mesh(const Plant& plant, int sides) {
  CHECK_GE(sides, 3);
  TriMesh mesh;
  VertexAttribute part, number, color;
  color.width = 3;
  const auto vertex = [&](const Vec3& p, const Vec3& n, bool leaf, Index limb) {
    mesh.positions.push_back(p);
    mesh.normals.push_back(n);
    part.values.push_back(leaf ? 1 : 0);
    number.values.push_back(static_cast<float>(limb));
    color.values.insert(color.values.end(), leaf ? std::begin(kGreen) : std::begin(kWood), leaf ? std::end(kGreen) : std::end(kWood));
    return static_cast<Index>(mesh.positions.size() - 1);
  };
  const auto n = static_cast<Index>(sides);
  // Limbs of a branch in their order, each branch one tube from ring to ring.
  std::vector<std::vector<Index>> branches;
  for (std::size_t k = 0; k < plant.limbs.size(); ++k) {
    if (plant.limbs[k].branch >= branches.size()) branches.resize(plant.limbs[k].branch + std::size_t{1});
    branches[plant.limbs[k].branch].push_back(static_cast<Index>(k));
  }
  for (const std::vector<Index>& branch : branches) {
    Vec3 side = Vec3::Zero();
    Index last_ring = 0, centre = 0;
    Vec3 heading = Vec3::UnitZ();
    for (std::size_t k = 0; k < branch.size(); ++k) {
      const Limb& limb = plant.limbs[branch[k]];
      const Vec3 along = (limb.to - limb.from).norm() > 0 ? Vec3((limb.to - limb.from).normalized()) : heading;
      // The frame turns as little as it can from limb to limb.
      side = side.norm() > 0 ? Vec3(Quat::FromTwoVectors(heading, along) * side) : along.unitOrthogonal();
      heading = along;
      const auto ring = [&](const Vec3& at, const Vec3& direction, Real thickness) {
        const Vec3 a = (side - side.dot(direction) * direction).normalized(), b = direction.cross(a);
        const auto first = static_cast<Index>(mesh.positions.size());
        for (int q = 0; q < sides; ++q) {
          const Vec3 out = std::cos(2 * kPi * q / sides) * a + std::sin(2 * kPi * q / sides) * b;
          vertex(at + thickness / 2 * out, out, false, branch[k]);
        }
        return first;
      };
      if (k == 0) {
        centre = vertex(limb.from, -along, false, branch[k]);
        last_ring = ring(limb.from, along, limb.thick_from);
        for (Index q = 0; q < n; ++q) mesh.triangles.push_back({centre, last_ring + (q + 1) % n, last_ring + q});
      }
      Vec3 direction = along;
      if (k + 1 < branch.size()) {
        const Limb& next = plant.limbs[branch[k + 1]];
        const Vec3 sum = along + (next.to - next.from).normalized();
        if (sum.norm() > 1e-6) direction = sum.normalized();
      }
      const Index new_ring = ring(limb.to, direction, limb.thick_to);
      for (Index q = 0; q < n; ++q) {
        const Index r = (q + 1) % n;
        mesh.triangles.push_back({last_ring + q, last_ring + r, new_ring + r});
        mesh.triangles.push_back({last_ring + q, new_ring + r, new_ring + q});
      }
      last_ring = new_ring;
      if (k + 1 == branch.size()) {
        centre = vertex(limb.to, along, false, branch[k]);
        for (Index q = 0; q < n; ++q) mesh.triangles.push_back({centre, last_ring + q, last_ring + (q + 1) % n});
      }
    }
  }
  for (const Leaf& leaf : plant.leaves) {
    const Vec3 across = leaf.normal.cross(leaf.along).normalized(), middle = leaf.at + leaf.size / 2 * leaf.along;
    const Index foot = vertex(leaf.at, leaf.normal, true, leaf.limb), right = vertex(middle + leaf.size / 4 * across, leaf.normal, true, leaf.limb),
                tip = vertex(leaf.at + leaf.size * leaf.along, leaf.normal, true, leaf.limb), left = vertex(middle - leaf.size / 4 * across, leaf.normal, true, leaf.limb);
    mesh.triangles.push_back({foot, left, tip});
    mesh.triangles.push_back({foot, tip, right});
  }
  mesh.attributes["part"] = std::move(part);
  mesh.attributes["limb"] = std::move(number);
  mesh.attributes["color"] = std::move(color);
  return mesh;
}

}  // namespace effuse::geometry
