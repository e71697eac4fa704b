#include "flow/effects/moving_obstacles.h"

namespace effuse::flow {

MovingObstacles::MovingObstacles(const std::vector<PlacedObstacle>& placed) : friction_(1, 1.0) {
  for (const PlacedObstacle& each : placed) {
    tracks_.push_back(each.track);
    friction_.push_back(each.friction);
    obstacles_.add({each.shape, geometry::RigidMotion(each.track.at(0)), each.temperature, static_cast<Index>(tracks_.size())});
  }
  obstacles_.update();
}

void MovingObstacles::move(Real from, Real to) {
  for (std::size_t i = 0; i < tracks_.size(); ++i) {
    const geometry::RigidMotion motion = tracks_[i].between(from, to);
    const geometry::RigidMotion& now = obstacles_[i].motion;
    if (motion.moves() || now.moves() || motion.to().position != now.to().position || motion.to().orientation.coeffs() != now.to().orientation.coeffs()) obstacles_.move(i, motion);
  }
  obstacles_.update();
}

sph::SolidOptions MovingObstacles::solids() {
  if (tracks_.empty()) return {};
  sph::SolidOptions options{&obstacles_, {}, friction_};
  for (const geometry::PoseTrack& track : tracks_)
    if (track.keys().size() > 1) options.move = [this](Real from, Real to) { move(from, to); };
  return options;
}

}  // namespace effuse::flow
