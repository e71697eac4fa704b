#pragma once

#include <filesystem>
#include <memory>
#include <string>
#include <utility>
#include <vector>

#include "flow/scene/scene.h"
#include "flow/scene/simulation.h"
#include "samples/effuse/film_export.h"
#include "samples/effuse/solid_things.h"
#include "geometry/terrain/terrain.h"
#include "skin/scene/skin_settings.h"
#include "skin/write/write_mesh.h"

namespace effuse {

/// Turns the simulation's state into the files of a frame: skin meshes, volume, picture; and the run
/// folder's terrain, contact sheet and manifest. A frame's bytes hang on its state alone, so that a run resumed
/// writes the bytes it would have.
class FrameWriter {
 public:
  FrameWriter(const flow::Scene& scene, const skin::SkinSettings& settings, const geometry::Terrain& terrain, const SolidThings& solids,
              std::filesystem::path folder);
  ~FrameWriter();

  /// terrain.ply, terrain.glb; obstacles.ply, obstacles.glb: where they are at the first frame
  void write_terrain();

  struct Result {
    std::size_t triangles = 0;
    Real volume = 0;           ///< enclosed by the skin above ground [m^3]
    Real particle_volume = 0;  ///< [m^3]
    std::size_t regions = 0;   ///< particles that the skin has a region of
    skin::TriangleShapes shapes;  ///< of its triangles
    std::size_t held_back = 0;    ///< vertices displaced less than asked for
  };
  /// frames/skin.0001.*, frames/lava.0001.vdb, frames/obstacles.0001.ply if any moves, preview/preview.0001.png
  Result write_frame(const flow::Simulation& simulation);

  /// preview/contact_sheet.png of twelve pictures spread over the film; nothing without pictures.
  void write_contact_sheet(int frames);

  /// What joins the frames so far: .pvd and .vtp.series, film.usda, as the formats ask for; film.glb when the film is done.
  void write_collections(int frames_done) const;

  /// manifest.json: what is where, in which units. flow: names and paths of maps and series (FlowWriter::files).
  void write_manifest(int frames_done, const std::vector<std::pair<std::string, std::string>>& flow) const;

 private:
  skin::Metadata metadata(int frame, Real time) const;
  /// PLY also holds what is shown beside the lava where none of the scene's formats does: GLB, OBJ, VDB and BGEO are of the lava alone.
  bool own_ply() const { return settings_.ply || ((settings_.obj || settings_.glb || settings_.vdb || settings_.bgeo) && !settings_.vtp && !settings_.usda); }
  void write_own(const flow::NamedMesh& own, int frame) const;
  /// Told once, on the first frame it happens in.
  void warn_of_lava_on(const Vec3& eye, const geometry::Points& points, Real spacing, int frame);
  bool told_of_camera_ = false;
  const flow::Scene& scene_;
  const skin::SkinSettings& settings_;
  const geometry::Terrain& terrain_;
  const SolidThings& solids_;
  bool pieces_ = false;  // an effect makes solid things of its own
  std::filesystem::path folder_;
  bool lava_ = false;  // or bodies alone: no skin
  std::unique_ptr<skin::Preview> preview_;
  std::vector<std::string> meshes_, volumes_;  // names of what effects show beside the lava
  FilmExport film_;
  skin::SurfaceCache last_;  // saves work, changes nothing
};

}  // namespace effuse
