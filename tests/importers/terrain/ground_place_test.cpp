#include "importers/terrain/ground_place.h"

#include <gtest/gtest.h>

#include <cmath>

#include "geometry/base/error.h"
#include "tests/importers/test_files.h"

namespace effuse::importers {
namespace {

/// 600 x 400 m of a plane that rises by 0.3 to the east and falls by 0.4 to the north, with one spike; about UTM 16N's central meridian.
const geometry::Georeference kUtm{Vec3(499700, 1156000, 0), "EPSG:32616"};

geometry::HeightField plane() {
  constexpr int kNx = 31, kNy = 21;
  std::vector<Real> z(kNx * kNy);
  for (int j = 0; j < kNy; ++j)
    for (int i = 0; i < kNx; ++i) z[static_cast<std::size_t>(j) * kNx + i] = 500 + 0.3 * 20 * i - 0.4 * 20 * j;
  z[3 * kNx + 4] = 1000;
  return geometry::HeightField(Vec2(0, 0), Vec2(20, 20), kNx, kNy, std::move(z));
}

TEST(GroundPlace, APlaneIsAsHighAsSteepAndFallsTheWayThatItWasMade) {
  const GroundPlace place = ground_place(plane(), kUtm, Vec2(500000, 1156210));
  EXPECT_EQ(place.map, Vec2(500000, 1156210));
  EXPECT_NEAR(place.height, 500 + 0.3 * 300 - 0.4 * 210, 1e-9);
  EXPECT_NEAR(place.slope, std::atan(0.5), 1e-12);
  EXPECT_NEAR(place.downhill, std::atan2(0.4, -0.3), 1e-12);
  EXPECT_NEAR(place.degrees.x(), -87, 1e-9) << "the zone's central meridian";
  EXPECT_EQ(highest_place(plane(), kUtm).map, Vec2(499780, 1156060)) << "the spike";
}

TEST(GroundPlace, DegreesNameTheSamePlaceToAMillimetre) {
  const GroundPlace by_map = ground_place(plane(), kUtm, Vec2(499911, 1156333)), by_degrees = ground_place(plane(), kUtm, by_map.degrees);
  EXPECT_LT((by_map.map - by_degrees.map).norm(), 1e-3);
  EXPECT_NEAR(by_map.height, by_degrees.height, 1e-3);
}

TEST(GroundPlace, WhereNoGroundIsItSaysWhereThereIsSome) {
  try {
    ground_place(plane(), kUtm, Vec2(-84.7, 10.46));
    FAIL() << "found ground";
  } catch (const InputError& error) {
    for (const char* part : {"no ground at -84.7, 10.46", "x 499700 to 500300, y 1156000 to 1156400", "in degrees -87.00"}) EXPECT_TRUE(contains(error.what(), part)) << part << " in " << error.what();
  }
  // Web maps say north first.
  const Vec2 degrees = ground_place(plane(), kUtm, Vec2(499911, 1156333)).degrees;
  try {
    ground_place(plane(), kUtm, Vec2(degrees.y(), degrees.x()));
    FAIL() << "found ground";
  } catch (const InputError& error) {
    EXPECT_TRUE(contains(error.what(), "east comes first: -87.0")) << error.what();
  }
  // Of a map that nobody knows no degrees are: small numbers are metres.
  const geometry::Georeference unknown{Vec3(0, 0, 0), ""};
  EXPECT_EQ(ground_place(plane(), unknown, Vec2(10, 46)).map, Vec2(10, 46));
  EXPECT_TRUE(std::isnan(ground_place(plane(), unknown, Vec2(10, 46)).degrees.x()));
  EXPECT_THROW(ground_place(plane(), unknown, Vec2(-1, 46)), InputError);
}

}  // namespace
}  // namespace effuse::importers
