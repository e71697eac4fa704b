#include "skin/page/page.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <iterator>
#include <nlohmann/json.hpp>
#include <tuple>

#include "geometry/base/zones.h"
#include "geometry/mesh/measure.h"
#include "skin/page/page_bytes.h"
#include "skin/page/page_files.h"
#include "skin/page/text85.h"
#include "skin/write/mesh_arrays.h"

namespace effuse::skin {

using geometry::TriMesh;
using Json = nlohmann::ordered_json;

namespace {

// One scope, in this order: what a file uses stands before it.
constexpr const char* kScripts[] = {"unpack.js", "space.js", "camera.js", "colors.js", "shaders.js", "draw.js", "frames.js", "charts.js", "save.js", "main.js"};

/// JSON in ASCII that may stand in a script element: no '<', no bytes that are not UTF-8.
std::string in_script(const Json& json) {
  std::string text = json.dump(-1, ' ', true, Json::error_handler_t::replace);
  for (std::size_t i = text.find('<'); i != std::string::npos; i = text.find('<', i)) text.replace(i, 1, "\\u003c");
  return text;
}

std::string in_html(const std::string& text) {
  std::string out;
  for (const char c : one_line(text)) {
    if (c == '<') out += "&lt;";
    else if (c == '&') out += "&amp;";
    else out += c;
  }
  return out;
}

Json triple(const Vec3& v) { return {v.x(), v.y(), v.z()}; }
Json corners(const Box3& box) { return box.isEmpty() ? Json(nullptr) : Json{triple(box.min()), triple(box.max())}; }

/// As many digits as a float has; null where there is no number.
Json number(Real value) { return std::isfinite(value) ? Json::parse(fmt::format("{:.7g}", value)) : Json(nullptr); }

}  // namespace

TriMesh block_below(const TriMesh& ground) {
  // Sides that only one triangle has.
  struct Side {
    Index low, high;
    bool turned;
  };
  std::vector<Side> sides;
  for (const geometry::Triangle& t : ground.triangles)
    for (std::size_t k = 0; k < 3; ++k) {
      const Index a = t[k], b = t[(k + 1) % 3];
      sides.push_back({std::min(a, b), std::max(a, b), b < a});
    }
  std::sort(sides.begin(), sides.end(), [](const Side& a, const Side& b) { return std::tie(a.low, a.high) < std::tie(b.low, b.high); });

  TriMesh block;
  const Box3 box = geometry::bounds(ground);
  const Real floor = box.isEmpty() ? 0 : box.min().z() - 0.04 * box.sizes().head<2>().norm();
  const auto same = [](const Side& a, const Side& b) { return a.low == b.low && a.high == b.high; };
  for (std::size_t i = 0; i < sides.size(); ++i) {
    if ((i > 0 && same(sides[i], sides[i - 1])) || (i + 1 < sides.size() && same(sides[i], sides[i + 1]))) continue;
    const Vec3 a = ground.positions[sides[i].turned ? sides[i].high : sides[i].low], b = ground.positions[sides[i].turned ? sides[i].low : sides[i].high];
    // The ground is to the left of a -> b: outside is to the right.
    const Vec3 normal = Vec3(b.y() - a.y(), a.x() - b.x(), 0).normalized();
    if (!normal.allFinite()) continue;
    const auto first = static_cast<Index>(block.positions.size());
    for (const Vec3& p : {a, b, Vec3(b.x(), b.y(), floor), Vec3(a.x(), a.y(), floor)}) {
      block.positions.push_back(p);
      block.normals.push_back(normal);
    }
    block.triangles.push_back({first, first + 3, first + 2});
    block.triangles.push_back({first, first + 2, first + 1});
  }
  geometry::VertexAttribute color{3, {}};
  for (std::size_t v = 0; v < block.positions.size(); ++v) color.values.insert(color.values.end(), {0.060f, 0.053f, 0.049f});
  block.attributes["color"] = std::move(color);
  return block;
}

Page::Page(PageAbout about, const TriMesh& terrain) : about_(std::move(about)) {
  if (terrain.triangles.empty()) return;
  require_well_formed("the ground", terrain);
  terrain_ = add_blob(terrain, false);
  const TriMesh block = block_below(terrain);
  if (!block.triangles.empty()) base_ = add_blob(block, false);
  all_box_ = geometry::bounds(terrain);
}

std::size_t Page::add_blob(const TriMesh& mesh, bool lava) {
  TriMesh with_normals;  // the mesh with what it lacks
  with_normals.positions = mesh.positions;
  with_normals.triangles = mesh.triangles;
  with_normals.normals = unit_normals(mesh);
  const PageBytes bytes = lava ? lava_bytes(mesh) : mesh.attributes.contains("color") ? other_bytes(mesh) : PageBytes{};
  const PackedMesh packed = pack_mesh(with_normals, bytes.planes);
  const std::string deflated = deflate_raw(packed.bytes);

  Json j;
  j["vertices"] = packed.vertices;
  j["triangles"] = packed.triangles;
  j["bytes"] = deflated.size();
  j["box"] = packed.box;
  j["planes"] = packed.planes;
  for (const auto& [name, range] : bytes.ranges) j["ranges"][name] = {number(range.first), number(range.second)};
  Blob blob{in_script(j), text85(deflated), packed.triangles};
  if (lava) {
    if (const auto found = bytes.ranges.find("temperature"); found != bytes.ranges.end()) {
      coldest_ = hottest_ > 0 ? std::min(coldest_, Real{found->second.first}) : Real{found->second.first};
      hottest_ = std::max(hottest_, Real{found->second.second});
    }
    fastest_ = std::max(fastest_, bytes.fast);
    thickest_ = std::max(thickest_, bytes.thick);
  } else {
    // What has not moved is there already.
    const auto [known, added] = known_.emplace(blob.about + blob.text, blobs_.size());
    if (!added) return known->second;
  }
  blobs_.push_back(std::move(blob));
  return blobs_.size() - 1;
}

void Page::add(const PageFrame& frame) {
  ZONE("page.frame");
  Shown shown{frame.number, frame.time, kNone, kNone};
  if (!frame.lava.triangles.empty()) {
    require_well_formed(fmt::format("the lava of frame {}", frame.number), frame.lava);
    shown.lava = add_blob(frame.lava, true);
    const Box3 box = geometry::bounds(frame.lava);
    if (lava_box_.isEmpty()) first_lava_ = box;
    lava_box_.extend(box);
    all_box_.extend(box);
  }
  if (!frame.others.triangles.empty()) {
    require_well_formed(fmt::format("the things of frame {}", frame.number), frame.others);
    shown.others = add_blob(frame.others, false);
    others_box_.extend(geometry::bounds(frame.others));
    all_box_.extend(others_box_);
  }
  frames_.push_back(shown);
}

std::string Page::html(PageReport* report) const {
  ZONE("page.html");
  const auto id = [](std::size_t blob) { return blob == kNone ? Json(nullptr) : Json(blob); };
  Json j;
  j["title"] = one_line(about_.title);
  j["facts"] = Json::array();
  for (const auto& [name, value] : about_.facts) j["facts"].push_back({name, one_line(value)});
  j["fps"] = about_.fps;
  j["origin"] = triple(about_.origin);
  j["crs"] = one_line(about_.crs);
  j["lavaBox"] = corners(lava_box_);
  j["firstLava"] = corners(first_lava_);
  j["othersBox"] = corners(others_box_);
  j["box"] = corners(all_box_);
  j["ranges"] = {{"temperature", {number(coldest_), number(hottest_)}}, {"speed", {0, number(fastest_)}}, {"crust", {0, 1}}, {"thickness", {0, number(thickest_)}}};
  j["terrain"] = id(terrain_);
  j["base"] = id(base_);
  j["frames"] = Json::array();
  for (const Shown& frame : frames_) j["frames"].push_back({{"number", frame.number}, {"time", number(frame.time)}, {"lava", id(frame.lava)}, {"others", id(frame.others)}});
  j["seriesTimes"] = Json::array();
  for (const Real time : about_.series_times) j["seriesTimes"].push_back(number(time));
  j["series"] = Json::array();
  for (const PageSeries& series : about_.series) {
    Json values = Json::array();
    for (const Real value : series.values) values.push_back(number(value));
    j["series"].push_back({{"chart", series.chart}, {"name", series.name}, {"unit", series.unit}, {"values", values}});
  }
  for (int b = 0; b < 256; ++b) {
    const Vec3 light = glow_of_byte(b);
    for (int k = 0; k < 3; ++k) j["glow"].push_back(Json::parse(fmt::format("{:.4g}", light[k])));
  }
  std::string blobs = "[";
  for (std::size_t b = 0; b < blobs_.size(); ++b) blobs += (b == 0 ? "" : ",\n") + blobs_[b].about;
  blobs += "]";

  std::string html;
  const auto blob = [&](std::size_t b) { html += fmt::format("<script type=\"text/plain\" id=\"mesh{}\">", b) + blobs_[b].text + "</script>\n"; };
  std::string body(page_file("page.html"));
  const auto fill = [&](const std::string& place, const std::string& text) {
    const std::size_t at = body.find(place);
    if (at != std::string::npos) body.replace(at, place.size(), text);
  };
  fill("{{title}}", in_html(about_.title));
  fill("{{style}}", std::string(page_file("page.css")));
  html += body;
  html += "<script type=\"application/json\" id=\"about\">" + in_script(j) + "</script>\n";
  html += "<script type=\"application/json\" id=\"meshes\">" + blobs + "</script>\n";
  // The ground before the program, which starts at once; frames come in while it draws.
  for (const std::size_t b : {terrain_, base_})
    if (b != kNone) blob(b);
  html += "<script>\n\"use strict\";\n(() => {\n";
  for (const char* name : kScripts) html += page_file(name);
  html += "})();\n</script>\n";
  std::size_t frame_bytes = 0;
  for (std::size_t b = 0; b < blobs_.size(); ++b) {
    if (b == terrain_ || b == base_) continue;
    blob(b);
    frame_bytes += blobs_[b].text.size();
  }
  html += "</body>\n</html>\n";
  if (report) {
    *report = {frames_.size(), 0, html.size(), frame_bytes};
    for (const Shown& frame : frames_)
      if (frame.lava != kNone) report->triangles += blobs_[frame.lava].triangles;
  }
  return html;
}

}  // namespace effuse::skin
