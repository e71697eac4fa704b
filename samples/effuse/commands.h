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
  int from_frame = 0;  ///< go on differently from here, the frames before stay; 0: no
  bool stats = false;  ///< print all zones of the profile
  std::vector<std::string> set;
};
ExitCode run(const RunCommand& command, const CommonOptions& common);

struct CheckCommand {
  std::filesystem::path scene;
  std::vector<std::string> set;
};
ExitCode check(const CheckCommand& command, const CommonOptions& common);

/// `effuse info`: what files hold.
struct InfoCommand {
  std::vector<std::filesystem::path> files;
  std::vector<double> at;  ///< of terrain grids: what the ground is like at this place, map coordinates or degrees, east first; none: not asked
};
ExitCode info(const InfoCommand& command, const CommonOptions& common);

/// `effuse effects`: every key that a scene may have, for people, as JSON, as the schema of scene files, or as a page.
struct EffectsCommand {
  bool schema = false;    ///< JSON schema, for editors
  bool markdown = false;  ///< scene_reference()
};
ExitCode effects(const EffectsCommand& command, const CommonOptions& common);

/// `effuse import`: terrain into the form another program wants. Options that a scene's [terrain] has as keys are read as those are
/// (terrain_settings.h); "" and none: not given. Lengths may carry their unit.
struct ImportCommand {
  std::vector<std::filesystem::path> files;  ///< one terrain, or the tiles of one
  std::filesystem::path output;              ///< .tif .asc: a grid; .ply .obj .glb .stl .off: a mesh
  std::string max_error;                     ///< of a grid's mesh at its posts, or of a mesh from itself [m]; all posts or vertices stay
  std::string crs;
  std::vector<double> crop;
  bool on_map = false;                       ///< positions as map coordinates, not relative to an origin: .ply .obj .off
  std::uint64_t max_posts = 50'000'000;
  // Of grids:
  std::string file_crs, vertical_unit, holes;
  std::string resample;                      ///< spacing, method, or both: "10 m,cubic"
  std::string pits;                          ///< policy, or with the depth: "fill:2m"
  std::vector<double> size, range;
  // Of meshes:
  std::string up, unit, stitch, edge;
  bool keep = false;                         ///< repair = false
  std::string fill_holes;                    ///< or "all"
  std::string cell;                          ///< between the posts of a grid made of it
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

/// `effuse render`: pictures of a run's frames, from its files, by another camera and light.
struct RenderCommand {
  std::filesystem::path run, folder;  ///< folder empty: RUN/render
  std::string frames;                 ///< "12", "10-40", "10-", "-40"; empty: all
  int every = 1;                      ///< only each so many'th
  std::vector<std::string> to = {"png"};  ///< png, exr, mp4, gif
  bool force = false;
  std::vector<std::string> set;       ///< of [preview] alone
};
/// Files already made stay when a later frame cannot be read. mp4 and gif are made by ffmpeg, where there is one.
ExitCode render_run(const RenderCommand& command, const CommonOptions& common);

/// `effuse view`: a run as one page of HTML that needs nothing else.
struct ViewCommand {
  std::filesystem::path folder, output;  ///< output empty: view.html in the folder
  std::size_t triangles = 30000;         ///< of the lava in a frame, at most; of the ground twice as many; 0: all there are
  std::string frames;                    ///< "10-60"; empty: all
  int every = 1;                         ///< frame of them
  std::string title;                     ///< empty: the run's name
};
ExitCode view(const ViewCommand& command, const CommonOptions& common);

/// `effuse export`: the frames of a run as other programs want them.
struct ExportCommand {
  std::filesystem::path folder;        ///< of the run
  std::filesystem::path output;        ///< folder to write; empty: the run's own, where its output.formats would have put them
  std::vector<std::string> formats;    ///< vtp usda bgeo glb-flipbook geotiff ply obj glb
  std::string frames;                  ///< "A-B"; empty: all
};
/// Reads the run's PLY files, or GLB where there are none. What is missing is told and left out. The first Ctrl-C ends it after the frame in hand.
ExitCode export_run(const ExportCommand& command, const CommonOptions& common);

/// `effuse study`; not called study, which is a namespace.
struct StudyCommand {
  std::vector<std::string> names;  ///< of studies; empty: all
  std::filesystem::path folder;
  std::vector<std::string> cases;  ///< only these; empty: all, or all quick ones
  bool full = false, resume = false, strict = false, list = false;
  bool cheapest = false;   ///< print, from the costs the folder holds, the cheapest setting for an error; run nothing
  bool calibrate = false;  ///< measure this machine instead, and keep the figures for `effuse check`
};
ExitCode run_studies(const StudyCommand& command, const CommonOptions& common);

}  // namespace effuse
