// Every file of the shared mesh folders: what SOURCES.md says of it comes out of import and repair, or the refusal; and what it costs,
// read in a process of its own as the program reads it.

#include <fmt/format.h>
#include <fmt/ranges.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <set>

#include "geometry/mesh/measure.h"
#include "geometry/repair/repair.h"
#include "importers/mesh/import_mesh.h"
#include "tests/importers/cost_of.h"
#include "tests/importers/test_files.h"

namespace effuse::importers {
namespace {

/// What is wrong with a file by SOURCES.md, seen in the repair's counters. kSound: nothing, and the mesh stays as it is.
enum Change : unsigned {
  kSound = 0,
  kStitched = 1,    // cracks
  kFlat = 2,        // degenerate triangles that have three different places
  kDuplicates = 4,
  kWalls = 8,       // duplicates back to back
  kParted = 16,     // non-manifold edges
  kSplit = 32,      // non-manifold vertices
  kTurned = 64,     // mis-oriented edges, or inside out
};

struct Expected {
  const char* file;
  std::size_t triangles;     // as read: SOURCES.md's faces, larger polygons cut; without degenerate ones where welding collapses them
  bool closed;               // after repair, no hole filled
  std::size_t components;    // after repair
  unsigned changes;
  const char* refusal = nullptr;
};

class SharedMesh : public testing::TestWithParam<Expected> {};

TEST_P(SharedMesh, IsWhatItsSourceSays) {
  const std::filesystem::path data = shared_data();
  if (data.empty()) GTEST_SKIP() << "no shared data on this machine (EFFUSE_SHARED_DATA)";
  const Expected& expected = GetParam();
  const std::filesystem::path file = data / "meshes" / expected.file;
  ASSERT_TRUE(std::filesystem::exists(file)) << file;
  MeshOptions options;
  options.limits.apart = true;
  if (expected.refusal) {
    const std::string message = refusal([&] { import_mesh(file, options); });
    EXPECT_TRUE(contains(message, expected.refusal)) << message;
    EXPECT_TRUE(contains(message, file.filename().string())) << message;
    EXPECT_EQ(message.find('\n'), std::string::npos) << message;
  } else {
    MeshImport import = import_mesh(file, options);
    const geometry::RepairReport r = geometry::repair(import.mesh);
    EXPECT_TRUE(geometry::sound(r.after)) << to_string(r.after);
    EXPECT_EQ(r.before.triangles, expected.triangles);
    EXPECT_EQ(r.after.closed(), expected.closed) << to_string(r.after);
    EXPECT_EQ(r.after.components, expected.components) << to_string(r.after);
    const unsigned changes = (r.stitched_vertices ? kStitched : 0u) | (r.flat_triangles ? kFlat : 0u) | (r.duplicate_triangles ? kDuplicates : 0u) | (r.inner_walls ? kWalls : 0u) |
                             (r.parted_edges ? kParted : 0u) | (r.split_vertices ? kSplit : 0u) | (r.turned_triangles ? kTurned : 0u);
    EXPECT_EQ(changes, expected.changes) << fmt::format("{}", fmt::join(geometry::to_lines(r), "; "));
    if (r.after.closed()) {
      EXPECT_GT(geometry::signed_volume(import.mesh), 0);
    }
  }
  // Time and memory of this file alone: read and repaired, or refused, in a process of its own. assimp's OBJ reader
  // starts with a buffer of 16 MB; the rest is a few times the file. (read_apart.h allows 768 MiB and 64 times the file.)
  const Cost cost = cost_of([&] {
    return refusal([&] {
             MeshImport import = import_mesh(file);
             geometry::repair(import.mesh);
           }).empty() ? 0 : 2;
  });
  EXPECT_EQ(cost.exit, expected.refusal ? 2 : 0);
  EXPECT_LT(cost.seconds, 10);
  const double size = static_cast<double>(std::filesystem::file_size(file));
  if (kMemoryIsCounted) {
    EXPECT_LT(cost.grown, 32e6 + 8 * size) << cost.peak;
  }
  fmt::print("{}: {:.2f} s, {:.1f} MB ({:.0f} times its size)\n", expected.file, cost.seconds, cost.grown / 1e6, cost.grown / size);
}

INSTANTIATE_TEST_SUITE_P(
    All, SharedMesh,
    testing::Values(
        Expected{"terrain-meshes/openfoam-turbine-siting-terrain.stl", 21186, false, 1, kSound}, Expected{"terrain-meshes/three_peaks.off", 3671, false, 1, kSound},
        Expected{"clean/20mm-xyz-cube.stl", 260, true, 1, kSound}, Expected{"clean/7_8ths_cube.stl", 24, true, 1, kSound}, Expected{"clean/box.obj", 12, true, 1, kSound},
        Expected{"clean/cross_quad.off", 76, true, 1, kSound}, Expected{"clean/cube_binary.ply", 12, true, 1, kSound}, Expected{"clean/cylinder.stl", 416, true, 1, kSound},
        Expected{"clean/elephant.off", 5558, true, 1, kSound}, Expected{"clean/fixed_top.ply", 4772, true, 1, kSound}, Expected{"clean/ico4.obj", 1280, true, 1, kSound},
        Expected{"clean/monkey.glb", 968, false, 3, kSplit}, Expected{"clean/openfoam-blob.stl", 3072, true, 1, kSound}, Expected{"clean/plate_holes.STL", 1252, true, 1, kSound},
        Expected{"clean/quadknot.obj", 2880, true, 1, kSound}, Expected{"clean/sphere.ply", 1280, true, 1, kSound}, Expected{"clean/star.off", 24, true, 1, kSound},
        Expected{"clean/tet.ply", 4, true, 1, kSound}, Expected{"clean/torus.STL", 8700, true, 1, kSound}, Expected{"clean/unit_cube.STL", 12, true, 1, kSound},
        Expected{"messy/Spider_ascii.stl", 1312, false, 18, kTurned}, Expected{"messy/Spider_binary.stl", 1312, false, 18, kTurned}, Expected{"messy/angle_block.STL", 704, true, 1, kStitched},
        Expected{"messy/blobby-shuffled.off", 4050, true, 1, kTurned}, Expected{"messy/box_longline.obj", 478, true, 1, kDuplicates | kTurned}, Expected{"messy/box_without_lineending.obj", 12, true, 1, kSound},
        Expected{"messy/busted.STL", 3878, true, 1, kSound}, Expected{"messy/concave_polygon.obj", 64, false, 1, kSound}, Expected{"messy/corner_tris_with_hole.off", 52, false, 1, kSound},
        Expected{"messy/cube-ouvert.off", 10, false, 1, kSound}, Expected{"messy/cube.glb", 12, true, 1, kSound}, Expected{"messy/cube_compressed.obj", 12, true, 1, kSound},
        Expected{"messy/cycloidal.ply", 43368, true, 112, kParted | kSplit}, Expected{"messy/elephant-with-holes.off", 4463, false, 1, kSplit}, Expected{"messy/featuretype.STL", 3476, true, 1, kStitched},
        Expected{"messy/joined_tetrahedra.obj", 8, true, 1, kWalls}, Expected{"messy/large_block.STL", 12, true, 1, kSound}, Expected{"messy/multibody.stl", 32, true, 2, kTurned},
        Expected{"messy/nancolor.obj", 12, true, 1, kSound}, Expected{"messy/negative_indices.obj", 12, true, 1, kSound}, Expected{"messy/not_convex.obj", 96, true, 3, kParted | kSplit},
        Expected{"messy/number_formats.obj", 0, false, 0, 0, "wanted a coordinate"}, Expected{"messy/obj_with_no_face_in_chunk.obj", 1, false, 1, kSound}, Expected{"messy/octagonal_pocket.stl", 3262, true, 1, kStitched},
        Expected{"messy/open_cube.off", 10, false, 1, kSound}, Expected{"messy/openfoam-bag-open.obj", 78, false, 1, kSound}, Expected{"messy/polygonfaces.obj", 3, false, 1, kSound},
        Expected{"messy/quads_to_stitch.off", 16, false, 1, kSound}, Expected{"messy/shared.STL", 24, true, 2, kParted | kSplit}, Expected{"messy/soup.stl", 100, false, 100, kSound},
        Expected{"messy/sphereWithHole.stl", 285, false, 1, kSplit}, Expected{"messy/suzanne.ply", 968, false, 3, kSplit}, Expected{"messy/teapot.stl", 894, false, 4, kSplit},
        Expected{"messy/two_objects.obj", 16, true, 1, kParted},
        Expected{"invalid/BoxWithInfinites.glb", 0, false, 0, 0, "not finite"}, Expected{"invalid/OutOfMemory.off", 0, false, 0, 0, "cannot hold them"}, Expected{"invalid/empty.obj", 0, false, 0, 0, "holds no triangles"},
        Expected{"invalid/empty.ply", 0, false, 0, 0, "holds no triangles"}, Expected{"invalid/empty.stl", 0, false, 0, 0, "a solid without facets"}, Expected{"invalid/face_in_group_name.obj", 0, false, 0, 0, "holds no triangles"},
        Expected{"invalid/malformed.obj", 0, false, 0, 0, "names vertex 0"}, Expected{"invalid/malformed2.obj", 0, false, 0, 0, "a face with 0 corners"}, Expected{"invalid/notenoughindices.obj", 0, false, 0, 0, "a face with 2 corners"},
        Expected{"invalid/points_ascii.ply", 0, false, 0, 0, "holds no triangles"}, Expected{"invalid/triangle_with_empty_solid.stl", 0, false, 0, 0, "a solid without facets"},
        // Legal, too: its faces go on after a '\'; thirteen of its triangles are lines.
        Expected{"invalid/wallhole.obj", 66, true, 1, kFlat}),
    [](const auto& tested) {
      std::string name = tested.param.file;
      for (char& c : name)
        if (!std::isalnum(static_cast<unsigned char>(c))) c = '_';
      return name;
    });

TEST(SharedMeshTable, HasEveryFile) {
  const std::filesystem::path data = shared_data();
  if (data.empty()) GTEST_SKIP() << "no shared data on this machine (EFFUSE_SHARED_DATA)";
  std::size_t files = 0;
  for (const auto& entry : std::filesystem::recursive_directory_iterator(data / "meshes")) files += entry.is_regular_file();
  EXPECT_EQ(files, 66u);
}

}  // namespace
}  // namespace effuse::importers
