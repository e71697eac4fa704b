#pragma once

#include <filesystem>
#include <functional>
#include <map>
#include <string>
#include <vector>

#include "geometry/mesh/points.h"
#include "geometry/mesh/tri_mesh.h"
#include "skin/write/write_mesh.h"
#include "skin/write/write_usda.h"

namespace effuse {

/// Files of a film's frames for other programs, written by a run as it goes or from its folder later:
///
///   vtp    frames/NAME.####.vtp, NAME.pvd, frames/NAME.vtp.series; terrain.vtp, obstacles.vtp where they stand still
///   usda   frames/NAME.####.usda, terrain.usda, obstacles.usda, film.usda: the stage with all of them, camera and sun
///
/// with times of the lava in VTP, frames of the film in USDA.
class FilmExport {
 public:
  struct Formats {
    bool vtp = false, usda = false;
    bool any() const { return vtp || usda; }
  };
  struct Film {
    Real fps = 24, time_scale = 1;
    Real time_of(int frame) const { return frame * time_scale / fps; }  ///< [s] of lava
  };
  FilmExport(Film film, Formats formats, std::filesystem::path folder) : film_(film), formats_(formats), folder_(std::move(folder)) {}

  /// What stands still all the time: the terrain, obstacles. NAME.vtp, NAME.usda.
  void add_still(const std::string& name, const geometry::TriMesh& mesh, const skin::Metadata& about);
  /// One thing of one frame; a mesh without triangles is particles.
  void add(const std::string& name, int frame, const geometry::TriMesh& mesh, const skin::Metadata& about);
  /// The files that join frames, of those in the folder up to `frames`. Those of things that this has written no frame of stay as they are.
  ///   views  camera and light of the frames, one holds until the next
  void finish(int frames, const std::vector<skin::UsdaView>& views, Real aspect, const skin::Metadata& about) const;

 private:
  std::vector<skin::UsdaSequence::File> files_of(const std::string& name, const char* extension, int frames) const;
  Film film_;
  Formats formats_;
  std::filesystem::path folder_;
  std::map<std::string, skin::UsdaSequence> things_;
  std::vector<skin::UsdaStage::Still> stills_;
};

/// Particles as a mesh of vertices: what they have under the names of the formats.
geometry::TriMesh mesh_of_points(const geometry::Points& points);

/// frames/NAME.####.bgeo: velocities times scale, so that Houdini's `v` is in metres a second of film, as its motion blur takes it.
void write_film_bgeo(const std::filesystem::path& file, const geometry::Points& points, Real scale);

}  // namespace effuse
