#include "skin/preview/preview.h"

#include <gtest/gtest.h>
#include <unistd.h>

#include <cmath>
#include <fstream>
#include <limits>
#include <map>
#include <set>

#include "geometry/base/error.h"
#include "geometry/base/files.h"
#include "geometry/base/parallel.h"
#include "geometry/base/random.h"
#include "skin/color/lava_color.h"
#include "skin/preview/bloom.h"
#include "skin/preview/glow_field.h"
#include "skin/preview/ground.h"
#include "skin/preview/ground_texture.h"
#include "skin/preview/label.h"
#include "skin/preview/sky.h"
#include "skin/write/png.h"
#include "tests/skin/sample_lava.h"

namespace effuse::skin {
namespace {

namespace fs = std::filesystem;
using geometry::TriMesh;

double hill(double x, double y) { return 12 * std::exp(-((x - 20) * (x - 20) + y * y) / 3000) + 0.02 * x; }

/// A hill of n x n posts over [-100, 100]^2, moved by offset.
TriMesh hill_mesh(int n, const Vec3& offset = Vec3::Zero()) {
  TriMesh mesh;
  for (int j = 0; j < n; ++j)
    for (int i = 0; i < n; ++i) {
      const double x = -100 + 200.0 * i / (n - 1), y = -100 + 200.0 * j / (n - 1);
      mesh.positions.push_back(Vec3(x, y, hill(x, y)) + offset);
    }
  for (int j = 0; j + 1 < n; ++j)
    for (int i = 0; i + 1 < n; ++i) {
      const Index a = static_cast<Index>(j * n + i), b = a + 1, c = a + static_cast<Index>(n), d = c + 1;
      mesh.triangles.push_back({a, b, d});
      mesh.triangles.push_back({a, d, c});
    }
  return mesh;
}

TriMesh hot_tube(const Vec3& offset = Vec3::Zero()) {
  TriMesh mesh = testing_meshes::tube(60, 4, 60, 16, hill);
  for (Vec3& p : mesh.positions) p += offset;
  color_lava(mesh);
  return mesh;
}

PreviewOptions looking_down(int width = 160, int height = 90) {
  PreviewOptions options;
  options.width = width;
  options.height = height;
  options.camera = frame_camera(Box3(Vec3(-60, -40, 0), Vec3(80, 40, 15)), -kPi / 2, 0.7);
  return options;
}

Vec3 pixel(const Image& image, int x, int y) {
  const std::size_t at = 3 * (static_cast<std::size_t>(y) * static_cast<std::size_t>(image.width) + static_cast<std::size_t>(x));
  return {image.rgb[at], image.rgb[at + 1], image.rgb[at + 2]};
}

/// Where a point of the world is seen: column, row.
Vec2 seen_at(const PreviewOptions& o, const Vec3& p) {
  const Vec3 forward = (o.camera.target - o.camera.eye).normalized(), right = forward.cross(Vec3::UnitZ()).normalized(),
             up = right.cross(forward);
  const Vec3 d = p - o.camera.eye;
  const double f = o.height / 2.0 / std::tan(o.camera.field_of_view / 2), depth = d.dot(forward);
  return {o.width / 2.0 + f * d.dot(right) / depth, o.height / 2.0 - f * d.dot(up) / depth};
}

TEST(Preview, LavaIsSeenWhereItLiesHotInTheWestAndDarkInTheEast) {
  const Preview preview(hill_mesh(41));
  const PreviewOptions options = looking_down();
  const TriMesh lava = hot_tube();
  const Image with = preview.render(lava, options), without = preview.render({}, options);

  const auto at = [&](double x) {
    const Vec2 where = seen_at(options, Vec3(x, 0, hill(x, 0) + 2.4));
    return std::pair{static_cast<int>(where.x()), static_cast<int>(where.y())};
  };
  const auto [hx, hy] = at(3);
  const Vec3 hot = pixel(with, hx, hy);
  EXPECT_GT(hot.x(), 1) << "glows";
  EXPECT_GT(hot.x(), 2 * hot.y()) << "red to orange " << hot.transpose();
  EXPECT_GT(hot.y(), 3 * hot.z()) << "not pink";
  const auto [cx, cy] = at(57);
  const Vec3 cold = pixel(with, cx, cy);
  EXPECT_LT(cold.maxCoeff(), 0.3) << "crust is dark";

  // Ground: neither black nor blinding, and lit by the lava beside it.
  double darkest = 1e9, brightest = 0;
  for (int y = 20; y < 90; ++y)
    for (int x = 0; x < 160; ++x) {
      darkest = std::min(darkest, pixel(without, x, y).maxCoeff());
      brightest = std::max(brightest, pixel(without, x, y).maxCoeff());
    }
  EXPECT_GT(darkest, 0.002);
  EXPECT_LT(brightest, 2);
  PreviewOptions dark = options;
  dark.bloom = 0;
  const Vec2 beside = seen_at(options, Vec3(3, -9, hill(3, -9)));
  const int bx = static_cast<int>(beside.x()), by = static_cast<int>(beside.y());
  const Vec3 lit = pixel(preview.render(lava, dark), bx, by), unlit = pixel(preview.render({}, dark), bx, by);
  EXPECT_GT(lit.x(), 1.1 * unlit.x());
  EXPECT_NEAR(lit.z(), unlit.z(), 0.3 * unlit.z()) << "the glow is red, not blue";
}

TEST(Preview, SameBitsOnAnyNumberOfThreads) {
  const TriMesh terrain = hill_mesh(60), lava = hot_tube();
  const auto render = [&](int threads) {
    const ThreadLimit limit(threads);
    return Preview(terrain).render(lava, looking_down(320, 180)).rgb;
  };
  const std::vector<float> one = render(1);
  EXPECT_TRUE(one == render(2));
  EXPECT_TRUE(one == render(4));
}

TEST(Preview, ItDoesNotMatterWhereOnTheMapTheTerrainLies) {
  const Vec3 far(2667400, 6478700, 1000);
  PreviewOptions here = looking_down(), there = here;
  there.camera.eye += far;
  there.camera.target += far;
  const Image a = Preview(hill_mesh(41)).render(hot_tube(), here), b = Preview(hill_mesh(41, far)).render(hot_tube(far), there);
  double difference = 0;
  for (std::size_t i = 0; i < a.rgb.size(); ++i) difference += std::abs(a.rgb[i] - b.rgb[i]);
  EXPECT_LT(difference / static_cast<double>(a.rgb.size()), 2e-3) << "mean of a channel; float of 1e6 m alone would shift pixels";
}

TEST(Preview, NothingButEmptyMeshesIsAPictureToo) {
  PreviewOptions options = looking_down(64, 36);
  const Image image = Preview(TriMesh{}).render(TriMesh{}, options);
  for (const float x : image.rgb) EXPECT_TRUE(std::isfinite(x) && x > 0);
}

TEST(Preview, LavaWithoutColoursIsDarkRockAndNightIsDarkButForTheGlow) {
  const Preview preview(hill_mesh(41));
  TriMesh bare = testing_meshes::tube(60, 4, 60, 16, hill);
  PreviewOptions options = looking_down(64, 36);
  for (const float x : preview.render(bare, options).rgb) EXPECT_TRUE(std::isfinite(x));
  options.sun_direction = Vec3(0, 0, -1);
  const Image night = preview.render(hot_tube(), options);
  float brightest = 0;
  for (const float x : night.rgb) brightest = std::max(brightest, x);
  EXPECT_GT(brightest, 1) << "lava glows at night";
  EXPECT_LT(pixel(night, 2, 34).maxCoeff(), 0.05) << "the ground in the corner does not";
}

/// Square of rock over flat ground, of that temperature.
TriMesh plate(float kelvin) {
  TriMesh mesh;
  mesh.positions = {{-90, -90, 1}, {90, -90, 1}, {90, 90, 1}, {-90, 90, 1}};
  mesh.triangles = {{0, 1, 2}, {0, 2, 3}};
  mesh.attributes["color"] = {3, std::vector<float>(12, 0.05f)};
  mesh.attributes["temperature"] = {1, std::vector<float>(4, kelvin)};
  return mesh;
}

TEST(Preview, ByNightColdRubbleIsAsDarkAsItsColourWhereGlassAndFreshLavaMirrorTheSky) {
  TriMesh flat = hill_mesh(11);
  for (Vec3& p : flat.positions) p.z() = 0;
  const Preview preview(flat);
  PreviewOptions options = looking_down(64, 36);
  options.sun_direction = Vec3(-std::cos(-0.05), 0, std::sin(-0.05));  // just set, in the west
  options.haze = options.bloom = options.glow_light = 0;
  options.camera = {Vec3(85, 0, 8), Vec3(-20, 0, 1), 0.2};
  // Light of what is seen low over the rock, against that of its colour under the whole sky.
  const auto shine = [&](float kelvin, Real gloss) {
    options.gloss = gloss;
    const Image image = preview.render(plate(kelvin), options);
    double sum = 0;
    for (int x = 0; x < image.width; ++x) sum += pixel(image, x, 20).mean();
    return sum / image.width / (0.05 * Sky(options.sun_direction, options.sun, options.sky).ambient(Vec3f::UnitZ()).cast<double>().mean());
  };
  EXPECT_NEAR(shine(300, 0), 1, 0.35);
  EXPECT_GT(shine(300, 1), 2.5);
  EXPECT_GT(shine(1400, 0), 1.5) << "a film of melt";
  EXPECT_LT(shine(300, 0.15), 1.6);
}

TEST(Preview, ALowSunMakesNoDarkTilesOfADemInWholeMetres) {
  // Posts 10 m apart on a slope that the sun just grazes; heights as they are, and rounded.
  TriMesh even, rounded;
  constexpr int n = 41;
  for (int j = 0; j < n; ++j)
    for (int i = 0; i < n; ++i) {
      const double x = 10 * (i - n / 2), y = 10 * (j - n / 2);
      const double z = 0.13 * x + 6 * std::sin(0.02 * x) * std::cos(0.023 * y);
      even.positions.emplace_back(x, y, z);
      rounded.positions.emplace_back(x, y, std::round(z));
    }
  for (int j = 0; j + 1 < n; ++j)
    for (int i = 0; i + 1 < n; ++i) {
      const Index a = static_cast<Index>(j * n + i), b = a + 1, c = a + static_cast<Index>(n), d = c + 1;
      even.triangles.push_back({a, b, d});
      even.triangles.push_back({a, d, c});
    }
  rounded.triangles = even.triangles;
  PreviewOptions options = looking_down(160, 120);
  options.camera = {Vec3(0, 0, 420), Vec3(0, 0, 0), 0.7};
  options.sun_direction = Vec3(0.97, 0, 0.235);  // 13.6 degrees over the uphill side
  options.bloom = 0;
  options.sky = 0.1;
  const Image smooth_light = Preview(even).render({}, options), light = Preview(rounded).render({}, options);
  int dark = 0, all = 0;
  for (int y = 0; y < options.height; ++y)
    for (int x = 0; x < options.width; ++x, ++all) dark += pixel(light, x, y).mean() < 0.5 * pixel(smooth_light, x, y).mean();
  EXPECT_LT(dark, 0.001 * all) << "1.3 % of the picture, in tiles as large as cells, where facets shade one another";
}

TEST(Preview, BadOptionsAndBrokenMeshesAreInputErrors) {
  const Preview preview(hill_mesh(5));
  const auto refused = [&](auto&& change) {
    PreviewOptions options = looking_down(16, 9);
    change(options);
    EXPECT_THROW(preview.render({}, options), InputError);
  };
  refused([](PreviewOptions& o) { o.width = 0; });
  refused([](PreviewOptions& o) { o.height = 100000; });
  refused([](PreviewOptions& o) { o.samples = 0; });
  refused([](PreviewOptions& o) { o.camera.target = o.camera.eye; });
  refused([](PreviewOptions& o) { o.camera.field_of_view = 4; });
  refused([](PreviewOptions& o) { o.sun_direction = Vec3::Zero(); });
  refused([](PreviewOptions& o) { o.exposure = std::nan(""); });
  refused([](PreviewOptions& o) { o.gloss = 1.5; });
  TriMesh broken = hill_mesh(5);
  broken.triangles[3][0] = 999;
  EXPECT_THROW(Preview{broken}, InputError);
  EXPECT_THROW(preview.render(broken, looking_down(16, 9)), InputError);
  broken = hill_mesh(5);
  broken.positions[3].z() = std::numeric_limits<double>::infinity();
  EXPECT_THROW(Preview{broken}, InputError);
}

TEST(Preview, LookingStraightDownIsFine) {
  PreviewOptions options = looking_down(32, 18);
  options.camera = {Vec3(0, 0, 300), Vec3(0, 0, 0), 0.6};
  for (const float x : Preview(hill_mesh(9)).render(hot_tube(), options).rgb) EXPECT_TRUE(std::isfinite(x));
}

TEST(FrameCamera, EveryCornerIsInsideAndOneTouchesEachOfTwoOppositeEdges) {
  const double margin = 0.06, aspect = 16.0 / 9;
  for (int k = 0; k < 200; ++k) {
    const auto draw = [&](std::uint64_t stream) { return random_uniform(7, stream, static_cast<std::uint64_t>(k)); };
    const Vec3 centre(1000 * draw(0), -500 * draw(1), 100 * draw(2)), half(1 + 300 * draw(3), 1 + 300 * draw(4), 50 * draw(5));
    PreviewOptions o;
    o.width = 1600;
    o.height = 900;
    o.camera = frame_camera(Box3(centre - half, centre + half), 6.28 * draw(6), 3 * draw(7) - 1.5, aspect, margin);
    const Box3 box(centre - half, centre + half);
    Vec2 low(1, 1), high(0, 0);
    for (int c = 0; c < 8; ++c) {
      const Vec2 at = seen_at(o, box.corner(static_cast<Box3::CornerType>(c))).cwiseQuotient(Vec2(1600, 900));
      low = low.cwiseMin(at);
      high = high.cwiseMax(at);
    }
    EXPECT_GT(low.minCoeff(), margin - 1e-9);
    EXPECT_LT(high.maxCoeff(), 1 - margin + 1e-9);
    const bool fills_across = low.x() < margin + 1e-6 && high.x() > 1 - margin - 1e-6,
               fills_up = low.y() < margin + 1e-6 && high.y() > 1 - margin - 1e-6;
    EXPECT_TRUE(fills_across || fills_up) << "no nearer camera would do";
  }
}

TEST(FrameCamera, AnEmptyBoxAndAPointHaveACameraToo) {
  for (const Box3& box : {Box3(), Box3(Vec3(5, 5, 5), Vec3(5, 5, 5))}) {
    const Camera camera = frame_camera(box, 1, 0.3);
    EXPECT_TRUE(camera.eye.allFinite());
    EXPECT_GT((camera.eye - camera.target).norm(), 0);
  }
}

TEST(Ground, TheTerrainStaysAsItIsAndTheApronGoesOnFromItsBorder) {
  const TriMesh terrain = hill_mesh(21);
  const Ground ground = build_ground(terrain);
  ASSERT_EQ(ground.terrain_vertices, terrain.positions.size());
  for (std::size_t i = 0; i < terrain.positions.size(); ++i)
    EXPECT_LT((ground.positions[i].cast<double>() + ground.origin - terrain.positions[i]).norm(), 1e-4);
  for (std::size_t k = 0; k < terrain.triangles.size(); ++k) EXPECT_EQ(ground.triangles[k], terrain.triangles[k]);
  // No border edge of the terrain is left bare: each has a second triangle.
  std::map<std::pair<Index, Index>, int> edges;
  for (const auto& t : ground.triangles)
    for (std::size_t k = 0; k < 3; ++k) ++edges[std::minmax(t[k], t[(k + 1) % 3])];
  for (const auto& [edge, count] : edges) {
    if (edge.second < ground.terrain_vertices) {
      EXPECT_EQ(count, 2) << edge.first << " " << edge.second;
    }
  }
  for (const Vec3f& n : ground.normals) EXPECT_NEAR(n.norm(), 1, 1e-5);
}

TEST(Ground, ATerrainWoundUpsideDownIsDrawnTheSame) {
  TriMesh turned = hill_mesh(21);
  for (geometry::Triangle& t : turned.triangles) std::swap(t[1], t[2]);
  const PreviewOptions options = looking_down(64, 36);
  const Image upright = Preview(hill_mesh(21)).render({}, options), over = Preview(turned).render({}, options);
  double difference = 0;
  for (std::size_t i = 0; i < upright.rgb.size(); ++i) difference += std::abs(upright.rgb[i] - over.rgb[i]);
  EXPECT_LT(difference / static_cast<double>(upright.rgb.size()), 1e-3);
}

TEST(Ground, AHoleInTheTerrainStaysAHole) {
  TriMesh terrain = hill_mesh(21);
  std::erase_if(terrain.triangles, [&](const geometry::Triangle& t) { return terrain.positions[t[0]].head<2>().norm() < 25; });
  const Ground ground = build_ground(terrain);
  for (std::size_t k = terrain.triangles.size(); k + 2 < ground.triangles.size(); ++k)
    for (const Index v : ground.triangles[k]) EXPECT_GT(ground.positions[v].head<2>().norm(), 90) << "the apron is outside";
}

TEST(PlaneNoise, ItsDerivativesAreItsSlopesAndItStaysWithinBounds) {
  float low = 0, high = 0;
  for (std::uint64_t k = 0; k < 2000; ++k) {
    const float x = static_cast<float>(20 * random_uniform(3, 0, k) - 10), y = static_cast<float>(20 * random_uniform(3, 1, k) - 10),
                h = 1.0f / 256;
    const PlaneNoise n = plane_noise(x, y, 5);
    // Central differences: h^2 / 6 of the third derivative, and rounding of 1e-7 / h.
    EXPECT_NEAR(n.dx, (plane_noise(x + h, y, 5).value - plane_noise(x - h, y, 5).value) / (2 * h), 4e-3);
    EXPECT_NEAR(n.dy, (plane_noise(x, y + h, 5).value - plane_noise(x, y - h, 5).value) / (2 * h), 4e-3);
    low = std::min(low, n.value);
    high = std::max(high, n.value);
  }
  EXPECT_GT(low, -1.1f);
  EXPECT_LT(high, 1.1f);
  EXPECT_GT(high - low, 1.0f);
}

TEST(GlowField, FarAwayLightFallsWithTheSquareOfTheDistanceAndWallsShadeIt) {
  // A glowing square of 2 m: 4 m^2 of radiance 100.
  const std::vector<Vec3f> positions{{-1, -1, 1}, {1, -1, 1}, {1, 1, 1}, {-1, 1, 1}};
  const std::vector<geometry::Triangle> triangles{{0, 1, 2}, {0, 2, 3}};
  const std::vector<Vec3f> glow(4, Vec3f(100, 10, 0));
  const auto flat = [](float, float) { return 0.0f; };
  const GlowField open(positions, triangles, glow, {flat, [](const Vec3f&, const Vec3f&) { return false; }});
  const auto facing = [&](const GlowField& field, float x) { return field(Vec3f(x, 0, 0), Vec3f(-1, 0, 0.1f).normalized()); };
  const Vec3f near = facing(open, 6), far = facing(open, 12);
  EXPECT_NEAR(near.x() / near.y(), 10, 1e-3) << "the light's colour";
  EXPECT_NEAR(near.x() / far.x(), 4, 1.2);
  EXPECT_NEAR(near.x(), 0.5 * 100 * 4 / (kPi * 37), 0.2);
  const GlowField walled(positions, triangles, glow, {flat, [](const Vec3f& a, const Vec3f& b) { return (a.x() > 8) != (b.x() > 8); }});
  EXPECT_NEAR(facing(walled, 6).x(), near.x(), 1e-6);
  EXPECT_EQ(facing(walled, 12).x(), 0);
  EXPECT_TRUE(GlowField(positions, triangles, std::vector<Vec3f>(4, Vec3f::Zero()), {flat, {}}).empty());
}

TEST(Sky, TheSunSetsAndTheSkyWithIt) {
  const Sky day(Vec3(0, -1, 1), 3, 1), dusk(Vec3(0, -1, 0.15), 3, 1), night(Vec3(0, -1, -0.5), 3, 1);
  EXPECT_LT(day.sun_light().x(), 1.5f * day.sun_light().z()) << "white by day";
  EXPECT_GT(dusk.sun_light().x(), 2 * dusk.sun_light().z()) << "warm";
  EXPECT_EQ(night.sun_light().maxCoeff(), 0);
  const Vec3f up(0, 0, 1);
  EXPECT_GT(luminance(day.radiance(up)), luminance(dusk.radiance(up)));
  EXPECT_GT(luminance(dusk.radiance(up)), luminance(night.radiance(up)));
}

TEST(Tone, DarkStaysDarkBrightSaturatesAndHotRedTurnsOrange) {
  const auto toned = [](float r, float g, float b) {
    float rgb[3] = {r, g, b};
    tone_map(rgb);
    return Vec3f(rgb[0], rgb[1], rgb[2]);
  };
  EXPECT_EQ(toned(0, 0, 0), Vec3f(0, 0, 0));
  float before = -1;
  for (float x = 0; x < 20; x += 0.05f) {
    const Vec3f c = toned(x, x, x);
    EXPECT_GE(c.y(), before);
    EXPECT_LE(c.maxCoeff(), 1);
    before = c.y();
  }
  const Vec3f hot = toned(6, 0.7f, 0);
  EXPECT_GT(hot.y(), 0.5f);
  EXPECT_LT(hot.z(), 0.3f);
}

class Pictures : public testing::Test {
 protected:
  void SetUp() override {
    folder_ = fs::temp_directory_path() /
              ("effuse_pictures_" + std::to_string(::getpid()) + "_" + testing::UnitTest::GetInstance()->current_test_info()->name());
    fs::create_directories(folder_);
  }
  void TearDown() override { fs::remove_all(folder_); }
  fs::path folder_;
};

TEST_F(Pictures, APngReadsBackAsTheToneMappedImage) {
  Image image{5, 4, {}};
  for (std::uint64_t i = 0; i < 60; ++i) image.rgb.push_back(static_cast<float>(3 * random_uniform(2, 0, i) - 0.2));
  write_png(folder_ / "a.png", image);
  const Rgb8Image back = read_png(folder_ / "a.png");
  ASSERT_EQ(back.width, 5);
  ASSERT_EQ(back.height, 4);
  for (std::size_t p = 0; p < 20; ++p) {
    float rgb[3] = {image.rgb[3 * p], image.rgb[3 * p + 1], image.rgb[3 * p + 2]};
    tone_map(rgb);
    for (std::size_t c = 0; c < 3; ++c) {
      const double linear = rgb[c], code = 255 * (linear <= 0.0031308 ? 12.92 * linear : 1.055 * std::pow(linear, 1 / 2.4) - 0.055);
      EXPECT_NEAR(back.rgb[3 * p + c], code, 0.501);
    }
  }
}

TEST_F(Pictures, AContactSheetHoldsEveryPictureInItsPlaceAndKeepsItsLight) {
  // Picture k is one grey; picture 1 is a checkerboard of black and white, whose mean is half the light.
  std::vector<fs::path> files;
  for (int k = 0; k < 5; ++k) {
    Rgb8Image picture{960, 540, std::vector<std::uint8_t>(3 * 960 * 540, static_cast<std::uint8_t>(40 * k + 20))};
    if (k == 1)
      for (std::size_t i = 0; i < picture.rgb.size(); ++i) picture.rgb[i] = (i / 3 % 960 + i / 3 / 960) % 2 ? 255 : 0;
    files.push_back(folder_ / ("p" + std::to_string(k) + ".png"));
    write_file(files.back(), encode_png(picture));
  }
  write_contact_sheet(folder_ / "sheet.png", files, {"0.0 s", "", "", "", "Frame 96"}, 3);
  const Rgb8Image sheet = read_png(folder_ / "sheet.png");
  EXPECT_EQ(sheet.width, 3 * 486 + 6);
  EXPECT_EQ(sheet.height, 2 * 276 + 6);
  const auto at = [&](int x, int y) {
    return static_cast<int>(
        sheet.rgb[3 * (static_cast<std::size_t>(y) * static_cast<std::size_t>(sheet.width) + static_cast<std::size_t>(x))]);
  };
  for (int k : {0, 2, 3, 4}) EXPECT_EQ(at(6 + k % 3 * 486 + 240, 6 + k / 3 * 276 + 200), 40 * k + 20) << k;
  EXPECT_NEAR(at(6 + 486 + 240, 206), 188, 1) << "half the light is code 188, not 128";
  // Labels: white ink at the upper left of pictures 0 and 4, none on 2.
  const auto ink = [&](int k) {
    int count = 0;
    for (int y = 0; y < 18; ++y)
      for (int x = 0; x < 120; ++x) count += at(6 + k % 3 * 486 + x, 6 + k / 3 * 276 + y) == 255;
    return count;
  };
  EXPECT_GT(ink(0), 50);
  EXPECT_GT(ink(4), ink(0));
  EXPECT_EQ(ink(2), 0);
}

TEST_F(Pictures, ASheetOfAMissingOrBrokenPictureIsAnInputErrorAndLeavesNothing) {
  EXPECT_THROW(write_contact_sheet(folder_ / "s.png", {folder_ / "none.png"}, {"a"}, 2), InputError);
  EXPECT_THROW(write_contact_sheet(folder_ / "s.png", {}, {}, 2), InputError);
  std::ofstream(folder_ / "bad.png") << "no picture";
  EXPECT_THROW(write_contact_sheet(folder_ / "s.png", {folder_ / "bad.png"}, {"a"}, 2), InputError);
  EXPECT_FALSE(fs::exists(folder_ / "s.png"));
}

TEST(Label, EveryGlyphHasInkSmallLettersAreCapitalsAndStrangersAreQuestionMarks) {
  const auto burnt = [](const std::string& text) {
    Rgb8Image image{40, 12, std::vector<std::uint8_t>(3 * 40 * 12, 0)};
    burn_label(image, 0, 0, 1, text);
    return image.rgb;
  };
  const std::string all = "0123456789ABCDEFGHIJKLMNOPQRSTUVWXYZ.,:-+/=%()_?#";
  std::set<std::vector<std::uint8_t>> different;
  for (const char c : all) different.insert(burnt(std::string(1, c)));
  EXPECT_EQ(different.size(), all.size()) << "no two glyphs are alike";
  EXPECT_EQ(burnt("x"), burnt("X"));
  EXPECT_EQ(burnt("\xe4"), burnt("?"));
  burnt(std::string(5000, 'W'));  // does not fit: cut off
}

}  // namespace
}  // namespace effuse::skin
