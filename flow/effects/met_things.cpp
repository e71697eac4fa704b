#include "flow/effects/met_things.h"

#include <algorithm>
#include <limits>
#include <numeric>

#include "geometry/fracture/fractured_body.h"

namespace effuse::flow {

using geometry::RigidMotion;
using geometry::RigidPose;

MetThings::MetThings(const World& world) {
  const auto number = [&] { return static_cast<Index>(obstacles_.size() + 1); };
  if (world.obstacles)
    for (const PlacedObstacle& each : *world.obstacles) {
      obstacles_.add({each.shape, RigidMotion{each.track.at(0), each.track.at(0), 1}, each.temperature, number()});
      tracks_.push_back(each.track);
    }
  if (!world.bodies) return;
  for (const PlacedBody& each : *world.bodies) {
    const auto body = static_cast<Index>(bodies_.size());
    breaks_.push_back(each.cells != nullptr);
    temperature_.push_back(each.temperature);
    geometry::TriMesh whole;
    if (each.cells) {
      std::vector<Index> all(each.cells->cells.size());
      std::iota(all.begin(), all.end(), Index{0});
      whole = geometry::surface_of(*each.cells, all);
    }
    bodies_.push_back({body, body, add(each.cells ? whole : each.mesh, each.pose, body, each.temperature), each.pose, each.pose});
  }
}

/// Surfaces are numbered by what they are, not by when they came: of two at equal distance the same one is met after loading.
std::size_t MetThings::add(const geometry::TriMesh& mesh, const RigidPose& pose, Index id, Real temperature) {
  return obstacles_.add({geometry::CollisionMesh(mesh), RigidMotion{pose, pose, 1}, temperature, static_cast<Index>(tracks_.size() + 1 + id)});
}

void MetThings::meet(const std::vector<Effect*>& others) {
  for (const Effect* other : others)
    if (!mover_ && ((!bodies_.empty() && !other->body_poses().empty()) || other->makes_pieces())) mover_ = other;
  blocks_ = mover_ && mover_->makes_pieces();
}

/// The bodies as their effect has them now, if it has moved on.
void MetThings::look() {
  if (!mover_ || mover_->time() == to_time_) return;
  from_time_ = to_time_;
  to_time_ = mover_->time();
  const std::vector<RigidPose> poses = mover_->body_poses();
  std::vector<SolidPiece> pieces;
  if (blocks_ || std::find(breaks_.begin(), breaks_.end(), 1) != breaks_.end()) pieces = mover_->pieces();
  std::sort(pieces.begin(), pieces.end(), [](const SolidPiece& a, const SolidPiece& b) { return a.id < b.id; });

  // Those that are still there, and those that broke.
  std::vector<Met> broken;
  std::vector<std::uint8_t> known(pieces.size(), 0);
  for (Met& each : bodies_) {
    each.from = each.to;
    if (!may_go(each)) {
      each.to = poses[each.id];
      continue;
    }
    const auto at = std::lower_bound(pieces.begin(), pieces.end(), each.id, [](const SolidPiece& p, Index id) { return p.id < id; });
    if (at == pieces.end() || at->id != each.id) {
      broken.push_back(each);
      continue;
    }
    each.to = at->pose;
    known[static_cast<std::size_t>(at - pieces.begin())] = 1;
  }
  for (const Met& gone : broken) {
    if (gone.obstacle != kNone) obstacles_.remove(gone.obstacle);
    std::erase_if(bodies_, [&](const Met& each) { return each.id == gone.id; });
  }

  // A new piece has its body's frame: it was part of that which had it nearest to where it is. A block comes where it is.
  for (std::size_t k = 0; k < pieces.size(); ++k) {
    if (known[k]) continue;
    const SolidPiece& piece = pieces[k];
    Box3 box;
    for (const Vec3& p : piece.mesh->positions) box.extend(p);
    const Vec3 middle = box.center();
    RigidPose from = piece.pose;
    Real least = std::numeric_limits<Real>::infinity();
    for (const Met& gone : broken) {
      const Real way = (gone.from.world(middle) - piece.pose.world(middle)).norm();
      if (gone.body == piece.body && piece.body != SolidPiece::kNoBody && way < least) least = way, from = gone.from;
    }
    bodies_.push_back({piece.id, piece.body, add(*piece.mesh, piece.pose, piece.id, temperature_of(piece)), from, piece.pose});
  }
}

/// Of pieces that a checkpoint told of, once all effects are loaded.
void MetThings::find_meshes() {
  if (!mover_ || std::none_of(bodies_.begin(), bodies_.end(), [](const Met& each) { return each.obstacle == kNone; })) return;
  const std::vector<SolidPiece> pieces = mover_->pieces();
  for (Met& each : bodies_)
    for (const SolidPiece& piece : pieces)
      if (each.obstacle == kNone && piece.id == each.id && piece.body == each.body) each.obstacle = add(*piece.mesh, each.to, each.id, temperature_of(piece));
}

void MetThings::move(Real t, Real dt) {
  if (tracks_.empty() && bodies_.empty() && !blocks_) return;
  look();
  find_meshes();
  const Real way = dt > 0 ? dt : 1;
  for (std::size_t k = 0; k < tracks_.size(); ++k) obstacles_.move(k, {tracks_[k].at(t), tracks_[k].at(t + dt), way});
  const auto at = [&](const Met& each, Real time) {
    const Real u = to_time_ > from_time_ ? std::clamp((time - from_time_) / (to_time_ - from_time_), 0.0, 1.0) : 1;
    return RigidPose{each.from.position + u * (each.to.position - each.from.position), each.from.orientation.slerp(u, each.to.orientation)};
  };
  for (const Met& each : bodies_)
    if (each.obstacle != kNone) obstacles_.move(each.obstacle, {at(each, t), at(each, t + dt), way});
  obstacles_.update();
}

void MetThings::add_planes(const geometry::Terrain* terrain, std::span<const Vec3> x, Real reach, Real thickness, std::vector<PlaneContact>& out) {
  const auto take = [&](int per_point) {
    for (std::size_t q = 0; q < found_.size(); ++q) {
      const std::size_t i = q / static_cast<std::size_t>(per_point);
      const geometry::Contact& c = found_[q];
      if (c.any()) out.push_back({static_cast<Index>(i), Vec3(x[i] + (thickness - c.distance) * c.normal), c.normal, c.surface_velocity});
    }
  };
  if (terrain) {
    found_.resize(x.size());
    terrain->contacts(x, reach, found_);
    take(1);
  }
  if (obstacles_.empty()) return;
  constexpr int kPerPoint = 3;
  found_.resize(kPerPoint * x.size());
  obstacles_.contacts(x, reach, kPerPoint, found_);
  take(kPerPoint);
}

void MetThings::save(StateWriter& out) const {
  out.value("bodies_from", from_time_);
  out.value("bodies_to", to_time_);
  std::vector<Index> numbers;
  std::vector<Real> poses;
  for (const Met& each : bodies_) {
    numbers.insert(numbers.end(), {each.id, each.body});
    for (const RigidPose* p : {&each.from, &each.to})
      poses.insert(poses.end(), {p->position.x(), p->position.y(), p->position.z(), p->orientation.w(), p->orientation.x(), p->orientation.y(), p->orientation.z()});
  }
  out.array("bodies_met", numbers);
  out.array("bodies_poses", poses);
}

void MetThings::load(StateReader& in) {
  std::vector<Index> numbers;
  std::vector<Real> v;
  in.value("bodies_from", from_time_);
  in.value("bodies_to", to_time_);
  in.array("bodies_met", numbers);
  in.array("bodies_poses", v);
  bool fits = v.size() == 7 * numbers.size();
  std::vector<Met> met;
  for (std::size_t k = 0; fits && k + 1 < numbers.size(); k += 2) {
    const Real* p = v.data() + 7 * k;
    const auto pose = [](const Real* q) { return RigidPose{Vec3(q[0], q[1], q[2]), Quat(q[3], q[4], q[5], q[6])}; };
    met.push_back({numbers[k], numbers[k + 1], kNone, pose(p), pose(p + 7)});
    const auto same = std::find_if(bodies_.begin(), bodies_.end(), [&](const Met& each) { return each.id == met.back().id; });
    if (same != bodies_.end()) std::swap(met.back().obstacle, same->obstacle);
    fits = met.back().body == SolidPiece::kNoBody ? blocks_ : met.back().body < breaks_.size() && (breaks_[met.back().body] || same != bodies_.end());
  }
  if (!fits) throw InputError(Place{"bodies"}, "the checkpoint holds other bodies");
  for (const Met& each : bodies_)
    if (each.obstacle != kNone) obstacles_.remove(each.obstacle);
  bodies_ = std::move(met);
}

}  // namespace effuse::flow
