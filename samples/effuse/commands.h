#pragma once

#include <filesystem>
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
};

struct RunCommand {
  std::filesystem::path scene, folder;
  int frames = 0;  ///< 0: as the scene says
  bool resume = false, force = false;
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

/// `effuse study`; not called study, which is a namespace.
struct StudyCommand {
  std::vector<std::string> names;  ///< of studies; empty: all
  std::filesystem::path folder;
  std::vector<std::string> cases;  ///< only these; empty: all, or all quick ones
  bool full = false, resume = false, strict = false, list = false;
};
ExitCode run_studies(const StudyCommand& command, const CommonOptions& common);

}  // namespace effuse
