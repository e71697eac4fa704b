// Files that a mesh names: buffers, materials. They come from whoever made the mesh.

#include <fmt/format.h>
#include <fmt/ranges.h>
#include <gtest/gtest.h>
#include <sys/stat.h>

#include <cstring>

#include "importers/mesh/import_mesh.h"
#include "tests/importers/test_files.h"

namespace effuse::importers {
namespace {

namespace fs = std::filesystem;

/// One triangle, its positions in another file.
std::string gltf_with(const std::string& address) {
  return fmt::format(R"({{"asset":{{"version":"2.0"}},"scene":0,"scenes":[{{"nodes":[0]}}],"nodes":[{{"mesh":0}}],)"
                     R"("meshes":[{{"primitives":[{{"attributes":{{"POSITION":0}}}}]}}],)"
                     R"("accessors":[{{"bufferView":0,"componentType":5126,"count":3,"type":"VEC3","min":[0,0,0],"max":[1,1,0]}}],)"
                     R"("bufferViews":[{{"buffer":0,"byteLength":36}}],"buffers":[{{"byteLength":36,"uri":"{}"}}]}})",
                     address);
}

std::string positions() {
  const float x[9] = {0, 0, 0, 1, 0, 0, 0, 1, 0};
  std::string bytes(sizeof x, '\0');
  std::memcpy(bytes.data(), x, sizeof x);
  return bytes;
}

class CompanionFiles : public testing::Test {
 protected:
  CompanionFiles() {
    fs::create_directories(home_ / "below");
    folder_.write("secret.bin", positions());
    folder_.write("home/own.bin", positions());
    folder_.write("home/below/own.bin", positions());
    folder_.write("home/a b \u00e4.bin", positions());
  }
  std::string refused(const std::string& address) const {
    const fs::path file = folder_.write("home/mesh.gltf", gltf_with(address));
    return refusal([&] { import_mesh(file); });
  }
  std::size_t triangles(const std::string& address) const { return import_mesh(folder_.write("home/mesh.gltf", gltf_with(address))).mesh.triangles.size(); }

  const TestFolder folder_;
  const fs::path home_ = folder_.path() / "home";
};

TEST_F(CompanionFiles, AreOpenedBesideTheMeshAndBelow) {
  for (const char* address : {"own.bin", "./own.bin", "below/own.bin", "below/../own.bin"}) EXPECT_EQ(triangles(address), 1u) << address;
  fs::create_symlink(folder_.path() / "secret.bin", home_ / "link.bin");
  EXPECT_EQ(triangles("link.bin"), 1u) << "its owner made the link";
}

TEST_F(CompanionFiles, AreFoundByAddressesWithCodedCharacters) {
  for (const char* address : {"a%20b%20%C3%A4.bin", "a%20b%20%c3%a4.bin", "a b \u00e4.bin"}) EXPECT_EQ(triangles(address), 1u) << address;
  EXPECT_NE(refused("a%2.bin"), "");
  EXPECT_NE(refused("own.bin%"), "");
  EXPECT_NE(refused("own.bin%00"), "");
}

TEST_F(CompanionFiles, ElsewhereAreNotOpened) {
  for (const std::string& address : {std::string("../secret.bin"), std::string("below/../../secret.bin"), std::string("%2E%2E/secret.bin"), std::string("../home.bin/../secret.bin"), std::string("../../../../../../../../../../etc/passwd")}) {
    const std::string why = refused(address);
    EXPECT_TRUE(contains(why, "mesh.gltf") && contains(why, "outside of its folder")) << address << ": " << why;
  }
}

TEST_F(CompanionFiles, ThatNeverEndAreNotOpened) {
  ASSERT_EQ(::mkfifo((home_ / "pipe").c_str(), 0600), 0);
  const std::string why = refused("pipe");
  EXPECT_TRUE(contains(why, "pipe (no regular file)")) << why;
  // A mesh does without its materials.
  const MeshImport box = import_mesh(folder_.write("home/mesh.obj", "mtllib pipe\nmtllib ../secret.bin\nusemtl a\nv 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n"));
  EXPECT_EQ(box.mesh.triangles.size(), 1u);
  const std::string notes = fmt::format("{}", fmt::join(box.notes, "\n"));
  EXPECT_TRUE(contains(notes, "not opened") && contains(notes, "pipe")) << notes;
}

/// Whole numbers for positions, and packed buffers: read as floats they would be a mesh of noise.
TEST_F(CompanionFiles, OfPackedMeshesAreNotTakenForFloats) {
  std::string quantized = gltf_with("own.bin");
  quantized.replace(quantized.find("5126"), 4, "5122");
  EXPECT_TRUE(contains(refusal([&] { import_mesh(folder_.write("home/q.gltf", quantized)); }), "no floats"));
  for (const char* extension : {"KHR_mesh_quantization", "EXT_meshopt_compression", "EXT_unheard_of"}) {
    std::string packed = gltf_with("own.bin");
    packed.insert(1, fmt::format(R"("extensionsRequired":["{}"],)", extension));
    const std::string why = refusal([&] { import_mesh(folder_.write("home/q.gltf", packed)); });
    EXPECT_TRUE(contains(why, extension) && contains(why, "q.gltf")) << why;
  }
  std::string lit = gltf_with("own.bin");
  lit.insert(1, R"("extensionsRequired":["KHR_materials_unlit","KHR_texture_transform"],)");
  EXPECT_EQ(import_mesh(folder_.write("home/lit.gltf", lit)).mesh.triangles.size(), 1u);
}

}  // namespace
}  // namespace effuse::importers
