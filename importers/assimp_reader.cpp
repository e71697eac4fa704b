#include "importers/assimp_reader.h"

#include <assimp/BaseImporter.h>
#include <assimp/DefaultIOSystem.h>
#include <assimp/MemoryIOWrapper.h>
#include <assimp/scene.h>

#include <assimp/Importer.hpp>
#include <new>
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

namespace {

/// The file in memory under its own name, everything else from the disk.
class MemoryFile : public Assimp::DefaultIOSystem {
 public:
  void hold(std::string name, const std::string& bytes) {
    name_ = std::move(name);
    bytes_ = &bytes;
  }
  bool Exists(const char* file) const override { return file == name_ || DefaultIOSystem::Exists(file); }
  Assimp::IOStream* Open(const char* file, const char* mode) override {
    if (file != name_) return DefaultIOSystem::Open(file, mode);
    return new Assimp::MemoryIOStream(reinterpret_cast<const std::uint8_t*>(bytes_->data()), bytes_->size());
  }
  void Close(Assimp::IOStream* stream) override { delete stream; }

 private:
  std::string name_;
  const std::string* bytes_ = nullptr;
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
  try {
    if (const aiScene* scene = call()) return *scene;
  } catch (const std::bad_alloc&) {
    throw InputError({name}, "asks for more memory than there is");
  } catch (const std::exception& error) {
    throw InputError({name}, printable(error.what()));
  }
  throw InputError({name}, printable(importer.GetErrorString()));
}
}  // namespace

const aiScene& AssimpReader::read(const std::filesystem::path& file, const std::string& bytes, unsigned flags) {
  impl_->files->hold(file.string(), bytes);
  return scene_or_error(file.string(), impl_->importer, [&] { return impl_->importer.ReadFile(file.string(), flags); });
}

const aiScene& AssimpReader::read_in_place(const std::filesystem::path& file, unsigned flags) {
  return scene_or_error(file.string(), impl_->importer, [&] { return impl_->importer.ReadFile(file.string(), flags); });
}

const aiScene& AssimpReader::process(const std::string& name, unsigned flags) {
  return scene_or_error(name, impl_->importer, [&] { return impl_->importer.ApplyPostProcessing(flags); });
}

}  // namespace effuse::importers
