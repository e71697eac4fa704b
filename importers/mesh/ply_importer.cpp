#include "importers/mesh/ply_importer.h"

#include <assimp/BaseImporter.h>
#include <assimp/importerdesc.h>
#include <assimp/scene.h>

#include <assimp/IOStream.hpp>
#include <assimp/IOSystem.hpp>
#include <stdexcept>
#include <string>

#include "geometry/base/error.h"

namespace effuse::importers {

namespace {

class PlyImporter final : public Assimp::BaseImporter {
 public:
  explicit PlyImporter(std::shared_ptr<PlyResult> result) : result_(std::move(result)) {}

  bool CanRead(const std::string& file, Assimp::IOSystem* files, bool check_signature) const override {
    if (!check_signature || !files) return SimpleExtensionCheck(file, "ply");
    const std::string start = read(*files, file, 4);
    return start == "ply\n" || start == "ply\r";
  }

  const aiImporterDesc* GetInfo() const override {
    static constexpr aiImporterDesc kDescription = {"effuse PLY importer",
                                                    "effuse",
                                                    "",
                                                    "",
                                                    aiImporterFlags_SupportTextFlavour | aiImporterFlags_SupportBinaryFlavour,
                                                    0,
                                                    0,
                                                    0,
                                                    0,
                                                    "ply"};
    return &kDescription;
  }

 protected:
  void InternReadFile(const std::string& file, aiScene* scene, Assimp::IOSystem* files) override {
    try {
      PlyMesh mesh = parse_ply(read(*files, file, std::string::npos), file);
      if (mesh.corners.empty()) throw InputError({file}, "holds no triangles");
      fill(*scene, mesh);
      if (result_) result_->mesh = std::move(mesh);
    } catch (const InputError& error) {
      if (result_) result_->fault = std::current_exception();
      throw std::runtime_error(error.what());
    }
  }

 private:
  static std::string read(Assimp::IOSystem& files, const std::string& name, std::size_t limit) {
    const std::unique_ptr<Assimp::IOStream> stream(files.Open(name, "rb"));
    if (!stream) return "";
    std::string bytes(std::min(stream->FileSize(), limit), '\0');
    if (!bytes.empty()) bytes.resize(stream->Read(bytes.data(), 1, bytes.size()));
    return bytes;
  }

  static void fill(aiScene& scene, const PlyMesh& from) {
    Box3 box;
    for (const Vec3& x : from.positions) box.extend(x);
    const Vec3 middle = box.center();
    auto mesh = std::make_unique<aiMesh>();
    mesh->mNumVertices = static_cast<unsigned>(from.positions.size());
    mesh->mVertices = new aiVector3D[from.positions.size()];
    for (std::size_t v = 0; v < from.positions.size(); ++v) {
      const Eigen::Vector3f local = (from.positions[v] - middle).cast<float>();
      mesh->mVertices[v] = aiVector3D(local.x(), local.y(), local.z());
    }
    mesh->mNumFaces = static_cast<unsigned>(from.face_start.size() - 1);
    mesh->mFaces = new aiFace[mesh->mNumFaces];
    for (unsigned f = 0; f < mesh->mNumFaces; ++f) {
      const std::size_t start = from.face_start[f], count = from.face_start[f + 1] - start;
      mesh->mFaces[f].mNumIndices = static_cast<unsigned>(count);
      mesh->mFaces[f].mIndices = new unsigned[count];
      std::copy_n(from.corners.begin() + static_cast<std::ptrdiff_t>(start), count, mesh->mFaces[f].mIndices);
      mesh->mPrimitiveTypes |= static_cast<unsigned>(count == 3 ? aiPrimitiveType_TRIANGLE : aiPrimitiveType_POLYGON);
    }
    scene.mMaterials = new aiMaterial* [1] { new aiMaterial };
    scene.mNumMaterials = 1;
    scene.mMeshes = new aiMesh* [1] { mesh.release() };
    scene.mNumMeshes = 1;
    scene.mRootNode = new aiNode("ply");
    scene.mRootNode->mMeshes = new unsigned[1]{0};
    scene.mRootNode->mNumMeshes = 1;
  }

  std::shared_ptr<PlyResult> result_;
};

}  // namespace

Assimp::BaseImporter* make_ply_importer(std::shared_ptr<PlyResult> result) { return new PlyImporter(std::move(result)); }

}  // namespace effuse::importers
