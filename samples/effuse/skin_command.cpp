#include <fmt/format.h>
#include <sys/resource.h>

#include <algorithm>
#include <array>
#include <chrono>
#include <cmath>
#include <map>
#include <nlohmann/json.hpp>
#include <optional>

#include "geometry/base/log.h"
#include "geometry/base/units.h"
#include "geometry/base/zones.h"
#include "geometry/mesh/measure.h"
#include "geometry/mesh/self_intersections.h"
#include "geometry/mesh/validate.h"
#include "importers/input_file.h"
#include "importers/points/import_points.h"
#include "importers/points/spacing.h"
#include "importers/terrain/import_dem.h"
#include "importers/terrain/import_terrain.h"
#include "samples/effuse/commands.h"
#include "samples/effuse/load_scene.h"
#include "samples/effuse/first_positions.h"
#include "skin/color/lava_color.h"
#include "skin/surface/level_set.h"
#include "skin/tessellate/make_skin.h"
#include "skin/write/write_mesh.h"

namespace effuse {

namespace fs = std::filesystem;
using importers::PointCloud;
using importers::quote;
using nlohmann::ordered_json;

namespace {

// Names of frames.

/// A file name with a place for the frame's number: #### (as many digits), $F4 or $F, %04d or %d, {}.
struct FramePattern {
  fs::path folder;
  std::string before, after;
  std::size_t digits = 0;  // at least so many, zeros in front; 0: as it comes

