#include "importers/terrain/dem_importer.h"

#include <assimp/BaseImporter.h>
#include <assimp/importerdesc.h>
#include <assimp/scene.h>

#include <algorithm>
#include <assimp/IOStream.hpp>
#include <assimp/IOSystem.hpp>
#include <assimp/Importer.hpp>
#include <cmath>
#include <limits>
#include <stdexcept>
#include <string>
#include <vector>

#include "geometry/base/check.h"
#include "geometry/base/error.h"
#include "geometry/base/state_io.h"
#include "importers/assimp_reader.h"
#include "importers/input_file.h"
#include "importers/terrain/esri_ascii.h"
#include "importers/terrain/gdal_raster.h"
#include "importers/terrain/import_dem.h"
#include "importers/terrain/xyz_grid.h"

namespace effuse::importers {

namespace {

std::string read_stream(Assimp::IOSystem& files, const std::string& name, std::size_t limit) {
  const std::unique_ptr<Assimp::IOStream, void (*)(Assimp::IOStream*)> stream(files.Open(name, "rb"),
                                                                              [](Assimp::IOStream* s) { delete s; });
  if (!stream) throw InputError({name}, "cannot be opened");
  std::string bytes(std::min(stream->FileSize(), limit), '\0');
  if (!bytes.empty() && stream->Read(bytes.data(), 1, bytes.size()) != bytes.size()) throw InputError({name}, "cannot be read to its end");
  return bytes;
}

/// Every stride-th post and the last of each row and column, so that the whole area stays covered.
std::vector<int> chosen_posts(int n, int stride) {
  std::vector<int> posts;
  for (int i = 0; i < n - 1; i += stride) posts.push_back(i);
  posts.push_back(n - 1);
  return posts;
}

/// The grid as assimp's mesh; without faces when the chosen posts have too many holes.
std::unique_ptr<aiMesh> make_mesh(const DemGrid& grid, int stride) {
  const std::vector<int> columns = chosen_posts(grid.nx, stride), rows = chosen_posts(grid.ny, stride);
  const auto height = [&](std::size_t c, std::size_t r) {
    return grid.z[static_cast<std::size_t>(rows[r]) * static_cast<std::size_t>(grid.nx) + static_cast<std::size_t>(columns[c])];
  };
  constexpr unsigned kNone = ~0u;
  std::vector<unsigned> number(columns.size() * rows.size(), kNone);
  std::vector<aiVector3D> positions;
  std::vector<std::array<unsigned, 3>> triangles;
  const auto vertex = [&](std::size_t c, std::size_t r) {
    unsigned& known = number[r * columns.size() + c];
    if (known == kNone) {
      known = static_cast<unsigned>(positions.size());
      positions.emplace_back(static_cast<float>(columns[c] * grid.spacing.x()), static_cast<float>(rows[r] * grid.spacing.y()),
                             static_cast<float>(height(c, r)));
    }
    return known;
  };
  for (std::size_t r = 0; r + 1 < rows.size(); ++r) {
    for (std::size_t c = 0; c + 1 < columns.size(); ++c) {
      if (std::isnan(height(c, r) + height(c + 1, r) + height(c, r + 1) + height(c + 1, r + 1))) continue;
      const unsigned sw = vertex(c, r), se = vertex(c + 1, r), nw = vertex(c, r + 1), ne = vertex(c + 1, r + 1);
      triangles.push_back({sw, se, ne});
      triangles.push_back({sw, ne, nw});
    }
  }
  auto mesh = std::make_unique<aiMesh>();
  mesh->mName.Set("terrain");
  mesh->mPrimitiveTypes = aiPrimitiveType_TRIANGLE;
  mesh->mNumVertices = static_cast<unsigned>(positions.size());
  mesh->mVertices = new aiVector3D[positions.size()];
  std::copy(positions.begin(), positions.end(), mesh->mVertices);
  mesh->mNumFaces = static_cast<unsigned>(triangles.size());
  mesh->mFaces = new aiFace[triangles.size()];
  for (std::size_t t = 0; t < triangles.size(); ++t) {
    mesh->mFaces[t].mNumIndices = 3;
    mesh->mFaces[t].mIndices = new unsigned[3]{triangles[t][0], triangles[t][1], triangles[t][2]};
  }
  return mesh;
}

class DemImporter final : public Assimp::BaseImporter {
 public:
  explicit DemImporter(std::shared_ptr<DemResult> result, DemRequest request) : result_(std::move(result)), request_(std::move(request)) {
    extensions_ = std::string("asc xyz ") + gdal_extensions();
    description_ = {"effuse importer of elevation grids", "effuse", "", "", aiImporterFlags_SupportTextFlavour | aiImporterFlags_SupportBinaryFlavour, 0, 0, 0, 0, extensions_.c_str()};
  }

