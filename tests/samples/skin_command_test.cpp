#include <fcntl.h>
#include <fmt/format.h>
#include <gtest/gtest.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <cmath>
#include <cstring>
#include <filesystem>
#include <nlohmann/json.hpp>

#include "flow/sph/modern_lava.h"
#include "geometry/base/files.h"
#include "geometry/base/random.h"
#include "geometry/mesh/measure.h"
#include "geometry/mesh/validate.h"
#include "importers/mesh/import_mesh.h"
#include "skin/write/write_points.h"
#include "tests/importers/points/hand_written.h"

/// `effuse skin`: other programs' particles become meshes.
namespace effuse {
namespace {

namespace fs = std::filesystem;
using geometry::TriMesh;
using importers::import_mesh;
using nlohmann::json;
namespace hand_written = importers::hand_written;
using Arguments = std::vector<std::string>;

class SkinCommandTest : public testing::Test {
 protected:
  SkinCommandTest() {
    const testing::TestInfo* info = testing::UnitTest::GetInstance()->current_test_info();
    folder_ = fs::temp_directory_path() / fmt::format("effuse.{}.{}.{}", info->test_suite_name(), info->name(), ::getpid());
    fs::remove_all(folder_);
    fs::create_directories(folder_);
  }
  ~SkinCommandTest() override { fs::remove_all(folder_); }

  struct Outcome {
    int code = -1;
    std::string out, err;
  };

  /// Runs `effuse skin` with the folder as the current one.
  Outcome skin(const Arguments& arguments) {
    std::vector<std::string> words = {EFFUSE_PROGRAM, "skin"};
    words.insert(words.end(), arguments.begin(), arguments.end());
    std::vector<char*> argv;
    for (std::string& word : words) argv.push_back(word.data());
    argv.push_back(nullptr);
    const pid_t pid = ::fork();
    if (pid == 0) {
      if (::chdir(folder_.c_str()) != 0 || !::freopen("stdout.txt", "w", stdout) || !::freopen("stderr.txt", "w", stderr)) ::_exit(99);
      ::execv(argv[0], argv.data());
      ::_exit(98);
    }
    int status = 0;
    ::waitpid(pid, &status, 0);
    Outcome outcome{WIFEXITED(status) ? WEXITSTATUS(status) : -WTERMSIG(status), read_file(folder_ / "stdout.txt"), read_file(folder_ / "stderr.txt")};
    fs::remove(folder_ / "stdout.txt");
    fs::remove(folder_ / "stderr.txt");
    return outcome;
  }

  void write(const std::string& name, const std::string& bytes) { write_file(folder_ / name, bytes); }
  TriMesh mesh(const std::string& name) { return import_mesh(folder_ / name).mesh; }
  std::size_t files() const { return static_cast<std::size_t>(std::distance(fs::directory_iterator(folder_), fs::directory_iterator())); }

