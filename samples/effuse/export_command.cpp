#include <fmt/format.h>

#include <algorithm>
#include <charconv>
#include <map>
#include <nlohmann/json.hpp>
#include <optional>
#include <set>
#include <tuple>

#include "geometry/base/error.h"
#include "geometry/base/files.h"
#include "geometry/base/log.h"
#include "importers/points/import_points.h"
#include "importers/terrain/esri_ascii.h"
#include "samples/effuse/commands.h"
#include "samples/effuse/film_export.h"
#include "samples/effuse/flipbook_export.h"
#include "samples/effuse/output_folder.h"
#include "samples/effuse/progress.h"
#include "samples/effuse/film_folder.h"
#include "samples/effuse/stop_signals.h"
#include "skin/write/raster.h"
#include "skin/write/write_mesh.h"

namespace effuse {

namespace fs = std::filesystem;
using geometry::TriMesh;

namespace {

const std::vector<std::string> kFormats = {"vtp", "usda", "bgeo", "glb-flipbook", "geotiff", "ply", "obj", "glb"};

std::set<std::string> wanted_formats(const std::vector<std::string>& words) {
  std::set<std::string> wanted;
  std::vector<Fault> faults;
  for (const std::string& word : words) {
    if (std::find(kFormats.begin(), kFormats.end(), word) != kFormats.end()) {
      wanted.insert(word);
      continue;
    }
    std::string all;
    for (const std::string& format : kFormats) all += (all.empty() ? "" : ", ") + format;
    const std::string nearest = nearest_name(word, kFormats);
    Fault& fault = faults.emplace_back();
    fault.place.file = "--to";
    fault.message = fmt::format("no format '{}'; {}", word, nearest.empty() ? "there are " + all : "did you mean '" + nearest + "'?");
  }
  if (!faults.empty()) throw InputError(faults);
  return wanted;
}

/// "A-B" or "A"; all when empty.
std::pair<int, int> frame_range(const std::string& text, int last) {
  if (text.empty()) return {1, last};
  const auto fail = [&]() -> std::pair<int, int> { throw InputError({"--frames"}, fmt::format("'{}', wanted two frame numbers from 1 on, 10-48, or one", text)); };
  int from = 0, to = 0;
  const char* const end = text.data() + text.size();
  const auto [dash, error] = std::from_chars(text.data(), end, from);
  if (error != std::errc() || from < 1) return fail();
  if (dash == end) {
    to = from;
  } else {
    if (*dash != '-') return fail();
    const auto [stop, second] = std::from_chars(dash + 1, end, to);
    if (second != std::errc() || stop != end || to < from) return fail();
  }
  if (from > last) throw InputError({"--frames"}, fmt::format("'{}', and the run's last frame is {}", text, last));
  return {from, std::min(to, last)};
}

/// Whether the things of a sequence are particles: by its first file that has any.
bool holds_particles(const FilmFolder& run, const FilmFolder::Sequence& sequence) {
  for (const auto& [frame, file] : sequence.files) {
    if (file.extension() != ".ply") return false;
    const TriMesh mesh = read_frame(run, file);
    if (!mesh.positions.empty()) return is_particles(mesh);
  }
  return false;
}

/// What is to be exported, checked before anything is written.
class Export {
 public:
  Export(const FilmFolder& run, std::set<std::string> formats, fs::path out, const std::string& frames) : run_(run), formats_(std::move(formats)), out_(std::move(out)) {
    std::error_code ignored;
    same_folder_ = fs::equivalent(out_, run.folder, ignored);
    if (wants("geotiff")) find_maps();
    if (!wants_frames()) return;
    const Place place{run.folder.string()};
    if (run.sequences.empty())
      throw InputError(place, "holds no frames/NAME.####.ply or .glb, which all formats but geotiff are made of: ply or glb among the scene's output.formats keeps them");
    std::tie(first_, last_) = frame_range(frames, run.last_frame);
    if (!wants("bgeo")) return;
    for (const FilmFolder::Sequence& sequence : run.sequences)
      if (holds_particles(run, sequence)) particles_.insert(sequence.name);
    if (particles_.empty())
      throw InputError(place, "holds no frames of particles, which bgeo is of: bgeo among the scene's output.formats keeps the lava's as frames/lava.####.bgeo while the run goes");
  }

  /// False when it was asked to stop; all files that are there then are whole.
  bool write(bool quiet) {
    for (const auto& [from, to] : maps_) {
      write_map(from, to);
      ++written["geotiff"];
    }
    if (!wants_frames()) return true;
    FilmExport film({run_.fps, run_.time_scale}, {wants("vtp"), wants("usda")}, out_);
    std::optional<FlipbookExport> book;
    if (wants("glb-flipbook")) book.emplace(run_, out_ / "film.glb", first_);
    for (const auto& [name, file] : run_.stills) {
      if (!wants("vtp") && !wants("usda") && !book) break;
      const TriMesh mesh = read_frame(run_, file);
      film.add_still(name, mesh, run_.metadata(0));
      if (book) book->add_still(name, mesh);
    }
    Progress progress(first_ - 1, last_, quiet);
    for (int frame = first_; frame <= last_; ++frame) {
      if (StopSignals::asked()) return false;
      std::size_t triangles = 0;
      for (const FilmFolder::Sequence& sequence : run_.sequences)
        if (const auto file = sequence.files.find(frame); file != sequence.files.end()) {
          const TriMesh mesh = read_frame(run_, file->second);
          triangles += mesh.triangles.size();
          film.add(sequence.name, frame, mesh, run_.metadata(frame));
          if (book && !is_particles(mesh)) book->add(sequence.name, frame, mesh);
          write_one(sequence.name, frame, file->second, mesh);
        }
      progress.frame_done(frame, fmt::format("{} triangles", triangles));
    }
    if (StopSignals::asked()) return false;
    film.finish(last_, run_.views, run_.aspect, run_.metadata(0));
    if (book) {
      book->finish(last_);
      ++written["glb-flipbook"];
    }
    return true;
  }

