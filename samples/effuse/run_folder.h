#pragma once

#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "geometry/mesh/tri_mesh.h"
#include "skin/page/page.h"

namespace effuse {

/// A run's folder as `effuse run` leaves it, read back: manifest.json, the frames' meshes, flow.csv.
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
  bool still_obstacles_ = false;
};

}  // namespace effuse
