#include <fmt/format.h>

#include <fcntl.h>
#include <unistd.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <cerrno>
#include <csignal>
#include <cstdio>
#include <cstring>
#include <map>
#include <new>
#include <nlohmann/json.hpp>
#include <optional>
#include <string_view>
#include <system_error>

#include "geometry/base/log.h"
#include "geometry/base/parallel.h"
#include "samples/effuse/commands.h"
#include "samples/effuse/describe_commands.h"

namespace {

using effuse::ExitCode;

/// One error as a line for people, or as the JSON document that --json promises.
int report(ExitCode code, const std::vector<effuse::Fault>& faults, bool json) {
  if (json) {
    nlohmann::ordered_json j;
    j["ok"] = false;
    j["exit_code"] = static_cast<int>(code);
    for (const effuse::Fault& fault : faults)
      j["errors"].push_back({{"file", fault.place.file}, {"line", fault.place.line}, {"column", fault.place.column}, {"message", fault.message}});
    effuse::print_document(j.dump(1, ' ', false, nlohmann::ordered_json::error_handler_t::replace));
  }
  for (const effuse::Fault& fault : faults) {
    std::string line = "error: " + to_string(fault);
    // One line each, and nothing that a file's name or content could make a terminal do.
    std::replace_if(line.begin(), line.end(), [](char c) { return static_cast<unsigned char>(c) < 0x20 || c == 0x7f; }, '?');
    line += '\n';
    std::fwrite(line.data(), 1, line.size(), stderr);  // who closed stderr does not want to know
  }
  return static_cast<int>(code);
}

int report(ExitCode code, const std::string& message, bool json) { return report(code, std::vector<effuse::Fault>{{effuse::Place{}, message}}, json); }

/// A closed standard stream is opened on nothing: else the first file written would get its number, and the log in it.
void open_standard_streams() {
  for (const int fd : {STDIN_FILENO, STDOUT_FILENO, STDERR_FILENO})
    if (::fcntl(fd, F_GETFD) == -1 && ::open("/dev/null", fd == STDIN_FILENO ? O_RDONLY : O_WRONLY) < 0) ::_exit(static_cast<int>(ExitCode::kFailed));
}

/// What was printed is out, or the exit code says that it is not.
int flushed(ExitCode code) {
  if (std::fflush(stdout) == 0 && !std::ferror(stdout)) return static_cast<int>(code);
  const int error = errno;
  const int lost = report(error == ENOSPC || error == EDQUOT || error == EFBIG ? ExitCode::kOutOfResources : ExitCode::kFailed,
                          fmt::format("cannot write to standard output: {}", std::strerror(error)), false);
  return code == ExitCode::kDone ? lost : static_cast<int>(code);
}

/// The words of splashsurf, where ours does the same; each says what it does here.
void add_skin_options(CLI::App* verb, effuse::SkinCommand& skin) {
  const std::map<std::string, bool> switches = {{"on", true}, {"off", false}};
  verb->add_option("particles", skin.particles, "particle files, or one name with ####, $F4, %04d or {} where the frame's number stands")->required();
  verb->add_option("-o,--output-file", skin.meshes, "mesh to write, by its ending .ply, .obj, .glb, .vdb; may be given several times; for several frames with #### in it")
      ->required()
      ->allow_extra_args(false);
  verb->add_option("--output-dir", skin.folder, "folder of the output files");
  verb->add_option("-r,--particle-radius", skin.particle_radius, "half the particle spacing, in the unit of the positions; absent: the file's radii, and without them an estimate from the distances of neighbours")
      ->check(CLI::PositiveNumber);
  verb->add_option("-l,--smoothing-length", skin.smoothing_length, "in particle radii: a particle is felt within twice this, as with SPH's cubic spline [2]")->check(CLI::Range(1.7, 4.0));
  verb->add_option("-c,--cube-size", skin.cube_size, "side of the grid's cells, in particle radii [1]")->check(CLI::Range(0.2, 2.0));
  verb->add_option("-t,--surface-threshold", skin.surface_threshold,
                   "0.1 to 0.9 (0.25 to 0.85 at the default smoothing length): puts the surface where, over a flat one, SPH's density falls to this share of that inside (0.5: where the particles' volume ends; less is fatter). Our surface is a "
                   "level set, no isosurface of the density: drops and edges differ. Absent: the surface encloses the particles' volume, (2 radius)^3 each, if the radius is known, else 0.5")
      ->check(CLI::Range(0.1, 0.9));
  verb->add_option("--match-volume", skin.match_volume, "on or off: see --surface-threshold")->transform(CLI::CheckedTransformer(switches));
  verb->add_option("--kernel", skin.kernel, "round: particles are averaged with spheres; anisotropic: with ellipsoids that follow the surface: flatter faces, sharper edges, drops keep their volume, half as slow again; not with --surface-threshold [round]")
      ->check(CLI::IsMember({"round", "anisotropic"}));
  verb->add_option("--mesh-smoothing-iters", skin.mesh_smoothing_iters,
                   "passes of mean-curvature flow on the level set before it is meshed, each of radius^2 / 6 (about three of splashsurf's on its mesh at cube size 0.5); drops keep their size [2; 0 with --kernel anisotropic]")
      ->check(CLI::Range(0, 100));
  verb->add_option("--drop-volume", skin.drop_volume, "leave out closed pieces, and fill bubbles, of less than this many particles' volume [0]")->check(CLI::Range(0.0, 1e9));
  verb->add_option("--tessellation", skin.tessellation, "levelset: triangles of one size; voronoi: fans of triangles, a spacing wide, on each particle's part of the surface. PLY carries the particle's id as region: of vertices, and with voronoi of faces. Fans cut through one another in gaps and necks narrower than they are, loose spray above all: --check tells [levelset]")
      ->check(CLI::IsMember({"levelset", "voronoi"}));
  verb->add_option("--coarsen", skin.coarsen, "fewer triangles where the surface is flat to so many particle spacings (2 radii), 0.1 say; 0: none; goes with levelset [0]")->check(CLI::Range(0.0, 1.0));
  verb->add_option("--kind", skin.kind,
                   "none: the smooth skin. aa, pahoehoe, block, obsidian, noise: displaced as such lava, and coloured, with glow where particles have a temperature. What the particles' `rest` says moves the detail along; without it, in a "
                   "sequence with ids, the place where each id was first seen (skin the whole sequence in one call); else it stands still in space, and the lava swims through it. VDB stays smooth [none]")
      ->check(CLI::IsMember({"none", "aa", "pahoehoe", "block", "obsidian", "noise"}));
  verb->add_option("--amplitude", skin.amplitude, "with --kind: half the height of its bumps where cold, in particle spacings (2 radii); 0: colours alone [0.25]")->check(CLI::Range(0.0, 10.0));
  verb->add_option("--edge", skin.edge, "with --kind: the mesh is refined to edges of so many particle spacings, 0.1 say for close-ups [the cube size]")->check(CLI::Range(0.05, 10.0));
  verb->add_option("--oversample", skin.oversample, "with --kind: edges so many times shorter, with no finer bumps: triangles follow the bumps more closely, and change less from frame to frame; 4 for stills and slow shots [1]")->check(CLI::Range(1.0, 16.0));
  // Beyond what 64 bits hold it would be cut to that in silence.
  const CLI::Validator whole([](std::string& text) { return !text.empty() && text.size() <= 19 && text.find_first_not_of("0123456789") == std::string::npos ? "" : "must be a whole number of up to 19 digits"; }, "");
  verb->add_option("--seed", skin.seed, "with --kind: another one, other bumps [1]")->check(whole);
  verb->add_option("--temperature", skin.temperature, "with --kind: of particles whose file has none, 1100 (kelvin) or '950 degC'; absent: cold rock that does not glow");
  verb->add_option("--terrain", skin.terrain, "ground to end the skin at: a DEM grid (ESRI ASCII) or a mesh, z up, in the coordinates of the particles; what they enclose is counted above it");
  verb->add_option("--origin", skin.origin, "x y z that the outputs count from: subtracted from all positions, for map coordinates and others that floats are too coarse for; --terrain and --particle-aabb stay in the particles' own")->expected(3);
  verb->add_option("--sph-normals", skin.sph_normals, "on: normals of the field's gradient, off: of the triangles, as displaced skins always have them; normals are always written [on]")->transform(CLI::CheckedTransformer(switches));
  verb->add_option_function<bool>(
          "--normals",
          [](bool on) {
            if (!on) throw CLI::ValidationError("--normals", "off: meshes are always written with normals, readers shade them flat without");
          },
          "on; normals are always written, see --sph-normals")
      ->transform(CLI::CheckedTransformer(switches));
  verb->add_option("--up", skin.up, "y or z: the particles' axis that points up; of the outputs it turns .glb only, which is y up by its standard [z]")->check(CLI::IsMember({"y", "z"}));
  verb->add_flag("--check,--check-mesh", skin.check, "look whether the mesh is closed, manifold, oriented and free of self-intersections; print what was found; exit code 1 if it is not");
  verb->add_option("-s,--start-index", skin.start_index, "first frame of a sequence to skin");
  verb->add_option("-e,--end-index", skin.end_index, "last frame of a sequence to skin");
  verb->add_option("--particle-aabb-min", skin.particle_aabb_min, "x y z: skin only particles in a box, this is its lower corner")->expected(3);
  verb->add_option("--particle-aabb-max", skin.particle_aabb_max, "x y z: its upper corner")->expected(3);
  verb->footer("Exit codes: 0 done, 1 a check of the mesh failed, 2 wrong use or bad input, 5 out of disk or memory.");
  // Ranges let nan through.
  const CLI::Validator finite([](std::string& text) { return std::isfinite(std::strtod(text.c_str(), nullptr)) ? "" : "must be a finite number"; }, "");
  for (const char* name : {"-r", "-l", "-c", "-t", "--drop-volume", "--coarsen", "--amplitude", "--edge", "--oversample", "--particle-aabb-min", "--particle-aabb-max"}) verb->get_option(name)->check(finite);
}

void add_import_options(CLI::App* verb, effuse::ImportCommand& import) {
  verb->add_option("file", import.files, "a grid (GeoTIFF, ESRI ASCII, HGT, USGS DEM, flt, bil, XYZ, netCDF, PNG) or several as a mosaic, or a mesh")->required();
  verb->add_option("-o,--output", import.output, "file to write: .tif .asc a grid; .ply .obj .glb .stl .off a mesh")->required();
  verb->add_option("--max-error", import.max_error, "fewer triangles: of a grid's mesh, no post lies farther above or below it ('0.5 m'); of a mesh, neither lies farther from the other; absent: every post, every triangle");
  verb->add_option("--crop", import.crop, "west south east north in the output's map coordinates; of a grid in degrees, degrees do too")->expected(4)->delimiter(',');
  verb->add_option("--crs", import.crs, "coordinate system to work in, in metres: EPSG:32616, WKT, PROJ [the file's, or the UTM zone of one in degrees]");
  verb->add_option("--file-crs", import.file_crs, "what the file's coordinates are in, when it does not say or says it wrong");
  verb->add_option("--resample", import.resample, "distance between posts, method (auto, nearest, bilinear, cubic, average), or both: 10m,cubic [as the file has them]");
  verb->add_option("--vertical-unit", import.vertical_unit, "of the file's heights: m, ft, us-ft, cm [as the file says, or m]");
  verb->add_option("--holes", import.holes, "posts without data: hole leaves them, fill spans a smooth surface, error refuses [hole]");
  verb->add_option("--pits", import.pits, "closed depressions: keep, fill to where they overflow, breach drains them by a notch; fill:2m only those up to 2 m deep [keep]");
  verb->add_option("--size", import.size, "of an image without a place: east-west north-south in metres, first post to last")->expected(2)->delimiter(',');
  verb->add_option("--range", import.range, "of an image: heights in metres of its darkest and brightest values")->expected(2)->delimiter(',');
  verb->add_option("--max-posts", import.max_posts, "refuse more [50000000]")->check(CLI::Range(std::uint64_t{4}, std::uint64_t{4000000000}));
  verb->add_flag("--on-map", import.on_map, "write positions as map coordinates, in all their digits, not relative to an origin: .ply .obj .off");
  verb->add_option("--up", import.up, "of a mesh: its axis that points up [as the file says, or z]")->check(CLI::IsMember({"x", "y", "z"}));
  verb->add_option("--unit,--units", import.unit, "of a mesh's numbers: mm, cm, m, km, in, ft, us-ft, or metres of one [as the file says, or m]");
  verb->add_flag("--keep", import.keep, "of a mesh: leave it as it is; absent: it is repaired (welded, wound one way, parted where it is not manifold, degenerate and duplicate triangles dropped)");
  verb->add_option("--stitch", import.stitch, "of a mesh: borders no farther apart become one ('1 mm') [a millionth of its size]");
  verb->add_option("--fill-holes", import.fill_holes, "of a mesh: fill holes up to this diagonal ('2 m'), or all [none]");
  verb->add_option("--edge", import.edge, "of a mesh: new triangles with edges about so long ('2 m'); sharp edges and borders stay");
  verb->add_option("--cell", import.cell, "of a grid made of a mesh: distance between its posts ('5 m')");
  verb->footer("Says what it found, assumed and changed. Exit codes: 0 done, 2 wrong use or bad input, 5 out of disk or memory.");
}

void add_set(CLI::App* verb, std::vector<std::string>& assignments) {
  verb->add_option("--set", assignments, "overrides a value of the scene, one word: --set lava.spacing='2 m' --set preview.target=[10,20]; may be given several times")
      ->type_name("KEY=VALUE")
      ->allow_extra_args(false)
      ->check(CLI::Validator([](std::string& text) { return text.find('=') == std::string::npos ? fmt::format("'{}' has no '=', wanted KEY=VALUE in one word", text) : std::string(); }, ""));
}

bool out_of_resources(const std::system_error& error) {
  for (const int code : {ENOSPC, EDQUOT, EFBIG, ENOMEM, EAGAIN})
    if (error.code() == std::error_code(code, std::generic_category()) || error.code() == std::error_code(code, std::system_category())) return true;
  return false;
}

}  // namespace