  std::map<std::string, std::size_t> written;  ///< files of things, by format
  std::vector<std::string> notes;

 private:
  bool wants(const char* format) const { return formats_.contains(format); }
  bool wants_frames() const { return formats_.size() > (wants("geotiff") ? 1u : 0u); }

  void find_maps() {
    std::error_code error;
    std::set<fs::path> found;
    for (fs::directory_iterator at(run_.folder / "maps", error), end; !error && at != end; at.increment(error)) {
      const fs::path& file = at->path();
      if ((file.extension() == ".tif" || file.extension() == ".asc") && file.stem().extension() != ".part") found.insert(file);
    }
    for (const fs::path& file : found) {
      const fs::path tif = fs::path(file).replace_extension(".tif");
      if (file.extension() == ".asc" && found.contains(tif)) continue;
      if (file != tif || !same_folder_) maps_.emplace_back(file, out_ / "maps" / tif.filename());
    }
    if (found.empty()) throw InputError({run_.folder.string()}, "holds no maps: output.maps of its scene was false, or the run did not come to its end");
    if (maps_.empty()) notes.push_back("geotiff: the run has them, maps/*.tif");
  }

  void write_map(const fs::path& from, const fs::path& to) const {
    if (from.extension() == ".tif") {
      write_file(to, read_file(from));
      return;
    }
    const importers::DemGrid grid = importers::parse_esri_ascii(read_file(from), from.string());
    skin::Raster raster;
    raster.cell = grid.spacing;
    raster.corner = grid.corner - grid.spacing / 2;
    raster.nx = grid.nx;
    raster.ny = grid.ny;
    raster.values.assign(grid.z.begin(), grid.z.end());
    raster.crs = run_.crs;
    skin::write_geotiff(to, raster);
  }

  void write_one(const std::string& name, int frame, const fs::path& source, const TriMesh& mesh) {
    for (const char* format : {"vtp", "usda"})
      if (wants(format)) ++written[format];
    const std::string stem = (out_ / "frames" / fmt::format("{}.{:04}.", name, frame)).string();
    if (wants("bgeo") && particles_.contains(name)) {
      const importers::PointCloud cloud = importers::import_points(source);
      write_film_bgeo(stem + "bgeo", cloud.points(), run_.time_scale);
      ++written["bgeo"];
    }
    if (is_particles(mesh)) return;
    const skin::Metadata about = run_.metadata(frame);
    for (const auto& [format, write] : {std::pair{"ply", &skin::write_ply}, {"obj", &skin::write_obj}, {"glb", &skin::write_glb}}) {
      const fs::path file = stem + format;
      std::error_code ignored;
      if (!wants(format) || (same_folder_ && format != std::string("obj") && fs::exists(file, ignored))) continue;  // the run's own, which holds more
      write(file, mesh, about);
      ++written[format];
    }
  }

  const FilmFolder& run_;
  std::set<std::string> formats_, particles_;
  fs::path out_;
  bool same_folder_ = false;
  int first_ = 1, last_ = 0;
  std::vector<std::pair<fs::path, fs::path>> maps_;  // from, to
};

/// What to open, of what was asked for.
std::string where(const std::string& format, const fs::path& out) {
  if (format == "vtp") return fmt::format("{}: in ParaView, or open_in_paraview.py", (out / "skin.pvd").string());
  if (format == "usda") return fmt::format("{}: terrain, skin, camera and sun", (out / "film.usda").string());
  if (format == "glb-flipbook") return (out / "film.glb").string();
  if (format == "geotiff") return (out / "maps" / "*.tif").string();
  return (out / "frames" / ("*." + format)).string();
}

}  // namespace

ExitCode export_run(const ExportCommand& command, const CommonOptions& common) {
  const std::set<std::string> formats = wanted_formats(command.formats);
  const FilmFolder run = read_film_folder(command.folder);
  const fs::path out = command.output.empty() ? command.folder : command.output;
  Export work(run, formats, out, command.frames);
  for (const std::string& note : run.notes) log_warning(note);
  for (const std::string& note : work.notes) log_info(note);
  const OutputFolder held(out);
  bool done = false;
  {
    const StopSignals signals;
    done = work.write(common.quiet || common.json);
  }
  if (!done) log_warning("interrupted: the files that are there are whole, those that join them (.pvd, .usda, film.glb) are missing or of before; the same command writes them all");
  nlohmann::ordered_json j{{"ok", done}, {"folder", out.string()}, {"files", nlohmann::ordered_json::object()}, {"notes", run.notes}};
  for (const std::string& note : work.notes) j["notes"].push_back(note);
  for (const std::string& format : kFormats) {
    if (!formats.contains(format)) continue;
    const auto count = work.written.find(format);
    const std::size_t n = count == work.written.end() ? 0 : count->second;
    j["files"][format] = n;
    if (done) log_info(n > 0 ? fmt::format("{}: {} file{}, {}", format, n, n > 1 ? "s" : "", where(format, out)) : fmt::format("{}: nothing to write", format));
  }
  if (common.json) print_document(j.dump(1, ' ', false, nlohmann::ordered_json::error_handler_t::replace));
  return done ? ExitCode::kDone : ExitCode::kInterrupted;
}

}  // namespace effuse