  fs::path folder_;
};
class SkinCommandTestSlow : public SkinCommandTest {};

bool contains(const std::string& text, const std::string& part) { return text.find(part) != std::string::npos; }

/// A column of water collapses in a tank: our solver's particles, half a second after the dam is gone.
class DamBreak {
 public:
  DamBreak() {
    flow::sph::ModernOptions o;
    o.spacing = 0.1;
    o.density = 1000;
    o.rheology = flow::sph::Rheology::newtonian(20);
    o.heat.on = false;
    o.rest_period = 0;
    const auto wall = [](const Vec3& point, const Vec3& normal, Index surface) {
      return [=](std::span<const Vec3> at, Real reach, std::span<geometry::Contact> out) {
        for (std::size_t i = 0; i < at.size(); ++i) {
          const Real d = (at[i] - point).dot(normal);
          out[i] = {};
          if (d < reach) out[i] = {Vec3(at[i] - d * normal), normal, d, Vec3::Zero(), 0, surface};
        }
      };
    };
    flow::sph::ModernLava lava(o, {}, {wall({0, 0, 0}, {0, 0, 1}, 0), wall({0, 0, 0}, {1, 0, 0}, 1), wall({0, 0, 0}, {0, 1, 0}, 2), wall({0, 0.6, 0}, {0, -1, 0}, 3)});
    std::vector<Vec3> block;
    for (int n = 0; n < 480; ++n) block.push_back(0.1 * Vec3(n % 8 + 0.5, n / 8 % 6 + 0.5, n / 48 + 0.5));
    lava.add(block, std::vector<Vec3>(block.size(), Vec3::Zero()), std::vector<Real>(block.size(), 1400.0));
    while (lava.time() < 0.5) lava.step(0.5 - lava.time());
    x.assign(lava.positions().begin(), lava.positions().end());
    v.assign(lava.velocities().begin(), lava.velocities().end());
    id.assign(lava.ids().begin(), lava.ids().end());
    radius.assign(x.size(), 0.05);
  }
  geometry::Points points() const {
    geometry::Points p;
    p.position = x;
    p.velocity = v;
    p.radius = radius;
    p.id = id;
    return p;
  }
  std::vector<Vec3> x, v;
  std::vector<Real> radius;
  std::vector<std::uint64_t> id;
};

void expect_same_mesh(const TriMesh& a, const TriMesh& b, const std::string& what) {
  EXPECT_EQ(a.positions, b.positions) << what;
  EXPECT_EQ(a.triangles, b.triangles) << what;
  EXPECT_EQ(a.normals, b.normals) << what;
  ASSERT_EQ(a.attributes.size(), b.attributes.size()) << what;
  for (const auto& [name, attribute] : a.attributes) EXPECT_EQ(attribute.values, b.attributes.at(name).values) << what << " " << name;
}

// On the map floats count in steps of half a metre: refused with the origin that helps, and with it the skin of the same ball at home.
TEST_F(SkinCommandTest, RefusesMapCoordinatesThatFloatsTearAndCountsFromAnOriginInstead) {
  const auto ball = [](const Vec3& middle) {
    std::string text;
    for (int n = 0; n < 343; ++n) {
      const Vec3 x = 0.25 * Vec3(n % 7 - 3, n / 7 % 7 - 3, n / 49 - 3);
      if (x.norm() < 0.8) text += fmt::format("{:.6f} {:.6f} {:.6f}\n", middle.x() + x.x(), middle.y() + x.y(), middle.z() + x.z());
    }
    return text;
  };
  write("far.xyz", ball({2667700, 6479200, 100}));
  write("home.xyz", ball({0, 0, 0}));
  const Outcome far = skin({"far.xyz", "-r", "0.125", "-o", "far.ply"});
  EXPECT_EQ(far.code, 2);
  EXPECT_TRUE(contains(far.err, "--origin 2667700 6479200 100")) << far.err;
  EXPECT_FALSE(fs::exists(folder_ / "far.ply"));
  EXPECT_EQ(skin({"far.xyz", "-r", "0.125", "-o", "far.ply", "--origin", "2667700", "6479200", "100", "--check"}).code, 0);
  EXPECT_EQ(skin({"home.xyz", "-r", "0.125", "-o", "home.ply"}).code, 0);
  const TriMesh there = mesh("far.ply"), here = mesh("home.ply");
  ASSERT_EQ(there.positions.size(), here.positions.size());
  for (std::size_t i = 0; i < here.positions.size(); ++i) ASSERT_LT((there.positions[i] - here.positions[i]).norm(), 1e-5);
  EXPECT_EQ(skin({"far.xyz", "-r", "0.125", "-o", "far.obj"}).code, 0) << "text has all digits";
}

TEST_F(SkinCommandTest, ADamBreakHasTheSameSkinFromPlyVtkAndBgeo) {
  const DamBreak dam;
  Real front = 0, top = 0;
  for (const Vec3& x : dam.x) {
    front = std::max(front, x.x());
    top = std::max(top, x.z());
  }
  ASSERT_GT(front, 1.3) << "it has run";
  ASSERT_LT(top, 0.95);
  skin::write_points_ply(folder_ / "dam.ply", dam.points());
  skin::write_points_vtk(folder_ / "dam.vtk", dam.points());
  skin::write_points_bgeo(folder_ / "dam.bgeo", dam.points());
  for (const char* name : {"dam.ply", "dam.vtk", "dam.bgeo"}) {
    const Outcome outcome = skin({name, "-o", fmt::format("{}.skin.ply", name), "--check", "--json"});
    ASSERT_EQ(outcome.code, 0) << outcome.err;
    const json j = json::parse(outcome.out);
    EXPECT_EQ(j.at("frames").at(0).at("particles"), 480);
    EXPECT_NEAR(j.at("frames").at(0).at("radius").get<double>(), 0.05, 1e-8);
    EXPECT_EQ(j.at("frames").at(0).at("radius_from"), "file");
    const json& check = j.at("frames").at(0).at("check");
    EXPECT_TRUE(check.at("closed").get<bool>() && check.at("manifold").get<bool>() && check.at("oriented").get<bool>());
    EXPECT_EQ(check.at("self_intersections"), 0);
    // The particles' 0.48 m^3, to 2 %.
    EXPECT_NEAR(check.at("volume").get<double>(), 0.48, 0.02 * 0.48);
  }
  const TriMesh ply = mesh("dam.ply.skin.ply");
  EXPECT_TRUE(geometry::validate(ply).solid());
  EXPECT_TRUE(ply.attributes.contains("velocity"));
  // Within a spacing of where the particles are.
  EXPECT_NEAR(geometry::bounds(ply).max().x(), front + 0.05, 0.05);
  expect_same_mesh(ply, mesh("dam.vtk.skin.ply"), "VTK");
  expect_same_mesh(ply, mesh("dam.bgeo.skin.ply"), "BGEO");
}

TEST_F(SkinCommandTestSlow, FilesWrittenByHandAllHaveTheSameSkin) {
  std::optional<TriMesh> first;
  for (const hand_written::File& file : hand_written::files()) {
    write(file.name, file.bytes);
    const Outcome outcome = skin({file.name, "-o", "skin.ply", "--check"});
    ASSERT_EQ(outcome.code, 0) << file.name << "\n" << outcome.out << outcome.err;
    EXPECT_TRUE(contains(outcome.out, "check passed")) << outcome.out;
    const TriMesh found = mesh("skin.ply");
    EXPECT_GT(found.triangles.size(), 100u);
    if (!first) first = found;
    expect_same_mesh(*first, found, file.name);
  }
}

TEST_F(SkinCommandTestSlow, SequencesKeepTheirNumbersAndMissingOnesAreReported) {
  const std::string particles = hand_written::xyz_text();
  for (const int frame : {2, 3, 5, 9, 10}) write(fmt::format("in.{:04}.xyz", frame), particles);
  write("in.other.xyz", "not one of them");
  for (const std::string pattern : {"in.####.xyz", "in.$F4.xyz", "in.%04d.xyz", "in.{}.xyz"}) {
    const Outcome outcome = skin({pattern, "-o", "out.####.obj", "-o", "{}.vdb", "--output-dir", "made", "--json"});
    ASSERT_EQ(outcome.code, 0) << pattern << outcome.err;
    EXPECT_TRUE(contains(outcome.err, "4 frames are missing: 4, 6-8")) << outcome.err;
    const json j = json::parse(outcome.out);
    EXPECT_EQ(j.at("missing"), json({4, 6, 7, 8}));
    ASSERT_EQ(j.at("frames").size(), 5u);
    EXPECT_EQ(j.at("frames").at(4).at("frame"), 10);
    for (const char* name : {"out.0002.obj", "out.0010.obj", "2.vdb", "10.vdb"}) EXPECT_TRUE(fs::exists(folder_ / "made" / name)) << name;
    EXPECT_EQ(std::distance(fs::directory_iterator(folder_ / "made"), fs::directory_iterator()), 10);
    fs::remove_all(folder_ / "made");
  }
  // As a shell spells them out, and a part of them.
  const Outcome some = skin({"in.0010.xyz", "in.0003.xyz", "in.0005.xyz", "-o", "a.##.ply", "-s", "4", "--end-index=10"});
  ASSERT_EQ(some.code, 0) << some.err;
  EXPECT_TRUE(fs::exists(folder_ / "a.05.ply") && fs::exists(folder_ / "a.10.ply") && !fs::exists(folder_ / "a.03.ply"));
  EXPECT_TRUE(contains(some.err, "missing: 6-9")) << some.err;
}

TEST_F(SkinCommandTest, WithoutARadiusItIsEstimatedAndSaid) {
  std::string block;
  for (int n = 0; n < 1000; ++n) block += fmt::format("{} {} {}\n", 0.2 * (n % 10), 0.2 * (n / 10 % 10), 0.2 * (n / 100));
  write("block.xyz", block);
  const Outcome outcome = skin({"block.xyz", "-o", "skin.ply"});
  ASSERT_EQ(outcome.code, 0) << outcome.err;
  EXPECT_TRUE(contains(outcome.err, "no radii; estimated as half the distance of neighbours: --particle-radius 0.1\n")) << outcome.err;
  // 1000 cubes of 0.2; edges and corners are rounded off.
  EXPECT_NEAR(geometry::signed_volume(mesh("skin.ply")), 8, 0.06 * 8);
  // Told the same radius, it encloses their volume.
  const Outcome told = skin({"block.xyz", "-o", "skin.ply", "-r", "0.1", "--json"});
  ASSERT_EQ(told.code, 0) << told.err;
  EXPECT_EQ(json::parse(told.out).at("frames").at(0).at("radius_from"), "--particle-radius");
  EXPECT_NEAR(geometry::signed_volume(mesh("skin.ply")), 8, 0.005 * 8);
}

TEST_F(SkinCommandTestSlow, TheSurfaceThresholdPutsAFlatSurfaceWhereTheDensityFallsToIt) {
  // A wide slab, its top at z = 0: half a spacing over the last layer. Where the density of a half-space falls to t by the
  // cubic spline of support 2, found by adding up layers far finer than particles.
  std::string slab;
  for (int n = 0; n < 16 * 16 * 6; ++n) slab += fmt::format("{} {} {}\n", n % 16, n / 16 % 16, -0.5 - n / 256);
  write("slab.xyz", slab);
  const auto density = [](double height) {
    double sum = 0;
    const double step = 0.02;
    for (double x = step / 2; x < 2; x += step)  // rings round the vertical
      for (double z = height + step / 2; z < 2; z += step) {
        const double q = std::sqrt(x * x + z * z);
        const double w = q < 1 ? 1 - 1.5 * q * q + 0.75 * q * q * q : q < 2 ? 0.25 * std::pow(2 - q, 3) : 0;
        sum += 2 * x * w * step * step;
      }
    return sum;
  };
  for (const double threshold : {0.3, 0.5, 0.6, 0.7}) {
    const Outcome outcome = skin({"slab.xyz", "-r", "0.5", "-t", fmt::format("{}", threshold), "-o", "skin.obj"});
    ASSERT_EQ(outcome.code, 0) << outcome.err;
    Real height = 0;
    int count = 0;
    for (const Vec3& x : mesh("skin.obj").positions)
      if (x.z() > -1 && std::abs(x.x() - 7.5) < 4 && std::abs(x.y() - 7.5) < 4) {
        height += x.z();
        ++count;
      }
    ASSERT_GT(count, 100);
    height /= count;
    const double found = height >= 0 ? density(height) : 1 - density(-height);
    EXPECT_NEAR(found, threshold, 0.02) << "at " << height;
  }
  const Outcome both = skin({"slab.xyz", "-t", "0.5", "--match-volume", "on", "-o", "x.ply"});
  EXPECT_EQ(both.code, 2);
  const Outcome far = skin({"slab.xyz", "-t", "0.1", "-l", "1.7", "-o", "x.ply"});
  EXPECT_EQ(far.code, 2);
  EXPECT_TRUE(contains(far.err, "--surface-threshold 0.1 with --smoothing-length 1.7")) << far.err;
}

TEST_F(SkinCommandTestSlow, AFailedCheckIsExitCodeOneAndTheFileIsThereToLookAt) {
  // A sponge, its triangles taken out to a whole spacing: walls cross.
  std::string sponge;
  for (std::uint64_t n = 0; n < 1500; ++n) sponge += fmt::format("{:.4f} {:.4f} {:.4f}\n", 4 * random_uniform(1, 0, n), 4 * random_uniform(1, 1, n), 4 * random_uniform(1, 2, n));
  write("sponge.xyz", sponge);
  const Arguments cloud = {"sponge.xyz", "-r", "0.125"};
  const auto with = [&](Arguments more) {
    more.insert(more.begin(), cloud.begin(), cloud.end());
    return skin(more);
  };
  const Outcome outcome = with({"--coarsen", "1", "-o", "sponge.ply", "--check"});
  EXPECT_EQ(outcome.code, 1);
  EXPECT_TRUE(contains(outcome.out, "check FAILED")) << outcome.out;
  EXPECT_TRUE(contains(outcome.out, "pairs of triangles intersect")) << outcome.out;
  EXPECT_TRUE(fs::exists(folder_ / "sponge.ply"));
  const Outcome as_json = with({"--coarsen", "1", "-o", "sponge.ply", "--check-mesh", "--json"});
  EXPECT_EQ(as_json.code, 1);
  EXPECT_FALSE(json::parse(as_json.out).at("ok").get<bool>());
  EXPECT_GT(json::parse(as_json.out).at("frames").at(0).at("check").at("self_intersections").get<int>(), 0);
  EXPECT_EQ(with({"-o", "sponge.ply", "--check", "--match-volume", "off"}).code, 0) << "as it is";
}

TEST_F(SkinCommandTestSlow, BrokenFilesAndWrongNamesAreExitCodeTwoAndLeaveNothing) {
  write("good.xyz", "0 0 0\n1 0 0\n");
  write("bad.xyz", "0 0 0\n1 zero 0\n");
  write("cut.vtk", hand_written::vtk_binary().substr(0, 120));
  write("cut.bgeo", hand_written::bgeo().substr(0, 200));
  write("one.xyz", "1 2 3\n");
  write("f.1.xyz", "0 0 0\n1 0 0\n");
  write("f.01.xyz", "0 0 0\n1 0 0\n");
  const std::size_t before = files();
  struct Case {
    Arguments arguments;
    std::string says;
  };
  const std::vector<Case> cases = {
      {{"bad.xyz", "-o", "a.ply"}, "error: bad.xyz:2: found 'zero', wanted a number"},
      {{"cut.vtk", "-o", "a.ply"}, "error: cut.vtk: at byte"},
      {{"cut.bgeo", "-o", "a.ply"}, "error: cut.bgeo: at byte"},
      {{"one.xyz", "-o", "a.ply"}, "error: one.xyz: has no radii, and not two places to estimate one from: give --particle-radius"},
      {{"none.xyz", "-o", "a.ply"}, "error: none.xyz: no such file"},
      {{"none.####.xyz", "-o", "a.####.ply"}, "error: none.####.xyz: no file has a name like this"},
      {{"good.xyz", "-o", "a.stl"}, "error: a.stl: skins are written as .ply, .obj, .glb and .vdb, not as '.stl'"},
      {{"good.xyz", "-o", "a.ply", "-o", "b"}, "error: b: skins are written as"},
      {{"f.{}.xyz", "-o", "a.####.ply"}, "is frame 1, and so is"},
      {{"f.####.xyz", "-o", "a.####.ply"}, "no file has a name like this"},
      {{"f.01.xyz", "bad.xyz", "-o", "a.####.ply"}, "error: bad.xyz: has no number in its name"},
      {{"f.0#.xyz", "-o", "a.ply"}, "error: a.ply: several frames need a place for their number"},
      {{"good.xyz", "-o", "a.ply", "-r", "-1"}, "--particle-radius"},
      {{"good.xyz", "-o", "a.ply", "--normals=off"}, "always written with normals"},
      {{"good.xyz", "-o", "a.ply", "--particle-aabb-min", "0", "0", "0"}, "go together"},
      {{"good.xyz", "-o", "a.ply", "--tessellation", "marching"}, "--tessellation"},
      {{"good.xyz", "-o", "a.ply", "--tessellation", "voronoi", "--coarsen", "0.1"}, "--coarsen goes with --tessellation levelset"},
      {{"good.xyz", "-o", "a.ply", "--coarsen", "nan"}, "--coarsen"},
      {{"good.xyz", "-o", "a.ply", "--terrain", "none.asc"}, "error: none.asc: no such file"},
      {{"good.xyz", "-o", "a.ply", "--terrain", "bad.xyz", "--up", "y"}, "--terrain is z up"},
      {{"good.xyz", "-o", "a.ply", "--particle-aabb-min", "0", "0", "0", "--particle-aabb-max", "1", "-1", "1"}, "is not below"},
  };
  for (const Case& c : cases) {
    const Outcome outcome = skin(c.arguments);
    EXPECT_EQ(outcome.code, 2) << c.says << "\n" << outcome.err;
    EXPECT_TRUE(contains(outcome.err, c.says)) << "'" << outcome.err << "' instead of '" << c.says << "'";
    EXPECT_EQ(outcome.out, "");
    EXPECT_EQ(files(), before) << "left something: " << c.says;
  }
  write("a.ply", hand_written::ply_ascii());
  EXPECT_TRUE(contains(skin({"a.ply", "-o", "./a.ply"}).err, "would overwrite the particles"));
  const Outcome as_json = skin({"bad.xyz", "-o", "b.ply", "--json"});
  EXPECT_EQ(as_json.code, 2);
  EXPECT_EQ(json::parse(as_json.out).at("errors").at(0).at("line"), 2);
}

TEST_F(SkinCommandTest, AFrameWithoutParticlesIsAnEmptyMesh) {
  write("a.0001.csv", "x,y,z,radius\n");
  write("a.0002.csv", "x,y,z,radius\n0,0,0,0.5\n");
  const Outcome outcome = skin({"a.####.csv", "-o", "m.####.ply", "-o", "m.####.glb", "-o", "m.####.vdb", "--check"});
  ASSERT_EQ(outcome.code, 0) << outcome.out << outcome.err;
  EXPECT_EQ(mesh("m.0002.ply").attributes.size(), 1u) << "region alone";
  EXPECT_GT(mesh("m.0002.ply").triangles.size(), 8u);
  for (const char* name : {"m.0001.ply", "m.0001.glb", "m.0001.vdb"}) EXPECT_TRUE(fs::exists(folder_ / name)) << name;
  EXPECT_TRUE(contains(read_file(folder_ / "m.0001.ply"), "element face 0\n"));
}

TEST_F(SkinCommandTest, ABoxCropsParticlesAndUpTurnsGlbOnly) {
  // Two blobs one over the other; the upper one, by its y, is kept.
  write("two.xyz", "0 0 0\n0 10 0\n0 10 1\n");
  ASSERT_EQ(skin({"two.xyz", "-r", "0.5", "-o", "z.glb", "-o", "z.ply", "--particle-aabb-min", "-1", "5", "-1", "--particle-aabb-max", "1", "11", "2"}).code, 0);
  ASSERT_EQ(skin({"two.xyz", "-r", "0.5", "-o", "y.glb", "-o", "y.ply", "--up", "y", "--particle-aabb-min", "-1", "5", "-1", "--particle-aabb-max", "1", "11", "2"}).code, 0);
  EXPECT_EQ(read_file(folder_ / "z.ply"), read_file(folder_ / "y.ply"));
  EXPECT_GT(geometry::bounds(mesh("y.ply")).min().y(), 9);
  // Our reader turns GLB back to z up: y-up particles come back with their y as z.
  EXPECT_GT(geometry::bounds(mesh("z.glb")).min().y(), 9);
  EXPECT_GT(geometry::bounds(mesh("y.glb")).min().z(), 9);
  EXPECT_GT(geometry::signed_volume(mesh("y.glb")), 0);
}

/// 10 x 10 x 4 particles of radius 0.5 with ids from `first` on.
std::string numbered_block(std::uint64_t first) {
  std::string block = "x,y,z,radius,id\n";
  for (std::uint64_t n = 0; n < 400; ++n) block += fmt::format("{},{},{},0.5,{}\n", n % 10, n / 10 % 10, n / 100, first + n);
  return block;
}

TEST_F(SkinCommandTest, BothTessellationsCarryTheParticlesIds) {
  write("block.csv", numbered_block(1000));
  for (const std::string kind : {"levelset", "voronoi"}) {
    const Outcome outcome = skin({"block.csv", "-o", "skin.ply", "--tessellation", kind, "--check", "--json"});
    ASSERT_EQ(outcome.code, 0) << outcome.out << outcome.err;
    const json j = json::parse(outcome.out).at("frames").at(0);
    // The inner 8 x 8 x 2 are not on the surface; of the others each has its region.
    EXPECT_EQ(j.at("regions"), 400 - 128);
    EXPECT_LE(j.at("thin_triangles_share").get<double>(), 0.005);
    const TriMesh found = mesh("skin.ply");
    // Fans a spacing wide round off the block's edges.
    EXPECT_NEAR(geometry::signed_volume(found), 400, (kind == "levelset" ? 0.02 : 0.03) * 400);
    const std::vector<float>& region = found.attributes.at("region").values;
    for (std::size_t v = 0; v < region.size(); ++v) {
      const int n = static_cast<int>(region[v]) - 1000;
      ASSERT_TRUE(n >= 0 && n < 400);
      EXPECT_LT((found.positions[v] - Vec3(n % 10, n / 10 % 10, n / 100)).norm(), kind == "levelset" ? 1.0 : 1.2);
    }
    EXPECT_EQ(contains(read_file(folder_ / "skin.ply"), "vertex_indices\nproperty uint region\n"), kind == "voronoi");
  }
  // Ids that a float would round, and such as 32 bits do not hold.
  write("block.csv", numbered_block(20'000'001));
  ASSERT_EQ(skin({"block.csv", "-o", "skin.ply"}).code, 0);
  EXPECT_TRUE(contains(read_file(folder_ / "skin.ply"), "comment region: "));
  write("block.csv", numbered_block(5'000'000'000));
  ASSERT_EQ(skin({"block.csv", "-o", "skin.ply"}).code, 0);
  EXPECT_TRUE(contains(read_file(folder_ / "skin.ply"), "property uint region\nproperty uint region_high\n"));
}

TEST_F(SkinCommandTest, CoarsenLeavesFewerTrianglesWithinItsError) {
  write("block.csv", numbered_block(0));
  ASSERT_EQ(skin({"block.csv", "-o", "fine.ply"}).code, 0);
  const Outcome outcome = skin({"block.csv", "-o", "coarse.ply", "--coarsen", "0.1", "--check", "--json"});
  ASSERT_EQ(outcome.code, 0) << outcome.err;
  const json j = json::parse(outcome.out).at("frames").at(0);
  EXPECT_LE(j.at("coarsen_error").get<double>(), 0.1) << "a tenth of a spacing of 1";
  const TriMesh fine = mesh("fine.ply"), coarse = mesh("coarse.ply");
  EXPECT_LT(2 * coarse.triangles.size(), fine.triangles.size());
  EXPECT_NEAR(geometry::signed_volume(coarse), geometry::signed_volume(fine), 0.02 * 400);
}

TEST_F(SkinCommandTest, DropsAreKeptOrLeftOutByChoice) {
  write("two.csv", numbered_block(0) + "20,0,0,0.5,900\n");
  for (const std::string kind : {"levelset", "voronoi"}) {
    ASSERT_EQ(skin({"two.csv", "-o", "kept.ply", "--tessellation", kind}).code, 0);
    EXPECT_EQ(geometry::validate(mesh("kept.ply")).components, 2u);
    const Outcome outcome = skin({"two.csv", "-o", "left.ply", "--tessellation", kind, "--drop-volume", "10", "--json"});
    ASSERT_EQ(outcome.code, 0);
    EXPECT_EQ(geometry::validate(mesh("left.ply")).components, 1u);
    EXPECT_EQ(json::parse(outcome.out).at("frames").at(0).at("dropped_pieces"), 1);
  }
}

TEST_F(SkinCommandTest, TheTerrainEndsTheSkinInTheParticlesCoordinates) {
  // On the map: a plane that rises to the east by a fifth, and a block of lava on it.
  std::string grid = "ncols 12\nnrows 12\nxllcenter 2667000\nyllcenter 6479000\ncellsize 2\n";
  for (int row = 0; row < 12; ++row) {
    for (int column = 0; column < 12; ++column) grid += fmt::format("{} ", 100 + 0.4 * column);
    grid += "\n";
  }
  write("ground.asc", grid);
  std::string block;
  const auto ground = [](double x) { return 100 + 0.2 * (x - 2667000); };
  for (int n = 0; n < 10 * 10 * 3; ++n) {
    const double x = 2667006 + n % 10, y = 6479006 + n / 10 % 10;
    block += fmt::format("{:.3f} {:.3f} {:.3f}\n", x, y, ground(x) + 0.5 + n / 100);
  }
  write("block.xyz", block);
  for (const std::string kind : {"levelset", "voronoi"}) {
    const Outcome outcome = skin({"block.xyz", "-r", "0.5", "-o", "skin.obj", "--terrain", "ground.asc", "--tessellation", kind, "--check", "--json"});
    ASSERT_EQ(outcome.code, 0) << outcome.out << outcome.err;
    EXPECT_NEAR(json::parse(outcome.out).at("frames").at(0).at("volume").get<double>(), 300, 3) << "above the ground";
    const TriMesh found = mesh("skin.obj");
    Real lowest = 1, under = 0;
    for (const Vec3& x : found.positions) {
      const Real height = x.z() - ground(x.x());
      lowest = std::min(lowest, height);
      under += height < -0.1;
    }
    // A voxel and a half under it, along its normal; many vertices there, for it has a bottom.
    EXPECT_NEAR(lowest, -0.75, 0.12);
    EXPECT_GT(under, 0.2 * static_cast<Real>(found.positions.size()));
  }
  // Without it the lowest vertices are half a spacing under the particles.
  ASSERT_EQ(skin({"block.xyz", "-r", "0.5", "-o", "free.obj"}).code, 0);
  Real lowest = 1;
  for (const Vec3& x : mesh("free.obj").positions) lowest = std::min(lowest, x.z() - ground(x.x()));
  EXPECT_GT(lowest, -0.4);
  // Beside the lava it changes nothing, which is said.
  write("beside.xyz", "0 0 0\n1 0 0\n");
  const Outcome beside = skin({"beside.xyz", "-r", "0.5", "-o", "skin.obj", "--terrain", "ground.asc"});
  ASSERT_EQ(beside.code, 0) << beside.err;
  EXPECT_TRUE(contains(beside.err, "no particle lies over ground.asc")) << beside.err;
}

/// The numbered block moved, in another order, as hot as told; without ids where asked.
std::string moved_block(const Vec3& by, bool backwards, const std::string& kelvin, bool ids = true) {
  std::string block = std::string("x,y,z,radius") + (ids ? ",id" : "") + (kelvin.empty() ? "" : ",temperature") + "\n";
  for (std::uint64_t k = 0; k < 400; ++k) {
    const std::uint64_t n = backwards ? 399 - k : k;
    block += fmt::format("{},{},{},0.5", static_cast<Real>(n % 10) + by.x(), static_cast<Real>(n / 10 % 10) + by.y(), static_cast<Real>(n / 100) + by.z());
    block += (ids ? fmt::format(",{}", 70 + n) : "") + (kelvin.empty() ? "" : "," + kelvin) + "\n";
  }
  return block;
}

using SkinCommandSlow = SkinCommandTest;

TEST_F(SkinCommandSlow, EveryKindOfSkinIsDisplacedColouredAndSound) {
  write("block.csv", moved_block(Vec3::Zero(), false, "1150"));
  ASSERT_EQ(skin({"block.csv", "-o", "smooth.ply", "--check"}).code, 0);
  const TriMesh smooth = mesh("smooth.ply");
  EXPECT_FALSE(smooth.attributes.contains("color"));
  for (const std::string kind : {"noise", "aa", "pahoehoe", "block", "obsidian"}) {
    const Outcome outcome = skin({"block.csv", "-o", "skin.ply", "-o", "skin.vdb", "--kind", kind, "--edge", "0.25", "--check", "--json"});
    ASSERT_EQ(outcome.code, 0) << kind << outcome.out << outcome.err;
    EXPECT_TRUE(contains(outcome.err, "hangs its detail in space")) << outcome.err;
    const json j = json::parse(outcome.out).at("frames").at(0);
    EXPECT_EQ(j.at("kind"), kind);
    EXPECT_GT(j.at("largest_displacement").get<double>(), 0.05) << kind;
    EXPECT_GT(j.at("triangles").get<std::size_t>(), 2 * smooth.triangles.size()) << kind;
    const TriMesh found = mesh("skin.ply");
    EXPECT_NEAR(geometry::signed_volume(found), 400, 0.04 * 400) << kind;
    for (const char* name : {"color", "glow", "detail", "temperature"}) EXPECT_TRUE(found.attributes.contains(name)) << kind << " " << name;
    const std::vector<float>& glow = found.attributes.at("glow").values;
    EXPECT_GT(*std::max_element(glow.begin(), glow.end()), 0.02f) << kind;
  }
  // Colours alone; and the smooth skin is what it was.
  ASSERT_EQ(skin({"block.csv", "-o", "flat.ply", "--kind", "noise", "--amplitude", "0"}).code, 0);
  EXPECT_EQ(mesh("flat.ply").positions, smooth.positions);
  EXPECT_TRUE(mesh("flat.ply").attributes.contains("color"));
  ASSERT_EQ(skin({"block.csv", "-o", "none.ply", "--kind", "none"}).code, 0);
  EXPECT_EQ(read_file(folder_ / "none.ply"), read_file(folder_ / "smooth.ply"));
  // Another seed, other bumps.
  ASSERT_EQ(skin({"block.csv", "-o", "one.ply", "--kind", "aa"}).code, 0);
  ASSERT_EQ(skin({"block.csv", "-o", "two.ply", "--kind", "aa", "--seed", "2"}).code, 0);
  EXPECT_NE(mesh("one.ply").positions, mesh("two.ply").positions);
}

TEST_F(SkinCommandTestSlow, DetailMovesWithTheParticlesIdsAndWithoutThemSwims) {
  // Eight voxels on, where the smooth surface is the same again, in another order.
  const Vec3 by(4, -8, 0);
  const auto largest_difference = [&](bool ids, const std::string& kind, const std::string& tessellation) {
    write("a.0001.csv", moved_block(Vec3::Zero(), false, "", ids));
    write("a.0002.csv", moved_block(by, true, "", ids));
    const Outcome outcome = skin({"a.####.csv", "-o", "m.####.ply", "--kind", kind, "--tessellation", tessellation, "--json"});
    EXPECT_EQ(outcome.code, 0) << outcome.err;
    EXPECT_EQ(contains(outcome.err, "it will swim"), !ids) << outcome.err;
    EXPECT_EQ(json::parse(outcome.out).at("frames").at(1).at("detail_on"), ids ? "id" : "world");
    const TriMesh one = mesh("m.0001.ply"), two = mesh("m.0002.ply");
    EXPECT_EQ(one.positions.size(), two.positions.size());
    Real largest = 0;
    for (std::size_t v = 0; v < std::min(one.positions.size(), two.positions.size()); ++v) largest = std::max(largest, (two.positions[v] - by - one.positions[v]).norm());
    return largest;
  };
  for (const std::string kind : {"aa", "noise"}) {
    EXPECT_LT(largest_difference(true, kind, "levelset"), 1e-3) << kind;
    EXPECT_GT(largest_difference(false, kind, "levelset"), 0.05) << kind;
  }
}

TEST_F(SkinCommandTest, TemperaturesAreTheFilesOrToldAndWithoutAnyNothingGlows) {
  write("cold.csv", moved_block(Vec3::Zero(), false, ""));
  write("hot.csv", moved_block(Vec3::Zero(), false, "1200"));
  const auto made = [&](Arguments arguments) {
    arguments.insert(arguments.end(), {"-o", "m.ply", "--kind", "noise"});
    const Outcome outcome = skin(arguments);
    EXPECT_EQ(outcome.code, 0) << outcome.err;
    return std::pair{mesh("m.ply"), outcome.err};
  };
  EXPECT_FALSE(made({"cold.csv"}).first.attributes.contains("glow"));
  const auto [told, told_err] = made({"cold.csv", "--temperature", "926.85 degC"});
  EXPECT_NEAR(told.attributes.at("temperature").values.front(), 1200, 0.01);
  const auto [own, own_err] = made({"hot.csv", "--temperature", "400"});
  EXPECT_TRUE(contains(own_err, "has temperatures of its own")) << own_err;
  EXPECT_EQ(own.attributes.at("glow").values, told.attributes.at("glow").values);
  EXPECT_TRUE(contains(made({"cold.csv", "--temperature", "600"}).second, "nothing glows below 800 K"));
}

TEST_F(SkinCommandTest, TurningUpwardsLeavesColoursAsTheyAre) {
  write("hot.csv", moved_block(Vec3::Zero(), false, "1200"));
  ASSERT_EQ(skin({"hot.csv", "-o", "z.glb", "--kind", "noise"}).code, 0);
  ASSERT_EQ(skin({"hot.csv", "-o", "y.glb", "--kind", "noise", "--up", "y"}).code, 0);
  const TriMesh z = mesh("z.glb"), y = mesh("y.glb");
  ASSERT_TRUE(z.attributes.contains("color"));
  EXPECT_EQ(z.attributes.at("color").values, y.attributes.at("color").values);
  EXPECT_NE(z.positions, y.positions);
}

TEST_F(SkinCommandTestSlow, RefusesDetailThatNothingWouldShow) {
  write("good.xyz", "0 0 0\n1 0 0\n");
  struct Case {
    Arguments arguments;
    std::string says;
  };
  for (const Case& c : std::vector<Case>{{{"-o", "a.ply", "--amplitude", "0.3"}, "go with --kind"},
                                         {{"-o", "a.ply", "--edge", "0.3"}, "go with --kind"},
                                         {{"-o", "a.ply", "--seed", "3"}, "go with --kind"},
                                         {{"-o", "a.ply", "--temperature", "1200"}, "go with --kind"},
                                         {{"-o", "a.vdb", "--kind", "aa"}, "--kind aa goes with a mesh"},
                                         {{"-o", "a.ply", "--kind", "lava"}, "--kind"},
                                         {{"-o", "a.ply", "--kind", "aa", "--temperature", "12 m"}, "--temperature:"},
                                         {{"-o", "a.ply", "--kind", "aa", "--temperature", "-5"}, "wanted more than 0"},
                                         {{"-o", "a.ply", "--kind", "aa", "--edge", "nan"}, "--edge"}}) {
    Arguments arguments = {"good.xyz", "-r", "0.5"};
    arguments.insert(arguments.end(), c.arguments.begin(), c.arguments.end());
    const Outcome outcome = skin(arguments);
    EXPECT_EQ(outcome.code, 2) << c.says;
    EXPECT_TRUE(contains(outcome.err, c.says)) << "'" << outcome.err << "' instead of '" << c.says << "'";
    EXPECT_EQ(files(), 1u) << c.says;
  }
}

/// 4 x 4 x 4 particles, a unit apart.
std::string block_of_lattice() {
  std::string block;
  for (int n = 0; n < 64; ++n) block += fmt::format("{} {} {}\n", n % 4, n / 4 % 4, n / 16);
  return block;
}

TEST_F(SkinCommandTest, WhatContradictsItselfIsExitCodeTwoWithTheReason) {
  write("block.xyz", block_of_lattice());
  const auto refused = [&](Arguments arguments, const std::string& reason) {
    const Outcome outcome = skin(arguments);
    EXPECT_EQ(outcome.code, 2) << reason;
    EXPECT_TRUE(contains(outcome.err, reason)) << outcome.err;
    EXPECT_FALSE(fs::exists(folder_ / "x.vdb")) << reason;
    EXPECT_FALSE(fs::exists(folder_ / "x.ply")) << reason;
  };
  refused({"block.xyz", "-r", "0.5", "-o", "x.vdb", "--tessellation", "voronoi"}, "--tessellation voronoi goes with a mesh");
  refused({"block.xyz", "-r", "0.5", "-o", "x.vdb", "--coarsen", "0.1"}, "--coarsen goes with a mesh");
  refused({"block.xyz", "-r", "0.5", "-o", "x.ply", "-s", "3", "-e", "2"}, "--start-index 3 is beyond --end-index 2");
  refused({"block.xyz", "-r", "0.5", "-o", "x.ply", "-s", "3"}, "is one file: --start-index and --end-index go with a sequence");
  refused({"block.xyz", "-r", "1e300", "-o", "x.ply"}, "a particle radius of 1e+300 (--particle-radius): wanted 1e-06 to 1e+06");
  refused({"block.xyz", "-r", "0.5", "-o", "x.ply", "--kind", "aa", "--seed", "99999999999999999999999"}, "must be a whole number");
  refused({"block.xyz", "-r", "0.5", "-o", "x.ply", "--kind", "aa", "--seed", "-1"}, "must be a whole number");
  // Nothing is there to be made a folder of.
  const Outcome inside_a_file = skin({"block.xyz", "-r", "0.5", "-o", "block.xyz/x.ply"});
  EXPECT_EQ(inside_a_file.code, 2) << inside_a_file.err;
}

TEST_F(SkinCommandTestSlow, TemperaturesThatNoLavaHasAreRefusedWithTheParticle) {
  const auto with = [&](const std::string& temperature, Arguments more) {
    write("hot.ply", "ply\nformat ascii 1.0\nelement vertex 2\nproperty float x\nproperty float y\nproperty float z\nproperty float temperature\nend_header\n0 0 0 1200\n1 0 0 " + temperature + "\n");
    more.insert(more.begin(), {"hot.ply", "-r", "0.5", "-o", "x.ply"});
    return skin(more);
  };
  for (const std::string bad : {"-20", "1e9", "nan"}) {
    const Outcome outcome = with(bad, {"--kind", "aa"});
    EXPECT_EQ(outcome.code, 2) << bad;
    EXPECT_TRUE(contains(outcome.err, "particle 1 has a temperature of ") || contains(outcome.err, "nan")) << outcome.err;
  }
  EXPECT_TRUE(contains(with("-20", {"--kind", "aa"}).err, "is it in degrees Celsius?"));
  EXPECT_EQ(with("nan", {}).code, 2);
  EXPECT_EQ(with("-20", {}).code, 0) << "carried as it is, and used for nothing";
}

TEST_F(SkinCommandTest, AnEmptyMeshIsSaid) {
  write("block.xyz", block_of_lattice());
  const Outcome boxed = skin({"block.xyz", "-r", "0.5", "-o", "x.ply", "--particle-aabb-min", "100", "100", "100", "--particle-aabb-max", "101", "101", "101"});
  EXPECT_EQ(boxed.code, 0);
  EXPECT_TRUE(contains(boxed.err, "no particle in the box")) << boxed.err;
  const Outcome dropped = skin({"block.xyz", "-r", "0.5", "-o", "x.ply", "--drop-volume", "1e6"});
  EXPECT_EQ(dropped.code, 0);
  EXPECT_TRUE(contains(dropped.err, "smaller than --drop-volume")) << dropped.err;
}

TEST_F(SkinCommandTest, ScatteredParticlesThatWouldNotFitIntoMemoryAreExitCodeFiveAtOnce) {
  // Each stands alone among a thousand blocks of voxels: some 70 GB.
  std::string dust;
  for (std::uint64_t n = 0; n < 4'000; ++n) dust += fmt::format("{:.0f} {:.0f} {:.0f}\n", 90'000 * random_uniform(1, 0, n), 90'000 * random_uniform(1, 1, n), 90'000 * random_uniform(1, 2, n));
  write("dust.xyz", dust);
  const Outcome outcome = skin({"dust.xyz", "-r", "1", "-c", "0.2", "-l", "4", "-o", "x.obj"});
  if (outcome.code == 0) GTEST_SKIP() << "a machine that has as much";
  EXPECT_EQ(outcome.code, 5) << outcome.err;
  EXPECT_TRUE(contains(outcome.err, " GB of memory that are free")) << outcome.err;
  EXPECT_FALSE(fs::exists(folder_ / "x.obj"));
}

TEST_F(SkinCommandTest, TheSameBytesOnOneAndTwoThreads) {
  write("a.vtk", hand_written::vtk_binary());
  ASSERT_EQ(skin({"a.vtk", "-o", "one.ply", "--threads", "1"}).code, 0);
  ASSERT_EQ(skin({"a.vtk", "-o", "two.ply", "--threads", "2"}).code, 0);
  EXPECT_EQ(read_file(folder_ / "one.ply"), read_file(folder_ / "two.ply"));
  write("block.csv", moved_block(Vec3::Zero(), false, "1100"));
  ASSERT_EQ(skin({"block.csv", "-o", "one.ply", "--kind", "block", "--threads", "1"}).code, 0);
  ASSERT_EQ(skin({"block.csv", "-o", "two.ply", "--kind", "block", "--threads", "2"}).code, 0);
  EXPECT_EQ(read_file(folder_ / "one.ply"), read_file(folder_ / "two.ply"));
}

}  // namespace
}  // namespace effuse
