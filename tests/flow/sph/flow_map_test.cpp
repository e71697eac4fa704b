#include "flow/sph/flow_map.h"

#include <gtest/gtest.h>

#include <cmath>
#include <cstring>
#include <limits>

#include "geometry/base/error.h"
#include "geometry/base/parallel.h"
#include "geometry/base/random.h"

namespace effuse::flow::sph {
namespace {

using geometry::Points;

/// Particles that own their arrays.
struct Cloud {
  std::vector<Vec3> x;
  std::vector<Real> radius, temperature;
  void add(Real at_x, Real at_y, Real r = 0.5, Real t = 1000) {
    x.emplace_back(at_x, at_y, 3);
    radius.push_back(r);
    temperature.push_back(t);
  }
  Points points() const {
    Points p;
    p.position = x;
    p.radius = radius;
    p.temperature = temperature;
    return p;
  }
  Real volume() const {
    Real sum = 0;
    for (const Real r : radius) sum += 8 * r * r * r;
    return sum;
  }
};

/// n particles of mixed sizes over [0, width]^2.
Cloud random_cloud(std::size_t n, Real width, std::uint64_t seed) {
  Cloud cloud;
  for (std::size_t p = 0; p < n; ++p)
    cloud.add(width * random_uniform(seed, 0, p), width * random_uniform(seed, 1, p), 0.2 + 0.8 * random_uniform(seed, 2, p), 800 + 600 * random_uniform(seed, 3, p));
  return cloud;
}

MapGrid grid(Real x, Real y, Real cell, int nx, int ny) { return {Vec2(x, y), Vec2(cell, cell), nx, ny}; }

constexpr auto kThickness = FlowMap::Layer::kThickness;
constexpr auto kMaxThickness = FlowMap::Layer::kMaxThickness;
constexpr auto kMaxTemperature = FlowMap::Layer::kMaxTemperature;
constexpr auto kArrivalTime = FlowMap::Layer::kArrivalTime;

TEST(FlowMap, SpreadsAParticleOverTheCellsUnderItsSquare) {
  // A cube of 2 m whose lower left quarter lies in cell (1, 1) of 4 m cells, the rest in its neighbours.
  FlowMap map(grid(0, 0, 4, 4, 4), 0);
  Cloud one;
  one.add(8, 8, 1);
  map.add(0, one.points(), 8);
  for (const int j : {1, 2})
    for (const int i : {1, 2}) EXPECT_DOUBLE_EQ(map.thickness(i, j), 2.0 / 16) << i << " " << j;
  EXPECT_EQ(map.thickness(0, 0), 0);
  EXPECT_DOUBLE_EQ(map.volume(), 8);

  // Three quarters of its width in column 0, all of it in row 3.
  FlowMap uneven(grid(0, 0, 4, 4, 4), 0);
  Cloud other;
  other.add(3.5, 14, 1);
  uneven.add(0, other.points(), 8);
  EXPECT_DOUBLE_EQ(uneven.thickness(0, 3), 6.0 / 16);
  EXPECT_DOUBLE_EQ(uneven.thickness(1, 3), 2.0 / 16);
}

TEST(FlowMap, ALatticeOneParticleDeepIsAsThickAsAParticleIsWide) {
  // In cells of any size: smaller than a particle, as large, larger, no multiple.
  Cloud lattice;
  for (int j = 0; j < 40; ++j)
    for (int i = 0; i < 40; ++i) lattice.add(i + 0.5, j + 0.5);
  for (const Real cell : {0.3, 1.0, 2.7, 5.0}) {
    FlowMap map(grid(5, 5, cell, static_cast<int>(30 / cell), static_cast<int>(30 / cell)), 0);
    map.add(0, lattice.points(), lattice.volume());
    for (const float h : map.layer(kThickness)) ASSERT_NEAR(h, 1, 1e-6) << cell;
  }
}

TEST(FlowMap, ConservesVolumeToRounding) {
  for (const std::uint64_t seed : {1, 2, 3}) {
    const Cloud cloud = random_cloud(5000, 100, seed);
    for (const Real cell : {0.7, 3.0, 11.3}) {
      const int n = static_cast<int>(std::ceil(104 / cell));
      FlowMap map({Vec2(-2, -2), Vec2(cell, 1.1 * cell), n, n}, 0.1);
      map.add(0, cloud.points(), 12345.678);
      EXPECT_NEAR(map.volume(), 12345.678, 1e-11 * 12345.678) << "seed " << seed << ", cell " << cell;
      // And as a reader of the raster would add it up, in single precision a cell.
      Real sum = 0;
      for (const float h : map.layer(kThickness)) sum += std::isnan(h) ? 0 : h;
      EXPECT_NEAR(sum * map.grid().cell_area(), 12345.678, 1e-7 * 12345.678);
    }
  }
}

TEST(FlowMap, WhatLiesBeyondTheMapIsNotInIt) {
  FlowMap map(grid(0, 0, 1, 10, 10), 0);
  Cloud cloud;
  cloud.add(0, 5);          // half of it
  cloud.add(10, 10);        // a quarter
  cloud.add(-0.5, 5);       // touches the border from outside
  cloud.add(1e9, -1e9);     // far away
  cloud.add(5, 10.4);       // a tenth
  map.add(0, cloud.points(), 5);
  EXPECT_NEAR(map.volume(), 0.85, 1e-12);
}

TEST(FlowMap, AgreesWithAFineCountOfPoints) {
  // Each square as 60 x 60 points: an integral done without any thought of overlaps.
  const Cloud cloud = random_cloud(50, 8, 9);
  FlowMap map(grid(1, 1, 1.3, 5, 5), 0);
  map.add(0, cloud.points(), cloud.volume());
  std::vector<Real> counted(25, 0);
  constexpr int kFine = 60;
  for (std::size_t p = 0; p < cloud.x.size(); ++p) {
    const Real r = cloud.radius[p];
    for (int b = 0; b < kFine; ++b)
      for (int a = 0; a < kFine; ++a) {
        const Real i = std::floor((cloud.x[p].x() - r + 2 * r * (a + 0.5) / kFine - 1) / 1.3), j = std::floor((cloud.x[p].y() - r + 2 * r * (b + 0.5) / kFine - 1) / 1.3);
        if (i >= 0 && i < 5 && j >= 0 && j < 5) counted[static_cast<std::size_t>(j * 5 + i)] += 8 * r * r * r / (kFine * kFine) / (1.3 * 1.3);
      }
  }
  for (int j = 0; j < 5; ++j)
    for (int i = 0; i < 5; ++i) EXPECT_NEAR(map.thickness(i, j), counted[static_cast<std::size_t>(j * 5 + i)], 0.02 * counted[static_cast<std::size_t>(j * 5 + i)] + 0.01) << i << " " << j;
}

TEST(FlowMap, RemembersTheThickestTheHottestAndTheFirstMoment) {
  FlowMap map(grid(0, 0, 1, 4, 1), 0.4);
  Cloud cloud;
  cloud.add(0.5, 0.5, 0.5, 1400);
  map.add(10, cloud.points(), 1);
  cloud.x[0].x() = 1.2;  // 0.7 of it in cell 1, 0.3 in cell 0
  cloud.temperature[0] = 1300;
  map.add(20, cloud.points(), 1);
  cloud.x[0].x() = 1.7;  // 0.8 in cell 1, 0.2 in cell 2
  cloud.temperature[0] = 1200;
  map.add(30, cloud.points(), 1);
  const auto none = [](float v) { return std::isnan(v); };
  const auto deposit = map.layer(kThickness), most = map.layer(kMaxThickness), hottest = map.layer(kMaxTemperature), arrival = map.layer(kArrivalTime);
  EXPECT_EQ(deposit[0], 0) << "lava came and left";
  EXPECT_NEAR(deposit[1], 0.8, 1e-6);
  EXPECT_NEAR(deposit[2], 0.2, 1e-6);
  EXPECT_NEAR(most[0], 1, 1e-6);
  EXPECT_NEAR(most[1], 0.8, 1e-6);
  EXPECT_EQ(hottest[0], 1400);
  EXPECT_EQ(hottest[1], 1300);
  EXPECT_EQ(hottest[2], 1200);
  EXPECT_EQ(arrival[0], 10);
  EXPECT_EQ(arrival[1], 20);
  EXPECT_TRUE(none(arrival[2])) << "0.2 m are not more than 0.4 m";
  for (const auto& layer : {deposit, most, hottest, arrival}) EXPECT_TRUE(none(layer[3])) << "nothing came here";
  EXPECT_EQ(map.inundated_area(), 2);
}

TEST(FlowMap, TakesSurfaceTemperaturesWhereGivenAndNoneWhereThereAreNone) {
  Cloud cloud;
  cloud.add(0.5, 0.5, 0.5, 1400);
  FlowMap given(grid(0, 0, 1, 1, 1), 0), bare(grid(0, 0, 1, 1, 1), 0);
  const std::vector<Real> surface = {900};
  given.add(0, cloud.points(), 1, surface);
  EXPECT_EQ(given.layer(kMaxTemperature)[0], 900);
  Points cold = cloud.points();
  cold.temperature = {};
  bare.add(0, cold, 1);
  EXPECT_TRUE(std::isnan(bare.layer(kMaxTemperature)[0]));
  EXPECT_EQ(bare.layer(kMaxThickness)[0], 1);
}

TEST(FlowMap, SavedAndLoadedItGoesOnToTheSameBits) {
  const MapGrid cells = grid(-3, -3, 1.7, 70, 75);  // several blocks, cut ones at the end
  FlowMap whole(cells, 0.2), first(cells, 0.2), second(cells, 0.2);
  const auto moment = [](int k) { return random_cloud(300, 30.0 * k, 4); };
  for (int k = 1; k <= 2; ++k) {
    const Cloud cloud = moment(k);
    whole.add(k, cloud.points(), cloud.volume());
    first.add(k, cloud.points(), cloud.volume());
  }
  StateWriter saved;
  first.save(saved);
  StateReader in(saved.bytes(), "state");
  second.load(in, "state");
  EXPECT_TRUE(in.done());
  const Cloud last = moment(3);
  whole.add(3, last.points(), last.volume());
  second.add(3, last.points(), last.volume());
  StateWriter a, b;
  whole.save(a);
  second.save(b);
  EXPECT_TRUE(a.bytes() == b.bytes());
  EXPECT_EQ(whole.inundated_area(), second.inundated_area());
  for (const auto layer : {kThickness, kMaxThickness, kMaxTemperature, kArrivalTime}) {
    const std::vector<float> x = whole.layer(layer), y = second.layer(layer);
    EXPECT_EQ(std::memcmp(x.data(), y.data(), x.size() * sizeof(float)), 0);
  }
}

TEST(FlowMap, RefusesTheStateOfAnotherMap) {
  FlowMap map(grid(0, 0, 1, 10, 10), 0.2);
  Cloud cloud;
  cloud.add(5, 5);
  map.add(1, cloud.points(), 1);
  StateWriter saved;
  map.save(saved);
  for (FlowMap other : {FlowMap(grid(0, 0, 2, 10, 10), 0.2), FlowMap(grid(0, 0, 1, 10, 9), 0.2), FlowMap(grid(1, 0, 1, 10, 10), 0.2), FlowMap(grid(0, 0, 1, 10, 10), 0.3)}) {
    StateReader in(saved.bytes(), "state");
    EXPECT_THROW(other.load(in, "state"), InputError);
    EXPECT_EQ(other.volume(), 0) << "nothing of it stays";
  }
  // Cut anywhere, it is refused and leaves the map as it was.
  for (std::size_t cut = 0; cut < saved.bytes().size(); cut += 7) {
    FlowMap same(grid(0, 0, 1, 10, 10), 0.2);
    StateReader in(std::string_view(saved.bytes()).substr(0, cut), "state");
    EXPECT_THROW(same.load(in, "state"), InputError) << cut;
    EXPECT_EQ(same.volume(), 0) << cut;
  }
}

TEST(FlowMap, GivesTheSameBitsOnAnyNumberOfThreads) {
  const Cloud cloud = random_cloud(20000, 200, 6);
  std::vector<std::string> states;
  std::vector<Real> areas, fronts;
  const std::vector<PlanLine> vents = {{Vec2(3, 4), Vec2(30, 8)}};
  for (const int threads : {1, 2, 4}) {
    const ThreadLimit limit(threads);
    FlowMap map(grid(0, 0, 2, 100, 100), 0.1);
    map.add(1, cloud.points(), cloud.volume());
    StateWriter out;
    map.save(out);
    states.push_back(out.bytes());
    areas.push_back(covered_area(cloud.points()));
    fronts.push_back(find_front(cloud.points(), vents)->distance);
  }
  for (const std::size_t k : {1, 2}) {
    EXPECT_TRUE(states[k] == states[0]);
    EXPECT_EQ(areas[k], areas[0]);
    EXPECT_EQ(fronts[k], fronts[0]);
  }
}

TEST(FlowMapDeathTest, StopsOnBrokenPromises) {
  Cloud cloud;
  cloud.add(1, 1);
  FlowMap map(grid(0, 0, 1, 4, 4), 0);
  map.add(5, cloud.points(), 1);
  EXPECT_DEATH(map.add(4, cloud.points(), 1), "time");
  Cloud broken = cloud;
  broken.x[0].y() = std::numeric_limits<Real>::quiet_NaN();
  EXPECT_DEATH(map.add(6, broken.points(), 1), "finite");
  EXPECT_DEATH(covered_area(broken.points()), "finite");
}

TEST(MapGrid, OfAHeightFieldHasItsPixels) {
  // 7 x 5 posts, 10 and 20 m apart, the south-west one at (5, 10): pixels from (0, 0) to (70, 100).
  const geometry::HeightField field(Vec2(5, 10), Vec2(10, 20), 7, 5, std::vector<Real>(35, 3.0));
  const geometry::Terrain terrain = geometry::Terrain::from_height_field(field);
  const MapGrid own = map_grid(terrain, 0, 1);
  EXPECT_EQ(own.corner, Vec2(0, 0));
  EXPECT_EQ(own.cell, Vec2(10, 20));
  EXPECT_EQ(own.nx, 7);
  EXPECT_EQ(own.ny, 5);
  const MapGrid finer = map_grid(terrain, 100.0 / 31, 1);
  EXPECT_EQ(finer.corner, Vec2(0, 0));
  EXPECT_EQ(finer.nx, 22);
  ASSERT_GT(100 / (100.0 / 31), 31) << "this length of cells is one that rounding makes longer";
  EXPECT_EQ(finer.ny, 31) << "no sliver of a 32nd";
  EXPECT_EQ(map_grid(terrain, 9, 1).nx, 8) << "the last one reaches over the edge";
  EXPECT_THROW(map_grid(terrain, 1e-3, 1), InputError);
  EXPECT_THROW(map_grid(terrain, 1e-300, 1), InputError);
}

TEST(MapGrid, OfAMeshCoversItInCellsOfTwoSpacings) {
  geometry::TriMesh mesh;
  mesh.positions = {Vec3(-3.5, 1, 0), Vec3(9, 1, 0), Vec3(9, 7.9, 2)};
  mesh.triangles = {{0, 1, 2}};
  const geometry::Terrain terrain = geometry::Terrain::from_mesh(mesh);
  const MapGrid cells = map_grid(terrain, 0, 0.5);
  EXPECT_EQ(cells.cell, Vec2(1, 1));
  EXPECT_EQ(cells.corner, Vec2(-4, 1)) << "on whole multiples of a cell";
  EXPECT_EQ(cells.nx, 13);
  EXPECT_EQ(cells.ny, 7);
}

TEST(CoveredArea, IsThatOfTheUnionOfTheSquares) {
  Cloud cloud;
  EXPECT_EQ(covered_area(cloud.points()), 0);
  cloud.add(0.3, 0.7);
  EXPECT_NEAR(covered_area(cloud.points()), 1, 1e-12);
  cloud.add(100.3, -70.7);
  EXPECT_NEAR(covered_area(cloud.points()), 2, 1e-12) << "two apart";
  // A sheet, and the same five deep: layers on one another add nothing.
  Cloud sheet, stack;
  for (int k = 0; k < 5; ++k)
    for (int j = 0; j < 30; ++j)
      for (int i = 0; i < 50; ++i) {
        if (k == 0) sheet.add(i + 0.37, j + 0.61);
        stack.add(i + 0.37, j + 0.61);
      }
  EXPECT_NEAR(covered_area(sheet.points()), 1500, 1e-9);
  EXPECT_GE(covered_area(stack.points()), 1500 - 1e-9);
  EXPECT_LE(covered_area(stack.points()), 1500 + 0.5 * 2 * 80 + 2) << "half a particle along the outline, as promised";
}

TEST(CoveredArea, OfADiskOfLavaIsItsOwn) {
  // Eight deep, random within each layer's cells, radius 30 spacings.
  Cloud disk;
  std::uint64_t k = 0;
  for (int layer = 0; layer < 8; ++layer)
    for (int j = -32; j < 32; ++j)
      for (int i = -32; i < 32; ++i) {
        const Vec2 at(i + random_uniform(8, 0, k), j + random_uniform(8, 1, k));
        ++k;
        if (at.norm() < 29.5) disk.add(at.x(), at.y());
      }
  EXPECT_NEAR(covered_area(disk.points()) / (kPi * 30 * 30), 1, 2 * 0.5 / 30);
}

TEST(Front, OfFewParticlesIsTheFarthestFromTheNearestVent) {
  Cloud cloud;
  const std::vector<PlanLine> vents = {{Vec2(0, 0), Vec2(10, 0)}, {Vec2(100, 0), Vec2(100, 0)}};
  EXPECT_FALSE(find_front(cloud.points(), vents));
  cloud.add(5, 8);    // 8 from the fissure
  cloud.add(13, 4);   // 5 from its end
  cloud.add(96, -3);  // 5 from the crater, far from the fissure
  EXPECT_FALSE(find_front(cloud.points(), {}));
  std::optional<Front> front = find_front(cloud.points(), vents);
  ASSERT_TRUE(front);
  EXPECT_DOUBLE_EQ(front->distance, 8);
  EXPECT_EQ(front->at, Vec2(5, 8));
  front = find_front(cloud.points(), std::span(vents).first(1));
  EXPECT_DOUBLE_EQ(front->distance, std::hypot(86, 3));
}

TEST(Front, LeavesOutTheFarthestHalfPercentOfTheVolume) {
  Cloud cloud;
  for (int k = 1; k <= 1000; ++k) cloud.add(k, 5);  // 1 .. 1000 m from the line
  const std::vector<PlanLine> line = {{Vec2(0, 0), Vec2(0, 10)}};
  EXPECT_EQ(find_front(cloud.points(), line)->distance, 995);
  EXPECT_EQ(find_front(cloud.points(), line)->at, Vec2(995, 5));
  cloud.x[3].x() = 1e6;
  EXPECT_EQ(find_front(cloud.points(), line)->distance, 996) << "one that flew off moves it by one";
}

}  // namespace
}  // namespace effuse::flow::sph
