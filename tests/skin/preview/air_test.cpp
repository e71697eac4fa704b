#include "skin/preview/air.h"

#include <gtest/gtest.h>

#include <cmath>

#include "geometry/base/parallel.h"
#include "geometry/procedural/primitives.h"
#include "skin/preview/preview.h"

namespace effuse::skin {
namespace {

PreviewOptions small() {
  PreviewOptions o;
  o.width = 120;
  o.height = 80;
  o.camera = {Vec3(0, -20, 4), Vec3(0, 0, 2), 0.7};
  o.sun_direction = Vec3(-0.3, -0.6, 0.7);
  o.bloom = 0;
  return o;
}

Vec3 pixel(const Image& image, int x, int y) {
  const float* p = &image.rgb[3 * (static_cast<std::size_t>(y) * static_cast<std::size_t>(image.width) + static_cast<std::size_t>(x))];
  return Vec3(p[0], p[1], p[2]);
}

const Preview& plain() {
  static const Preview preview(geometry::make_grid(Vec3(-30, -30, 0), Vec2(5, 5), 12, 12));
  return preview;
}

/// A ball of density about a point.
Cloud ball(const Vec3& at, Real extinction) {
  Cloud cloud;
  geometry::GridVolume& g = cloud.grid;
  g.n = {12, 12, 12};
  g.cell = 0.5;
  g.corner = at - Vec3::Constant(3);
  g.density.assign(g.size(), 0);
  for (int k = 0; k < 12; ++k)
    for (int j = 0; j < 12; ++j)
      for (int i = 0; i < 12; ++i)
        if ((Vec3(i + 0.5, j + 0.5, k + 0.5) * 0.5 - Vec3::Constant(3)).norm() < 2.5) g.density[g.index(i, j, k)] = static_cast<float>(extinction);
  return cloud;
}

TEST(Air, NothingInItChangesNothing) {
  Air air;
  Speck behind;
  behind.position = Vec3(0, -30, 4);
  behind.glow = Vec3::Ones();
  Speck below;
  below.position = Vec3(0, 5, -3);
  below.radius = 0.3;
  air.specks = {behind, below};
  air.clouds = {ball(Vec3(0, 0, 4), 0)};
  const Image with = plain().render({}, small(), air);
  // Light of what lies behind the camera or under ground may fall on the ground; nothing is drawn.
  PreviewOptions dark = small();
  dark.glow_light = 0;
  EXPECT_EQ(plain().render({}, dark, air).rgb, plain().render({}, dark).rgb);
  EXPECT_EQ(with.rgb.size(), 3u * 120 * 80);
}

TEST(Air, AnOpaqueSpeckHidesAGlowingOneAddsAndBothAreHiddenByWhatIsBefore) {
  PreviewOptions o = small();
  o.glow_light = 0;
  const Image bare = plain().render({}, o);
  Air air;
  air.specks.resize(1);
  Speck& s = air.specks[0];
  s.position = Vec3(0, 0, 2);
  s.radius = 0.6;
  const Vec3 before = pixel(bare, 60, 40);
  const Vec3 black = pixel(plain().render({}, o, air), 60, 40);
  EXPECT_LT(black.maxCoeff(), 1e-6);
  s.soft = true;
  s.glow = Vec3(2, 1, 0.5);
  const Vec3 lit = pixel(plain().render({}, o, air), 60, 40);
  EXPECT_GT((lit - before).minCoeff(), 0.4);
  geometry::TriMesh wall = geometry::make_box(Vec3(-4, -3, 0), Vec3(4, -2, 5));
  EXPECT_EQ(pixel(plain().render(wall, o, air), 60, 40), pixel(plain().render(wall, o), 60, 40));
}

TEST(Air, ACloudHidesByBeersLaw) {
  PreviewOptions o = small();
  o.sky = o.sun = 0;  // nothing for it to scatter
  o.sun_direction = Vec3(0, 0, -1);
  geometry::TriMesh wall = geometry::make_box(Vec3(-9, 5, 0), Vec3(9, 6, 9));
  wall.attributes["glow"] = {3, std::vector<float>(3 * wall.positions.size(), 1.0f)};
  o.glow_light = 0;
  const Real bare = pixel(plain().render(wall, o), 60, 40).y();
  for (const Real extinction : {0.1, 0.5}) {
    Air air;
    air.clouds = {ball(Vec3(0, 0, 2), extinction)};
    const Real seen = pixel(plain().render(wall, o, air), 60, 40).y();
    // Five metres through its middle, blurred by its cells at both ends.
    EXPECT_NEAR(std::log(bare / seen), 5 * extinction, 0.08 * 5 * extinction);
  }
}

TEST(Air, TheSunlitSideOfACloudIsTheBrighterOne) {
  PreviewOptions o = small();
  o.sun_direction = Vec3(-1, 0, 0.3);
  o.width = 240;
  Air air;
  air.clouds = {ball(Vec3(0, 0, 2), 2)};
  const Image image = plain().render({}, o, air);
  EXPECT_GT(pixel(image, 120 - 8, 40).sum(), 1.2 * pixel(image, 120 + 8, 40).sum());
}

TEST(Air, HotCloudsGlowAndFlamesLightTheGround) {
  PreviewOptions o = small();
  o.sun_direction = Vec3(0, 0.3, -0.5);
  Air cold, hot;
  cold.clouds = {ball(Vec3(0, 0, 2), 1)};
  hot = cold;
  hot.clouds[0].grid.temperature.assign(hot.clouds[0].grid.size(), 1400);
  EXPECT_GT(pixel(plain().render({}, o, hot), 60, 40).x(), pixel(plain().render({}, o, cold), 60, 40).x() + 1);
  Air flames;
  flames.specks.resize(1);
  flames.specks[0].position = Vec3(0, 0, 1);
  flames.specks[0].radius = 0.5;
  flames.specks[0].soft = true;
  flames.specks[0].glow = Vec3(6, 3, 1);
  EXPECT_GT(pixel(plain().render({}, o, flames), 60, 52).x(), 1.5 * pixel(plain().render({}, o), 60, 52).x());
}

TEST(Air, WaterMirrorsTheSkyAndIsSeenInto) {
  PreviewOptions o = small();
  o.camera = {Vec3(0, -20, 6), Vec3(0, 0, 1), 0.7};
  geometry::TriMesh water = geometry::make_grid(Vec3(-20, -20, 1), Vec2(40, 40), 1, 1);
  water.attributes["color"] = {3, std::vector<float>(12, 0.02f)};
  geometry::TriMesh rock = water;
  water.attributes["water"] = {1, std::vector<float>(4, 0.5f)};
  const Vec3 deep = pixel(plain().render(water, o), 60, 60), dull = pixel(plain().render(rock, o), 60, 60);
  EXPECT_NE(deep, dull);
  // Far away, at a slant, it is the sky's colour; nearer the ground shows through what is clear, not through what is not.
  EXPECT_GT(pixel(plain().render(water, o), 60, 26).z(), deep.z());
  geometry::TriMesh clear = water;
  clear.attributes["water"].values.assign(4, 50.0f);
  EXPECT_GT(pixel(plain().render(clear, o), 60, 70).x(), pixel(plain().render(water, o), 60, 70).x());
}

/// A lamp over water stands in it as a streak towards the viewer, not as a lamp upside down.
TEST(Air, RipplesDrawLightOutTowardsTheViewer) {
  PreviewOptions o = small();
  o.width = 240;
  o.height = 160;
  o.samples = 16;
  o.sun = o.sky = 0.02;
  o.glow_light = o.haze = 0;
  o.camera = {Vec3(0, -20, 4), Vec3(0, 0, 2), 0.7};
  geometry::TriMesh mesh = geometry::make_grid(Vec3(-25, -25, 1), Vec2(50, 50), 1, 1);
  const geometry::TriMesh lamp = geometry::make_sphere(Vec3(0, 5, 3.5), 0.4, 2);
  const std::size_t first = mesh.positions.size(), n = first + lamp.positions.size();
  for (const geometry::Triangle& t : lamp.triangles) mesh.triangles.push_back({t[0] + static_cast<Index>(first), t[1] + static_cast<Index>(first), t[2] + static_cast<Index>(first)});
  mesh.positions.insert(mesh.positions.end(), lamp.positions.begin(), lamp.positions.end());
  mesh.normals.clear();
  mesh.attributes["color"] = {3, std::vector<float>(3 * n, 0.02f)};
  std::vector<float> water(n, 0), glow(3 * n, 0);
  for (std::size_t i = 0; i < n; ++i) water[i] = i < first ? 1.f : 0.f;
  for (std::size_t i = 3 * first; i < 3 * n; ++i) glow[i] = 20;
  mesh.attributes["water"] = {1, water};
  mesh.attributes["glow"] = {3, glow};
  const Image image = plain().render(mesh, o);
  // The lamp's own pixels, and those of its light on the water below.
  int rows = 0, streak_rows = 0, streak_columns = 0, bottom = 0;
  for (int y = 0; y < o.height; ++y)
    if (pixel(image, 120, y).x() > 5) ++rows, bottom = y;
  ASSERT_GT(rows, 4);
  for (int y = bottom + 2; y < o.height; ++y) streak_rows += pixel(image, 120, y).x() > 0.1;
  for (int x = 0; x < o.width; ++x) {
    bool lit = false;
    for (int y = bottom + 2; y < o.height; ++y) lit = lit || pixel(image, x, y).x() > 0.1;
    streak_columns += lit;
  }
  EXPECT_GT(streak_rows, 1.4 * rows) << "a calm mirror shows the lamp as tall as it is";
  EXPECT_GT(streak_rows, streak_columns);
}

TEST(Air, SameBitsOnAnyNumberOfThreads) {
  Air air;
  for (int i = 0; i < 300; ++i) {
    Speck s;
    s.position = Vec3(std::sin(i) * 5, std::cos(1.7 * i) * 5, 0.02 * i);
    s.radius = 0.1 + 0.001 * i;
    s.streak = Vec3(0.3, 0, 0.2);
    s.color = Vec3(0.5, 0.4, 0.3);
    s.opacity = 0.7;
    if (i % 3 == 0) s.glow = Vec3(1, 0.5, 0.2);
    s.soft = i % 2 == 0;
    air.specks.push_back(s);
  }
  air.clouds = {ball(Vec3(1, 1, 3), 0.5)};
  Image of[2];
  for (const int k : {0, 1}) {
    const ThreadLimit limit(k + 1);
    of[k] = plain().render({}, small(), air);
  }
  EXPECT_EQ(of[0].rgb, of[1].rgb);
}

TEST(Ground, AHollowBelowItsBorderIsSeen) {
  // A bowl: its border stands 5 m over its bottom.
  geometry::TriMesh bowl = geometry::make_grid(Vec3(-20, -20, 0), Vec2(2, 2), 20, 20);
  for (Vec3& p : bowl.positions) p.z() = std::min(5.0, 0.02 * p.head<2>().squaredNorm());
  PreviewOptions o = small();
  o.camera = {Vec3(0, -3, 30), Vec3(0, 0, 0), 0.5};
  geometry::TriMesh disk = geometry::make_grid(Vec3(-4, -4, 0.4), Vec2(8, 8), 1, 1);
  disk.attributes["glow"] = {3, std::vector<float>(12, 5.0f)};
  EXPECT_GT(pixel(Preview(bowl).render(disk, o), 60, 40).x(), 3);
}

}  // namespace
}  // namespace effuse::skin