  bool CanRead(const std::string& file, Assimp::IOSystem* files, bool check_signature) const override {
    const std::string extension = lower_extension(file);
    if (extension == ".asc" || extension == ".xyz" || gdal_reads(extension)) return true;
    if (!check_signature || !files) return false;
    try {
      const std::string start = read_stream(*files, file, 512);
      return looks_like_esri_ascii(start) || looks_like_tiff(start) || looks_like_xyz(start);
    } catch (const InputError&) {
      return false;
    }
  }

  const aiImporterDesc* GetInfo() const override { return &description_; }

  void SetupProperties(const Assimp::Importer* importer) override {
    stride_ = std::max(0, importer->GetPropertyInteger("EFFUSE_DEM_STRIDE", 0));
  }

 protected:
  void InternReadFile(const std::string& file, aiScene* scene, Assimp::IOSystem* files) override {
    try {
      std::vector<std::filesystem::path> all = {file};
      all.insert(all.end(), request_.more.begin(), request_.more.end());
      const auto read_text = [&](const std::filesystem::path& path) { return read_stream(*files, path.string(), std::string::npos); };
      DemGrid grid = place_dem(all, request_.options, read_text);
      fill(*scene, grid);
      if (result_) result_->grid = std::move(grid);
    } catch (const InputError& error) {
      if (result_) result_->fault = std::current_exception();
      throw std::runtime_error(error.what());
    }
  }

 private:
  void fill(aiScene& scene, const DemGrid& grid) const {
    constexpr int kOverviewPosts = 256;
    const int stride = stride_ > 0 ? stride_ : std::max(1, std::max(grid.nx, grid.ny) / kOverviewPosts);
    std::unique_ptr<aiMesh> mesh = make_mesh(grid, stride);
    if (mesh->mNumFaces == 0) mesh = make_mesh(grid, 1);  // a coarse net may catch nothing but holes
    scene.mMaterials = new aiMaterial* [1] { new aiMaterial };
    scene.mNumMaterials = 1;
    scene.mMeshes = new aiMesh* [1] { mesh.release() };
    scene.mNumMeshes = 1;
    scene.mRootNode = new aiNode("terrain");
    scene.mRootNode->mMeshes = new unsigned[1]{0};
    scene.mRootNode->mNumMeshes = 1;
    scene.mMetaData = aiMetadata::Alloc(5);
    scene.mMetaData->Set(0, "origin_x", grid.corner.x());
    scene.mMetaData->Set(1, "origin_y", grid.corner.y());
    scene.mMetaData->Set(2, "cell_x", grid.spacing.x());
    scene.mMetaData->Set(3, "cell_y", grid.spacing.y());
    scene.mMetaData->Set(4, "crs", aiString(grid.crs.substr(0, 1000)));
  }

