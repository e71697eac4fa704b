#pragma once

#include <filesystem>

#include "geometry/motion/skeleton_clip.h"

namespace effuse::importers {

/// A motion capture clip (BVH), by assimp. BVH is y-up, without a unit: scale [m] is what one of its numbers means (0.01: centimetres).
/// Ends of limbs become joints that never turn. Throws InputError when the file is no BVH, or has no frame or joint.
geometry::SkeletonClip read_bvh(const std::filesystem::path& file, Real scale);

}  // namespace effuse::importers
