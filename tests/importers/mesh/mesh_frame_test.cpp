#include "importers/mesh/mesh_frame.h"

#include <fmt/format.h>
#include <gtest/gtest.h>

#include "geometry/mesh/measure.h"
#include "geometry/mesh/validate.h"
#include "importers/mesh/import_mesh.h"
#include "tests/importers/test_files.h"

namespace effuse::importers {
namespace {

const std::string kRoof = "v 0 0 0\nv 4 0 0\nv 4 2 1\nv 0 2 1\nf 1 2 3 4\n";

Box3 box_of(const std::filesystem::path& file, const MeshOptions& options = {}) { return geometry::bounds(import_mesh(file, options).mesh); }

TEST(MeshFrame, TheAxisAskedForBecomesZWithoutAMirror) {
  const TestFolder folder;
  // A slope of one in two that faces each axis in turn; turned up, it is the same one.
  const std::filesystem::path z = folder.write("z.obj", kRoof);
  const std::filesystem::path y = folder.write("y.obj", "v 0 0 0\nv 4 0 0\nv 4 1 -2\nv 0 1 -2\nf 1 2 3 4\n");
  const std::filesystem::path x = folder.write("x.obj", "v 0 0 0\nv 0 0 -4\nv 1 2 -4\nv 1 2 0\nf 1 2 3 4\n");
  const geometry::TriMesh upright = import_mesh(z).mesh;
  for (const auto& [file, up] : {std::pair(y, UpAxis::kY), {x, UpAxis::kX}}) {
    MeshOptions options;
    options.up = up;
    EXPECT_EQ(guess_up(import_mesh(file).mesh), up);
    const MeshImport turned = import_mesh(file, options);
    EXPECT_EQ(turned.mesh.positions, upright.positions) << name_of(up);
    EXPECT_EQ(turned.mesh.triangles, upright.triangles) << name_of(up);
  }
  EXPECT_EQ(guess_up(upright), UpAxis::kZ);
  EXPECT_EQ(guess_up(import_mesh(EFFUSE_SOURCE_DIR "/samples/scenes/house.obj").mesh), UpAxis::kUnknown) << "a closed house has no side that it looks to";
}

TEST(MeshFrame, UnitsBecomeMetres) {
  const TestFolder folder;
  const std::filesystem::path file = folder.write("a.obj", kRoof);
  MeshOptions options;
  options.metres_per_unit = 1e-3;
  EXPECT_NEAR(box_of(file, options).max().x(), 0.004, 1e-15);
}

std::string collada(const std::string& asset) {
  return "<?xml version=\"1.0\"?><COLLADA xmlns=\"http://www.collada.org/2005/11/COLLADASchema\" version=\"1.4.1\"><asset>" + asset +
         "</asset><library_geometries><geometry id=\"g\"><mesh><source id=\"p\"><float_array id=\"pa\" count=\"12\">0 0 0 4 0 0 4 2 1 0 2 1</float_array>"
         "<technique_common><accessor source=\"#pa\" count=\"4\" stride=\"3\"><param name=\"X\" type=\"float\"/><param name=\"Y\" type=\"float\"/><param name=\"Z\" type=\"float\"/></accessor></technique_common></source>"
         "<vertices id=\"v\"><input semantic=\"POSITION\" source=\"#p\"/></vertices><triangles count=\"2\"><input semantic=\"VERTEX\" source=\"#v\" offset=\"0\"/><p>0 1 2 0 2 3</p></triangles></mesh></geometry></library_geometries>"
         "<library_visual_scenes><visual_scene id=\"s\"><node id=\"n\"><instance_geometry url=\"#g\"/></node></visual_scene></library_visual_scenes><scene><instance_visual_scene url=\"#s\"/></scene></COLLADA>";
}

TEST(MeshFrame, ColladaSaysItsUnitAndItsUp) {
  const TestFolder folder;
  const Box3 z_up = box_of(folder.write("z.dae", collada("<unit name=\"centimeter\" meter=\"0.01\"/><up_axis>Z_UP</up_axis>")));
  EXPECT_TRUE(z_up.max().isApprox(Vec3(0.04, 0.02, 0.01), 1e-6)) << z_up.max().transpose();
  // y up: what was y is z now.
  const Box3 y_up = box_of(folder.write("y.dae", collada("<unit name=\"meter\" meter=\"1\"/><up_axis>Y_UP</up_axis>")));
  EXPECT_TRUE(y_up.max().isApprox(Vec3(4, 0, 2), 1e-6)) << y_up.max().transpose();
  EXPECT_NEAR(y_up.min().y(), -1, 1e-6);
}

TEST(MeshFrame, OwnFilesSayWhereTheyLie) {
  const MeshFrame ply = frame_of_own_file("ply\nformat binary_little_endian 1.0\ncomment effuse, metres, z up\ncomment origin: 2667405 6478705 0.5\ncomment crs: EPSG:27200\nend_header\n", ".ply");
  EXPECT_EQ(ply.origin, Vec3(2667405, 6478705, 0.5));
  EXPECT_EQ(ply.crs, "EPSG:27200");
  EXPECT_EQ(ply.up, UpAxis::kZ);
  EXPECT_EQ(ply.metres_per_unit, 1);
  EXPECT_EQ(frame_of_own_file("ply\nformat ascii 1.0\ncomment origin: 1 2 3\nend_header\n", ".ply").source, "") << "somebody else's word for something else";
  EXPECT_EQ(frame_of_own_file("OFF\n# effuse, metres, z up\n# origin: 1 2 3\n4 4 0\n", ".off").origin, Vec3(1, 2, 3));
  std::string stl = "effuse, metres, z up; origin 2667405 6478705 0; crs PROJCS[\"NZGD49 / New Zealand Map Gr";
  stl.resize(80);
  EXPECT_EQ(frame_of_own_file(stl + "rest", ".stl").origin, Vec3(2667405, 6478705, 0));
  EXPECT_EQ(frame_of_own_file(stl + "rest", ".stl").crs, "") << "cut short, it is none";
  EXPECT_EQ(frame_of_own_file("ply\ncomment effuse, metres, z up\ncomment origin: 1 nan 3\nend_header\n", ".ply").origin, Vec3(0, 0, 0));
}

}  // namespace
}  // namespace effuse::importers