  fs::path file(long long frame) const { return folder / fmt::format("{}{:0{}}{}", before, frame, std::max<std::size_t>(digits, 1), after); }
};

std::optional<FramePattern> frame_pattern(const fs::path& path) {
  const std::string name = path.filename().string();
  const auto make = [&](std::size_t begin, std::size_t end, std::size_t digits) {
    return FramePattern{path.parent_path(), name.substr(0, begin), name.substr(end), digits};
  };
  const auto digit = [&](std::size_t i) { return i < name.size() && name[i] >= '0' && name[i] <= '9'; };
  for (std::size_t i = 0; i < name.size(); ++i) {
    std::size_t end = i;
    if (name[i] == '#') {
      while (end < name.size() && name[end] == '#') ++end;
      return make(i, end, end - i);
    }
    if (name.compare(i, 2, "{}") == 0) return make(i, i + 2, 0);
    if (name.compare(i, 2, "$F") == 0) return digit(i + 2) ? make(i, i + 3, static_cast<std::size_t>(name[i + 2] - '0')) : make(i, i + 2, 0);
    if (name.compare(i, 2, "%d") == 0) return make(i, i + 2, 0);
    if (name.compare(i, 2, "%0") == 0 && digit(i + 2) && name.compare(i + 3, 1, "d") == 0) return make(i, i + 4, static_cast<std::size_t>(name[i + 2] - '0'));
  }
  return std::nullopt;
}

/// A number that a file name can hold.
std::optional<long long> frame_number(std::string_view digits) {
  if (digits.empty() || digits.size() > 15) return std::nullopt;
  long long number = 0;
  for (const char c : digits) {
    if (c < '0' || c > '9') return std::nullopt;
    number = 10 * number + (c - '0');
  }
  return number;
}

/// What is skinned: numbered files, or one without a number.
struct Inputs {
  std::map<long long, fs::path> frames;
  std::optional<fs::path> single;
  std::vector<long long> missing;  // between the first and the last, at most 1000 of them
  std::size_t missing_count = 0;
};

void add_frame(Inputs& inputs, long long number, const fs::path& file) {
  const auto [at, added] = inputs.frames.emplace(number, file);
  if (!added) throw InputError(Place{file.string()}, fmt::format("is frame {}, and so is {}", number, at->second.string()));
}

/// The files that a pattern names, as they lie in its folder.
void add_matching(Inputs& inputs, const fs::path& given, const FramePattern& pattern) {
  const fs::path folder = pattern.folder.empty() ? fs::path(".") : pattern.folder;
  std::error_code error;
  fs::directory_iterator entries(folder, error);
  if (error) throw InputError(Place{given.string()}, fmt::format("cannot look into its folder: {}", error.message()));
  std::size_t found = 0;
  for (const fs::directory_entry& entry : entries) {
    const std::string name = entry.path().filename().string();
    if (name.size() <= pattern.before.size() + pattern.after.size() || !name.starts_with(pattern.before) || !name.ends_with(pattern.after)) continue;
    const std::string_view digits = std::string_view(name).substr(pattern.before.size(), name.size() - pattern.before.size() - pattern.after.size());
    if (digits.size() < pattern.digits) continue;
    if (const auto number = frame_number(digits)) {
      add_frame(inputs, *number, pattern.folder / name);
      ++found;
    }
  }
  if (found == 0) throw InputError(Place{given.string()}, "no file has a name like this");
}

/// The last digits in a file's name: what numbers it in a list of files.
std::optional<long long> own_number(const fs::path& file) {
  const std::string name = file.filename().string();
  std::size_t end = name.size();
  // not of the ending: .bgeo5 is none
  if (const std::size_t dot = name.rfind('.'); dot != std::string::npos && dot > 0) end = dot;
  while (end > 0 && !(name[end - 1] >= '0' && name[end - 1] <= '9')) --end;
  std::size_t begin = end;
  while (begin > 0 && name[begin - 1] >= '0' && name[begin - 1] <= '9') --begin;
  return frame_number(std::string_view(name).substr(begin, end - begin));
}

Inputs find_inputs(const SkinCommand& command) {
  Inputs inputs;
  for (const fs::path& given : command.particles) {
    std::error_code ignored;
    const std::optional<FramePattern> pattern = fs::exists(given, ignored) ? std::nullopt : frame_pattern(given);
    if (pattern) {
      add_matching(inputs, given, *pattern);
    } else if (command.particles.size() == 1) {
      inputs.single = given;
    } else {
      const std::optional<long long> number = own_number(given);
      if (!number) throw InputError(Place{given.string()}, "has no number in its name, which several files need");
      add_frame(inputs, *number, given);
    }
  }
  std::erase_if(inputs.frames, [&](const auto& frame) {
    return (command.start_index && frame.first < *command.start_index) || (command.end_index && frame.first > *command.end_index);
  });
  if (!inputs.single && inputs.frames.empty()) throw InputError(Place{}, "--start-index and --end-index leave no frame");
  for (auto at = inputs.frames.begin(); at != inputs.frames.end() && std::next(at) != inputs.frames.end(); ++at) {
    const long long next = std::next(at)->first;
    inputs.missing_count += static_cast<std::size_t>(next - at->first - 1);
    for (long long n = at->first + 1; n < next && inputs.missing.size() < 1000; ++n) inputs.missing.push_back(n);
  }
  return inputs;
}

/// "3, 5-7, 12"
std::string ranges(const std::vector<long long>& numbers) {
  std::string text;
  for (std::size_t i = 0; i < numbers.size();) {
    std::size_t last = i;
    while (last + 1 < numbers.size() && numbers[last + 1] == numbers[last] + 1) ++last;
    text += fmt::format("{}{}", text.empty() ? "" : ", ", numbers[i]);
    if (last > i) text += fmt::format("-{}", numbers[last]);
    i = last + 1;
  }
  return text;
}

// Where it goes.

enum class Format { kPly, kObj, kGlb, kVdb };

Format format_of(const fs::path& file) {
  const std::string ending = importers::lower_extension(file);
  if (ending == ".ply") return Format::kPly;
  if (ending == ".obj") return Format::kObj;
  if (ending == ".glb") return Format::kGlb;
  if (ending == ".vdb") return Format::kVdb;
  throw InputError(Place{file.string()}, fmt::format("skins are written as .ply, .obj, .glb and .vdb, not as {}", ending.empty() ? "a file without an ending" : quote(ending)));
}

/// The files of one frame; checks them against one another and against the particles before anything is made.
std::vector<fs::path> outputs_of(const SkinCommand& command, std::optional<long long> frame, const fs::path& input) {
  std::vector<fs::path> files;
  for (const fs::path& given : command.meshes) {
    format_of(given);
    const fs::path whole = command.folder.empty() ? given : command.folder / given;
    const std::optional<FramePattern> pattern = frame_pattern(whole);
    if (frame && !pattern) throw InputError(Place{given.string()}, "several frames need a place for their number in this name, as in mesh.####.ply");
    // One file alone keeps its name, whatever is in it.
    files.push_back(frame ? pattern->file(*frame) : whole);
    std::error_code ignored;
    if (fs::equivalent(files.back(), input, ignored)) throw InputError(Place{given.string()}, "would overwrite the particles");
  }
  return files;
}

// From a threshold of SPH's density to a radius of our level set.

/// Share of a cubic-spline kernel of unit support (its mass) beyond a plane at distance s >= 0 from its middle.
Real kernel_beyond(Real s) {
  if (s >= 1) return 0;
  // Shells of radius r have the area 2 pi r (r - s) beyond; W with q = 2 r, 8 / pi in front for unit support.
  const auto shell = [s](Real r) {
    const Real q = 2 * r;
    const Real w = q < 1 ? 1 - 1.5 * q * q + 0.75 * q * q * q : 0.25 * (2 - q) * (2 - q) * (2 - q);
    return 16 * r * (r - s) * w;
  };
  constexpr int kPanels = 200;
  const Real step = (1 - s) / kPanels;
  Real sum = shell(s) + shell(1);
  for (int k = 1; k < kPanels; ++k) sum += (k % 2 == 1 ? 4 : 2) * shell(s + k * step);
  return sum * step / 3;
}

/// How far outside a flat surface the density of what lies below it has fallen to that share of its inner value [supports].
Real threshold_distance(Real share) {
  if (share > 0.5) return -threshold_distance(1 - share);
  Real low = 0, high = 1;
  for (int k = 0; k < 60; ++k) {
    const Real middle = (low + high) / 2;
    (kernel_beyond(middle) > share ? low : high) = middle;
  }
  return low;
}

/// The mean of |x - xbar| (build_level_set) at a height over a flat surface, which lies half a spacing over the top layer of a
/// cubic lattice: the radius that puts the level set there [spacings].
Real flat_radius(Real influence, Real height) {
  constexpr int kSide = 4;
  const int reach = static_cast<int>(influence) + 1;
  Real sum = 0;
  for (int a = 0; a < kSide; ++a)
    for (int b = 0; b < kSide; ++b) {
      const Vec3 x((a + 0.5) / kSide, (b + 0.5) / kSide, 0.5 + height);
      Vec3 mean = Vec3::Zero();
      Real weight = 0;
      for (int i = -reach; i <= reach + 1; ++i)
        for (int j = -reach; j <= reach + 1; ++j)
          for (int k = -2 * reach; k <= 0; ++k) {
            const Vec3 p(i, j, k);
            const Real s = 1 - (p - x).squaredNorm() / (influence * influence);
            if (s <= 0) continue;
            mean += s * s * s * (p - x);
            weight += s * s * s;
          }
      sum += mean.norm() / weight;
    }
  return sum / (kSide * kSide);
}

skin::LevelSetOptions level_set_options(const SkinCommand& command, Real radius, bool match_volume) {
  skin::LevelSetOptions options;
  options.spacing = 2 * radius;
  options.voxel = command.cube_size * radius;
  options.influence = command.smoothing_length;
  if (command.kernel == "anisotropic") options.kernel = skin::SurfaceKernel::kAnisotropic;
  options.smoothing = command.mesh_smoothing_iters.value_or(options.kernel == skin::SurfaceKernel::kAnisotropic ? 0 : options.smoothing);
  options.drop_volume = command.drop_volume;
  options.match_volume = match_volume;
  if (match_volume) {
    options.radius = std::min(options.radius, options.influence - 1.05);
    options.cover = std::min(options.cover, options.radius);
    return options;
  }
  if (options.kernel == skin::SurfaceKernel::kAnisotropic) {
    if (command.surface_threshold) throw InputError(Place{}, "--surface-threshold goes with --kernel round: anisotropic kernels have no density to cut at");
    return options;
  }
  const Real threshold = command.surface_threshold.value_or(0.5);
  options.radius = flat_radius(options.influence, threshold_distance(threshold) * options.influence);
  options.cover = command.surface_threshold ? 0 : std::min(options.cover, options.radius);  // a threshold says where the surface is
  const Real most = std::min(1.0, options.influence - 1.05);
  if (options.radius < 0.2 || options.radius > most)
    throw InputError(Place{}, fmt::format("--surface-threshold {} with --smoothing-length {} would round a lone particle with {:.2f} of its spacing, wanted 0.2 to {:.2f}", threshold,
                                          command.smoothing_length, options.radius, most));
  return options;
}

// The detail.

/// What --kind and its companions ask for; nothing of --kind none. Lengths in spacings, so that nothing is left to fill in but them.
std::optional<skin::DisplaceOptions> detail_options(const SkinCommand& command) {
  const auto kind = std::find(skin::kSkinKindNames.begin(), skin::kSkinKindNames.end(), command.kind);
  if (kind == skin::kSkinKindNames.end()) {
    if (command.amplitude || command.edge || command.oversample || command.seed || !command.temperature.empty())
      throw InputError(Place{}, "--amplitude, --edge, --oversample, --seed and --temperature go with --kind: the smooth skin has no detail and no colour");
    return std::nullopt;
  }
  if (std::all_of(command.meshes.begin(), command.meshes.end(), [](const fs::path& file) { return format_of(file) == Format::kVdb; }))
    throw InputError(Place{}, fmt::format("--kind {} goes with a mesh: .vdb holds the smooth surface", command.kind));
  skin::DisplaceOptions detail;
  detail.kind = static_cast<skin::SkinKind>(kind - skin::kSkinKindNames.begin());
  detail.amplitude = command.amplitude.value_or(detail.amplitude);
  detail.edge = command.edge.value_or(command.cube_size / 2);
  detail.oversample = command.oversample.value_or(detail.oversample);
  detail.seed = command.seed.value_or(detail.seed);
  return detail;
}

/// --temperature [K].
std::optional<Real> told_temperature(const SkinCommand& command) {
  if (command.temperature.empty()) return std::nullopt;
  Real kelvin = 0;
  try {
    kelvin = parse_quantity(command.temperature, "K");
  } catch (const std::invalid_argument& error) {
    throw InputError(Place{}, fmt::format("--temperature: {}", error.what()));
  }
  if (!(kelvin > 0 && kelvin <= 5000)) throw InputError(Place{}, fmt::format("--temperature {} is {:.6g} K, wanted more than 0 and at most 5000 K", command.temperature, kelvin));
  return kelvin;
}

/// Temperatures as no file should have them; with --kind, which makes colour and glow of them, also those that no lava has.
void refuse_temperatures(const fs::path& file, const PointCloud& cloud, bool used) {
  constexpr Real kHottest = 5000;  // [K] as --temperature has it
  for (std::size_t i = 0; i < cloud.temperature.size(); ++i) {
    const Real T = cloud.temperature[i];
    if (std::isfinite(T) && (!used || (T >= 0 && T <= kHottest))) continue;
    throw InputError(Place{file.string()}, fmt::format("particle {} has a temperature of {:.6g}, wanted {}{}", i, T, used ? "kelvin from 0 to 5000" : "a finite number", used && T < 0 && T > -274 ? ": is it in degrees Celsius?" : ""));
  }
}

// The ground.

/// As imported, but counted from `wanted`, in the file's coordinates, instead of its own origin.
geometry::Terrain counted_from(const geometry::Terrain& terrain, const Vec3& wanted) {
  const Vec3 origin = terrain.georeference().origin - wanted;
  if (const geometry::HeightField* field = terrain.height_field()) {
    std::vector<Real> posts = field->posts();
    for (Real& z : posts) z += origin.z();
    return geometry::Terrain::from_height_field(geometry::HeightField(field->corner() + origin.head<2>(), field->spacing(), field->nx(), field->ny(), std::move(posts)));
  }
  geometry::TriMesh mesh = terrain.mesh();
  for (Vec3& x : mesh.positions) x += origin;
  return geometry::Terrain::from_mesh(std::move(mesh));
}

// One frame.

void crop(PointCloud& cloud, const Box3& box) {
  std::vector<std::size_t> kept;
  for (std::size_t i = 0; i < cloud.size(); ++i)
    if (box.contains(cloud.position[i])) kept.push_back(i);
  const auto take = [&](auto& array) {
    if (array.empty()) return;
    for (std::size_t k = 0; k < kept.size(); ++k) array[k] = array[kept[k]];
    array.resize(kept.size());
  };
  take(cloud.position);
  take(cloud.radius);
  take(cloud.velocity);
  take(cloud.temperature);
  take(cloud.crust);
  take(cloud.age);
  take(cloud.id);
  take(cloud.rest);
  take(cloud.rest2);
}

Real median(std::vector<Real> values) {
  const auto middle = values.begin() + static_cast<std::ptrdiff_t>(values.size() / 2);
  std::nth_element(values.begin(), middle, values.end());
  return *middle;
}

/// The radius that counts, and where it is from. Kept for a whole sequence, so that its frames go together.
struct Radius {
  Real value = 0;
  std::string source;
};

/// y up, as the particles are, to z up, as write_glb expects.
geometry::TriMesh turned_to_z_up(geometry::TriMesh mesh) {
  const auto turn = [](auto& y, auto& z) {
    const auto old_y = y;
    y = -z;
    z = old_y;
  };
  for (Vec3& x : mesh.positions) turn(x.y(), x.z());
  for (Vec3& n : mesh.normals) turn(n.y(), n.z());
  for (auto& [name, attribute] : mesh.attributes)
    if (attribute.width == 3 && name != "color" && name != "glow")
      for (std::size_t i = 0; i + 2 < attribute.values.size(); i += 3) turn(attribute.values[i + 1], attribute.values[i + 2]);
  return mesh;
}

/// What --check found.
struct Check {
  geometry::MeshReport report;
  std::size_t self_intersections = 0;
  Real volume = 0;
  bool passed = false;
};

/// as_float: positions as formats of single precision hold them, which far from the origin is not what was made.
Check check_mesh(geometry::TriMesh mesh, bool as_float, bool no_particles) {
  ZONE("skin.check");
  if (as_float)
    for (Vec3& x : mesh.positions) x = x.cast<float>().cast<Real>();
  Check check;
  check.report = geometry::validate(mesh);
  check.self_intersections = geometry::self_intersections(mesh).size();
  check.volume = geometry::signed_volume(mesh);
  const bool nothing = no_particles && mesh.triangles.empty();  // a frame before the first drop is as it should be
  check.passed = nothing || (check.report.solid() && check.self_intersections == 0 && check.volume > 0);
  return check;
}

ordered_json to_json(const Check& check) {
  const geometry::MeshReport& r = check.report;
  return {{"passed", check.passed},
          {"closed", r.closed()},
          {"manifold", r.manifold()},
          {"oriented", r.oriented()},
          {"self_intersections", check.self_intersections},
          {"components", r.components},
          {"euler", r.euler},
          {"volume", check.volume},
          {"boundary_edges", r.boundary_edges},
          {"non_manifold_edges", r.non_manifold_edges},
          {"non_manifold_vertices", r.non_manifold_vertices},
          {"misoriented_edges", r.misoriented_edges},
          {"degenerate_triangles", r.repeated_indices + r.zero_area}};
}

/// One line without the vertices and triangles, which stand elsewhere.
std::string to_text(const Check& check) {
  return fmt::format("check {}: {}, {}, encloses {:.6g}", check.passed ? "passed" : "FAILED", to_string(check.report),
                     check.self_intersections == 0 ? "no self-intersections" : fmt::format("{} pairs of triangles intersect", check.self_intersections), check.volume);
}

/// Ground in the file's own coordinates, which are to be the particles': the terrain.ply of a run lies where its particles are, not on
/// the map.
importers::TerrainImport import_ground(const fs::path& file, const CommonOptions& common) {
  importers::TerrainImportOptions options;
  options.mesh.limits = options.dem.limits = read_limits(common);
  if (importers::is_dem(file)) return importers::import_terrain(file, options);
  importers::MeshImport mesh = importers::import_mesh(file, options.mesh);
  mesh.frame.origin = Vec3::Zero();
  return importers::terrain_from_mesh(std::move(mesh), file.string(), options);
}

class Skinner {
 public:
  Skinner(const SkinCommand& command, const CommonOptions& common) : command_(command), common_(common) {
    if (command.particle_aabb_min.size() == 3) box_ = Box3(Vec3(command.particle_aabb_min.data()), Vec3(command.particle_aabb_max.data()));
    if (box_ && box_->isEmpty()) throw InputError(Place{}, "--particle-aabb-min is not below --particle-aabb-max");
    if (command.origin.size() == 3) origin_ = Vec3(command.origin.data());
    if (!origin_.allFinite()) throw InputError(Place{}, "--origin is not finite");
    detail_ = detail_options(command);
    temperature_ = told_temperature(command);
    if (command.particle_radius > 0) radius_ = Radius{command.particle_radius, "--particle-radius"};
    if (!command.terrain.empty()) {
      const importers::TerrainImport import = import_ground(command.terrain, common);
      for (const std::string& note : import.notes) tell_once(command.terrain, note);
      terrain_ = counted_from(import.terrain, origin_);
    }
  }

