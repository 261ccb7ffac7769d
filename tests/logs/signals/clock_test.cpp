#include "rhec/logs/signals/clock.hpp"

#include <gtest/gtest.h>

namespace rhec::logs {
namespace clock_test {

TEST(Clock, ReadsDecimalsToTheNanosecond) {
  EXPECT_EQ(stamp_of("1700000000.123456789", 0.0), 1700000000123456789);
  EXPECT_EQ(stamp_of("-0.5", 0.0), -500000000);
  EXPECT_EQ(stamp_of("0.0000000014", 0.0), 1);
  EXPECT_EQ(stamp_of("0.0000000016", 0.0), 2);
  EXPECT_EQ(stamp_of("+3", 0.0), 3000000000);
  EXPECT_EQ(stamp_of("1.5e1", 0.0), 15000000000);
}

TEST(Clock, TakesCountsThatAreTooLargeForSecondsForSmallerUnits) {
  EXPECT_EQ(stamp_of("1700000000123", 0.0), 1700000000123000000);
  EXPECT_EQ(stamp_of("1700000000123456", 0.0), 1700000000123456000);
  EXPECT_EQ(stamp_of("1700000000123456789", 0.0), 1700000000123456789);
}

TEST(Clock, KnowsUnits) {
  EXPECT_EQ(stamp_of("1500", *clock_unit("ms")), 1500000000);
  EXPECT_EQ(stamp_of(2.5, *clock_unit("us")), 2500);
  EXPECT_FALSE(clock_unit("min"));
  const ClockName name = parse_clock_name("gps time [ms]");
  EXPECT_EQ(name.name, "gps time");
  EXPECT_EQ(name.unit, "ms");
  EXPECT_EQ(parse_clock_name("time[ms]").unit, "ms");
  EXPECT_EQ(parse_clock_name("speed [m/s]").name, "speed");
  EXPECT_EQ(parse_clock_name("wheel[left]").name, "wheel[left]");
}

TEST(Clock, ReadsDatesWhateverTheUnit) {
  EXPECT_EQ(stamp_of("1970-01-02T00:00:01.5Z", 0.0), 86401500000000);
  EXPECT_EQ(stamp_of("1970-01-02 00:00:01", *clock_unit("ms")), 86401000000000);
}

TEST(Clock, RefusesWhatIsNoTime) {
  for (const char* text : {"", "now", "1.2.3", "1e300", "nan", "inf", "--1"}) EXPECT_FALSE(stamp_of(text, 0.0)) << text;
  EXPECT_FALSE(stamp_of("99999999999999999999", *clock_unit("s")));
}

}  // namespace clock_test
}  // namespace rhec::logs
