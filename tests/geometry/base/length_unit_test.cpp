#include "geometry/base/length_unit.h"

#include <gtest/gtest.h>

#include <stdexcept>

namespace effuse {
namespace {

TEST(LengthUnit, IsReadHoweverItIsWritten) {
  EXPECT_EQ(length_unit("mm"), 1e-3);
  EXPECT_EQ(length_unit("ft"), 0.3048);
  EXPECT_NEAR(*length_unit("US survey foot"), 0.3048006096, 1e-10);
  EXPECT_EQ(length_unit("us-ft"), length_unit("US_Survey_Feet"));
  EXPECT_EQ(length_unit("Metres"), 1);
  EXPECT_FALSE(length_unit("kg"));
  EXPECT_FALSE(length_unit(""));
}

TEST(LengthUnit, MayBeANumberOfMetres) {
  EXPECT_EQ(parse_length_unit("0.5"), 0.5);
  EXPECT_EQ(parse_length_unit("cm"), 0.01);
}

TEST(LengthUnit, WhatIsNoneIsToldWithTheNearest) {
  const auto told = [](const char* text) -> std::string {
    try {
      parse_length_unit(text);
    } catch (const std::invalid_argument& error) {
      return error.what();
    }
    return "";
  };
  EXPECT_NE(told("mmm").find("no unit of length 'mmm', did you mean 'mm'"), std::string::npos) << told("mmm");
  EXPECT_NE(told("furlong").find("us-ft"), std::string::npos);
  for (const char* text : {"-1", "0", "nan", "inf", "1e999", "1 m", ""}) EXPECT_NE(told(text).find("no unit of length"), std::string::npos) << text;
}

}  // namespace
}  // namespace effuse
