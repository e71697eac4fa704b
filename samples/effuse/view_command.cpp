#include <fmt/format.h>

#include <algorithm>
#include <charconv>
#include <cmath>
#include <nlohmann/json.hpp>
#include <optional>
#include <utility>

#include "geometry/base/files.h"
#include "geometry/base/log.h"
#include "geometry/base/parallel.h"
#include "geometry/base/zones.h"
#include "geometry/remesh/decimate.h"
#include "geometry/terrain/terrain.h"
#include "samples/effuse/commands.h"
#include "samples/effuse/progress.h"
#include "samples/effuse/run_folder.h"
#include "skin/page/page.h"

namespace effuse {

namespace fs = std::filesystem;
using geometry::TriMesh;

namespace {

/// "12", "10-60", "10-", "-60": first and last of frames 1 to count.
std::pair<int, int> frame_range(const std::string& text, int count) {
  std::pair<int, int> range{1, count};
  if (text.empty()) return range;
  const auto wrong = [&](const std::string& why) { return InputError(Place{}, fmt::format("--frames {}: {}, wanted A-B within 1-{}, as in 10-{}", text, why, count, std::max(count, 10))); };
  const auto read = [&](std::string_view word, int& number) {
    if (word.empty()) return;
    const auto [end, error] = std::from_chars(word.data(), word.data() + word.size(), number);
    if (error != std::errc() || end != word.data() + word.size()) throw wrong("is no range of frames");
  };
  const std::size_t dash = text.find('-');
  read(std::string_view(text).substr(0, dash), range.first);
  if (dash == std::string::npos) range.second = range.first;
  else read(std::string_view(text).substr(dash + 1), range.second);
  if (text == "-") throw wrong("is no range of frames");
  if (range.first < 1 || range.second < range.first || range.first > count) throw wrong(fmt::format("the run has frames 1 to {}", count));
  range.second = std::min(range.second, count);
  return range;
}

/// Height of each vertex over the ground below it [m]; 0 in the ground and where there is none.
void add_thickness(TriMesh& lava, const geometry::Terrain& ground) {
  geometry::VertexAttribute thickness{1, std::vector<float>(lava.positions.size())};
  parallel_for(lava.positions.size(), [&](std::size_t v) {
    const Vec3& p = lava.positions[v];
    const std::optional<Real> below = ground.height_below(p.x(), p.y(), p.z());
    thickness.values[v] = below ? static_cast<float>(p.z() - *below) : 0;
  });
  lava.attributes["thickness"] = std::move(thickness);
}

/// "3, 5-7 and 40 more"
std::string listed(const std::vector<int>& numbers) {
  std::string text;
  constexpr std::size_t kShown = 5;
  std::size_t told = 0, ranges = 0;
  for (std::size_t i = 0; i < numbers.size() && ranges < kShown; ++ranges) {
    std::size_t last = i;
    while (last + 1 < numbers.size() && numbers[last + 1] == numbers[last] + 1) ++last;
    text += fmt::format("{}{}", text.empty() ? "" : ", ", numbers[i]);
    if (last > i) text += fmt::format("-{}", numbers[last]);
    i = last + 1;
    told = i;
  }
  return told < numbers.size() ? fmt::format("{} and {} more", text, numbers.size() - told) : text;
}

std::string megabytes(std::size_t bytes) { return fmt::format("{:.{}f} MB", static_cast<Real>(bytes) / 1e6, bytes < 10'000'000 ? 1 : 0); }

skin::PageAbout about(const RunFolder& run, const ViewCommand& command) {
  skin::PageAbout about;
  about.title = command.title.empty() ? run.name() : command.title;
  if (about.title.empty()) about.title = "Lava";
  about.fps = run.fps();
  about.origin = run.origin();
  about.crs = run.crs();
  if (run.time_scale() != 1) about.facts.emplace_back("", fmt::format("{:.4g} s a second of film", run.time_scale()));
  run.read_series(about.series_times, about.series);
  return about;
}

}  // namespace

ExitCode view(const ViewCommand& command, const CommonOptions& common) {
  const RunFolder run(command.folder);
  const fs::path output = command.output.empty() ? command.folder / "view.html" : command.output;
  const auto [first, last] = frame_range(command.frames, run.frames());
  TriMesh ground = run.terrain();
  std::optional<geometry::Terrain> terrain;
  if (!ground.triangles.empty()) terrain = geometry::Terrain::from_mesh(ground);

  geometry::Decimated cut_ground;
  if (command.triangles > 0) cut_ground = geometry::decimate(ground, 2 * command.triangles);
  skin::Page page(about(run, command), ground);
  std::vector<int> missing;
  std::size_t cut = 0, largest = 0, shown = 0, with_mesh = 0;
  Progress progress(first, last, common.quiet || common.json);
  for (int number = first; number <= last; number += command.every) {
    progress.tick(fmt::format("{} shown", shown));
    skin::PageFrame frame{number, run.time(number), {}, run.others(number)};
    if (std::optional<TriMesh> lava = run.lava(number)) {
      frame.lava = std::move(*lava);
    } else if (run.has_lava()) {
      missing.push_back(number);
      continue;
    }
    largest = std::max(largest, frame.lava.triangles.size());
    if (command.triangles > 0 && frame.lava.triangles.size() > command.triangles) {
      geometry::decimate(frame.lava, command.triangles);
      ++cut;
    }
    if (terrain) add_thickness(frame.lava, *terrain);
    with_mesh += !frame.lava.triangles.empty() || !frame.others.triangles.empty();
    page.add(frame);
    ++shown;
  }
  progress.end();
  if (shown == 0)
    throw InputError(Place{command.folder.string()}, fmt::format("none of the frames {} to {} has its skin (frames/skin.####.ply, .glb or .obj): the files are gone", first, last));
  if (with_mesh == 0)
    throw InputError(Place{command.folder.string()}, run.has_lava() ? "no lava in any of these frames: more of them, or later ones, may have some (--frames)"
                                                                     : "a run that wrote no meshes, wanted skins as PLY, GLB or OBJ: effuse run with --set output.formats='[\"ply\"]'");

  skin::PageReport report;
  const std::string html = page.html(&report);
  write_file(output, html);

  if (!missing.empty()) log_warning(fmt::format("{}: the skins of frames {} are missing: the page leaves them out", command.folder.string(), listed(missing)));
  for (const std::string& layer : run.point_layers()) log_warning(fmt::format("{} are points, which the page does not draw", layer));
  if (cut_ground.after < cut_ground.before) log_info(fmt::format("ground cut down from {} to {} triangles, some {:.2g} m off: it may cover the edges of thin lava", cut_ground.before, cut_ground.after, cut_ground.error));
  if (cut > 0) log_info(fmt::format("{} of {} frames cut down to {} triangles (the largest had {}): --triangles N for more or fewer, 0 for all", cut, shown, command.triangles, largest));
  if (common.json) {
    nlohmann::ordered_json j{{"page", output.string()}, {"bytes", report.bytes}, {"frames", report.frames}, {"triangles", report.triangles}, {"frames_cut_down", cut}, {"frames_missing", missing}};
    print_document(j.dump(1, ' ', false, nlohmann::ordered_json::error_handler_t::replace));
  } else {
    fmt::print("{}: {} frames, {} triangles a frame, {}\n", output.string(), report.frames, report.triangles / report.frames, megabytes(report.bytes));
  }
  return ExitCode::kDone;
}

}  // namespace effuse