  /// False: its check failed.
  bool frame(std::optional<long long> number, const fs::path& file) {
    const auto start = std::chrono::steady_clock::now();
    const std::vector<fs::path> outputs = outputs_of(command_, number, file);
    PointCloud cloud = importers::import_points(file, {.radius = command_.particle_radius == 0});
    for (const std::string& note : cloud.notes) tell_once(file, note);
    refuse_temperatures(file, cloud, detail_.has_value());
    const std::size_t read = cloud.size();
    const std::string anchor = detail_ ? anchor_detail(file, number.has_value(), cloud) : "";
    if (box_) crop(cloud, *box_);
    if (read == 0) warn_once(file, "holds no particle: its mesh is empty");
    else if (cloud.size() == 0) warn_once(file, "has no particle in the box of --particle-aabb-min and -max: its mesh is empty");
    for (auto* at : {&cloud.position, &cloud.rest, &cloud.rest2})
      for (Vec3& x : *at) x -= origin_;
    if (detail_) choose_temperature(file, cloud);
    choose_radius(file, cloud);
    refuse_coarse_floats(file, cloud, outputs);

    ordered_json j;
    if (number) j["frame"] = *number;
    j["input"] = file.string();
    j["particles"] = cloud.size();
    if (box_) j["outside_box"] = read - cloud.size();
    for (const std::string& note : cloud.notes) j["notes"].push_back(note);

    const Real radius = cloud.size() > 0 ? radius_->value : 1;
    const bool match = command_.match_volume.value_or(!command_.surface_threshold && !estimated_);
    Real volume = 0;
    for (const Real r : cloud.radius) volume += 8 * r * r * r;
    if (terrain_ && cloud.size() > 0) look_for_ground(file, cloud);
    skin::SkinOptions options;
    options.level_set = level_set_options(command_, radius, match);
    options.tessellation = command_.tessellation == "voronoi" ? skin::TessellationKind::kVoronoi : skin::TessellationKind::kLevelSet;
    options.coarsen = command_.coarsen;
    options.mesh = command_.check || std::any_of(outputs.begin(), outputs.end(), [](const fs::path& f) { return format_of(f) != Format::kVdb; });
    options.detail = detail_;
    const bool meshed = options.mesh;
    skin::Skin skin;
    try {
      skin = skin::make_skin(cloud.points(), volume, terrain_ ? &*terrain_ : nullptr, options, &last_);
    } catch (const InputError& error) {
      throw named(error, file);
    }
    const skin::LevelSet& surface = skin.surface;
    geometry::TriMesh& mesh = skin.mesh;
    if (!command_.sph_normals) geometry::compute_normals(mesh);
    if (detail_) {
      skin::color_lava(mesh);
      if (cloud.temperature.empty()) mesh.attributes.erase("glow");  // nobody said how hot it is
    }
    if (cloud.size() > 0) {
      j["radius"] = radius;
      j["radius_from"] = radius_->source;
      j["volume"] = skin.report.volume.after > 0 ? skin.report.volume.after : surface.report().volume;
      j["particle_volume"] = volume;
      if (match && std::abs(surface.report().residual) > 0.01)
        tell_once(file, fmt::format("the skin encloses {:.3g} times the particles' volume: they overlap, or the radius is not half their spacing", 1 + surface.report().residual));
    }
    if (meshed) {
      j["vertices"] = mesh.positions.size();
      j["triangles"] = mesh.triangles.size();
      j["regions"] = skin.regions.size();
      j["thin_triangles_share"] = skin.report.shapes.thin;
      j["folded_triangles"] = skin.report.shapes.folded;
      if (skin.report.coarsened > 0) j["coarsen_error"] = skin.report.coarsen_error;
    }
    if (detail_) {
      j["kind"] = command_.kind;
      j["detail_on"] = anchor;
      j["largest_displacement"] = skin.report.displace.largest;
      j["held_back_vertices"] = skin.report.displace.held_back;
      if (!skin.report.refined_enough) tell_once(file, "edges stay longer than --edge asks for: the mesh would have more than 20 million triangles");
    }
    const skin::LevelSetReport& report = surface.report();
    if (cloud.size() > 0 && meshed && mesh.triangles.empty()) warn_once(file, report.dropped_pieces > 0 ? "every piece is smaller than --drop-volume: its mesh is empty" : "its mesh is empty: the ground covers all particles, or voxels are too coarse for them");
    if (report.dropped_pieces + report.filled_bubbles > 0) {
      j["dropped_pieces"] = report.dropped_pieces;
      j["filled_bubbles"] = report.filled_bubbles;
    }
    std::optional<Check> check;
    if (command_.check) {
      const bool as_float = std::any_of(outputs.begin(), outputs.end(), [](const fs::path& f) { return format_of(f) != Format::kObj; });
      check = check_mesh(mesh, as_float, cloud.size() == 0);
      j["check"] = to_json(*check);
    }

    const skin::Metadata about = {{"generator", fmt::format("effuse {}", EFFUSE_VERSION)}, {"particles", file.filename().string()}, {"origin", fmt::format("{:.17g} {:.17g} {:.17g}", origin_.x(), origin_.y(), origin_.z())}};
    for (const fs::path& output : outputs) write(output, skin, about);
    for (const fs::path& output : outputs) j["outputs"].push_back(output.string());
    const double seconds = std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
    j["seconds"] = seconds;
    log_info(fmt::format("{}: {} particles{} -> {}, {:.2f} s", file.string(), cloud.size(), dropped(report), meshed ? fmt::format("{} triangles", mesh.triangles.size()) : "level set", seconds));
    if (check && !common_.json) fmt::print("{}: {}\n", outputs.front().string(), to_text(*check));
    frames_.push_back(std::move(j));
    return !check || check->passed;
  }

