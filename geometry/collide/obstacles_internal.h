#pragma once

#include <algorithm>
#include <array>
#include <optional>
#include <span>
#include <vector>

#include "geometry/collide/box_tree.h"
#include "geometry/collide/obstacles.h"

/// What Obstacles hold. For geometry/collide only.
namespace effuse::geometry {

struct Obstacles::Impl {
  struct Place {
    Box3 now, swept;  ///< at the step's end, and on all of its way
    bool there = false;
  };
  std::vector<std::optional<Obstacle>> all;  ///< none: removed
  std::vector<Place> place;
  MovingBoxes boxes;
  BoxTree tree;  ///< over the swept boxes
  Box3 now, swept;
  std::vector<Index> changed;
  std::size_t left = 0;

  bool up_to_date() const { return changed.empty(); }
};

/// The nearest contacts of a point, as they come: by distance, then surface, then the obstacle's number. As many as out has room for, at
/// most kMost; out is filled from the front, behind it nothing is touched.
class NearestContacts {
 public:
  static constexpr std::size_t kMost = 16;

  explicit NearestContacts(std::span<Contact> out) : out_(out) {}

  /// A place on obstacle `which`, in its own frame.
  void add(const CollisionMesh::Nearest& found, const Obstacle& obstacle, Index which) {
    const auto before = [&](std::size_t k) {
      if (found.distance != out_[k].distance) return found.distance < out_[k].distance;
      return obstacle.surface != out_[k].surface ? obstacle.surface < out_[k].surface : which < number_[k];
    };
    std::size_t slot = std::min(count_, out_.size() - 1);
    if (full() && !before(slot)) return;
    count_ = std::min(count_ + 1, out_.size());
    for (; slot > 0 && before(slot - 1); --slot) {
      out_[slot] = out_[slot - 1];
      number_[slot] = number_[slot - 1];
    }
    number_[slot] = which;
    const RigidPose& pose = obstacle.motion.to();
    const Vec3 point = pose.world(found.point);
    out_[slot] = {point, pose.orientation * found.normal, found.distance, obstacle.velocity_at(found.triangle, point), obstacle.temperature, obstacle.surface};
  }
  std::size_t count() const { return count_; }
  bool full() const { return count_ == out_.size(); }

 private:
  std::span<Contact> out_;
  std::array<Index, kMost> number_{};
  std::size_t count_ = 0;
};

}  // namespace effuse::geometry
