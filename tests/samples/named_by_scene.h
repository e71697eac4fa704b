#pragma once

#include <algorithm>
#include <filesystem>
#include <fstream>
#include <map>
#include <regex>
#include <set>
#include <sstream>
#include <string>
#include <vector>

#include <fmt/format.h>

/// What a scene's text calls for, as one who reads README.md would say, line by line and by no code of the program's.
namespace effuse {

/// A [table] or one of [[tables]]: its name in full ("particles.emitter") and its keys with what stands behind them, quotes and all.
struct TextTable {
  std::string name;
  std::map<std::string, std::string> keys;

  std::string text(const std::string& key, const std::string& otherwise) const {
    const auto found = keys.find(key);
    return found == keys.end() ? otherwise : found->second.substr(1, found->second.rfind('"') - 1);
  }
};

inline std::vector<TextTable> tables_of(const std::string& scene) {
  static const std::regex header(R"(^\[\[?([a-z_.]+)\]\]?\s*(#.*)?$)"), pair(R"re(^([a-z_]+)\s*=\s*("[^"]*"|[^#]*).*$)re");
  std::vector<TextTable> tables(1);
  std::istringstream lines(scene);
  for (std::string line; std::getline(lines, line);) {
    std::smatch m;
    if (std::regex_match(line, m, header)) tables.push_back({m[1], {}});
    else if (std::regex_match(line, m, pair)) tables.back().keys[m[1]] = m[2];
  }
  return tables;
}

struct CalledFor {
  std::set<std::string> effects;
  std::set<std::string> files;   ///< below the run's folder
  std::set<std::string> zones;   ///< regular expressions: zones that may be entered
  std::set<std::string> worked;  ///< regular expressions: each has a zone that was entered
};

/// frames: so many are made.
inline CalledFor called_for(const std::string& scene, int frames) {
  const std::vector<TextTable> tables = tables_of(scene);
  const auto count = [&](const std::string& name) { return std::count_if(tables.begin(), tables.end(), [&](const TextTable& t) { return t.name == name; }); };
  const auto any_with = [&](const std::string& name, const std::string& key) { return std::any_of(tables.begin(), tables.end(), [&](const TextTable& t) { return t.name == name && t.keys.contains(key); }); };
  const auto value = [&](const std::string& name, const std::string& key) {
    for (const TextTable& t : tables)
      if (t.name == name && t.keys.contains(key)) return t.keys.at(key);
    return std::string();
  };
  CalledFor c;
  const auto every_frame = [&](const std::string& stem, const std::string& ending) {
    for (int k = 1; k <= frames; ++k) c.files.insert(fmt::format("{}.{:04}.{}", stem, k, ending));
  };
  const auto may = [&](std::initializer_list<const char*> zones) { c.zones.insert(zones.begin(), zones.end()); };
  const auto works = [&](const char* zone) { c.zones.insert(zone), c.worked.insert(zone); };
  const auto writes = [&](const char* format) {
    const std::string formats = value("output", "formats");
    return formats.empty() || formats.find(format) != std::string::npos;
  };

  // Every run.
  c.files = {"manifest.json", "run.json", "scene.toml", "terrain.ply", "terrain.glb", "open_in_blender.py", "open_in_houdini.py", "open_in_paraview.py", fmt::format("checkpoints/checkpoint.{:04}.state", frames)};
  may({"load", "checkpoint", R"(write\.terrain)", R"(write\.(ply|glb))"});
  if (any_with("terrain", "file")) works(R"(import\.(apart|terrain))");
  if (value("preview", "pictures") != "false") {
    every_frame("preview/preview", "png");
    c.files.insert("preview/contact_sheet.png");
    works(R"(preview(\..*)?)");
    may({R"(write\.(png|contact_sheet))"});
  }

  // Things: what stands, moves, breaks.
  const bool lava = count("lava") > 0, blocks = count("lava.crust_blocks") > 0, modern = value("lava", "model") != "\"classic\"";
  const auto bodies = count("body"), breakable = std::count_if(tables.begin(), tables.end(), [](const TextTable& t) { return t.name == "body" && t.keys.contains("strength"); });
  const bool things = count("obstacle") + count("figure") + bodies > 0, move = count("obstacle.key") + count("figure") + bodies > 0;
  if (things) c.files.insert({"obstacles.ply", "obstacles.glb"});
  if (move || blocks) every_frame("frames/obstacles", "ply");
  if (move && (bodies != breakable || count("obstacle") + count("figure") > 0)) {
    c.files.insert({"bodies.csv", "bodies.glb"});
    may({R"(write\.(bodies_csv|animation))"});
  }
  if (bodies > 0) works(R"(bodies\.(step|place|sweep|contacts|solve))");
  if (blocks) may({R"(bodies\.(step|place|sweep|contacts|solve))"});
  if (breakable > 0) works(R"(bodies\.(brittle|bonds\..*)|fracture\..*|mesh\.self_intersections)");
  bool meshes = false;
  for (const char* thing : {"obstacle", "body", "springs", "elastic"}) meshes = meshes || any_with(thing, "file");
  if (meshes || value("terrain", "file").find(".obj") != std::string::npos) works(R"(import\.(apart|mesh)|mesh\.repair)");
  if (count("figure") > 0) works(R"(import\.assimp)");

  // Effects.
  const auto meets_ground = [&] { may({R"(terrain\.contacts)"}); if (things) may({R"(collide\..*)"}); };
  if (lava) {
    c.effects.insert("lava");
    for (const char* format : {"ply", "obj", "glb"})
      if (writes(format)) every_frame("frames/skin", format), may({R"(write\.obj)"});
    if (writes("vdb")) every_frame("frames/lava", "vdb");
    c.files.insert({"flow.csv", fmt::format("checkpoints/flow.{:04}.state", frames)});
    const bool on_map = value("terrain", "file").find("maunga-whau") != std::string::npos;  // the one with a CRS
    for (const char* map : {"arrival_time", "deposit", "max_temperature", "max_thickness"})
      for (const char* ending : {"asc", "tif", "prj"})
        if (on_map || ending != std::string("prj")) c.files.insert(fmt::format("maps/{}.{}", map, ending));
    works(modern ? R"(sph\.(?!forces|rates).*)" : R"(sph\.(forces|rates|step|sort|grid|neighbors|density|contacts|surface|heat))");
    works(R"(skin(\..*)?)");
    works(R"(flow\..*)");
    may({R"(write\.(flow_csv|maps|geotiff|esri_ascii))"});
    meets_ground();
    if (blocks) works(R"(lava\.crust_blocks)");
    if (modern && (count("waves") > 0 || count("ocean") > 0)) may({R"(waves\.lava)"});
  }
  for (const TextTable& t : tables) {
    const auto effect = [&](const std::string& usual) {
      c.effects.insert(t.text("name", usual));
      return "frames/" + t.text("name", usual);
    };
    if (t.name == "springs") every_frame(effect("springs"), "ply"), works(R"(springs\..*)"), meets_ground();
    if (t.name == "elastic") every_frame(effect("elastic"), "ply"), works(R"(elastic\..*|fem\..*)"), meets_ground();
    if (t.name == "waves") every_frame(effect("waves"), "ply"), works(R"(waves\.(explicit|implicit))");
    if (t.name == "ocean") every_frame(effect("ocean"), "ply"), works(R"(ocean\..*)");
    if (t.name == "smoke") every_frame(effect("smoke"), "vdb"), works(R"(smoke(\..*)?)"), may({R"(write\.volume)"});
    if (t.name == "plants") {
      const std::string stem = effect("plants");
      every_frame(stem, "ply"), every_frame(stem + "-flames", "ply");
      works(R"(plants\..*)"), may({R"(write\.points)"});
    }
    if (t.name == "particles") {
      const std::string preset = t.text("preset", "particles"), stem = effect(preset);
      every_frame(stem, "ply");
      works(R"(particles(\.contacts)?)"), may({R"(write\.points)"});
      meets_ground();
      if (preset == "fire" || preset == "smoke" || preset == "steam") every_frame(stem, "vdb"), may({R"(particles\.density)", R"(write\.volume)"});
    }
  }
  if ((c.effects.empty() && things) || (!lava && bodies > 0)) c.effects.insert("bodies");
  return c;
}

/// The scene, cheaper for a test that wants each effect for a moment: coarser, not warmed up, at most 100 times as fast as life. It names
/// what it named.
inline std::string made_small(const std::string& scene) {
  static const std::regex length(R"re(^(spacing|cell) = "([0-9.]+) m"(.*)$)re"), warm(R"(^warm_up = .*$)"), fast(R"(^time_scale = ([0-9.]+)(.*)$)"), size(R"(^(width|height) = [0-9]+$)");
  std::istringstream lines(scene);
  std::string out;
  bool picture = false;
  for (std::string line; std::getline(lines, line);) {
    std::smatch m;
    picture = line.starts_with("[") ? line == "[preview]" : picture;
    if (std::regex_match(line, m, length)) line = fmt::format("{} = \"{} m\"{}", m[1].str(), 1.5 * std::stod(m[2]), m[3].str());
    else if (std::regex_match(line, m, warm)) line = "warm_up = \"0 s\"";
    else if (std::regex_match(line, m, fast)) line = fmt::format("time_scale = {}{}", std::min(100.0, std::stod(m[1])), m[2].str());
    else if (picture && std::regex_match(line, m, size)) continue;
    out += line + "\n";
    if (line == "[preview]") out += "width = 96\nheight = 54\n";
  }
  return out;
}

}  // namespace effuse
