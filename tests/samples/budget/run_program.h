#pragma once

#include <fmt/format.h>
#include <gtest/gtest.h>
#include <sys/wait.h>
#include <unistd.h>

#include <cstdlib>
#include <filesystem>
#include <string>

#include "geometry/base/files.h"

/// The program as a process of its own: its memory and times are nobody else's.
namespace effuse::budget {

struct ProgramRun {
  int code = -1;
  std::string out, err;
};

/// A folder of the test's own, removed at its end; the program's cache lies in it.
class TestFolder {
 public:
  TestFolder() {
    std::string name = (std::filesystem::temp_directory_path() / "effuse.budget.XXXXXX").string();
    EXPECT_NE(::mkdtemp(name.data()), nullptr);
    path_ = name;
  }
  ~TestFolder() {
    std::error_code ignored;
    std::filesystem::remove_all(path_, ignored);
  }
  TestFolder(const TestFolder&) = delete;
  TestFolder& operator=(const TestFolder&) = delete;

  const std::filesystem::path& path() const { return path_; }
  std::string write(const std::string& name, const std::string& text) const {
    write_file(path_ / name, text);
    return (path_ / name).string();
  }
  /// arguments: as a shell reads them.
  ProgramRun effuse(const std::string& arguments) const {
    const std::string out = (path_ / "stdout").string(), err = (path_ / "stderr").string();
    const int status = std::system(fmt::format("XDG_CACHE_HOME='{}' '{}' {} > '{}' 2> '{}'", (path_ / "cache").string(), EFFUSE_PROGRAM, arguments, out, err).c_str());
    return {WIFEXITED(status) ? WEXITSTATUS(status) : -1, read_file(out), read_file(err)};
  }

 private:
  std::filesystem::path path_;
};

}  // namespace effuse::budget
