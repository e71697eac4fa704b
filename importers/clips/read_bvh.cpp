#include "importers/clips/read_bvh.h"

#include <assimp/scene.h>
#include <fmt/format.h>

#include <algorithm>
#include <functional>
#include <map>

#include "geometry/base/error.h"
#include "importers/assimp_reader.h"
#include "importers/input_file.h"

namespace effuse::importers {

using geometry::ClipJoint;

namespace {
constexpr std::uint64_t kLimit = 200'000'000;

/// BVH's y up to our z up: about x by a quarter turn.
Vec3 upright(const aiVector3D& v) { return Vec3(v.x, -v.z, v.y); }
Quat upright(const aiQuaternion& q) { return Quat(q.w, q.x, -q.z, q.y); }
}  // namespace

geometry::SkeletonClip read_bvh(const std::filesystem::path& file, Real scale) {
  const Place place{file.string()};
  if (lower_extension(file) != ".bvh") throw InputError(place, fmt::format("is a {} file, wanted motion capture: .bvh", lower_extension(file)));
  const std::string bytes = read_input(file, kLimit, "a clip");
  AssimpReader reader;
  const aiScene& scene = reader.read(file, bytes, 0);
  if (!scene.mRootNode || scene.mNumAnimations < 1) throw InputError(place, "has no motion: HIERARCHY and MOTION with frames were wanted");
  const aiAnimation& motion = *scene.mAnimations[0];
  std::map<std::string, const aiNodeAnim*> channels;
  std::size_t frames = 0;
  for (unsigned k = 0; k < motion.mNumChannels; ++k) {
    channels[motion.mChannels[k]->mNodeName.C_Str()] = motion.mChannels[k];
    frames = std::max<std::size_t>(frames, motion.mChannels[k]->mNumRotationKeys);
  }
  geometry::SkeletonClip clip;
  std::vector<const aiNodeAnim*> of_joint;
  const std::function<void(const aiNode&, Index)> visit = [&](const aiNode& node, Index parent) {
    const auto found = channels.find(node.mName.C_Str());
    clip.joints.push_back({node.mName.C_Str(), parent, scale * upright(aiVector3D(node.mTransformation.a4, node.mTransformation.b4, node.mTransformation.c4))});
    of_joint.push_back(found == channels.end() ? nullptr : found->second);
    const auto own = static_cast<Index>(clip.joints.size() - 1);
    for (unsigned k = 0; k < node.mNumChildren; ++k) visit(*node.mChildren[k], own);
  };
  visit(*scene.mRootNode, ClipJoint::kNone);
  // Of no frames assimp makes one, and a length that is none.
  if (frames == 0 || !(motion.mDuration >= 0 && motion.mDuration < 1e8)) throw InputError(place, "has no frame, wanted at least one");
  clip.frame_time = motion.mTicksPerSecond > 0 ? 1 / motion.mTicksPerSecond : 1. / 30;
  for (std::size_t f = 0; f < frames; ++f) {
    geometry::SkeletonPose pose;
    for (std::size_t j = 0; j < of_joint.size(); ++j) {
      const aiNodeAnim* channel = of_joint[j];
      Quat turn = Quat::Identity();
      if (channel && channel->mNumRotationKeys > 0) turn = upright(channel->mRotationKeys[std::min<std::size_t>(f, channel->mNumRotationKeys - 1)].mValue);
      if (!(turn.norm() > 0.5) || !turn.coeffs().allFinite()) throw InputError(place, fmt::format("frame {}: joint '{}' is turned by something that is no number", f + 1, clip.joints[j].name));
      pose.turn.push_back(turn.normalized());
    }
    const aiNodeAnim* root = of_joint[0];
    pose.root = root && root->mNumPositionKeys > 0 ? Vec3(scale * upright(root->mPositionKeys[std::min<std::size_t>(f, root->mNumPositionKeys - 1)].mValue)) : clip.joints[0].offset;
    if (!pose.root.allFinite()) throw InputError(place, fmt::format("frame {}: the root's place is no number", f + 1));
    clip.frames.push_back(std::move(pose));
  }
  return clip;
}

}  // namespace effuse::importers
