#pragma once

#include <algorithm>
#include <array>
#include <map>
#include <regex>
#include <set>
#include <sstream>
#include <string>
#include <string_view>
#include <vector>

/// What may include what (DESIGN section 1), and what a file may look like: functions of paths and texts, so that the
/// rules can be tried on made-up lines. Paths are written from the repository's root with '/'.
namespace effuse::architecture {

/// What is wrong: "path:line: sentence".
using Faults = std::vector<std::string>;

inline bool starts_with(std::string_view text, std::string_view start) { return text.substr(0, start.size()) == start; }
inline bool ends_with(std::string_view text, std::string_view end) {
  return text.size() >= end.size() && text.substr(text.size() - end.size()) == end;
}

/// Whether path is folder, lies in it, or is a file of that name beside it ("importers/info" has "importers/info.cpp").
inline bool inside(std::string_view path, std::string_view folder) {
  if (folder.empty()) return true;
  if (!starts_with(path, folder)) return false;
  return path.size() == folder.size() || path[folder.size()] == '/' || path[folder.size()] == '.';
}

struct Include {
  int line = 0;
  std::string name;      ///< between the quotes or brackets; the macro's name when it is neither
  bool quoted = false;   ///< "name"
  bool readable = true;  ///< false: #include MACRO
};

/// Every #include of a C++ text, conditional ones too; not those in // comments or in strings on one line.
inline std::vector<Include> includes_of(const std::string& text) {
  static const std::regex pattern(R"(^\s*#\s*include(?:_next)?\s*(?:"([^"]*)\"|<([^>]*)>|(\w+)))");
  std::vector<Include> found;
  std::istringstream in(text);
  std::string line;
  for (int number = 1; std::getline(in, line); ++number) {
    std::smatch match;
    if (line.find("include") == std::string::npos || !std::regex_search(line, match, pattern)) continue;
    if (match[1].matched) found.push_back({number, match[1], true, true});
    else if (match[2].matched) found.push_back({number, match[2], false, true});
    else found.push_back({number, match[3], false, false});
  }
  return found;
}

/// A room and the folders that it may include from. The first that holds a file is its room.
struct Room {
  std::string folder;
  std::vector<std::string> may_include;
};

/// The arrows. A solver is any folder of flow that is not named here: it sees itself, the integrators and geometry.
inline const std::vector<Room>& rooms() {
  static const std::vector<Room> all{
      {"geometry/base", {"geometry/base"}},
      {"geometry", {"geometry"}},
      {"flow/integrate", {"flow/integrate", "geometry"}},
      {"flow/reference", {"flow/reference", "flow/integrate", "geometry"}},
      {"flow/scene", {"flow/scene", "flow/integrate", "geometry"}},
      {"flow/effects", {"flow", "geometry"}},
      {"skin/scene", {"skin", "flow/scene", "geometry"}},
      {"skin", {"skin", "geometry"}},
      {"importers/scene", {"importers", "flow/scene", "geometry"}},
      {"importers/info", {"importers", "flow/scene", "geometry"}},
      {"importers", {"importers", "geometry"}},
      {"samples", {"samples", "skin", "importers", "flow", "geometry"}},
      {"tests", {""}},
  };
  return all;
}

/// Folders that stand above the rest of their room, because they speak to scenes: included by one another and by who is
/// above the room, not by the rest.
inline const std::vector<std::string>& rooms_joining_scenes() {
  static const std::vector<std::string> all{"skin/scene", "importers/scene", "importers/info"};
  return all;
}

inline Room room_of(const std::string& path) {
  for (const Room& room : rooms())
    if (inside(path, room.folder)) return room;
  if (starts_with(path, "flow/")) {
    const std::string solver = path.substr(0, path.find_first_of("/.", 5));
    return {solver, {solver, "flow/integrate", "geometry"}};
  }
  return {"", {}};
}

/// A heavy package, by how its includes begin, and the folders whose .cpp files are its home.
struct Package {
  std::string name;
  std::vector<std::string> prefixes;
  std::vector<std::string> homes;
};

inline const std::vector<Package>& packages() {
  static const std::vector<Package> all{
      {"CGAL", {"CGAL/"}, {"geometry"}},
      {"Boost", {"boost/"}, {"geometry"}},
      {"FCL", {"fcl/", "ccd/", "octomap/"}, {"geometry"}},
      {"OpenVDB", {"openvdb/"}, {"skin", "geometry/query"}},
      {"TBB", {"tbb/", "oneapi/"}, {"geometry/base", "skin"}},
      {"Embree", {"embree3/", "embree4/"}, {"skin"}},
      {"libpng", {"png.h"}, {"skin"}},
      {"OpenEXR", {"Imf"}, {"skin"}},
      {"zlib", {"zlib.h"}, {"skin", "importers"}},
      {"assimp", {"assimp/"}, {"importers"}},
      {"GDAL", {"gdal", "ogr", "cpl_"}, {"importers"}},
      {"toml++", {"toml++/", "toml.hpp"}, {"importers"}},
      {"nlohmann/json", {"nlohmann/"}, {"skin", "importers", "samples"}},
      {"CLI11", {"CLI/"}, {"samples"}},
      {"Cairo", {"cairo"}, {"samples"}},
      {"fmt", {"fmt/"}, {"geometry", "flow", "skin", "importers", "samples"}},
      {"sanitizers", {"sanitizer/"}, {"geometry/base"}},
  };
  return all;
}

/// Headers of C and of the system; <cstdint> and its like have no '.' and are told from packages by that.
inline bool is_system_header(const std::string& name) {
  static const std::set<std::string> posix{"unistd.h", "fcntl.h", "signal.h", "dlfcn.h", "fenv.h", "immintrin.h", "pthread.h", "sched.h",
                                           "poll.h", "malloc.h", "termios.h", "locale.h", "execinfo.h", "spawn.h"};
  return starts_with(name, "sys/") || starts_with(name, "linux/") || posix.contains(name);
}
inline bool is_standard_header(const std::string& name) { return name.find_first_of("./") == std::string::npos; }

/// A header is a promise to whoever includes it; one called *_internal.h is part of its room's .cpp files instead:
/// not installed, free to include what they may, included by them only.
inline bool is_internal(const std::string& path) { return ends_with(path, "_internal.h"); }
inline bool is_public_header(const std::string& path) { return ends_with(path, ".h") && !is_internal(path); }

/// Every include of the file at path that climbs, meets a package outside its home, or is not written from the root.
/// exists(path): whether the repository has such a file.
template <class Exists>
Faults include_faults(const std::string& path, const std::string& text, Exists&& exists) {
  Faults faults;
  const Room room = room_of(path);
  const bool is_test = room.folder == "tests";
  for (const Include& include : includes_of(text)) {
    const std::string& name = include.name;
    const auto fault = [&](const std::string& sentence) {
      faults.push_back(path + ":" + std::to_string(include.line) + ": includes " + name + ": " + sentence);
    };
    if (!include.readable) {
      fault("a macro's name cannot be followed; write the file's");
    } else if (include.quoted) {
      if (!exists(name)) {
        fault("no such file; project headers are written from the repository's root, others in <>");
        continue;
      }
      if (is_test) continue;
      if (!ends_with(name, ".h")) fault("only headers are included");
      const bool below = std::any_of(room.may_include.begin(), room.may_include.end(), [&](const std::string& f) { return inside(name, f); });
      if (!below) fault("an arrow that climbs: " + room.folder + " may not see it");
      const auto& joining = rooms_joining_scenes();
      const auto joins = [&](const std::string& p) { return std::any_of(joining.begin(), joining.end(), [&](const std::string& f) { return inside(p, f); }); };
      if (below && joins(name) && !joins(path) && room.folder != "samples") fault("it speaks to scenes, and stands above the rest of its room");
      if (is_internal(name) && is_public_header(path)) fault("a public header may not show what is internal");
      if (is_internal(name) && room_of(name).folder != room.folder && name.substr(0, name.find('/')) != path.substr(0, path.find('/')))
        fault("internal to " + name.substr(0, name.find('/')));
    } else if (is_test || is_standard_header(name) || starts_with(name, "Eigen/")) {
      continue;
    } else if (is_system_header(name)) {
      if (is_public_header(path)) fault("a system header belongs into the .cpp");
    } else {
      const auto package = std::find_if(packages().begin(), packages().end(), [&](const Package& p) {
        return std::any_of(p.prefixes.begin(), p.prefixes.end(), [&](const std::string& prefix) { return starts_with(name, prefix); });
      });
      if (package == packages().end()) {
        fault("a package without a home: give it one in tests/architecture/rules.h");
        continue;
      }
      const bool home = std::any_of(package->homes.begin(), package->homes.end(), [&](const std::string& f) { return inside(path, f); });
      if (!home) fault(package->name + " lives in " + package->homes.front() + " and is not seen from " + room.folder);
      if (is_public_header(path)) fault(package->name + " belongs into the .cpp: headers speak our types and Eigen's");
    }
  }
  return faults;
}

/// Files that include one another in a circle: each circle once, "a.h -> b.h -> a.h". files: path -> text.
inline Faults circles(const std::map<std::string, std::string>& files) {
  std::map<std::string, std::vector<std::string>> edges;
  for (const auto& [path, text] : files)
    for (const Include& include : includes_of(text))
      if (include.quoted && files.contains(include.name)) edges[path].push_back(include.name);
  Faults found;
  std::set<std::string> done;
  std::vector<std::string> trail;
  const auto visit = [&](const auto& self, const std::string& path) -> void {
    const auto seen = std::find(trail.begin(), trail.end(), path);
    if (seen != trail.end()) {
      std::string circle;
      for (auto it = seen; it != trail.end(); ++it) circle += *it + " -> ";
      found.push_back(circle + path);
      return;
    }
    if (!done.insert(path).second) return;
    trail.push_back(path);
    for (const std::string& next : edges[path]) self(self, next);
    trail.pop_back();
  };
  for (const auto& [path, text] : files) visit(visit, path);
  return found;
}

/// A struct, class, union or enum that is defined at a namespace's own level, where it has a name in the whole program.
struct Type {
  int line = 0;
  std::string name;  ///< "effuse::skin::Raster"
};

/// The types of a C++ text as our formatting writes it: namespaces and what is directly in them begin a line. None of
/// anonymous namespaces, and none outside any.
inline std::vector<Type> types_of(const std::string& text) {
  static const std::regex opens(R"(^(?:inline )?namespace ?([\w:]*) ?\{)");
  static const std::regex type(R"(^(?:template ?<.*> )?(?:struct|class|union|enum|enum class)(?: alignas\(\w+\))? (\w+)(?: final)?(?: :[^;{]*)? ?\{)");
  std::vector<Type> found;
  std::vector<std::string> within;
  std::istringstream in(text);
  std::string line;
  for (int number = 1; std::getline(in, line); ++number) {
    std::smatch match;
    if (starts_with(line, "}  // namespace")) {
      if (!within.empty()) within.pop_back();
    } else if (std::regex_search(line, match, opens)) {
      within.push_back(match[1]);
    } else if (!within.empty() && std::find(within.begin(), within.end(), "") == within.end() && std::regex_search(line, match, type)) {
      std::string name;
      for (const std::string& space : within) name += space + "::";
      found.push_back({number, name + std::string(match[1])});
    }
  }
  return found;
}

/// Types of one name that two files define. Each may be fine by itself; in one program the linker keeps one
/// destructor for both, and says nothing ([basic.def.odr]).
inline Faults types_defined_twice(const std::map<std::string, std::string>& files) {
  std::map<std::string, std::string> first;
  Faults faults;
  for (const auto& [path, text] : files)
    for (const Type& type : types_of(text)) {
      const std::string here = path + ":" + std::to_string(type.line);
      const auto [at, is_new] = first.emplace(type.name, here);
      if (!is_new) faults.push_back(here + ": " + type.name + " is defined in " + at->second + " as well");
    }
  return faults;
}

/// What is wrong with the names at the top level: exactly the design's, besides dot-names and what builds leave behind.
inline Faults top_level_faults(const std::vector<std::string>& names) {
  static const std::set<std::string> wanted{"CMakeLists.txt", "CMakePresets.json", "LICENSE", "README.md", "geometry", "flow", "skin", "importers", "tests", "samples"};
  static const std::set<std::string> ignored{"build", "out", "compile_commands.json"};
  Faults faults;
  std::set<std::string> missing = wanted;
  for (const std::string& name : names) {
    if (starts_with(name, ".") || ignored.contains(name)) continue;
    if (!missing.erase(name)) faults.push_back(name + ": the top level has no such place (DESIGN section 1)");
  }
  for (const std::string& name : missing) faults.push_back(name + ": missing at the top level");
  return faults;
}

inline constexpr int kMostLines = 900;

/// What any text file of ours must not hold: a developer's own paths, notes to oneself, too many lines.
inline Faults text_faults(const std::string& path, const std::string& text) {
  // Written in pieces, so that this file does not find itself.
  static const std::regex own_path(std::string("(^|[^A-Za-z0-9_.~/$}*-])/(ho") + "me|ro" + "ot|wo" + "rk|Us" + "ers)/[A-Za-z0-9_.]");
  static const std::regex windows_path(std::string("[A-Z]:\\\\(Us") + "ers|wo" + "rk)\\\\");
  static const std::regex note(std::string("\\b(TO") + "DO|FIX" + "ME|X" + "XX)\\b");
  Faults faults;
  std::istringstream in(text);
  std::string line;
  int number = 0;
  while (std::getline(in, line)) {
    ++number;
    const auto fault = [&](const std::string& sentence) { faults.push_back(path + ":" + std::to_string(number) + ": " + sentence); };
    if (std::regex_search(line, own_path) || std::regex_search(line, windows_path)) fault("a path of somebody's own machine");
    if (std::regex_search(line, note)) fault("a note to oneself: do it, or open an issue");
  }
  if (number >= kMostLines) faults.push_back(path + ": " + std::to_string(number) + " lines; from " + std::to_string(kMostLines) + " on, it is two ideas");
  if (ends_with(path, ".h") && text.find("#pragma once") == std::string::npos) faults.push_back(path + ": no #pragma once");
  return faults;
}

}  // namespace effuse::architecture