  ordered_json& frames() { return frames_; }

 private:
  /// An error of a package below, which knows no file.
  static InputError named(const InputError& error, const fs::path& file) {
    std::vector<Fault> faults = error.faults();
    for (Fault& fault : faults)
      if (fault.place.file.empty()) fault.place.file = file.string();
    return InputError(std::move(faults));
  }

  static std::string dropped(const skin::LevelSetReport& report) {
    if (report.dropped_pieces + report.filled_bubbles == 0) return "";
    return fmt::format(" ({} small pieces dropped, {} bubbles filled)", report.dropped_pieces, report.filled_bubbles);
  }

  /// What a sequence says of every frame is told once.
  void tell_once(const fs::path& file, const std::string& note) {
    if (std::find(told_.begin(), told_.end(), note) != told_.end()) return;
    told_.push_back(note);
    log_info(fmt::format("{}: {}", file.string(), note));
  }

  void warn_once(const fs::path& file, const std::string& note) {
    if (std::find(told_.begin(), told_.end(), note) != told_.end()) return;
    told_.push_back(note);
    log_warning(fmt::format("{}: {}", file.string(), note));
  }

  /// What the detail hangs on: "rest" of the file, the first position of each "id", or the "world", which is told.
  std::string anchor_detail(const fs::path& file, bool sequence, PointCloud& cloud) {
    if (cloud.size() == 0 || !cloud.rest.empty()) return "rest";
    if (sequence && first_.carry(cloud)) return "id";
    warn_once(file, sequence            ? fmt::format("no rest and no ids that tell particles apart: --kind {} hangs its detail in space, and it will swim as they move", command_.kind)
                    : cloud.id.empty()  ? fmt::format("no rest: --kind {} hangs its detail in space; over several frames it would swim", command_.kind)
                                        : fmt::format("no rest: --kind {} hangs its detail in space; skinned in one call, the frames of a sequence would move it with their ids", command_.kind));
    return "world";
  }

