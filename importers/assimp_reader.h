#pragma once

#include <filesystem>
#include <memory>
#include <string>
#include <vector>

struct aiScene;
namespace Assimp {
class BaseImporter;
}

namespace effuse::importers {

/// One file read through assimp, from memory: what was checked is what is parsed. Other files that it
/// names (materials, buffers) are opened where they stand if they are regular files in its folder or in one below: a file
/// from somebody else could put /etc/passwd into a mesh, and a pipe never ends. Links there lead where their owner says.
///
/// assimp's own assertions, which are live in Debian's build and would end the process, become errors.
class AssimpReader {
 public:
  AssimpReader();
  ~AssimpReader();
  AssimpReader(const AssimpReader&) = delete;
  AssimpReader& operator=(const AssimpReader&) = delete;

  /// Registers an importer of ours (takes ownership), in the place of assimp's own for its extension.
  void add(Assimp::BaseImporter* importer, const std::string& extension);

  /// A setting for importers and post processing.
  void set_integer(const char* property, int value);

  /// Whether some importer claims the extension (".obj").
  bool reads(const std::string& extension) const;

  /// The scene of bytes, known to importers by the path file; lives as long as the reader, whose bytes must
  /// outlive this call. flags: aiPostProcessSteps. Throws InputError with assimp's words.
  const aiScene& read(const std::filesystem::path& file, const std::string& bytes, unsigned flags);
  /// The same of a file that its importer opens itself, where it lies: nothing is held in memory.
  const aiScene& read_in_place(const std::filesystem::path& file, unsigned flags);
  /// Files named by the last one read that are there and were not opened, and why: "../a.mtl (outside of its folder)".
  std::vector<std::string> refused() const;
  /// More post processing of the scene that was read.
  const aiScene& process(const std::string& name, unsigned flags);

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace effuse::importers
