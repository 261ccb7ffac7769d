#include "rhec/logs/signals/units.hpp"

#include <gtest/gtest.h>

#include <cmath>

namespace rhec::logs {
namespace units_test {

TEST(Units, AreFactorsOfThoseOfTheInternationalSystem) {
  EXPECT_DOUBLE_EQ(find_unit("deg")->factor, M_PI / 180.0);
  EXPECT_DOUBLE_EQ(find_unit("rpm")->factor, 2.0 * M_PI / 60.0);
  EXPECT_DOUBLE_EQ(find_unit("km/h")->factor * 3.6, 1.0);
  EXPECT_EQ(find_unit("kn")->si, "m/s");
  EXPECT_FALSE(find_unit("furlong"));
  for (const std::string& name : unit_names()) EXPECT_TRUE(find_unit(find_unit(name)->si)) << name;
}

TEST(Units, AreRecognisedAsPeopleWriteThem) {
  EXPECT_EQ(unit_of_header("\xC2\xB0"), "deg");
  EXPECT_EQ(unit_of_header("\xB0/s"), "deg/s");
  EXPECT_EQ(unit_of_header("U/min"), "rpm");
  EXPECT_EQ(unit_of_header("KM/H"), "km/h");
  EXPECT_EQ(unit_of_header("m / s"), "m/s");
  EXPECT_EQ(unit_of_header("left_wheel"), "");
  EXPECT_EQ(unit_of_header(""), "");
}

}  // namespace units_test
}  // namespace rhec::logs