  /// Fills cloud.temperature by --temperature where the file has none.
  void choose_temperature(const fs::path& file, PointCloud& cloud) {
    if (cloud.size() == 0) return;
    if (temperature_ && !cloud.temperature.empty()) tell_once(file, "has temperatures of its own: --temperature is not used");
    if (temperature_ && cloud.temperature.empty()) cloud.temperature.assign(cloud.size(), *temperature_);
    if (cloud.temperature.empty()) return;
    const Real hottest = *std::max_element(cloud.temperature.begin(), cloud.temperature.end());
    const Real draper = skin::LavaColorOptions().glow_from;
    if (hottest <= draper) tell_once(file, fmt::format("the hottest particle has {:.4g} K: nothing glows below {:.0f} K", hottest, draper));
  }

  /// Fills cloud.radius and, with the first particles of all, radius_.
  void choose_radius(const fs::path& file, PointCloud& cloud) {
    if (cloud.size() == 0) return;
    const bool own = command_.particle_radius == 0 && !cloud.radius.empty();
    if (!radius_ && own) {
      radius_ = Radius{median(cloud.radius), "file"};
      const auto [least, most] = std::minmax_element(cloud.radius.begin(), cloud.radius.end());
      if (*most > 1.01 * *least)
        tell_once(file, fmt::format("radii are from {:.6g} to {:.6g}: smoothing length and cube size are of the median, {:.6g}", *least, *most, radius_->value));
    }
    if (!radius_) {
      const Real spacing = importers::estimate_spacing(cloud.position);
      if (!(spacing > 0)) throw InputError(Place{file.string()}, "has no radii, and not two places to estimate one from: give --particle-radius");
      estimated_ = true;
      radius_ = Radius{spacing / 2, "estimated"};
      log_info(fmt::format("{}: no radii; estimated as half the distance of neighbours: --particle-radius {:.6g}", file.string(), radius_->value));
    }
    if (!(radius_->value >= kLeastRadius && radius_->value <= kLargestRadius))
      throw InputError(Place{file.string()}, fmt::format("a particle radius of {:.6g} ({}): wanted {:g} to {:g}, in the unit of the positions", radius_->value, radius_->source, kLeastRadius, kLargestRadius));
    if (!own) cloud.radius.assign(cloud.size(), radius_->value);
  }
  static constexpr Real kLeastRadius = 1e-6, kLargestRadius = 1e6;  // volumes and voxels stay numbers that floats hold