  std::shared_ptr<DemResult> result_;
  DemRequest request_;
  std::string extensions_;
  aiImporterDesc description_ = {};
  int stride_ = 0;
};

}  // namespace

Assimp::BaseImporter* make_dem_importer(std::shared_ptr<DemResult> result, DemRequest request) { return new DemImporter(std::move(result), std::move(request)); }

namespace {

DemGrid read_dem(const std::vector<std::filesystem::path>& files, const DemOptions& options) {
  // Texts are held in memory; of rasters only what is asked for.
  constexpr std::uint64_t kLargestText = std::uint64_t{8} << 30;
  for (const std::filesystem::path& file : files) check_input(file, lower_extension(file) == ".asc" || lower_extension(file) == ".xyz" ? kLargestText : std::numeric_limits<std::uint64_t>::max(), "a terrain");
  const auto result = std::make_shared<DemResult>();
  AssimpReader reader;
  // The ending tells assimp who reads: a grid under another name is one all the same.
  std::string extension = lower_extension(files.front());
  if (extension.empty()) extension = ".";
  reader.add(make_dem_importer(result, {options, {files.begin() + 1, files.end()}}), extension.substr(1));
  try {
    reader.read_in_place(files.front(), 0);
  } catch (const InputError&) {
    if (!result->fault) throw;
  }
  if (result->fault) std::rethrow_exception(result->fault);
  return std::move(result->grid);
}

std::string bytes_of_grid(const DemGrid& grid) {
  StateWriter out;
  out.array("place", std::vector<Real>{grid.corner.x(), grid.corner.y(), grid.spacing.x(), grid.spacing.y()});
  out.value("nx", grid.nx);
  out.value("ny", grid.ny);
  out.array("z", grid.z);
  out.value("nodata", std::uint64_t{grid.nodata});
  out.text("format", grid.format);
  out.text("crs", grid.crs);
  out.value("notes", std::uint64_t{grid.notes.size()});
  for (const std::string& note : grid.notes) out.text("note", note);
  return out.bytes();
}

DemGrid grid_of_bytes(const std::string& bytes, const std::string& name) {
  // The bytes come from a process that has met a broken file: nothing in them is believed.
  StateReader in(bytes, name);
  DemGrid grid;
  std::vector<Real> place;
  in.array("place", place);
  in.value("nx", grid.nx);
  in.value("ny", grid.ny);
  in.array("z", grid.z);
  std::uint64_t count = 0;
  in.value("nodata", count);
  grid.nodata = count;
  in.text("format", grid.format);
  in.text("crs", grid.crs);
  in.value("notes", count);
  for (std::uint64_t k = 0; k < count; ++k) {
    std::string note;
    in.text("note", note);
    grid.notes.push_back(std::move(note));
  }
  const bool whole = place.size() == 4 && grid.nx >= 2 && grid.ny >= 2 && grid.z.size() == static_cast<std::size_t>(grid.nx) * static_cast<std::size_t>(grid.ny);
  if (!whole) throw InputError({name}, "was not read as a whole");
  grid.corner = Vec2(place[0], place[1]);
  grid.spacing = Vec2(place[2], place[3]);
  return grid;
}

}  // namespace

DemGrid import_dem(const std::vector<std::filesystem::path>& files, const DemOptions& options) {
  CHECK(!files.empty());
  if (!options.limits.apart) return read_dem(files, options);
  ReadLimits limits = options.limits;
  std::uint64_t bytes = 0;
  for (const std::filesystem::path& file : files) {
    std::error_code ignored;
    const std::uintmax_t size = std::filesystem::file_size(file, ignored);
    if (!ignored) bytes += size;
  }
  // A grid is held a few times over while it is placed and handed back; a compressed file may hold as many posts as are allowed.
  constexpr std::uint64_t kBytesPerPost = 48;
  if (limits.bytes == 0) limits.bytes = (std::uint64_t{768} << 20) + 8 * bytes + kBytesPerPost * std::min(options.max_posts, std::uint64_t{1} << 32);
  if (limits.seconds == 0) limits.seconds = 60 + static_cast<double>(bytes) / 2e6;
  return grid_of_bytes(read_apart(files.front(), limits, [&] { return bytes_of_grid(read_dem(files, options)); }), files.front().string());
}

}  // namespace effuse::importers