int main(int argc, char** argv) {
  open_standard_streams();
  std::signal(SIGXFSZ, SIG_IGN);  // a file that grows too large is an error to report, with nothing half written
  CLI::App app{"effuse: lava over real terrain"};
  app.set_version_flag("--version", std::string("effuse ") + EFFUSE_VERSION);
  app.require_subcommand(1);
  app.fallthrough();
  app.footer("Exit codes: 0 done, 1 failed, 2 wrong use or bad input, 4 unstable, 5 out of disk or memory, 130 interrupted.");

  effuse::CommonOptions common;
  if (argc > 0 && argv[0][0] != '\0') common.program = argv[0];
  const auto add_common = [&](CLI::App* verb) {
    verb->add_flag("--json", common.json, "one JSON document on stdout, nothing else there");
    verb->add_flag("-q,--quiet", common.quiet, "no progress, no talk");
    verb->add_option("--threads", common.threads, "threads to use; all when absent")->check(CLI::Range(1, 1024));
    verb->add_option("--read-limit", common.read_limit, "time and memory that reading one mesh or grid may take: 60s,4GB; absent: by the file's size");
    return verb;
  };

  effuse::RunCommand run;
  CLI::App* run_verb = add_common(app.add_subcommand("run", "simulate a scene and write its frames"));
  run_verb->add_option("scene", run.scene, "scene file (TOML)")->required();
  run_verb->add_option("-o,--output", run.folder, "folder to write; out/SCENE when absent");
  run_verb->add_option("--frames", run.frames, "make this many frames")->check(CLI::Range(1, 9999));
  run_verb->add_flag("--resume", run.resume, "go on with the run in the folder, from its newest checkpoint");
  run_verb->add_option("--from-frame", run.from_frame, "make the folder's run anew from this frame on, with the scene as it is now (--set lava.rheology.a=-3 ...); the frames before stay as they are")->check(CLI::Range(2, 9999))->excludes("--resume");
  run_verb->add_flag("--force", run.force, "replace the run that the folder holds")->excludes("--from-frame");
  run_verb->add_flag("--stats", run.stats, "say at the end where all of the time went; run.json has it in any case");
  add_set(run_verb, run.set);

  effuse::RenderCommand render;
  CLI::App* render_verb = add_common(app.add_subcommand("render", "pictures of a run's frames again, by another camera and light, without simulating again"));
  render_verb->add_option("run", render.run, "folder of a run that wrote ply")->required();
  render_verb->add_option("-o,--output", render.folder, "folder for the pictures; RUN/render when absent");
  render_verb->add_option("--frames", render.frames, "which: 12, 10-40, 10- or -40; absent: all");
  render_verb->add_option("--every", render.every, "only each so many'th [1]")->check(CLI::Range(1, 9999));
  render_verb->add_option("--to", render.to, "png, exr (linear light, half floats), mp4, gif (by ffmpeg, where it is installed); several with commas [png]")->delimiter(',')->check(CLI::IsMember({"png", "exr", "mp4", "gif"}));
  render_verb->add_flag("--force", render.force, "replace the pictures that are there");
  add_set(render_verb, render.set);

  effuse::CheckCommand check;
  CLI::App* check_verb = add_common(app.add_subcommand("check", "say all that is wrong with a scene, or what it would cost"));
  check_verb->add_option("scene", check.scene, "scene file (TOML)")->required();
  add_set(check_verb, check.set);

  effuse::InfoCommand info;
  CLI::App* info_verb = add_common(app.add_subcommand("info", "facts of files: terrain, meshes, volumes, scenes, runs (their folder, or run.json in it)"));
  info_verb->add_option("file", info.files, "files")->required();
  info_verb->add_option("--at", info.at, "X,Y of a terrain grid, in its map coordinates, or degrees as web maps give them, east first: where that is for a scene, how high and steep, and which way it falls")->expected(2)->delimiter(',');

  effuse::ImportCommand import;
  CLI::App* import_verb = add_common(app.add_subcommand("import", "terrain and meshes as other programs want them: reprojected, cropped, resampled, filled, repaired, simplified; grids as meshes to a stated error, meshes as grids"));
  add_import_options(import_verb, import);

  effuse::EffectsCommand effects;
  CLI::App* effects_verb = add_common(app.add_subcommand("effects", "the effects there are, and every key of a scene"));
  effects_verb->add_flag("--schema", effects.schema, "print a JSON schema of scene files (draft 2020-12), for editors");
  effects_verb->add_flag("--markdown", effects.markdown, "print the same as a page (samples/scene-reference.md)")->excludes("--schema");

  effuse::SkinCommand skin;
  CLI::App* skin_verb = add_common(app.add_subcommand("skin", "the surface of any program's particles as a mesh: PLY, VTK, VTP, VTU, BGEO, XYZ, CSV in, PLY, OBJ, GLB, VDB out"));
  add_skin_options(skin_verb, skin);

  effuse::ViewCommand view;
  CLI::App* view_verb = add_common(app.add_subcommand("view", "one HTML page to scrub through a run: opens from disk, needs nothing else"));
  view_verb->add_option("folder", view.folder, "of a run")->required();
  view_verb->add_option("-o,--output", view.output, "page to write; view.html in the folder when absent");
  view_verb->add_option("--triangles", view.triangles, "of the lava in a frame, at most; the ground may have twice as many; 0: as many as there are")->capture_default_str();
  view_verb->add_option("--frames", view.frames, "only these: 10-60");
  view_verb->add_option("--every", view.every, "only every so manieth of them")->check(CLI::Range(1, 9999));
  view_verb->add_option("--title", view.title, "of the page; the run's name when absent");

  effuse::ExportCommand exports;
  CLI::App* export_verb = add_common(app.add_subcommand("export", "the frames of a run in other formats: VTP, USDA, BGEO, a GLB of the whole film, GeoTIFF, PLY, OBJ, GLB"));
  export_verb->add_option("folder", exports.folder, "the run's folder")->required();
  export_verb->add_option("--to", exports.formats, "vtp (and .pvd, .vtp.series), usda (and film.usda), bgeo (particles), glb-flipbook (film.glb), geotiff (maps), ply, obj, glb; several with commas")
      ->required()
      ->delimiter(',')
      ->allow_extra_args(false);
  export_verb->add_option("-o,--output", exports.output, "folder to write; the run's own when absent");
  export_verb->add_option("--frames", exports.frames, "only these: 10-48");

  effuse::StudyCommand study;
  CLI::App* study_verb = add_common(app.add_subcommand("study", "compare effuse with exact, converged and measured references: tables, curves, plots, a page"));
  study_verb->add_option("name", study.names, "studies: validation, skin, integrators, lava, heat, terrain, solvers; all when absent");
  study_verb->add_option("-o,--output", study.folder, "folder to write; out/study when absent");
  study_verb->add_option("--case", study.cases, "run this case only; may be given several times")->allow_extra_args(false);
  study_verb->add_flag("--full", study.full, "the slow cases, too: minutes each");
  study_verb->add_flag("--resume", study.resume, "keep the results of this version that the folder holds (DIR/cases; remove a file there to run its case anew)");
  study_verb->add_flag("--strict", study.strict, "exit 1 when a figure misses its bar");
  study_verb->add_flag("--calibrate", study.calibrate, "measure this machine, half a minute, and keep its figures for the times that `effuse check` predicts (in $XDG_CACHE_HOME/effuse or ~/.cache/effuse)");
  study_verb->add_flag("--cheapest", study.cheapest, "print, from what the studies wrote to the folder, a table of the cheapest setting for an error, and run none");
  study_verb->add_flag("--list", study.list, "print the cases there are, and run none");

  std::string shell;
  CLI::App* completions_verb = app.add_subcommand("completions", "a completion script for a shell: effuse completions bash > ~/.local/share/bash-completion/completions/effuse");
  completions_verb->add_option("shell", shell, "bash, zsh or fish")->required()->check(CLI::IsMember({"bash", "zsh", "fish"}));
  CLI::App* manual_verb = app.add_subcommand("manual", "effuse(1) for man: effuse manual | man -l -");

  // What goes wrong before the arguments are parsed keeps the promise of --json, too.
  const bool asks_json = std::find(argv + 1, argv + argc, std::string_view("--json")) != argv + argc;

  // A typing error in the verb: name the nearest one instead of CLI11's list.
  if (argc > 1 && argv[1][0] != '-') {
    const std::vector<std::string> verbs = effuse::verb_names(app);
    if (std::find(verbs.begin(), verbs.end(), argv[1]) == verbs.end()) {
      const std::string nearest = effuse::nearest_name(argv[1], verbs);
      return report(ExitCode::kBadInput, fmt::format("no verb '{}'; {}", argv[1], nearest.empty() ? fmt::format("there are {}", fmt::join(verbs, ", ")) : "did you mean '" + nearest + "'?"), asks_json);
    }
  }
  try {
    app.parse(argc, argv);
  } catch (const CLI::ParseError& error) {
    if (error.get_exit_code() == 0) return app.exit(error);  // --help, --version
    return report(ExitCode::kBadInput, fmt::format("{} (see --help)", error.what()), asks_json);
  }

  if (common.quiet || common.json) effuse::set_log_level(effuse::LogLevel::kWarnings);
  std::optional<effuse::ThreadLimit> limit;
  if (common.threads > 0) limit.emplace(common.threads);
  try {
    if (*completions_verb || *manual_verb) {
      const std::string text = *manual_verb ? effuse::man_page(app, EFFUSE_VERSION) : effuse::completions(app, shell);
      std::fwrite(text.data(), 1, text.size(), stdout);
      return flushed(ExitCode::kDone);
    }
    if (*run_verb) return flushed(effuse::run(run, common));
    if (*render_verb) return flushed(effuse::render_run(render, common));
    if (*check_verb) return flushed(effuse::check(check, common));
    if (*info_verb) return flushed(effuse::info(info, common));
    if (*import_verb) return flushed(effuse::import_terrain_file(import, common));
    if (*effects_verb) return flushed(effuse::effects(effects, common));
    if (*skin_verb) return flushed(effuse::skin_particles(skin, common));
    if (*view_verb) return flushed(effuse::view(view, common));
    if (*export_verb) return flushed(effuse::export_run(exports, common));
    if (*study_verb) return flushed(effuse::run_studies(study, common));
  } catch (const effuse::InputError& error) {
    return report(ExitCode::kBadInput, error.faults(), common.json);
  } catch (const effuse::UnstableError& error) {
    return report(ExitCode::kUnstable, error.what(), common.json);
  } catch (const effuse::ResourceError& error) {
    return report(ExitCode::kOutOfResources, error.what(), common.json);
  } catch (const std::bad_alloc&) {
    return report(ExitCode::kOutOfResources, "out of memory", common.json);
  } catch (const std::system_error& error) {
    return report(out_of_resources(error) ? ExitCode::kOutOfResources : ExitCode::kFailed, error.what(), common.json);
  } catch (const std::exception& error) {
    return report(ExitCode::kFailed, error.what(), common.json);
  }
  return static_cast<int>(ExitCode::kFailed);
}