  /// Far from the origin floats are so coarse that a mesh tears.
  void refuse_coarse_floats(const fs::path& file, const PointCloud& cloud, const std::vector<fs::path>& outputs) const {
    if (cloud.size() == 0 || std::all_of(outputs.begin(), outputs.end(), [](const fs::path& f) { return format_of(f) == Format::kObj; })) return;
    Box3 box;
    for (const Vec3& x : cloud.position) box.extend(x);
    const Real farthest = std::max(box.min().cwiseAbs().maxCoeff(), box.max().cwiseAbs().maxCoeff()), step = farthest * 0x1p-23;
    constexpr Real kFinest = 64;  // parts of a radius
    if (step * kFinest <= radius_->value) return;
    const Real across = box.sizes().maxCoeff();
    const std::string found = fmt::format("positions up to {:.4g}: the floats of PLY, GLB and VDB count in steps of {:.2g} there, wanted {:.2g}, a sixty-fourth of a particle's radius. ", farthest, step, radius_->value / kFinest);
    if (across / 2 * 0x1p-23 * kFinest > radius_->value)
      throw InputError(Place{file.string()}, found + fmt::format("They lie {:.4g} apart, so that no --origin helps: .obj holds more digits, --particle-aabb-min and -max cut strays away, or is the radius, {:.4g}, too small?", across, radius_->value));
    const Vec3 middle = (origin_ + box.center()).array().round();
    throw InputError(Place{file.string()}, found + fmt::format("--origin {:.12g} {:.12g} {:.12g} has the outputs count from there", middle.x(), middle.y(), middle.z()));
  }

