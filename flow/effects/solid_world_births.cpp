#include <fmt/format.h>

#include <Eigen/Eigenvalues>
#include <algorithm>

#include "flow/effects/solid_world.h"
#include "geometry/base/check.h"
#include "geometry/base/zones.h"
#include "geometry/mesh/mass_properties.h"

/// Bodies that come into a SolidWorld after its beginning: pieces of what broke, blocks of crust.
namespace effuse::flow {

using bodies::BodyId;
using bodies::Shape;
using geometry::RigidMotion;
using geometry::RigidPose;

/// A body or piece that may break, in the lava's way.
void SolidWorld::admit(BodyId id, Index parent) {
  ids_.push_back(id);
  const bodies::BrittleBodies::Piece& piece = brittle_->pieces().at(id);
  geometry::TriMesh mesh = geometry::surface_of(*brittle_->material(piece.source).cells, piece.cells);
  // Obstacles stand in body axes.
  geometry::TriMesh turned = mesh;
  for (Vec3& p : turned.positions) p = bodies_->shape(id).body_from_given().world(p);
  look_.resize(ids_.size());
  look_.back() = std::make_shared<const geometry::TriMesh>(std::move(mesh));
  before_.push_back(bodies_->body_pose(id));
  obstacles_.add({geometry::CollisionMesh(turned), RigidMotion(before_.back()), temperature_.at(parent), static_cast<Index>(obstacles_.size() + 1)});
}

/// Takes in the pieces that have come and lets go of what they were.
void SolidWorld::admit_pieces() {
  for (auto id = static_cast<BodyId>(driven_.size() + ids_.size()); id < bodies_->size(); ++id) {
    const auto block = std::find_if(blocks_.begin(), blocks_.end(), [&](const Block& each) { return each.id == id; });
    if (block != blocks_.end()) {
      admit_block(*block);
      continue;
    }
    // One that came and broke in the same step has left its own pieces only; its number stays empty.
    const bodies::BrittleBodies::Birth& birth = brittle_->birth(id);
    const Index parent = origin_[static_cast<std::size_t>(std::find(ids_.begin(), ids_.end(), birth.parent) - ids_.begin())];
    origin_.push_back(parent);
    names_.push_back(fmt::format("a piece of {}", names_[tracks_.size() + parent]));
    temperature_.push_back(temperature_[parent]);
    friction_.push_back(friction_[tracks_.size() + parent + 1]);
    acceleration_.push_back(bodies_->options().gravity);
    wet_.emplace_back();
    if (brittle_->knows(id)) {
      admit(id, parent);
    } else {
      ids_.push_back(id);
      look_.emplace_back();
      before_.push_back(bodies_->body_pose(id));
      const geometry::CollisionMesh mesh(geometry::surface_of(*brittle_->material(birth.source).cells, birth.cells));
      obstacles_.remove(obstacles_.add({mesh, RigidMotion(before_.back()), 0, static_cast<Index>(obstacles_.size() + 1)}));
    }
  }
  for (std::size_t b = 0; b < ids_.size(); ++b)
    if (gone(b) && look_[b]) {
      look_[b] = nullptr;
      wet_[b].clear();
      obstacles_.remove(place(b));
    }
}

BodyId SolidWorld::add_block_body(const Block& block, const RigidPose& pose, const Vec3& velocity, const Vec3& spin) {
  const geometry::ConvexHull hull = geometry::make_convex_hull(block.corners);
  const geometry::MassProperties mass = geometry::mass_properties(geometry::mesh_of(hull));
  const auto shape = Shape::parts({hull}, mass, geometry::mesh_of(hull));
  return bodies_->add(shape, block.mass / mass.volume, pose, {}, velocity, spin);
}

void SolidWorld::admit_block(const Block& block) {
  ids_.push_back(block.id);
  origin_.push_back(SolidPiece::kNoBody);
  names_.push_back("a block of crust");
  temperature_.push_back(block.temperature);
  friction_.push_back(1);
  acceleration_.push_back(bodies_->options().gravity);
  wet_.emplace_back();
  const geometry::TriMesh hull = geometry::mesh_of(geometry::make_convex_hull(block.corners));
  geometry::TriMesh look, turned;
  for (const geometry::Triangle& t : hull.triangles) {
    const Vec3 n = (hull.positions[t[1]] - hull.positions[t[0]]).cross(hull.positions[t[2]] - hull.positions[t[0]]).normalized();
    const auto first = static_cast<Index>(look.positions.size());
    look.triangles.push_back({first, first + 1, first + 2});
    for (const Index i : t) {
      look.positions.push_back(hull.positions[i]);
      look.normals.push_back(n);
    }
  }
  look.attributes["inner"].values.assign(look.positions.size(), 0.0f);
  turned = bodies_->shape(block.id).surface();
  look_.push_back(std::make_shared<const geometry::TriMesh>(std::move(look)));
  before_.push_back(bodies_->body_pose(block.id));
  obstacles_.add({geometry::CollisionMesh(turned), RigidMotion(before_.back()), block.temperature, static_cast<Index>(obstacles_.size() + 1)});
}

void SolidWorld::add_block(std::span<const Vec3> corners, Real mass, const RigidPose& pose, const Vec3& velocity, const Vec3& spin, Real temperature) {
  CHECK(has_bodies());
  Block block{0, {corners.begin(), corners.end()}, mass, temperature};
  block.id = add_block_body(block, pose, velocity, spin);
  blocks_.push_back(std::move(block));
  admit_block(blocks_.back());
  obstacles_.update();
}

std::vector<Vec3> SolidWorld::block_centres() const {
  std::vector<Vec3> all;
  for (const Block& block : blocks_)
    if (!bodies_->is_gone(block.id)) all.push_back(bodies_->centres()[block.id]);
  return all;
}

Real SolidWorld::block_mass() const {
  Real sum = 0;
  for (const Block& block : blocks_)
    if (!bodies_->is_gone(block.id)) sum += bodies_->mass(block.id);
  return sum;
}

Real SolidWorld::drop_blocks(const std::function<bool(const Vec3&)>& beyond) {
  Real mass = 0;
  for (const Block& block : blocks_)
    if (!bodies_->is_gone(block.id) && beyond(bodies_->centres()[block.id])) {
      mass += bodies_->mass(block.id);
      bodies_->retire(block.id);
    }
  if (mass > 0) admit_pieces();
  return mass;
}

void SolidWorld::wet(std::span<const Vec3> x, Real spacing) {
  if (!brittle_) return;
  ZONE("solids.wet");
  for (std::vector<Vec3>& places : wet_) places.clear();
  Box3 near;
  for (std::size_t b = 0; b < ids_.size(); ++b)
    if (breaks(b)) near.extend(geometry::placed_box(obstacles_[place(b)].motion.to(), obstacles_[place(b)].shape.bounds()));
  if (near.isEmpty()) return;
  near = Box3(near.min() - Vec3::Constant(spacing), near.max() + Vec3::Constant(spacing));
  std::vector<Vec3> asked;
  for (const Vec3& p : x)
    if (near.contains(p)) asked.push_back(p);
  constexpr int kMost = 4;
  std::vector<geometry::Contact> found(asked.size() * kMost);
  obstacles_.contacts(asked, spacing, kMost, found);
  for (const geometry::Contact& c : found) {
    if (!c.any() || !is_body(c.surface)) continue;
    const std::size_t b = body_of(c.surface);
    if (breaks(b)) wet_[b].push_back(bodies_->pose(ids_[b]).body(c.point));
  }
}

/// Lava's force and torque about the centre, shared out over the places where it lies on the body.
void SolidWorld::spread(std::size_t b, const Vec3& force, const Vec3& torque) {
  const BodyId id = ids_[b];
  const std::vector<Vec3>& places = wet_[b];
  const RigidPose pose = bodies_->pose(id);
  const Vec3 centre = bodies_->centres()[id];
  Vec3 middle = Vec3::Zero();
  for (const Vec3& p : places) middle += pose.world(p);
  middle /= std::max<Real>(1, static_cast<Real>(places.size()));
  Mat3 J = Mat3::Zero();
  for (const Vec3& p : places) {
    const Vec3 r = pose.world(p) - middle;
    J += r.squaredNorm() * Mat3::Identity() - r * r.transpose();
  }
  // Places in a line, or too few, carry no moment.
  const Eigen::SelfAdjointEigenSolver<Mat3> axes(J);
  const bool wide = places.size() > 2 && axes.eigenvalues()[0] > 1e-6 * axes.eigenvalues()[2];
  if (!wide) {
    bodies_->add_force(id, force, centre);
    bodies_->add_torque(id, torque);
    return;
  }
  const Vec3 a = force / static_cast<Real>(places.size());
  const Vec3 turn = J.inverse() * (torque - (middle - centre).cross(force));
  for (const Vec3& p : places) {
    const Vec3 at = pose.world(p);
    brittle_->add_force(id, a + turn.cross(at - middle), at);
  }
}

std::vector<SolidPiece> SolidWorld::pieces() const {
  std::vector<SolidPiece> all;
  for (std::size_t b = 0; b < ids_.size(); ++b)
    if (look_[b]) all.push_back({static_cast<Index>(b), origin_[b], look_[b], bodies_->pose(ids_[b]), origin_[b] == SolidPiece::kNoBody ? temperature_[b] : 0});
  return all;
}

}  // namespace effuse::flow
