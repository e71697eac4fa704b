#pragma once

#include <filesystem>

namespace effuse {

/// The folder to write, made and held against a second effuse: two would mix their files. Throws InputError when it cannot be made or written to,
/// is no folder or is held, ResourceError when the disk is full.
class OutputFolder {
 public:
  explicit OutputFolder(const std::filesystem::path& folder);
  ~OutputFolder();
  OutputFolder(const OutputFolder&) = delete;
  OutputFolder& operator=(const OutputFolder&) = delete;

 private:
  int fd_ = -1;
};

}  // namespace effuse
