#include "importers/assimp_reader.h"

#include <assimp/BaseImporter.h>
#include <assimp/DefaultIOSystem.h>
#include <assimp/MemoryIOWrapper.h>
#include <assimp/scene.h>
#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <assimp/Importer.hpp>
#include <charconv>
#include <new>
#include <set>
#include <stdexcept>

#include "geometry/base/error.h"
#include "geometry/base/zones.h"
#include "importers/input_file.h"

namespace Assimp {

void aiAssertViolation(const char* failedExpression, const char* file, int line);

/// Stands before the function of this name in libassimp, which calls abort(): an importer's assertion
/// becomes an exception, which assimp turns into its error string.
__attribute__((visibility("default"))) void aiAssertViolation(const char* failedExpression, const char*, int) {
  throw std::runtime_error(std::string("assimp: unexpected content (") + failedExpression + ")");
}

}  // namespace Assimp

namespace effuse::importers {

namespace fs = std::filesystem;

namespace {

/// "a b" of "a%20b": addresses in glTF and COLLADA write blanks and accents so, file names do not. assimp 5.2 takes them as they are.
std::string without_percents(std::string_view address) {
  std::string name;
  for (std::size_t k = 0; k < address.size(); ++k) {
    unsigned byte = 0;
    const bool coded = address[k] == '%' && k + 2 < address.size() &&
                       std::from_chars(address.data() + k + 1, address.data() + k + 3, byte, 16).ptr == address.data() + k + 3;
    name += coded ? static_cast<char>(byte) : address[k];
    if (coded) k += 2;
  }
  return name;
}

/// The file in memory under its own name; of others what the read may open.
class MemoryFile : public Assimp::DefaultIOSystem {
 public:
  void hold(const fs::path& file, const std::string& bytes) {
    name_ = file.string();
    folder_ = fs::absolute(file).lexically_normal().parent_path();
    bytes_ = &bytes;
    refused_.clear();
  }
  bool Exists(const char* file) const override { return file == name_ || !opened(file).empty(); }
  Assimp::IOStream* Open(const char* file, const char* mode) override {
    if (file == name_) return new Assimp::MemoryIOStream(reinterpret_cast<const std::uint8_t*>(bytes_->data()), bytes_->size());
    const std::string path = opened(file);
    return path.empty() ? nullptr : DefaultIOSystem::Open(path.c_str(), mode);
  }
  void Close(Assimp::IOStream* stream) override { delete stream; }
  /// Names that were there, and were not opened.
  const std::set<std::string>& refused() const { return refused_; }

 private:
  /// The path to open for a name; empty: none.
  std::string opened(const std::string& file) const {
    if (name_.empty()) return file;  // read_in_place: its caller has looked at every file
    for (const std::string& name : {file, without_percents(file)}) {
      if (name.find('\0') != std::string::npos) continue;
      std::error_code error;
      const fs::path path = fs::absolute(name, error).lexically_normal();
      const fs::file_status status = fs::status(path, error);
      if (!fs::exists(status) || fs::is_directory(status)) continue;
      const bool inside = std::mismatch(folder_.begin(), folder_.end(), path.begin(), path.end()).first == folder_.end();
      if (inside && fs::is_regular_file(status)) return name;
      if (refused_.size() < 100) refused_.insert(fmt::format("{} ({})", printable(utf8(name)), inside ? "no regular file" : "outside of its folder"));
    }
    return "";
  }

  std::string name_;
  fs::path folder_;
  const std::string* bytes_ = nullptr;
  mutable std::set<std::string> refused_;  // Exists(), const in assimp, finds them too
};

}  // namespace

struct AssimpReader::Impl {
  Assimp::Importer importer;
  MemoryFile* files = nullptr;  // owned by importer
};

AssimpReader::AssimpReader() : impl_(std::make_unique<Impl>()) {
  impl_->files = new MemoryFile;
  impl_->importer.SetIOHandler(impl_->files);
}

AssimpReader::~AssimpReader() = default;

void AssimpReader::add(Assimp::BaseImporter* importer, const std::string& extension) {
  std::unique_ptr<Assimp::BaseImporter> ours(importer);
  if (Assimp::BaseImporter* theirs = impl_->importer.GetImporter(extension.c_str())) {
    impl_->importer.UnregisterLoader(theirs);
    delete theirs;
  }
  impl_->importer.RegisterLoader(ours.release());
}

void AssimpReader::set_integer(const char* property, int value) { impl_->importer.SetPropertyInteger(property, value); }

bool AssimpReader::reads(const std::string& extension) const { return impl_->importer.IsExtensionSupported(extension.c_str()); }

namespace {
/// The scene that call returns, or an InputError with whatever went wrong.
template <class Call>
const aiScene& scene_or_error(const std::string& name, const Assimp::Importer& importer, const Call& call) {
  ZONE("import.assimp");
  std::string why;
  try {
    if (const aiScene* scene = call()) return *scene;
    why = importer.GetErrorString();
  } catch (const std::exception& error) {
    why = error.what();
  }
  // assimp, too, catches what the library throws for want of memory, and hands on its words.
  if (why.find("bad_alloc") != std::string::npos || why.find("_M_default_append") != std::string::npos || why.find("cannot create std::vector") != std::string::npos)
    throw InputError({name}, "asks for more memory than it may take: it is broken, or the limit is to be raised (--read-limit)");
  throw InputError({name}, printable(why));
}
}  // namespace

const aiScene& AssimpReader::read(const std::filesystem::path& file, const std::string& bytes, unsigned flags) {
  impl_->files->hold(file, bytes);
  try {
    return scene_or_error(file.string(), impl_->importer, [&] { return impl_->importer.ReadFile(file.string(), flags); });
  } catch (const InputError& error) {
    if (impl_->files->refused().empty()) throw;
    throw InputError({file.string()}, fmt::format("{}; it names files that are not opened: {}", error.faults().front().message, fmt::join(impl_->files->refused(), ", ")));
  }
}

std::vector<std::string> AssimpReader::refused() const { return {impl_->files->refused().begin(), impl_->files->refused().end()}; }

const aiScene& AssimpReader::read_in_place(const std::filesystem::path& file, unsigned flags) {
  return scene_or_error(file.string(), impl_->importer, [&] { return impl_->importer.ReadFile(file.string(), flags); });
}

const aiScene& AssimpReader::process(const std::string& name, unsigned flags) {
  return scene_or_error(name, impl_->importer, [&] { return impl_->importer.ApplyPostProcessing(flags); });
}

}  // namespace effuse::importers