  /// The level set ends at the ground, which has to be where the particles are.
  void look_for_ground(const fs::path& file, const PointCloud& cloud) {
    for (const Vec3& x : cloud.position)
      if (terrain_->height(x.x(), x.y())) return;
    tell_once(file, fmt::format("no particle lies over {}: it changes nothing", command_.terrain.string()));
  }

  void write(const fs::path& file, const skin::Skin& made, const skin::Metadata& about) const {
    const geometry::TriMesh& mesh = made.mesh;
    switch (format_of(file)) {
      case Format::kPly:
        return skin::write_skin_ply(file, mesh, made.regions, about);
      case Format::kObj:
        return skin::write_obj(file, mesh, about);
      case Format::kGlb:
        return command_.up == "y" ? skin::write_glb(file, turned_to_z_up(mesh), about) : skin::write_glb(file, mesh, about);
      case Format::kVdb:
        return skin::write_vdb(file, made.surface, about);
    }
  }

  const SkinCommand& command_;
  const CommonOptions& common_;
  std::optional<Box3> box_;
  Vec3 origin_ = Vec3::Zero();
  std::optional<Radius> radius_;
  std::optional<geometry::Terrain> terrain_;
  std::optional<skin::DisplaceOptions> detail_;  // nothing: smooth, without colour
  std::optional<Real> temperature_;              // [K] of files that have none
  FirstPositions first_;
  skin::SurfaceCache last_;  // of the frame before
  bool estimated_ = false;
  std::vector<std::string> told_;
  ordered_json frames_ = ordered_json::array();
};

}  // namespace

ExitCode skin_particles(const SkinCommand& command, const CommonOptions& common) {
  if (command.particle_aabb_min.size() != command.particle_aabb_max.size()) throw InputError(Place{}, "--particle-aabb-min and --particle-aabb-max go together");
  if (command.surface_threshold && command.match_volume.value_or(false))
    throw InputError(Place{}, "--surface-threshold and --match-volume on: the surface lies where the one or the other puts it");
  if (!command.match_volume.value_or(true) || command.surface_threshold) level_set_options(command, 1, false);  // refused now, if at all
  if (command.coarsen > 0 && command.tessellation == "voronoi") throw InputError(Place{}, "--coarsen goes with --tessellation levelset: voronoi's triangles belong to their particles");
  if (!command.terrain.empty() && command.up == "y") throw InputError(Place{}, "--terrain is z up, and so must the particles be: not --up y");
  const bool volumes_only = std::all_of(command.meshes.begin(), command.meshes.end(), [](const fs::path& file) { return format_of(file) == Format::kVdb; });
  if (volumes_only && !command.check && (command.tessellation == "voronoi" || command.coarsen > 0))
    throw InputError(Place{}, fmt::format("{} goes with a mesh: .vdb holds the surface itself", command.coarsen > 0 ? "--coarsen" : "--tessellation voronoi"));
  if (command.start_index && command.end_index && *command.start_index > *command.end_index)
    throw InputError(Place{}, fmt::format("--start-index {} is beyond --end-index {}", *command.start_index, *command.end_index));
  const Inputs inputs = find_inputs(command);
  if (inputs.single && (command.start_index || command.end_index))
    throw InputError(Place{inputs.single->string()}, "is one file: --start-index and --end-index go with a sequence, particles.####.ply");
  // Names are refused before the first frame is made.
  if (inputs.single) outputs_of(command, std::nullopt, *inputs.single);
  for (const auto& [number, file] : inputs.frames) outputs_of(command, number, file);
  if (inputs.missing_count > 0)
    log_warning(fmt::format("{} frames are missing: {}{}", inputs.missing_count, ranges(inputs.missing), inputs.missing_count > inputs.missing.size() ? ", ..." : ""));

  Skinner skinner(command, common);
  bool passed = true;
  if (inputs.single) passed = skinner.frame(std::nullopt, *inputs.single);
  for (const auto& [number, file] : inputs.frames) passed = skinner.frame(number, file) && passed;
  if (common.json) {
    ordered_json j;
    j["ok"] = passed;
    j["frames"] = std::move(skinner.frames());
    if (!inputs.single) j["missing"] = inputs.missing;
    rusage usage{};
    ::getrusage(RUSAGE_SELF, &usage);
    j["peak_memory_bytes"] = static_cast<std::int64_t>(usage.ru_maxrss) * 1024;
    print_document(j.dump(1, ' ', false, ordered_json::error_handler_t::replace));
  }
  return passed ? ExitCode::kDone : ExitCode::kFailed;
}

}  // namespace effuse
