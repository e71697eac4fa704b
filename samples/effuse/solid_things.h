#pragma once

#include <filesystem>
#include <vector>

#include "flow/scene/effect.h"
#include "flow/scene/joints.h"
#include "flow/scene/obstacles.h"
#include "flow/scene/rigid_bodies.h"
#include "flow/scene/scene.h"
#include "geometry/mesh/tri_mesh.h"
#include "importers/read_apart.h"
#include "skin/scene/skin_settings.h"

namespace effuse {

/// Where a scene's files lie, and what reading one may cost.
struct SceneFiles {
  std::filesystem::path folder;
  importers::ReadLimits limits;
};

/// The mesh that a form names, its file's relative to the scene's folder and repaired (geometry/repair), or its box or ball. Throws
/// InputError at the scene's line. notes: what was repaired.
geometry::TriMesh load_form(const flow::PlannedForm& form, const SceneFiles& files, std::vector<std::string>& notes);

/// Reads the meshes of a scene's obstacles, relative to its folder, and puts them on the terrain. What goes wrong is a fault at the
/// line that names the file. notes: what was done to meshes on the way, a line each.
std::vector<flow::PlacedObstacle> load_obstacles(const flow::Scene& scene, const SceneFiles& files, const geometry::Terrain& terrain, std::vector<Fault>& faults,
                                                 std::vector<std::string>& notes);

/// The same for its figures, whose bones are obstacles; to be put behind the scene's own.
std::vector<flow::PlacedObstacle> load_figures(const flow::Scene& scene, const SceneFiles& files, const geometry::Terrain& terrain, std::vector<Fault>& faults,
                                               std::vector<std::string>& notes);

/// The same for its rigid bodies.
std::vector<flow::PlacedBody> load_bodies(const flow::Scene& scene, const SceneFiles& files, const geometry::Terrain& terrain, std::vector<Fault>& faults,
                                          std::vector<std::string>& notes);

/// Its joints, among obstacles and bodies of which none was left out.
std::vector<flow::PlacedJoint> load_joints(const flow::Scene& scene, const std::vector<flow::PlacedObstacle>& obstacles, const std::vector<flow::PlacedBody>& bodies,
                                           const geometry::Terrain& terrain, std::vector<Fault>& faults, std::vector<std::string>& notes);

/// What is solid in a scene, beside the terrain.
struct SolidThings {
  std::vector<flow::PlacedObstacle> obstacles;
  std::vector<flow::PlacedBody> bodies;
  std::vector<flow::PlacedJoint> joints;
  std::vector<geometry::TriMesh> looks;  ///< of obstacles, then bodies, in their own frames: make_looks()
  void make_looks();
  bool any() const { return !obstacles.empty() || !bodies.empty(); }
  bool any_moves() const;
  /// Triangles of all.
  std::size_t triangles() const;
  /// What they cost beside the simulation: bytes of trees to collide with, looks and the picture's tree; seconds to read, build and write
  /// them once, and to draw or write them in a frame. Measured on a torus of a million triangles: 1.4 GB, 7.5 s, 2 s a frame.
  double memory() const { return 1400.0 * static_cast<double>(triangles()); }
  double start_seconds() const { return 8e-6 * static_cast<double>(triangles()); }
  double frame_seconds() const { return 2e-6 * static_cast<double>(triangles()); }
  bool any_breaks() const;
  /// All where they are at a time [s], as one mesh of their looks. poses: of the bodies; empty: where the scene puts them. pieces: instead of
  /// the bodies that can break. Where there are such: "piece", 0 for the others, and "inner", 1 on faces that breaking has made.
  geometry::TriMesh at(Real time, const std::vector<geometry::RigidPose>& poses = {}, const std::vector<flow::SolidPiece>& pieces = {}) const;
};

/// Throws InputError where the picture's camera stands in an obstacle at a frame of the film. Bodies, which move as they will, are not asked.
void check_camera_among(const SolidThings& things, const skin::SkinSettings& settings, const geometry::Terrain& terrain, const flow::Scene& scene);

/// Lava and other meshes for one picture: these cold and dull.
geometry::TriMesh in_one_picture(geometry::TriMesh lava, const geometry::TriMesh& obstacles);

}  // namespace effuse
