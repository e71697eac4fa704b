#pragma once

#include <span>
#include <utility>
#include <vector>

#include "flow/bodies/joint.h"

namespace effuse::flow::bodies {

/// Bodies that may move each other: joined, through contacts and joints, without passing through one that nothing moves.
/// Islands do not know of each other and are solved at the same time.
struct Island {
  std::vector<Index> bodies;   ///< rising
  std::vector<Index> points;   ///< of contact, rising
  std::vector<JointId> joints; ///< rising
};

/// Ends of a contact or joint; bodies out of range (terrain) and those not `moving` belong to no island.
struct Link {
  Index a, b;
};

/// The islands of the moving bodies, by their lowest body. Links between two bodies neither of which moves are in none.
std::vector<Island> make_islands(std::span<const unsigned char> moving, std::span<const Link> contacts, std::span<const std::pair<JointId, Link>> joints);

}  // namespace effuse::flow::bodies
