#include <fmt/format.h>
#include <gtest/gtest.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <filesystem>
#include <map>
#include <ostream>
#include <set>

#include "geometry/base/files.h"
#include "geometry/base/log.h"
#include "geometry/base/random.h"
#include "geometry/mesh/measure.h"
#include "samples/study/outcome.h"
#include "samples/study/run_study.h"
#include "samples/study/skin/blobs.h"
#include "samples/study/skin/closeups.h"
#include "samples/study/skin/fill.h"
#include "samples/study/skin/jpeg.h"
#include "samples/study/skin/solids.h"
#include "samples/study/skin/soundness.h"
#include "samples/study/study.h"
#include "skin/tessellate/make_skin.h"

/// The study of the skin: its cases against their bars, and what they stand on.
namespace effuse::study {
void PrintTo(const Case& c, std::ostream* out);  // study_test.cpp

namespace {

namespace fs = std::filesystem;

// ---- Every figure of every case holds its bar. ----

/// Minutes: `effuse study skin --full` runs them, too.
bool is_long(const Case& c) { return c.name.starts_with("work-") || c.name == "close-ups"; }

/// Figures that miss their bar, and the error they have now. The page calls them missed; here they may get better, and not worse by more
/// than a quarter. All are the sampling's: a lattice cut by a round wall leaves points of it 0.59 (cylinder), 0.66 (torus), 0.58 (sphere)
/// spacings from the nearest particle's ball, as the cases' notes tell.
struct Shortfall {
  std::string_view name, method;
  double error;
  std::string_view figure = "Hausdorff distance";  // [spacings]
};
constexpr Shortfall kShort[] = {{"cylinder", "level set, lattice", 0.576}, {"torus", "anisotropic, lattice", 0.586}, {"sphere", "anisotropic, lattice", 0.535}};

std::vector<Case> cases_to_hold() {
  std::vector<Case> cases = skin_cases();
  std::erase_if(cases, is_long);
  return cases;
}

class SkinStudySlow : public testing::TestWithParam<Case> {};
TEST_P(SkinStudySlow, HoldsItsBars) {
  Outcome outcome;
  outcome.name = GetParam().name;
  outcome.result = GetParam().run();
  EXPECT_FALSE(outcome.result.measures.empty());
  EXPECT_FALSE(outcome.result.plots.empty());
  for (const Measure& m : outcome.result.measures) {
    const auto known = std::find_if(std::begin(kShort), std::end(kShort), [&](const Shortfall& s) { return s.name == outcome.name && m.what.starts_with(s.method) && m.what.ends_with(s.figure); });
    EXPECT_LE(m.error, known != std::end(kShort) ? std::max(m.hold, 1.25 * known->error) : m.hold) << m.what << "\n" << table_text({outcome}) << outcome.result.note;
  }
}
INSTANTIATE_TEST_SUITE_P(, SkinStudySlow, testing::ValuesIn(cases_to_hold()), [](const auto& each) {
  std::string name = each.param.name;
  std::replace(name.begin(), name.end(), '-', '_');
  return name;
});

TEST(SkinStudy, CasesHaveNamesOfTheirOwnInAllStudiesThatFilesCanHave) {
  std::set<std::string> names;
  for (const auto& cases : {validation_cases(), skin_cases()})
    for (const Case& c : cases) {
      EXPECT_TRUE(names.insert(c.name).second) << c.name;
      EXPECT_EQ(c.name.find_first_not_of("abcdefghijklmnopqrstuvwxyz0123456789_-"), std::string::npos) << c.name;
      EXPECT_FALSE(c.title.empty()) << c.name;
      EXPECT_FALSE(c.source.empty()) << c.name;
      EXPECT_TRUE(c.run) << c.name;
    }
}

TEST(SkinStudy, HasTheCasesOfEveryFileThatIsThere) {
  const fs::path folder = fs::path(EFFUSE_SOURCE_DIR) / "samples" / "study" / "skin";
  const std::string cases = read_file(folder / "skin_cases.cpp");
  for (const auto& entry : fs::directory_iterator(folder)) {
    const std::string name = entry.path().stem();
    if (entry.path().extension() != ".cpp" || !name.ends_with("_cases") || name == "skin_cases") continue;
    EXPECT_NE(cases.find("add_" + name + "(cases);"), std::string::npos) << name;
  }
}

// ---- Solids ----

/// Points in the box, the same every time.
Vec3 random_point(const Box3& box, std::uint64_t i) {
  return box.min() + Vec3(random_uniform(31, 0, i), random_uniform(31, 1, i), random_uniform(31, 2, i)).cwiseProduct(box.sizes());
}

TEST(Solids, VolumesDistancesAndPointsAreOfOneBody) {
  for (const Solid& solid : solids()) {
    // Volume by points thrown at random: one deviation of 50,000 is 0.4 per cent or less.
    std::size_t in = 0;
    constexpr std::uint64_t n = 50'000;
    for (std::uint64_t i = 0; i < n; ++i) in += solid.distance(random_point(solid.box, i)) < 0;
    EXPECT_NEAR(static_cast<Real>(in) / n * solid.box.volume() / solid.volume, 1, 0.015) << solid.name;

    // Points lie on the surface, spread by area: what a shell of thickness 2 e holds of volume is their area times 2 e, in each octant.
    std::array<Real, 8> points{}, shell{};
    const auto octant = [](const Vec3& p) { return static_cast<std::size_t>((p.x() > 0.3 * p.y()) + 2 * (p.y() > 0.5) + 4 * (std::abs(p.z()) > 0.6 * p.head<2>().norm())); };
    Real in_shell = 0;
    for (std::uint64_t i = 0; i < n; ++i) {
      const Vec3 p = solid.point(random_uniform(32, 0, i), random_uniform(32, 1, i), random_uniform(32, 2, i));
      ASSERT_NEAR(solid.distance(p), 0, 1e-9) << solid.name << " " << p.transpose();
      points[octant(p)] += 1.0 / n;
      const Vec3 q = random_point(solid.box, i);
      if (std::abs(solid.distance(q)) > 0.05) continue;
      shell[octant(q)] += 1;
      ++in_shell;
    }
    for (std::size_t k = 0; k < 8; ++k) EXPECT_NEAR(points[k], shell[k] / in_shell, 0.04) << solid.name << " octant " << k;
    // Distances are distances: no nearer surface than they say, and one as near.
    for (std::uint64_t i = 0; i < 30; ++i) {
      const Vec3 p = random_point(solid.box, i);
      Real nearest = 1e30;
      for (std::uint64_t k = 0; k < 8'000; ++k) nearest = std::min(nearest, (p - solid.point(random_uniform(33, 0, k), random_uniform(33, 1, k), random_uniform(33, 2, k))).norm());
      EXPECT_GE(nearest, std::abs(solid.distance(p)) - 1e-9) << solid.name;
      EXPECT_LE(nearest, std::abs(solid.distance(p)) + 0.4) << solid.name;
    }
  }
}

/// A ball of radius r by latitude and longitude, normals exact.
geometry::TriMesh ball(Real r, int around) {
  geometry::TriMesh mesh;
  const auto at = [&](int i, int k) { return static_cast<Index>(i == 0 ? 0 : i == around ? 1 : 2 + (i - 1) * 2 * around + k % (2 * around)); };
  mesh.positions = {Vec3(0, 0, r), Vec3(0, 0, -r)};
  for (int i = 1; i < around; ++i)
    for (int k = 0; k < 2 * around; ++k) {
      const Real b = kPi * i / around, a = kPi * k / around;
      mesh.positions.emplace_back(r * std::sin(b) * std::cos(a), r * std::sin(b) * std::sin(a), r * std::cos(b));
    }
  for (int i = 0; i < around; ++i)
    for (int k = 0; k < 2 * around; ++k) {
      if (i > 0) mesh.triangles.push_back({at(i, k), at(i + 1, k), at(i, k + 1)});
      if (i + 1 < around) mesh.triangles.push_back({at(i, k + 1), at(i + 1, k), at(i + 1, k + 1)});
    }
  for (const Vec3& p : mesh.positions) mesh.normals.push_back(p.normalized());
  return mesh;
}

TEST(Solids, ErrorsOfABallThatIsTooLargeAndOfOneWithADentAreWhatTheyAre) {
  const Solid& sphere = solids().front();
  const SurfaceError exact = surface_error(ball(8, 80), sphere, 6000);
  EXPECT_TRUE(exact.solid) << exact.what;
  EXPECT_LT(exact.hausdorff, 0.01);
  EXPECT_LT(exact.volume, 0.002);
  EXPECT_LT(exact.normal, 1e-3);
  const SurfaceError large = surface_error(ball(8.2, 80), sphere, 6000);
  EXPECT_NEAR(large.hausdorff, 0.2, 0.01);
  EXPECT_NEAR(large.mean, 0.2, 0.01);
  EXPECT_NEAR(large.volume, std::pow(8.2 / 8, 3) - 1, 0.002);
  // Flattened at the top: only the way from the surface to the mesh knows how far.
  geometry::TriMesh dented = ball(8, 80);
  for (Vec3& p : dented.positions) p.z() = std::min(p.z(), 7.0);
  const SurfaceError dent = surface_error(dented, sphere, 20'000);
  EXPECT_NEAR(dent.hausdorff, 1, 0.02);
  EXPECT_LT(dent.mean, 0.1);
  // A hole.
  dented.triangles.pop_back();
  EXPECT_FALSE(surface_error(dented, sphere, 6000).solid);
  EXPECT_FALSE(surface_error({}, sphere, 6000).solid);
}

TEST(FillSlow, PutsOneParticleIntoEachUnitOfVolumeAndDisorderHasNoRows) {
  for (const Solid& solid : solids()) {
    const std::vector<Vec3> rows = fill(solid.box, solid.distance, solid.volume, Filling::kLattice);
    const std::vector<Vec3> x = fill(solid.box, solid.distance, solid.volume, Filling::kDisorder);
    ASSERT_EQ(x.size(), rows.size());
    EXPECT_NEAR(static_cast<Real>(x.size()) / solid.volume, 1, 0.003) << solid.name;
    std::size_t close = 0;
    for (std::size_t i = 0; i < x.size(); ++i) {
      EXPECT_LT(solid.distance(x[i]), -0.3) << solid.name;
      EXPECT_LT(solid.distance(rows[i]), 0) << solid.name;
      for (std::size_t j = 0; j < i; ++j) close += (x[i] - x[j]).norm() < 0.7;
    }
    EXPECT_LT(static_cast<Real>(close), 0.01 * static_cast<Real>(x.size())) << solid.name << ": particles at one place";
    EXPECT_EQ(x, fill(solid.box, solid.distance, solid.volume, Filling::kDisorder));
    EXPECT_NE(x, fill(solid.box, solid.distance, solid.volume, Filling::kDisorder, 2));
  }
}

TEST(DefaultSurfaceSlow, OfSolidsFilledAsByALiquidHoldsEveryBarAtThreeVoxelSizes) {
  // One setting: LevelSetOptions as they come. Bars of Hausdorff and mean distance in spacings; so many points of the surface that the largest at its
  // edges are among them.
  for (const Solid& solid : solids()) {
    const std::vector<Vec3> x = fill(solid.box, solid.distance, solid.volume, Filling::kDisorder);
    const std::vector<Real> radius(x.size(), 0.5);
    geometry::Points points;
    points.position = x;
    points.radius = radius;
    for (const int voxels : {2, 3, 4}) {
      skin::LevelSetOptions options;
      options.spacing = 1;
      options.voxel = 1.0 / voxels;
      const SurfaceError error = surface_error(skin::tessellate_level_set(skin::build_level_set(points, solid.volume, nullptr, options)), solid, 100'000);
      EXPECT_LT(error.hausdorff, 0.5) << solid.name << ", voxel 1/" << voxels;
      EXPECT_LT(error.mean, 0.15) << solid.name << ", voxel 1/" << voxels;
      EXPECT_LT(error.volume, 0.02) << solid.name << ", voxel 1/" << voxels;
      EXPECT_TRUE(error.solid) << solid.name << ", voxel 1/" << voxels << ": " << error.what;
    }
  }
}

// ---- What makes a skin sound ----

TEST(Blobs, AreWhatTheyAreCalled) {
  EXPECT_EQ(blobs().size(), std::size_t{kClusters + 1 + kMergingFrames + kPartingFrames});
  EXPECT_EQ(random_cluster(1).size(), 150u);
  EXPECT_NE(random_cluster(1), random_cluster(2));
  for (const Vec3& x : thin_sheet()) EXPECT_EQ(x.z(), 0);
  // Between the balls nothing at first, and lava at last; in the neck the other way round.
  const auto between = [](const std::vector<Vec3>& x) { return std::count_if(x.begin(), x.end(), [](const Vec3& p) { return std::abs(p.x()) < 0.5; }); };
  EXPECT_EQ(between(merging_balls(0)), 0);
  EXPECT_GT(between(merging_balls(1)), 10);
  EXPECT_GT(between(parting_ball(0)), 2 * between(parting_ball(1)));
  EXPECT_EQ(parting_ball(0).size(), parting_ball(1).size());
}

/// A cluster's skin, and the particles that it is of.
struct Sound {
  std::vector<Vec3> x = random_cluster(4);
  std::vector<Real> radius = std::vector<Real>(x.size(), 0.5);
  geometry::Points points;
  skin::SkinOptions options;
  skin::Skin skin;
  explicit Sound(skin::TessellationKind kind) {
    points.position = x;
    points.radius = radius;
    options.level_set.spacing = 1;
    options.tessellation = kind;
    skin = skin::make_skin(points, static_cast<Real>(x.size()), nullptr, options);
  }
  Soundness look() const { return soundness(skin, points, options); }
};

TEST(Soundness, SeesEveryFaultThatThereIs) {
  for (const auto kind : {skin::TessellationKind::kLevelSet, skin::TessellationKind::kVoronoi}) {
    Sound whole(kind);
    ASSERT_TRUE(whole.look().sound(0.005));

    Sound holed(kind);
    holed.skin.mesh.triangles.pop_back();
    EXPECT_FALSE(holed.look().solid);

    // A corner drawn to the middle of the opposite side but for a trace.
    Sound thin(kind);
    auto& p = thin.skin.mesh.positions;
    const geometry::Triangle t = thin.skin.mesh.triangles.front();
    p[t[0]] = 0.501 * p[t[1]] + 0.499 * p[t[2]] + 0.001 * (p[t[0]] - p[t[1]]);
    EXPECT_GT(thin.look().thin, whole.look().thin);

    // The last region's particle is another one now, which has none.
    Sound other(kind);
    auto& owners = other.skin.regions.particle;
    Index inner = 0;
    while (std::find(owners.begin(), owners.end(), inner) != owners.end()) ++inner;
    owners.back() = inner;
    EXPECT_EQ(other.look().without_region, 1u);
    EXPECT_EQ(other.look().regions_of_others, 1u);

    // And a region that nothing is of.
    Sound empty(kind);
    auto& of = kind == skin::TessellationKind::kVoronoi ? empty.skin.regions.of_triangle : empty.skin.regions.of_vertex;
    for (Index& r : of) r = r == 0 ? 1 : r;
    EXPECT_EQ(empty.look().nowhere, 1u);
    EXPECT_FALSE(empty.look().sound(1));
  }
}

TEST(VolumeAbove, OfABallOverASlopeIsThatOfItsCap) {
  // A ball of radius 8 and a plane at a distance of d from its middle: a cap of height h = 8 - d.
  const geometry::TriMesh whole = ball(8, 80);
  for (const Real rise : {0.0, 0.4})
    for (const Real at : {-20.0, 0.0, 3.0}) {
      std::vector<Real> z;
      for (int j = 0; j < 41; ++j)
        for (int i = 0; i < 41; ++i) z.push_back(at + rise * (i - 20));
      const geometry::Terrain ground = geometry::Terrain::from_height_field(geometry::HeightField(Vec2(-20, -20), Vec2(1, 1), 41, 41, z));
      const Real h = std::min(16.0, 8 - at / std::hypot(1, rise));
      EXPECT_NEAR(volume_above(whole, ground) / (kPi * h * h * (24 - h) / 3), 1, 0.01) << at << " " << rise;
    }
}

// ---- Pictures ----

/// A decoder of the little JPEG that effuse writes, from the specification: one scan, three components, the first at twice the resolution.
class Jpeg {
 public:
  explicit Jpeg(const std::string& bytes) : bytes_(bytes) {
    std::size_t at = 2;
    while (true) {
      const int marker = byte(at + 1);
      const std::size_t next = at + 2 + word(at + 2);
      if (byte(at) != 0xff) throw std::runtime_error("no marker");
      if (marker == 0xdb)
        for (std::size_t k = 0; k < 64; ++k) quantiser_[byte(at + 4)][k] = byte(at + 5 + k);
      if (marker == 0xc0) {
        height = static_cast<int>(word(at + 5));
        width = static_cast<int>(word(at + 7));
      }
      if (marker == 0xc4) read_codes(at + 4);
      at = next;
      if (marker == 0xda) break;
    }
    bit_ = 8 * at;
    decode();
  }
  int width = 0, height = 0;
  std::vector<Vec3> rgb;

 private:
  int byte(std::size_t i) const { return static_cast<unsigned char>(bytes_.at(i)); }
  std::size_t word(std::size_t i) const { return static_cast<std::size_t>(256 * byte(i) + byte(i + 1)); }
  void read_codes(std::size_t at) {
    auto& table = codes_[byte(at)];
    std::size_t symbol = at + 17;
    int code = 0;
    for (int length = 1; length <= 16; ++length, code *= 2)
      for (int k = byte(at + static_cast<std::size_t>(length)); k > 0; --k) table[{length, code++}] = byte(symbol++);
  }
  int bit() {
    if (bit_ % 8 == 0 && byte(bit_ / 8 - 1) == 0xff && byte(bit_ / 8) == 0) bit_ += 8;  // stuffed
    const int value = byte(bit_ / 8) >> (7 - bit_ % 8) & 1;
    ++bit_;
    return value;
  }
  int symbol(int table) {
    int code = 0;
    for (int length = 1; length <= 16; ++length) {
      code = 2 * code + bit();
      if (const auto found = codes_[table].find({length, code}); found != codes_[table].end()) return found->second;
    }
    throw std::runtime_error("no such code");
  }
  int number(int size) {
    int value = 0;
    for (int k = 0; k < size; ++k) value = 2 * value + bit();
    return size > 0 && value < 1 << (size - 1) ? value - (1 << size) + 1 : value;
  }
  std::array<Real, 64> block(int table, int& level) {
    std::array<Real, 64> F{}, f{};
    level += number(symbol(0x00));
    F[0] = level * quantiser_[table][0];
    for (int k = 1; k < 64; ++k) {
      const int s = symbol(0x10);
      if (s == 0) break;
      k += s >> 4;
      // The k-th of the zigzag: diagonals in turn upward and downward.
      int sum = 0, first = 0;
      while (first + std::min(sum, 14 - sum) + 1 <= k) first += std::min(sum, 14 - sum) + 1, ++sum;
      const int low = std::max(0, sum - 7), along = low + k - first, row = sum % 2 ? along : sum - along;
      if (const int v = number(s & 15); v != 0) F[static_cast<std::size_t>(8 * row + sum - row)] = v * quantiser_[table][static_cast<std::size_t>(k)];
    }
    for (int y = 0; y < 8; ++y)
      for (int x = 0; x < 8; ++x)
        for (int v = 0; v < 8; ++v)
          for (int u = 0; u < 8; ++u)
            f[static_cast<std::size_t>(8 * y + x)] += 0.25 * (u ? 1 : std::sqrt(0.5)) * (v ? 1 : std::sqrt(0.5)) * F[static_cast<std::size_t>(8 * v + u)] *
                                                      std::cos((2 * x + 1) * u * kPi / 16) * std::cos((2 * y + 1) * v * kPi / 16);
    return f;
  }
  void decode() {
    rgb.resize(static_cast<std::size_t>(width * height));
    int level[3] = {0, 0, 0};
    for (int y0 = 0; y0 < height; y0 += 16)
      for (int x0 = 0; x0 < width; x0 += 16) {
        std::array<std::array<Real, 64>, 4> light;
        for (auto& b : light) b = block(0, level[0]);
        const std::array<Real, 64> blue = block(1, level[1]), red = block(1, level[2]);
        for (int y = 0; y < 16 && y0 + y < height; ++y)
          for (int x = 0; x < 16 && x0 + x < width; ++x) {
            const Real Y = light[static_cast<std::size_t>(2 * (y / 8) + x / 8)][static_cast<std::size_t>(8 * (y % 8) + x % 8)] + 128;
            const Real cb = blue[static_cast<std::size_t>(8 * (y / 2) + x / 2)], cr = red[static_cast<std::size_t>(8 * (y / 2) + x / 2)];
            rgb[static_cast<std::size_t>((y0 + y) * width + x0 + x)] = Vec3(Y + 1.402 * cr, Y - 0.344136 * cb - 0.714136 * cr, Y + 1.772 * cb);
          }
      }
    // What is left are the filling bits and the end.
    const std::size_t end = (bit_ + 7) / 8 + (byte((bit_ + 7) / 8) == 0 ? 1 : 0);
    if (end + 2 != bytes_.size() || byte(end) != 0xff || byte(end + 1) != 0xd9) throw std::runtime_error("does not end where it should");
  }

  std::string bytes_;
  std::size_t bit_ = 0;
  std::map<int, std::array<int, 64>> quantiser_;
  std::map<int, std::map<std::pair<int, int>, int>> codes_;
};

TEST(Jpeg, ReadsBackAsThePicture) {
  // Gradients, a disc, some noise; sizes that are not multiples of a block.
  const auto worst = [](int width, int height, int quality, Real noise) {
    skin::Rgb8Image image{width, height, {}};
    for (int y = 0; y < height; ++y)
      for (int x = 0; x < width; ++x) {
        const bool disc = std::hypot(x - width / 2, y - height / 2) < width / 4;
        const Real grain = noise * random_uniform(4, 0, static_cast<std::uint64_t>(y * width + x));
        for (const Real v : {disc ? 200.0 : 40 + 1.5 * x, 60 + 1.2 * y, disc ? 20.0 : 100.0}) image.rgb.push_back(static_cast<std::uint8_t>(std::clamp(v + grain, 0.0, 255.0)));
      }
    const Jpeg back(encode_jpeg(image, quality));
    EXPECT_EQ(back.width, width);
    EXPECT_EQ(back.height, height);
    Real squares = 0;
    for (std::size_t p = 0; p < back.rgb.size(); ++p)
      for (std::size_t c = 0; c < 3; ++c) squares += std::pow(back.rgb[p][static_cast<Eigen::Index>(c)] - image.rgb[3 * p + c], 2);
    return std::sqrt(squares / static_cast<Real>(3 * back.rgb.size()));
  };
  // Colour at half the resolution is off along the disc's rim.
  EXPECT_LT(worst(61, 43, 95, 0), 9);
  EXPECT_LT(worst(61, 43, 100, 60), 12);
  EXPECT_LT(worst(16, 16, 90, 0), 20);
  EXPECT_LT(worst(1, 1, 90, 0), 4);
  EXPECT_LT(worst(61, 43, 95, 0), worst(61, 43, 10, 0));
}

TEST(Jpeg, SmallerWhenCoarser) {
  skin::Rgb8Image image{160, 120, {}};
  for (std::uint64_t i = 0; i < 3 * 160 * 120; ++i) image.rgb.push_back(static_cast<std::uint8_t>(256 * random_uniform(6, 0, i)));
  EXPECT_LT(encode_jpeg(image, 40).size(), encode_jpeg(image, 90).size());
  EXPECT_NO_THROW(Jpeg(encode_jpeg(image, 100))) << "long codes";
}

TEST(Closeups, TheToeIsAsLongAsItSaysAndStandsOnItsGround) {
  const LavaToe toe(kCoolingStages[1]);
  const geometry::Terrain ground = toe.ground();
  EXPECT_GT(toe.x.size(), 1500u);
  for (std::size_t i = 0; i < toe.x.size(); ++i) {
    ASSERT_GT(ground.contact(toe.x[i], 10).distance, 0);
    ASSERT_GE(toe.temperature[i], kCoolingStages[1].front - 1e-9);
    ASSERT_LE(toe.temperature[i], kCoolingStages[1].back + 1e-9);
  }
  skin::PreviewOptions view = view_of_toe(64, 48);
  const geometry::TriMesh smooth = skin_of_toe(toe, nullptr, view, 2);
  const skin::SkinKind kind = skin::SkinKind::kAa;
  const geometry::TriMesh rough = skin_of_toe(toe, &kind, view, 2);
  EXPECT_GT(rough.positions.size(), smooth.positions.size());
  EXPECT_TRUE(rough.attributes.contains("glow") && rough.attributes.contains("detail"));
  EXPECT_FALSE(smooth.attributes.contains("detail"));
}

TEST(StudyPictures, AreWrittenUnderNamesThatStayInTheFolder) {
  set_log_level(LogLevel::kQuiet);
  const fs::path folder = fs::temp_directory_path() / fmt::format("effuse.pictures.{}", ::getpid());
  for (const std::string& file : std::vector<std::string>{"a-b_1.jpg", "../x.jpg", "x", ".jpg", "a.b.jpg"}) {
    fs::remove_all(folder);
    StudyOptions options;
    options.folder = folder;
    const std::vector<Case> cases = {{"one", "One", "nobody", true, [&] {
                                        CaseResult result;
                                        result.pictures.push_back({file, "bytes"});
                                        return result;
                                      }}};
    const StudyReport report = run_study(cases, options, [](std::size_t, std::size_t, const Case&, const Outcome*) {});
    const bool good = file == "a-b_1.jpg";
    EXPECT_EQ(report.outcomes.at(0).failure.empty(), good) << file;
    EXPECT_EQ(fs::exists(folder / "pictures"), good) << file;
    if (good) {
      EXPECT_EQ(read_file(folder / "pictures" / file), "bytes");
    }
  }
  fs::remove_all(folder);
  set_log_level(LogLevel::kInfo);
}

}  // namespace
}  // namespace effuse::study
