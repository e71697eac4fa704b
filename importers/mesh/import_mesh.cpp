#include "importers/mesh/import_mesh.h"

#include <assimp/mesh.h>
#include <assimp/postprocess.h>
#include <assimp/scene.h>
#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <memory>
#include <utility>

#include "geometry/base/error.h"
#include "geometry/base/zones.h"
#include "geometry/mesh/measure.h"
#include "geometry/mesh/weld.h"
#include "importers/assimp_reader.h"
#include "importers/input_file.h"
#include "importers/mesh/glb_attributes.h"
#include "importers/mesh/mesh_bytes.h"
#include "importers/mesh/ply_importer.h"
#include "importers/mesh/text_meshes.h"

namespace effuse::importers {

namespace fs = std::filesystem;

using geometry::TriMesh;
using geometry::VertexAttribute;

namespace {

constexpr std::uint64_t kMeshLimit = std::uint64_t{4} << 30;  // bytes
constexpr std::size_t kVertexLimit = 200'000'000;             // after all copies that nodes ask for

struct Placement {
  Mat3 linear = Mat3::Identity();
  Vec3 offset = Vec3::Zero();
};

Placement placement_of(const aiMatrix4x4& m) {
  Placement placement;
  placement.linear << m.a1, m.a2, m.a3, m.b1, m.b2, m.b3, m.c1, m.c2, m.c3;
  placement.offset = Vec3(m.a4, m.b4, m.c4);
  return placement;
}

/// Puts the scene's meshes together, each as often as nodes show it.
class Collector {
 public:
  Collector(const aiScene& scene, std::string name, bool colors_are_linear)
      : scene_(scene), name_(std::move(name)), colors_are_linear_(colors_are_linear) {}

  TriMesh mesh;
  std::size_t not_triangles = 0, placed = 0;

  /// What each mesh of the scene carries besides assimp's own, by its number; set before add().
  std::vector<std::map<std::string, VertexAttribute>> extra;

  void add(const aiNode& node, const Placement& parent) {
    // Without recursion: a chain of nodes may be long.
    std::vector<std::pair<const aiNode*, Placement>> stack = {{&node, parent}};
    while (!stack.empty()) {
      const auto [at, above] = stack.back();
      stack.pop_back();
      const Placement own = placement_of(at->mTransformation);
      const Placement here{above.linear * own.linear, above.linear * own.offset + above.offset};
      for (unsigned m = 0; m < at->mNumMeshes; ++m) add_mesh(at->mMeshes[m], here);
      for (unsigned c = at->mNumChildren; c-- > 0;) stack.emplace_back(at->mChildren[c], here);
    }
    if (!all_normals_) mesh.normals.clear();
    std::erase_if(mesh.attributes, [&](const auto& entry) {
      return entry.second.values.size() != mesh.positions.size() * static_cast<std::size_t>(entry.second.width);
    });
  }

 private:
  void add_mesh(unsigned number, const Placement& placement) {
    const aiMesh& from = *scene_.mMeshes[number];
    const std::size_t first = mesh.positions.size(), count = from.mNumVertices;
    if (first + count > kVertexLimit) throw InputError({name_}, fmt::format("has more than {} vertices", kVertexLimit));
    for (std::size_t v = 0; v < count; ++v) {
      const aiVector3D& x = from.mVertices[v];
      const Vec3 position = placement.linear * Vec3(x.x, x.y, x.z) + placement.offset;
      if (!position.allFinite()) throw InputError({name_}, fmt::format("vertex {} has a position that is not finite", first + v));
      mesh.positions.push_back(position);
    }

    // A mirroring transform turns triangles inside out: turn them back.
    const bool mirrored = placement.linear.determinant() < 0;
    for (unsigned f = 0; f < from.mNumFaces; ++f) {
      const aiFace& face = from.mFaces[f];
      if (face.mNumIndices != 3) {
        ++not_triangles;
        continue;
      }
      geometry::Triangle triangle;
      for (std::size_t c = 0; c < 3; ++c) {
        if (face.mIndices[c] >= count)
          throw InputError({name_}, fmt::format("a face names vertex {}, there are {}", face.mIndices[c], count));
        triangle[c] = static_cast<Index>(first + face.mIndices[c]);
      }
      if (mirrored) std::swap(triangle[1], triangle[2]);
      mesh.triangles.push_back(triangle);
    }

    if (from.mNormals && all_normals_) {
      const Mat3 turn = placement.linear.inverse().transpose();
      for (std::size_t v = 0; v < count; ++v)
        mesh.normals.push_back((turn * Vec3(from.mNormals[v].x, from.mNormals[v].y, from.mNormals[v].z)).normalized());
    } else {
      all_normals_ = false;
    }
    if (from.mColors[0]) {
      VertexAttribute& color = attribute("color", 3, first);
      for (std::size_t v = 0; v < count; ++v)
        for (float c : {from.mColors[0][v].r, from.mColors[0][v].g, from.mColors[0][v].b})
          color.values.push_back(colors_are_linear_ ? c : linear_from_srgb(c));
    }
    if (number < extra.size()) {
      for (const auto& [name, values] : extra[number]) {
        // An attribute that only some meshes carry does not stay: add() drops what has the wrong length.
        VertexAttribute& target = attribute(name, values.width, first);
        if (target.width == values.width) target.values.insert(target.values.end(), values.values.begin(), values.values.end());
      }
    }
    ++placed;
  }

