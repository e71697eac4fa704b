#pragma once

#include <cstddef>
#include <map>
#include <string>
#include <utility>
#include <vector>

#include "geometry/mesh/tri_mesh.h"

namespace effuse::skin {

/// A curve beside the picture: values over the page's `series_times`, NaN where there are none. Curves of the same chart share its axis.
struct PageSeries {
  std::string chart, name, unit;  ///< "Front", "", "m"
  std::vector<Real> values;
};

/// What the page says of itself.
struct PageAbout {
  std::string title;
  std::vector<std::pair<std::string, std::string>> facts;  ///< "map", "EPSG:27200"
  Real fps = 24;
  Vec3 origin = Vec3::Zero();  ///< of the meshes' coordinates on the map [m]
  std::string crs;
  std::vector<Real> series_times;  ///< [s]
  std::vector<PageSeries> series;
};

/// One moment. Attributes of the lava that the page knows, each of which may be lacking: "temperature" [K], "velocity" [m/s], "crust" 0..1,
/// "thickness" [m], "color" (display: reflected and emitted light) and "glow" (emission), both linear. Of the others: "color".
struct PageFrame {
  int number = 1;
  Real time = 0;              ///< [s]
  geometry::TriMesh lava;
  geometry::TriMesh others;   ///< obstacles, bodies, plants, ...: one mesh
};

struct PageReport {
  std::size_t frames = 0, triangles = 0;  ///< of the lava, in all frames
  std::size_t bytes = 0;                  ///< of the page
  std::size_t frame_bytes = 0;            ///< of those, meshes of frames
};

/// One HTML file to scrub through a run, that opens from disk with no server and asks the network for nothing: WebGL 2, no library.
///
/// Frames are packed as they come (pack_mesh.h), so that only their packed bytes are kept. About 8 bytes a triangle in the page with all
/// attributes: 100 frames of 20,000 are 16 MB. An attribute is 8 bit of its range in that frame; the page can save what it shows as PLY and GLB with that.
/// Temperatures, speeds and thicknesses are shown on ranges of all frames: from the lowest to the highest temperature; from 0 to
/// what 99.5 % of the vertices of each frame stay below.
///
/// The browser must be of 2023 or later: DecompressionStream("deflate-raw"). It says so if not.
class Page {
 public:
  /// terrain: may be empty. Meshes must be well formed (InputError, naming the ground or the frame, if not); normals are computed where there are none.
  Page(PageAbout about, const geometry::TriMesh& terrain);
  /// Frames in the order they are shown.
  void add(const PageFrame& frame);
  std::string html(PageReport* report = nullptr) const;

 private:
  struct Blob {
    std::string about;  // JSON
    std::string text;
    std::size_t triangles = 0;
  };
  std::size_t add_blob(const geometry::TriMesh& mesh, bool lava);

  struct Shown {
    int number;
    Real time;
    std::size_t lava, others;  // blobs, or kNone
  };
  static constexpr std::size_t kNone = static_cast<std::size_t>(-1);

  PageAbout about_;
  std::vector<Blob> blobs_;
  std::map<std::string, std::size_t> known_;  // text of a blob of other things -> its number: what stands still is there once
  std::size_t terrain_ = kNone, base_ = kNone;
  std::vector<Shown> frames_;
  Box3 lava_box_, first_lava_, others_box_, all_box_;
  Real coldest_ = 0, hottest_ = 0, fastest_ = 0, thickest_ = 0;
};

/// The walls and floor that make a block of a piece of ground, for eyes only: from each border edge straight down to the same depth. Empty when the mesh
/// has no border. Its attribute "color" is dark rock.
geometry::TriMesh block_below(const geometry::TriMesh& ground);

}  // namespace effuse::skin
