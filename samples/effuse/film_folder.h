#pragma once

#include <filesystem>
#include <map>
#include <string>
#include <vector>

#include "geometry/mesh/tri_mesh.h"
#include "skin/color/lava_color.h"
#include "skin/write/write_mesh.h"
#include "skin/write/write_usda.h"

namespace effuse {

/// A run's folder as it lies on the disk, for what is made of it later. Frames are those whose files are there; what should be and is not is noted: a
/// run that was cut off, or lost files, is readable as far as it goes. manifest.json says when frames are and where on the map; where that is
/// missing or damaged scene.toml does, and the frames' own comments.
struct FilmFolder {
  /// The frames of one thing: the skin, obstacles, an effect's mesh or particles.
  struct Sequence {
    std::string name;
    std::map<int, std::filesystem::path> files;  ///< by frame: .ply, or .glb where there is none
  };

  std::filesystem::path folder;
  std::string name;
  Real fps = 24, time_scale = 1;
  Vec3 origin = Vec3::Zero();
  std::string crs;
  std::vector<skin::UsdaView> views;  ///< the manifest's camera and light
  Real aspect = 16.0 / 9;
  skin::LavaColorOptions color;     ///< of the scene
  std::vector<Sequence> sequences;  ///< by name, skin first
  int last_frame = 0;               ///< that any sequence has
  std::map<std::string, std::filesystem::path> stills;  ///< "terrain", and "obstacles" that never move: .ply or .glb
  std::vector<std::string> notes;

  Real time_of(int frame) const { return frame * time_scale / fps; }  ///< [s] of lava
  /// What travels with each file; frame 0: with one that stands still.
  skin::Metadata metadata(int frame) const;
};

/// Throws InputError when there is no such folder, or nothing of a run in it.
FilmFolder read_film_folder(const std::filesystem::path& folder);

/// A frame's file as the mesh it was written from: colour linear, of the skin "glow" too; triangles none: particles. The particles' regions stay out.
/// Throws InputError when it is damaged.
geometry::TriMesh read_frame(const FilmFolder& run, const std::filesystem::path& file);

/// Vertices without triangles.
inline bool is_particles(const geometry::TriMesh& mesh) { return mesh.triangles.empty() && !mesh.positions.empty(); }

}  // namespace effuse
