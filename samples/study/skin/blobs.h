#pragma once

#include <string>
#include <utility>
#include <vector>

#include "geometry/base/types.h"

/// Particles as flows leave them, spacing 1: clusters, a sheet one particle thick, blobs that merge and part.
namespace effuse::study {

/// `n` particles, normal about the origin with a deviation of 1.7: lone ones, chains and lumps.
std::vector<Vec3> random_cluster(std::uint64_t seed, std::uint64_t n = 150);

/// A round sheet of one particle, 14 wide, on a square lattice moved by up to 0.25 in its plane.
std::vector<Vec3> thin_sheet();

/// Two balls of radius 2.4 that come together from 6.5 to 2 between their middles. share: 0 .. 1 of the way.
std::vector<Vec3> merging_balls(Real share);

/// A ball of radius 3.2 drawn out to 3.2 times its length, thinned to a quarter in the middle. share: 0 .. 1 of the way.
std::vector<Vec3> parting_ball(Real share);

inline constexpr int kClusters = 10, kMergingFrames = 48, kPartingFrames = 24;
/// All of these and what they are: ten clusters, the sheet, every step-th frame of merging and of parting.
std::vector<std::pair<std::string, std::vector<Vec3>>> blobs(int step = 1);

}  // namespace effuse::study
