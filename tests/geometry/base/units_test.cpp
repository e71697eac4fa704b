#include "geometry/base/units.h"

#include <gtest/gtest.h>

#include <cmath>
#include <stdexcept>

#include "geometry/base/random.h"

namespace effuse {
namespace {

std::string message_of(std::string_view text, std::string_view unit) {
  try {
    const Real value = parse_quantity(text, unit);
    return "no error, but " + std::to_string(value);
  } catch (const std::invalid_argument& error) {
    return error.what();
  }
}

struct Claim {
  std::string_view text, unit;
  Real value;
};
class Quantity : public testing::TestWithParam<Claim> {};

TEST_P(Quantity, IsReadInSi) {
  const auto [text, unit, value] = GetParam();
  EXPECT_DOUBLE_EQ(parse_quantity(text, unit), value) << text;
}
INSTANTIATE_TEST_SUITE_P(
    Units, Quantity,
    testing::Values(Claim{"12.5", "m", 12.5}, Claim{"  -3e2 ", "", -300}, Claim{"+4", "1", 4}, Claim{"1150 degC", "K", 1423.15},
                    Claim{"-40 degF", "K", 233.15}, Claim{"300 K", "K", 300}, Claim{"30 m3/s", "m3/s", 30}, Claim{"30 m^3/s", "m3/s", 30},
                    Claim{"5 mm", "m", 0.005}, Claim{"5mm", "m", 0.005}, Claim{"1 km2", "m2", 1e6}, Claim{"12 deg", "rad", 12 * kPi / 180},
                    Claim{"2 %", "", 0.02}, Claim{"2 kPa", "Pa", 2000}, Claim{"3 MPa s", "Pa s", 3e6}, Claim{"1 kPa.s", "Pa s", 1000},
                    Claim{"1.5 W/(m2 K)", "W/(m2 K)", 1.5}, Claim{"1.5 W/m2/K", "W/(m2 K)", 1.5}, Claim{"1 kJ/(kg*K)", "J/(kg K)", 1000},
                    Claim{"1 N m", "J", 1}, Claim{"1 J/s", "W", 1}, Claim{"1 kg m2/s3", "W", 1}, Claim{"7 l/min", "m3/s", 7e-3 / 60},
                    Claim{"1 day", "s", 86400}, Claim{"2 h", "s", 7200}, Claim{"90 min", "s", 5400}, Claim{"3 t", "kg", 3000},
                    Claim{"10 ft", "m", 3.048}, Claim{"1 in", "m", 0.0254}, Claim{"25 Hz", "1/s", 25}, Claim{"25 s-1", "Hz", 25},
                    Claim{"25 s^-1", "Hz", 25}, Claim{"1 (m/s)^2", "m2/s2", 1}, Claim{"3 um", "m", 3e-6}, Claim{"1 cm3", "m3", 1e-6},
                    Claim{"2700 kg/m3", "kg/m3", 2700}, Claim{"2.7 g/cm3", "kg/m3", 2700}, Claim{"0.1 1/K", "1/K", 0.1}));

TEST(Units, AWrongDimensionIsNamedWithWhatIsWanted) {
  EXPECT_EQ(message_of("30 m3", "m3/s"), "'30 m3' is a volume [m3], wanted a volume rate [m3/s]");
  EXPECT_EQ(message_of("30 l", "m"), "'30 l' is a volume [m3], wanted a length [m]");
  EXPECT_EQ(message_of("12 deg", ""), "'12 deg' is an angle [rad], wanted a plain number");
  EXPECT_EQ(message_of("5 m5 kg", "K"), "'5 m5 kg' is a quantity in [m5 kg], wanted a temperature [K]");
}

TEST(Units, WhatCannotBeReadIsExplained) {
  EXPECT_NE(message_of("fast", "m/s").find("'fast' does not begin with a number, wanted a speed [m/s], like '1.5 m/s'"), std::string::npos) << message_of("fast", "m/s");
  EXPECT_NE(message_of("", "m").find("does not begin with a number"), std::string::npos);
  EXPECT_NE(message_of("3 kgg", "kg").find("is 'kg' meant?"), std::string::npos) << message_of("3 kgg", "kg");
  EXPECT_NE(message_of("3 dge", "rad").find("is 'deg' meant?"), std::string::npos) << message_of("3 dge", "rad");
  EXPECT_NE(message_of("1 degC/s", "K/s").find("stands alone"), std::string::npos);
  EXPECT_NE(message_of("1 W/m2 K", "W/(m2 K)").find("two ways"), std::string::npos);
  EXPECT_NE(message_of("1 W/(m2 K", "W/(m2 K)").find("closing parenthesis"), std::string::npos);
  EXPECT_NE(message_of("1 m/", "m").find("ends where a unit should be"), std::string::npos);
  EXPECT_NE(message_of("1 m^", "m").find("exponent"), std::string::npos);
  EXPECT_NE(message_of("1 m)", "m").find("where it should end"), std::string::npos);
  EXPECT_NE(message_of("1 m 3", "m").find("where a unit should be"), std::string::npos);
}

TEST(Units, NumbersThatAreNotFiniteAreRefused) {
  for (const char* text : {"nan", "inf", "-inf m", "1e999 m", "1e308 Tm"}) EXPECT_THROW(parse_quantity(text, "m"), std::invalid_argument) << text;
}

TEST(Units, HugeNestingAndExponentsAreRefusedNotObeyed) {
  EXPECT_THROW(parse_quantity("1 " + std::string(100000, '('), "m"), std::invalid_argument);
  EXPECT_THROW(parse_quantity("1 m999999999", "m"), std::invalid_argument);
  EXPECT_THROW(parse_quantity("1 m99999999999999999999", "m"), std::invalid_argument);
}

TEST(Units, RandomTextIsReadOrRefusedNeverCrashes) {
  const std::string alphabet = "0123456789.-+e /*^()mkgsKPadegCF% ";
  int read = 0;
  for (std::uint64_t k = 0; k < 20000; ++k) {
    std::string text;
    for (std::uint64_t c = 0; c < 1 + random_bits(1, k, 0) % 12; ++c) text += alphabet[random_bits(2, k, c) % alphabet.size()];
    try {
      parse_quantity(text, "m");
      ++read;
    } catch (const std::invalid_argument&) {
    }
  }
  EXPECT_GT(read, 0);
}

TEST(Units, FormatIsReadBackBitForBit) {
  for (std::uint64_t k = 0; k < 2000; ++k) {
    const Real value = random_normal(7, 0, k) * std::pow(10.0, 40 * random_uniform(7, 9, k) - 20);
    for (const char* unit : {"", "1", "m3/s", "W/(m2 K)", "K", "rad"}) {
      const std::string text = format_quantity(value, unit);
      EXPECT_EQ(parse_quantity(text, unit), value) << text;
    }
  }
  EXPECT_EQ(format_quantity(12.5, "m3/s"), "12.5 m3/s");
  EXPECT_EQ(format_quantity(0.1, ""), "0.1");
}

}  // namespace
}  // namespace effuse
