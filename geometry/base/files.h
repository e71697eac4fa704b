#pragma once

#include <filesystem>
#include <string>
#include <string_view>

/// Files that are whole or absent.
namespace effuse {

/// Writes path whole or not at all: a file without a name where there are such (Linux), fsync, then its name; several may write the same
/// path at once. Creates the folder. Throws ResourceError when the disk is full, std::runtime_error with the system's words otherwise.
void write_file(const std::filesystem::path& path, std::string_view bytes);

/// For packages that write to a path themselves (OpenVDB, assimp): give them temporary(), then
/// commit(). Without commit the temporary file is removed. Temporary names are of one process and AtomicFile, and end in ".part"
/// before the extension of path, so that writers which look at the extension see the right one.
class AtomicFile {
 public:
  explicit AtomicFile(std::filesystem::path path);
  ~AtomicFile();
  AtomicFile(const AtomicFile&) = delete;
  AtomicFile& operator=(const AtomicFile&) = delete;

  const std::filesystem::path& temporary() const { return temporary_; }
  /// fsync and rename; throws as write_file does, also when nothing was written.
  void commit();

 private:
  std::filesystem::path path_, temporary_;
  bool committed_ = false;
};

/// The whole file. Throws InputError naming it when it is missing, a folder or unreadable.
std::string read_file(const std::filesystem::path& path);

}  // namespace effuse