  VertexAttribute& attribute(const std::string& name, int width, std::size_t first) {
    VertexAttribute& found = mesh.attributes[name];
    if (first == 0) found.width = width;
    return found;
  }

  const aiScene& scene_;
  std::string name_;
  bool colors_are_linear_;
  bool all_normals_ = true;
};

/// For each mesh of the scene, what its GLB primitive carries: found by name and number of vertices.
std::vector<std::map<std::string, VertexAttribute>> match_primitives(const aiScene& scene, std::vector<GlbPrimitive> primitives,
                                                                     std::vector<std::string>& notes) {
  std::vector<std::map<std::string, VertexAttribute>> extra(scene.mNumMeshes);
  if (std::all_of(primitives.begin(), primitives.end(), [](const GlbPrimitive& p) { return p.attributes.empty(); })) return extra;
  for (unsigned m = 0; m < scene.mNumMeshes; ++m) {
    const std::string name = scene.mMeshes[m]->mName.C_Str();
    const auto fits = [&](const GlbPrimitive& p) {
      return p.vertices == scene.mMeshes[m]->mNumVertices &&
             (primitives.size() == 1 || p.mesh_name.empty() || name.starts_with(p.mesh_name));
    };
    const auto found = std::find_if(primitives.begin(), primitives.end(), fits);
    const bool only = found != primitives.end() && std::find_if(found + 1, primitives.end(), fits) == primitives.end();
    if (only) {
      extra[m] = found->attributes;
    } else {
      notes.push_back(fmt::format("attributes of mesh {} could not be told from another's and were left out", quote(name)));
    }
  }
  return extra;
}

/// Drops normals and attributes that hold something not finite.
void drop_broken_values(TriMesh& mesh, std::vector<std::string>& notes) {
  if (!std::all_of(mesh.normals.begin(), mesh.normals.end(), [](const Vec3& n) { return n.allFinite(); })) {
    mesh.normals.clear();
    notes.push_back("normals are not finite everywhere: left out");
  }
  std::erase_if(mesh.attributes, [&](const auto& entry) {
    const auto& values = entry.second.values;
    if (std::all_of(values.begin(), values.end(), [](float x) { return std::isfinite(x); })) return false;
    notes.push_back(fmt::format("{} is not finite everywhere: left out", quote(entry.first)));
    return true;
  });
}

/// Welds, but keeps normals where all that coincide agree: readers of OBJ hand out three vertices a face.
geometry::WeldReport weld_keeping_normals(TriMesh& mesh) {
  bool smooth = !mesh.normals.empty();
  if (smooth) {
    const std::vector<Index> first = geometry::first_coincident(mesh.positions);
    constexpr Real kSame = 0.9999;  // cosine of 0.8 degrees: below what nine digits or a byte round
    for (std::size_t v = 0; v < first.size() && smooth; ++v) smooth = mesh.normals[v].dot(mesh.normals[first[v]]) > kSame;
  }
  const std::string kept = "\x01normals";  // a name no file has
  if (smooth) {
    VertexAttribute& copy = mesh.attributes[kept];
    copy.width = 3;
    for (const Vec3& n : mesh.normals)
      for (int c = 0; c < 3; ++c) copy.values.push_back(static_cast<float>(n[c]));
  }
  const geometry::WeldReport report = geometry::weld(mesh);
  if (smooth) {
    const std::vector<float>& values = mesh.attributes.at(kept).values;
    if (mesh.normals.empty())
      for (std::size_t v = 0; v < mesh.positions.size(); ++v)
        mesh.normals.push_back(Vec3(values[3 * v], values[3 * v + 1], values[3 * v + 2]).normalized());
    mesh.attributes.erase(kept);
  }
  return report;
}

MeshCheck check(const std::string& extension, const std::string& bytes, const std::string& name) {
  if (extension == ".obj") return check_obj(bytes, name);
  if (extension == ".stl") return check_stl(bytes, name);
  if (extension == ".off") return check_off(bytes, name);
  if (extension == ".gltf") check_gltf_json(bytes, name);
  return {};
}

/// What a scene's faces come to.
struct FaceCount {
  std::size_t faces = 0, polygons = 0, triangles = 0;
  std::size_t expected = 0;  ///< triangles once every polygon is cut
};

FaceCount count_faces(const aiScene& scene, const std::string& name) {
  FaceCount count;
  for (unsigned m = 0; m < scene.mNumMeshes; ++m) {
    for (unsigned f = 0; f < scene.mMeshes[m]->mNumFaces; ++f) {
      const std::size_t corners = scene.mMeshes[m]->mFaces[f].mNumIndices;
      if (corners > kMaxCorners) throw InputError({name}, fmt::format("a face with {} corners, at most {} are read", corners, kMaxCorners));
      ++count.faces;
      count.polygons += corners > 3;
      count.triangles += corners == 3;
      count.expected += corners >= 3 ? corners - 2 : 0;
    }
  }
  return count;
}

void check_finite(const aiScene& scene, const std::string& name) {
  for (unsigned m = 0; m < scene.mNumMeshes; ++m)
    for (unsigned v = 0; v < scene.mMeshes[m]->mNumVertices; ++v) {
      const aiVector3D& x = scene.mMeshes[m]->mVertices[v];
      if (!std::isfinite(x.x) || !std::isfinite(x.y) || !std::isfinite(x.z))
        throw InputError({name}, fmt::format("vertex {} has a position that is not finite", v));
    }
}

/// Exact positions and all attributes of a PLY file, for which assimp's scene has no room.
void take_over(PlyMesh ply, MeshImport& import, const std::string& name) {
  if (ply.positions.size() != import.mesh.positions.size()) throw InputError({name}, "was not read as a whole");
  import.mesh.positions = std::move(ply.positions);
  import.mesh.normals = std::move(ply.normals);
  import.mesh.attributes = std::move(ply.attributes);
  import.notes.insert(import.notes.end(), ply.notes.begin(), ply.notes.end());
  for (Vec3& n : import.mesh.normals)
    if (n.norm() > 0) n.normalize();
}

/// Welds, and notes what went.
void clean(MeshImport& import, const std::string& name) {
  drop_broken_values(import.mesh, import.notes);
  const geometry::WeldReport welded = weld_keeping_normals(import.mesh);
  if (welded.merged_vertices > 0)
    import.notes.push_back(fmt::format("{} vertices welded to others at the same place", welded.merged_vertices));
  if (welded.dropped_triangles > 0)
    import.notes.push_back(fmt::format("{} triangles dropped: two corners at the same place", welded.dropped_triangles));
  if (import.mesh.triangles.empty()) throw InputError({name}, "holds no triangles: all collapse to edges or points");
}

/// What a COLLADA file says of up and unit. assimp has turned and scaled by them already: y up, metres.
MeshFrame frame_of_collada(std::string_view text) {
  MeshFrame frame;
  frame.source = "COLLADA's asset";
  frame.up = UpAxis::kY;
  frame.metres_per_unit = 1;
  if (text.find("<unit") == std::string_view::npos) frame.source = "COLLADA's standard";
  return frame;
}

/// FBX says which axis is up and how many centimetres its unit has. One that points down says nothing of up.
MeshFrame frame_of_fbx(const aiScene& scene) {
  MeshFrame frame;
  if (!scene.mMetaData) return frame;
  std::int32_t up = -1, sign = 1;
  double factor = 0;
  float factor_f = 0;
  scene.mMetaData->Get("UpAxisSign", sign);
  if (scene.mMetaData->Get("UpAxis", up) && up >= 0 && up <= 2 && sign > 0) frame.up = static_cast<UpAxis>(up + 1);
  if (!scene.mMetaData->Get("UnitScaleFactor", factor) && scene.mMetaData->Get("UnitScaleFactor", factor_f)) factor = factor_f;
  if (std::isfinite(factor) && factor > 0) frame.metres_per_unit = 0.01 * factor;
  frame.source = "FBX's header";
  return frame;
}

MeshFrame frame_of(const std::string& extension, std::string_view bytes, const aiScene& scene) {
  MeshFrame own = frame_of_own_file(bytes, extension);
  if (!own.source.empty()) return own;
  if (extension == ".glb" || extension == ".gltf") own = {UpAxis::kY, 1, Vec3::Zero(), "", "glTF's standard"};
  else if (extension == ".x3d" || extension == ".x3db" || extension == ".wrl") own = {UpAxis::kY, 1, Vec3::Zero(), "", "X3D's standard"};
  else if (extension == ".3ds") own = {UpAxis::kY, 0, Vec3::Zero(), "", "assimp's reader of 3DS"};
  else if (extension == ".dae") own = frame_of_collada(bytes);
  else if (extension == ".fbx") own = frame_of_fbx(scene);
  return own;
}

/// Into metres and z up, as the caller or the file says.
void place(MeshImport& import, const MeshOptions& options) {
  const MeshFrame& frame = import.frame;
  const UpAxis up = options.up != UpAxis::kUnknown ? options.up : frame.up;
  if (options.up != UpAxis::kUnknown && frame.up != UpAxis::kUnknown && options.up != frame.up)
    import.notes.push_back(fmt::format("{} says that {} is up; {} is taken, as asked", frame.source, name_of(frame.up), name_of(options.up)));
  if (up == UpAxis::kX || up == UpAxis::kY) {
    turn_up(import.mesh, up);
    import.notes.push_back(fmt::format("turned from {} up to z up{}", name_of(up), options.up != UpAxis::kUnknown ? ", as asked" : ""));
  }
  const Real scale = options.metres_per_unit > 0 ? options.metres_per_unit : frame.metres_per_unit > 0 ? frame.metres_per_unit : 1;
  if (options.metres_per_unit > 0 && frame.metres_per_unit > 0 && options.metres_per_unit != frame.metres_per_unit)
    import.notes.push_back(fmt::format("{} says that its unit is {:g} m; {:g} m is taken, as asked", frame.source, frame.metres_per_unit, scale));
  if (scale == 1) return;
  for (Vec3& p : import.mesh.positions) p *= scale;
  import.notes.push_back(fmt::format("scaled from a unit of {:g} m to metres{}", scale, options.metres_per_unit > 0 ? ", as asked" : ""));
}

MeshImport read_mesh(const fs::path& file, const MeshOptions& options) {
  const std::string name = file.string(), extension = lower_extension(file);
  const std::string bytes = read_input(file, kMeshLimit, "a mesh");

  // Looks over the file come first: they are quick, assimp takes milliseconds to start.
  MeshImport import;
  std::vector<std::string>& notes = import.notes;
  MeshCheck checked = check(extension, bytes, name);
  notes = std::move(checked.notes);
  std::vector<GlbPrimitive> primitives;
  if (extension == ".glb") {
    primitives = read_glb_primitives(bytes, name, notes);
    if (std::string aligned = aligned_glb(bytes); !aligned.empty()) checked.rewritten = std::move(aligned);
  }

  const auto ply = std::make_shared<PlyResult>();
  AssimpReader reader;
  reader.add(make_ply_importer(ply), "ply");
  if (extension == ".prj" && bytes.find_first_of("[") < 20)
    throw InputError({name}, "is the coordinate system of the grid of the same name: give that one");
  if (extension == ".xyz" || extension == ".csv" || extension == ".txt" || extension == ".dat")
    throw InputError({name}, "is no grid of heights: it begins neither with places, x y z, one a line, nor with the header of an ESRI ASCII grid");
  if (extension.empty() || !reader.reads(extension))
    throw InputError({name},
                     fmt::format("there is no reader for files ending in '{}'; meshes: .obj .ply .stl .off .glb .gltf .dae and more, "
                                 "terrain grids: .tif .asc .hgt .dem .flt .xyz .nc and more",
                                 printable(extension, 20)));

  // Read; positions are looked at before anything computes with them.
  const aiScene* scene = nullptr;
  try {
    scene = &reader.read(file, checked.rewritten ? *checked.rewritten : bytes, aiProcess_ValidateDataStructure);
  } catch (const InputError&) {
    if (ply->fault) std::rethrow_exception(ply->fault);
    throw;
  }
  for (const std::string& other : reader.refused()) notes.push_back("names a file that was not opened: " + other);
  check_finite(*scene, name);
  const FaceCount read = count_faces(*scene, name);
  scene = &reader.process(name, aiProcess_Triangulate);
  const FaceCount cut = count_faces(*scene, name);

  // All meshes as one, in our frame.
  Collector collector(*scene, name, extension == ".glb" || extension == ".gltf");
  collector.extra = match_primitives(*scene, std::move(primitives), notes);
  if (scene->mRootNode) collector.add(*scene->mRootNode, Placement{});
  import.mesh = std::move(collector.mesh);
  if (extension == ".ply") take_over(std::move(ply->mesh), import, name);
  for (Vec3& x : import.mesh.positions) x += checked.origin;
  if (import.mesh.triangles.empty()) throw InputError({name}, "holds no triangles");

  // What was done, one line each.
  const bool moved = checked.origin != Vec3::Zero();
  import.frame = frame_of(extension, bytes, *scene);
  place(import, options);
  if (moved)
    notes.push_back(fmt::format("read relative to ({:.0f}, {:.0f}, {:.0f}), so that map coordinates keep their digits", checked.origin.x(),
                                checked.origin.y(), checked.origin.z()));
  if (collector.placed > 1) notes.push_back(fmt::format("{} meshes joined", collector.placed));
  if (collector.not_triangles > 0) notes.push_back(fmt::format("{} points and lines left out", collector.not_triangles));
  if (checked.faces && read.faces < *checked.faces)
    notes.push_back(fmt::format("{} faces of {} were lost", *checked.faces - read.faces, *checked.faces));
  if (read.polygons > 0) notes.push_back(fmt::format("{} polygons cut into triangles", read.polygons));
  if (cut.triangles != read.expected)
    notes.push_back(fmt::format("polygons gave {} triangles in place of {}: some cross themselves", cut.triangles, read.expected));
  clean(import, name);
  const Box3 box = geometry::bounds(import.mesh);
  const Real far = std::max(box.min().cwiseAbs().maxCoeff(), box.max().cwiseAbs().maxCoeff()), size = box.sizes().maxCoeff();
  if (std::max(far, import.frame.origin.cwiseAbs().maxCoeff()) > kFarthest || size < kFinest)
    throw InputError({name}, fmt::format("is {:.3g} m large and reaches {:.3g} m from its origin, which is nothing on a planet: its numbers or their unit are wrong", size, std::max(far, import.frame.origin.cwiseAbs().maxCoeff())));
  if (extension != ".ply" && !moved && far > 8192)
    notes.push_back(fmt::format("coordinates reach {:.6g}: as floats they come in steps of {:.3g}", far, far * std::pow(2.0, -23)));
  return import;
}

}  // namespace

MeshImport import_mesh(const fs::path& file, const MeshOptions& options) {
  ZONE("import.mesh");
  if (!options.limits.apart) return read_mesh(file, options);
  return mesh_of_bytes(read_apart(file, options.limits, [&] { return bytes_of_mesh(read_mesh(file, options)); }), file.string());
}

std::vector<std::string> guesses(const MeshImport& import, const MeshOptions& options) {
  std::vector<std::string> lines;
  const Real size = geometry::bounds(import.mesh).sizes().maxCoeff();
  if (import.frame.metres_per_unit == 0 && options.metres_per_unit == 0)
    lines.push_back(fmt::format("warning: the file names no unit: metres are assumed, {:.4g} m across; in millimetres it would be {:.4g} m, in feet {:.4g} m (unit)", size, size / 1000, size * 0.3048));
  if (import.frame.up == UpAxis::kUnknown && options.up == UpAxis::kUnknown) lines.push_back("warning: the file does not say which axis is up: z is assumed (up)");
  return lines;
}

}  // namespace effuse::importers
