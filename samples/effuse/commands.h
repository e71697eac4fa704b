#pragma once

#include <cstdint>
#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "geometry/base/error.h"

/// The verbs of the program. Each prints data on stdout, talk on stderr, and returns the exit code;
/// errors are thrown and turned into codes by main().
namespace effuse {

/// The one JSON document of --json, on stdout. Write bytes that are not UTF-8 (file names may hold them) as U+FFFD.
void print_document(const std::string& json);

struct CommonOptions {
  bool json = false, quiet = false;
  int threads = 0;  ///< 0: all
  std::string program = "effuse";  ///< as it was called: for lines that say what to call next
  std::string read_limit;          ///< of time and memory to read a file: "60s,4GB"; empty: by its size
};

struct RunCommand {
  std::filesystem::path scene, folder;
  int frames = 0;  ///< 0: as the scene says
  bool resume = false, force = false;
  bool stats = false;  ///< print all zones of the profile
  std::vector<std::string> set;
};
ExitCode run(const RunCommand& command, const CommonOptions& common);

struct CheckCommand {
  std::filesystem::path scene;
  std::vector<std::string> set;
};
ExitCode check(const CheckCommand& command, const CommonOptions& common);

ExitCode info(const std::vector<std::filesystem::path>& files, const CommonOptions& common);
ExitCode effects(const CommonOptions& common);

/// `effuse import`: terrain into the form another program wants. Lengths may carry their unit.
struct ImportCommand {
  std::vector<std::filesystem::path> files;  ///< one terrain, or the tiles of one
  std::filesystem::path output;              ///< .tif .asc: a grid; .ply .obj .glb .stl .off: a mesh
  std::string max_error;                     ///< of a grid's mesh at its posts, or of a mesh from itself [m]; empty: all posts or vertices stay
  std::string crs, file_crs;                 ///< to work in; of the files
  std::vector<double> crop;                  ///< west, south, east, north; empty: all
  std::string resample;                      ///< "10 m", "cubic", or both with a comma; empty: as the file has them
  std::string vertical_unit;                 ///< of the files' heights
  std::string holes = "hole";                ///< or "fill", "error"
  std::string pits = "keep";                 ///< or "fill", "breach"; "fill:2m": only those up to 2 m deep
  std::vector<double> size, range;           ///< of an image's ground and heights [m]
  std::uint64_t max_posts = 50'000'000;
  // Of meshes:
  std::string up;                            ///< "x", "y", "z"; empty: as the file says, or z
  std::string units;                         ///< "mm", "ft", ...; empty: as the file says, or metres
  bool keep = false;                         ///< not repaired
  std::string edge;                          ///< remeshed to triangles of such edges; empty: not
  std::string fill_holes;                    ///< up to such a diagonal, or "all"; empty: none
  std::string cell;                          ///< between the posts of a grid made of it
  bool on_map = false;                       ///< positions as map coordinates, not relative to an origin: .ply .obj .off
};
/// Says each thing that it changed. Nothing is written when the input is refused.
ExitCode import_terrain_file(const ImportCommand& command, const CommonOptions& common);

/// `effuse skin`: the skin alone, for anybody's particles; lengths in the particles' own unit. Named as splashsurf's users
/// know them. Not called skin, which is a namespace.
struct SkinCommand {
  std::vector<std::filesystem::path> particles;  ///< files, or names with a place for the number: ####, $F4, %04d, {}
  std::vector<std::filesystem::path> meshes;     ///< to write: .ply .obj .glb .vdb
  std::filesystem::path folder;                  ///< for the meshes; empty: as they are
  double particle_radius = 0;                    ///< half the particle spacing; 0: the file's, or else estimated
  double smoothing_length = 2;                   ///< in radii; a particle is felt within twice that, as SPH's cubic spline is
  double cube_size = 1;                          ///< of a voxel, in radii
  std::optional<double> surface_threshold;       ///< of the density in units of the rest density; absent: volume or 0.5
  std::optional<bool> match_volume;              ///< enclose the particles' volume; absent: if a radius is known and no threshold given
  std::string kernel = "round";                  ///< or "anisotropic"
  std::optional<int> mesh_smoothing_iters;       ///< passes of mean-curvature flow on the level set; absent: 2, or 0 with anisotropic kernels
  double drop_volume = 0;                        ///< pieces and bubbles of fewer particles are left out
  std::string tessellation = "levelset";         ///< or "voronoi"
  double coarsen = 0;                            ///< in particle spacings, 2 radii; 0: not
  std::string kind = "none";                     ///< smooth, or a name of skin::kSkinKindNames: displaced and coloured
  std::optional<double> amplitude, edge, oversample;  ///< of the displacement, of the mesh [particle spacings], and edges so many times shorter; absent: the kind's, the cube size, 1
  std::optional<std::uint64_t> seed;
  std::string temperature;                       ///< of particles whose file has none, "1100" [K] or with its unit; empty: cold rock
  std::filesystem::path terrain;                 ///< where the skin ends, in the particles' coordinates; empty: none
  std::vector<double> origin;                    ///< three numbers that are subtracted from the particles' coordinates, or none
  bool sph_normals = true;                       ///< from the field's gradient; else of the triangles
  bool check = false;
  std::string up = "z";                          ///< of the particles: "y" or "z"
  std::optional<long long> start_index, end_index;
  std::vector<double> particle_aabb_min, particle_aabb_max;  ///< three numbers or none
};
/// Reads, skins and writes frame after frame. kFailed when a check of the mesh fails: not closed, manifold and oriented, or
/// triangles that intersect. Files written before a frame that cannot be read stay.
ExitCode skin_particles(const SkinCommand& command, const CommonOptions& common);

/// `effuse study`; not called study, which is a namespace.
struct StudyCommand {
  std::vector<std::string> names;  ///< of studies; empty: all
  std::filesystem::path folder;
  std::vector<std::string> cases;  ///< only these; empty: all, or all quick ones
  bool full = false, resume = false, strict = false, list = false;
};
ExitCode run_studies(const StudyCommand& command, const CommonOptions& common);

}  // namespace effuse
