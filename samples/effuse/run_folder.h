#pragma once

#include <filesystem>
#include <map>
#include <optional>
#include <string>
#include <vector>

#include "geometry/mesh/tri_mesh.h"
#include "geometry/terrain/terrain.h"
#include "skin/page/page.h"
#include "skin/preview/preview.h"

namespace effuse {

/// A run's folder as `effuse run` leaves it, read back for its page and for pictures of it: manifest.json, the frames' meshes, points and
/// volumes, flow.csv.
class RunFolder {
 public:
  /// Reads manifest.json. Throws InputError when the folder holds no run, or its manifest is damaged.
  explicit RunFolder(std::filesystem::path folder);

  const std::string& name() const { return name_; }
  int frames() const { return static_cast<int>(times_.size()); }
  Real time(int frame) const { return times_[static_cast<std::size_t>(frame - 1)]; }  ///< frames count from 1
  Real fps() const { return fps_; }
  Real time_scale() const { return time_scale_; }
  const Vec3& origin() const { return origin_; }
  const std::string& crs() const { return crs_; }
  /// Layers of points, which are no meshes.
  const std::vector<std::string>& point_layers() const { return point_layers_; }
  bool has_lava() const { return !skins_.empty(); }

  /// terrain.ply or .glb; empty when neither is there.
  geometry::TriMesh terrain() const;
  /// The skin of a frame, with its attributes; nothing when its file is missing. The first of PLY, GLB and OBJ that is there.
  std::optional<geometry::TriMesh> lava(int frame) const;
  /// All that is solid and not lava, as one mesh with "color": obstacles, bodies, plants, ...; files that are missing are left out.
  geometry::TriMesh others(int frame) const;
  /// The terrain as ground on its map. Throws InputError when it is missing or broken.
  geometry::Terrain ground() const;
  /// What a picture of the frame shows: skin, obstacles, other surfaces; grains, sparks and smoke. Throws InputError for a file that is
  /// missing or broken, and for a run whose skins are not PLY, which alone holds their colours as pictures want them. An effect's own files
  /// come when it has something to show, and may be absent.
  struct Shown {
    geometry::TriMesh lava, others;
    skin::Air air;
  };
  Shown shown(int frame) const;
  /// Names of what flies and whose files do not say how it looks. Of the frames shown so far.
  const std::vector<std::string>& left_out() const { return left_out_; }

  /// flow.csv as curves with the times of its lines; both empty when it is not there. Throws InputError when it is damaged.
  void read_series(std::vector<Real>& times, std::vector<skin::PageSeries>& series) const;

 private:
  std::filesystem::path frame_file(const std::string& stem, int frame, const std::string& ending) const;

  std::filesystem::path folder_;
  std::string name_, crs_, series_file_;
  std::vector<Real> times_;
  Real fps_ = 24, time_scale_ = 1;
  Vec3 origin_ = Vec3::Zero();
  std::vector<std::string> skins_;          // endings: "ply", "glb", "obj"
  std::vector<std::string> layers_;         // of meshes, PLY: "obstacles", "jello", ...
  std::vector<std::string> point_layers_;
  std::map<std::string, std::string> patterns_;  // frames/NAME.####.ext by the manifest's names
  bool still_obstacles_ = false;
  mutable std::vector<std::string> left_out_;
};

}  // namespace effuse
