#include "skin/color/lava_color.h"

#include <gtest/gtest.h>

#include <cmath>

#include "geometry/base/parallel.h"
#include "geometry/base/random.h"
#include "skin/color/srgb.h"
#include "skin/preview/bloom.h"

namespace effuse::skin {
namespace {

struct Locus {
  double temperature, x, y;
};
class BlackbodyLocus : public testing::TestWithParam<Locus> {};

// CIE 1931 chromaticities of the Planckian locus as tabulated (Wyszecki & Stiles 1982, four digits). One
// thousandth: the matching functions have four digits and steps of 10 nm.
TEST_P(BlackbodyLocus, ChromaticityIsWithinOneThousandthOfTheTable) {
  const auto [T, x, y] = GetParam();
  const Vec2 c = blackbody_chromaticity(T);
  EXPECT_NEAR(c.x(), x, 0.001);
  EXPECT_NEAR(c.y(), y, 0.001);
}
INSTANTIATE_TEST_SUITE_P(Table, BlackbodyLocus,
                         testing::Values(Locus{1000, 0.6528, 0.3444}, Locus{1200, 0.6251, 0.3674}, Locus{1500, 0.5857, 0.3931},
                                         Locus{2000, 0.5267, 0.4133}, Locus{2856, 0.4476, 0.4074}, Locus{4000, 0.3805, 0.3768},
                                         Locus{6500, 0.3135, 0.3237}, Locus{10000, 0.2807, 0.2884}));

TEST(LavaColor, HueIsNearWhiteAtDaylightAndRedWhenBarelyGlowing) {
  const Vec3 white = blackbody_hue(6500);
  EXPECT_GT(white.minCoeff(), 0.9) << white.transpose();
  const Vec3 red = blackbody_hue(850);
  EXPECT_EQ(red.x(), 1);
  EXPECT_LT(red.y(), 0.1);
  EXPECT_EQ(red.z(), 0);
}

TEST(LavaColor, HueTurnsFromRedOverOrangeToYellowWithoutReturning) {
  double before = 0;  // below 1000 K green is out of gamut too
  for (double T = 1000; T <= 2500; T += 50) {
    const Vec3 hue = blackbody_hue(T);
    EXPECT_DOUBLE_EQ(hue.maxCoeff(), 1) << T;
    EXPECT_GE(hue.minCoeff(), 0) << T;
    EXPECT_GT(hue.y(), before) << T;
    before = hue.y();
  }
}

TEST(LavaColor, EmissionStartsAtTheDraperPointAndRisesToItsReference) {
  const LavaColorOptions options;
  EXPECT_EQ(lava_emission(800, options), Vec3::Zero());
  EXPECT_EQ(lava_emission(-5, options), Vec3::Zero());
  EXPECT_EQ(lava_emission(std::nan(""), options), Vec3::Zero());
  double before = 0;
  for (double T = 810; T < 1600; T += 10) {
    const double now = lava_emission(T, options).maxCoeff();
    EXPECT_GT(now, before) << T;
    before = now;
  }
  EXPECT_NEAR(lava_emission(options.reference, options).maxCoeff(), options.strength, 1e-12);
}

TEST(LavaColor, OnScreenItGoesFromDeepRedOverOrangeToYellowWithoutAStandstill) {
  // What photographs of lava show; sRGB bytes.
  const auto screen = [](double T) {
    const Vec3 e = lava_emission(T);
    float rgb[3] = {static_cast<float>(e.x()), static_cast<float>(e.y()), static_cast<float>(e.z())};
    tone_map(rgb);
    return Vec3(255 * srgb_from_linear(rgb[0]), 255 * srgb_from_linear(rgb[1]), 255 * srgb_from_linear(rgb[2]));
  };
  const Vec3 red = screen(1100), orange = screen(1300), yellow = screen(1450);
  EXPECT_GT(red.x(), 150);
  EXPECT_LT(red.y(), 50) << "deep red";
  EXPECT_GT(orange.x(), 230);
  EXPECT_GT(orange.y(), 95) << "orange";
  EXPECT_LT(orange.y(), 150);
  EXPECT_GT(yellow.y(), 180) << "yellow";
  EXPECT_LT(yellow.y(), 225);
  EXPECT_LT(yellow.z(), 90) << "not white";
  for (double T = 1100; T < 1450; T += 50) EXPECT_GT(screen(T + 50).y() - screen(T).y(), 10) << T;
}

TEST(LavaColor, CracksAreHotterThanPlatesAndNothingIsHotterThanItsLava) {
  const LavaColorOptions options;
  for (double T = 300; T < 1600; T += 20)
    for (double crust : {0.0, 0.3, 1.0})
      for (double detail = -1; detail < 0.95; detail += 0.1) {
        const double here = apparent_temperature(T, crust, detail), up = apparent_temperature(T, crust, detail + 0.1);
        EXPECT_GE(here, up - 1e-9) << T << " " << crust << " " << detail;
        EXPECT_LE(here, T + 1e-9);
        EXPECT_GE(here, std::min(T, options.plate) - 1e-9);
      }
}

TEST(LavaColor, TheVentGlowsEvenlyTheMiddleIsPlatesAndCracksAndTheFarReachIsDark) {
  const auto glow = [](double T, double crust, double detail) { return lava_emission(apparent_temperature(T, crust, detail)).maxCoeff(); };
  EXPECT_DOUBLE_EQ(glow(1460, 0, -1), glow(1460, 0, 1)) << "no plates at the vent";
  EXPECT_GT(glow(1250, 0.8, -0.9), 0.5) << "cracks show";
  EXPECT_LT(glow(1250, 0.8, 0.5), 0.1) << "plates are black";
  EXPECT_LT(glow(850, 1, -0.9), 0.05) << "the front is dark";
}

TEST(LavaColor, GlowRisesWithTemperatureWhateverTheAltitudeAndIsNoneBelowTheDraperPoint) {
  for (const double crust : {0.0, 0.5, 1.0})
    for (double detail = -1; detail <= 1; detail += 0.25) {
      double before = 0;
      for (double T = 300; T < 1700; T += 4) {
        const double now = lava_emission(apparent_temperature(T, crust, detail)).maxCoeff();
        ASSERT_GE(now, before - 1e-12) << T << " " << crust << " " << detail;
        if (T < 798) {
          ASSERT_EQ(now, 0) << T;
        }
        before = now;
      }
      EXPECT_GT(before, detail < -0.5 || crust < 0.1 ? 1 : 0) << crust << " " << detail;
    }
}

TEST(LavaColor, AlbedoRisesWithAltitudeInTheClinkerAndStaysDark) {
  for (double T = 300; T < 1600; T += 50)
    for (const double crust : {0.0, 0.5, 1.0}) {
      Vec3 before = Vec3::Zero();
      for (double altitude = -1; altitude <= 1.001; altitude += 0.1) {
        const Vec3 now = lava_albedo(T, crust, altitude);
        ASSERT_TRUE((now.array() > before.array()).all()) << T << " " << altitude;
        ASSERT_LT(now.maxCoeff(), 0.09);
        before = now;
      }
      EXPECT_EQ(lava_albedo(T, crust, 0), lava_albedo(T, crust));
      EXPECT_EQ(lava_albedo(T, crust, 7), lava_albedo(T, crust, 1));
      // Crests are browner than valleys.
      const Vec3 crest = lava_albedo(T, crust, 1), valley = lava_albedo(T, crust, -1);
      EXPECT_GT(crest.x() / crest.z(), valley.x() / valley.z());
    }
}

geometry::TriMesh strip(std::size_t n) {
  geometry::TriMesh mesh;
  geometry::VertexAttribute temperature{1, {}}, crust{1, {}}, detail{1, {}};
  for (std::size_t i = 0; i < n; ++i) {
    mesh.positions.emplace_back(static_cast<double>(i), 0, 0);
    temperature.values.push_back(static_cast<float>(300 + 1300 * random_uniform(1, 0, i)));
    crust.values.push_back(static_cast<float>(random_uniform(1, 1, i)));
    detail.values.push_back(static_cast<float>(2 * random_uniform(1, 2, i) - 1));
  }
  mesh.attributes = {{"temperature", temperature}, {"crust", crust}, {"detail", detail}};
  return mesh;
}

TEST(LavaColor, AMeshIsColouredAsItsVerticesWouldBeOneByOne) {
  geometry::TriMesh mesh = strip(2000);
  color_lava(mesh);
  const auto& at = mesh.attributes;
  for (std::size_t i = 0; i < 2000; ++i) {
    const Vec3 expected =
        lava_emission(apparent_temperature(at.at("temperature").values[i], at.at("crust").values[i], at.at("detail").values[i]));
    for (std::size_t k = 0; k < 3; ++k) {
      // The table has a step of 5 K: the curve over it deviates by (5 K)^2 / 8 of its second derivative.
      EXPECT_NEAR(at.at("glow").values[3 * i + k], expected[static_cast<Eigen::Index>(k)], 2e-3);
      const float color = at.at("color").values[3 * i + k];
      EXPECT_GE(color, 0);
      EXPECT_LE(color, 1);
    }
  }
}

TEST(LavaColor, WhatIsReflectedComesBackFromColorMinusGlow) {
  geometry::TriMesh mesh = strip(500);
  color_lava(mesh);
  for (std::size_t i = 0; i < 500; ++i)
    for (std::size_t k = 0; k < 3; ++k) {
      const double color = mesh.attributes.at("color").values[3 * i + k], glow = mesh.attributes.at("glow").values[3 * i + k];
      const double reflected = color - display_emission(Vec3::Constant(glow)).x();
      EXPECT_GT(reflected, -1e-6);
      EXPECT_LT(reflected, 0.09) << "lava rock is dark";
    }
}

TEST(LavaColor, SameBitsOnAnyNumberOfThreads) {
  geometry::TriMesh one = strip(5000), many = one;
  {
    const ThreadLimit limit(1);
    color_lava(one);
  }
  {
    const ThreadLimit limit(4);
    color_lava(many);
  }
  EXPECT_EQ(one.attributes.at("glow").values, many.attributes.at("glow").values);
  EXPECT_EQ(one.attributes.at("color").values, many.attributes.at("color").values);
}

TEST(LavaColor, AMeshWithoutTemperatureIsColdRockAndAnEmptyOneStaysEmpty) {
  geometry::TriMesh mesh;
  color_lava(mesh);
  EXPECT_TRUE(mesh.attributes.at("glow").values.empty());
  mesh = {};
  mesh.positions.assign(3, Vec3::Zero());
  color_lava(mesh);
  EXPECT_EQ(mesh.attributes.at("glow").values, std::vector<float>(9, 0.0f));
  EXPECT_GT(mesh.attributes.at("color").values[0], 0.01f);
}

TEST(Srgb, EncoderRoundsAsTheFormulaDoes) {
  const SrgbEncoder encode;
  for (int i = -100; i < 20100; ++i) {
    const float x = static_cast<float>(i) / 20000;
    const double exact = 255 * srgb_from_linear(x);
    EXPECT_NEAR(encode(x), exact, 0.5 + 1e-4) << x;
  }
  EXPECT_EQ(encode(std::nanf("")), 0);
  EXPECT_EQ(encode(0.25f), 137) << "a quarter of the light is more than half the code";
}

TEST(Srgb, LinearAndBackIsTheSameByteForAll256) {
  const SrgbEncoder encode;
  for (int k = 0; k < 256; ++k) EXPECT_EQ(encode(static_cast<float>(linear_from_srgb(k / 255.0))), k);
}

}  // namespace
}  // namespace effuse::skin
