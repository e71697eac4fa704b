#pragma once

#include <filesystem>
#include <span>
#include <string>
#include <vector>

#include "geometry/collide/rigid_pose.h"
#include "skin/write/write_mesh.h"

namespace effuse::skin {

/// A mesh in its own frame, and where that is at each of a film's frames.
struct MovingMesh {
  std::string name;
  const geometry::TriMesh* mesh = nullptr;
  std::vector<geometry::RigidPose> poses;  ///< one a frame, z up; orientations unit
};

/// Binary glTF 2.0 of rigid things that move: a node for each, named, with its mesh, and one animation that moves them from frame to frame
/// (positions and orientations, linear between). What never moves has none. Things of the same mesh (the same pointer) share it.
/// y up, as write_glb has it: (x, z, -y). Blender, Houdini, three.js play it as it is.
///   times  [s] of film, rising, one a frame; at least one frame, as many poses as times (checked)
/// The file is whole or absent; what cannot be written (a mesh that is not well formed) is an InputError naming it.
void write_animated_glb(const std::filesystem::path& file, std::span<const MovingMesh> things, std::span<const Real> times, const Metadata& metadata = {});

}  // namespace effuse::skin
