#include "rhec/logs/mapping/units.hpp"

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

}  // namespace units_test
}  // namespace rhec::logs
