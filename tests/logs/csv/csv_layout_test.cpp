#include "logs/csv/csv_layout.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>

#include "support/error_of.hpp"

namespace rhec::logs {
namespace csv_layout_test {

using testing::ElementsAre;
using testing::HasSubstr;

CsvLayout of(const std::vector<std::string>& lines) { return csv_layout("d.csv", lines); }

TEST(CsvLayout, UnitsStandBehindNamesOrBelowThem) {
  const CsvLayout behind = of({"time;speed (km/h);\"steer, left\" ;wheel[left];yaw[\xC2\xB0];p(left)", "0;1;2;3;4;5"});
  EXPECT_THAT(behind.names(), ElementsAre("time", "speed", "steer, left", "wheel[left]", "yaw", "p(left)"));
  EXPECT_EQ(behind.columns[1].unit, "km/h");
  EXPECT_EQ(behind.columns[4].unit, "\xC2\xB0");
  EXPECT_EQ(behind.find("speed (km/h)"), 1) << "the whole cell is a name, too";
  const CsvLayout below = of({"time,speed,note", "[ms],km/h,", "0,1,a"});
  EXPECT_EQ(below.header_lines, 2);
  EXPECT_EQ(below.columns[1].unit, "km/h");
  EXPECT_EQ(below.unit_of_clock(0), 1e6);
  EXPECT_EQ(of({"time,speed", "0,1"}).header_lines, 1);
}

TEST(CsvLayout, TheSeparatorIsWhatHeaderAndDataAgreeOn) {
  EXPECT_EQ(of({"\"time, s\";\"speed, km/h\"", "0,5;1,5"}).separator, ';');
  EXPECT_EQ(of({"time;speed, left;speed, right", "0;1,5;2,5"}).separator, ';');
  EXPECT_EQ(of({"time\tspeed", "0\t1"}).separator, '\t');
  EXPECT_EQ(of({"time,a;b", "0,1"}).separator, ',');
  EXPECT_EQ(of({"# time x", "0 1"}).separator, ' ') << "as numpy writes it";
  EXPECT_EQ(of({"GPS Lat,GPS Lon", "48,11"}).separator, ',');
  EXPECT_EQ(of({"time of day"}).separator, ',');
  EXPECT_EQ(of({"sep=;", "time;x", "0;1"}).separator, ';');
  EXPECT_EQ(of({"sep=;", "time;x", "0;1"}).header_lines, 2);
}

TEST(CsvLayout, DecimalCommasAreTold) {
  const CsvLayout commas = of({"time;x;y;state", "0,5;1,5;7;3.1-beta", "1;2;8;4"});
  for (const CsvColumn& column : commas.columns) EXPECT_EQ(column.decimal_mark, ',') << column.name;
  const CsvLayout mixed = of({"time;x;y", "0.5;1,5;7"});
  EXPECT_EQ(mixed.columns[0].decimal_mark, '.');
  EXPECT_EQ(mixed.columns[1].decimal_mark, ',');
  EXPECT_EQ(mixed.columns[2].decimal_mark, '.');
  double value = 0.0;
  EXPECT_TRUE(read_csv_number("-1,5e1", ',', value));
  EXPECT_EQ(value, -15.0);
  EXPECT_FALSE(read_csv_number("1,5", '.', value));
  EXPECT_FALSE(read_csv_number("1.234,5", ',', value));
  EXPECT_TRUE(read_csv_number("N/A", '.', value));
  EXPECT_TRUE(std::isnan(value));
}

TEST(CsvLayout, CommentsBeforeTheHeaderArePassedOver) {
  const CsvLayout behind = of({"# logger 3", "", "# GPS: RTK", "time,x", "0,1"});
  EXPECT_THAT(behind.names(), ElementsAre("time", "x"));
  EXPECT_EQ(behind.header_lines, 4);
  const CsvLayout within = of({"# logger 3", "# time, x", "0, 1"});  // as numpy writes it
  EXPECT_THAT(within.names(), ElementsAre("time", "x"));
  EXPECT_EQ(within.header_lines, 2);
  EXPECT_THAT(of({"%time,x", "0,1"}).names(), ElementsAre("%time", "x"));
}

TEST(CsvLayout, NamesInLatin1BecomeUtf8) {
  const CsvLayout layout = of({"time;W\xE4rme [\xB0];W\xC3\xA4rme", "0;1;2"});
  EXPECT_EQ(layout.columns[1].name, "W\xC3\xA4rme") << "one byte that is no UTF-8 makes the line Latin-1";
  EXPECT_EQ(of({"time;W\xC3\xA4rme", "0;1"}).columns[1].name, "W\xC3\xA4rme");
  EXPECT_EQ(of({"time;W\xE4rme [\xB0]", "0;1"}).columns[1].unit, "\xC2\xB0");
}

TEST(CsvLayout, FindsTheClock) {
  EXPECT_EQ(of({"x,Time"}).clock, 1);
  EXPECT_EQ(of({"x,timestamp_ms"}).clock, 1);
  EXPECT_EQ(of({"x,timestamp_ms"}).unit_of_clock(1), 1e6);
  EXPECT_EQ(of({"x,T"}).clock, -1) << "a temperature";
  EXPECT_EQ(of({"x,Zeit", "1,2024-05-01T12:00:00Z"}).clock, 1) << "by what is in it";
  EXPECT_EQ(of({"x,time,Zeit", "1,2,2024-05-01T12:00:00Z"}).clock, 1);
  EXPECT_EQ(of({"received,x,t"}).clock, 2);
  EXPECT_EQ(of({"received,x,t"}).received, 0);
}

TEST(CsvLayout, SaysWhereAHeaderIsMissing) {
  EXPECT_THAT(error_of([] { of({"# a", "0,1"}); }), HasSubstr("d.csv:2: found '0,1', expected a header"));
  EXPECT_THAT(error_of([] { of({"sep=;", "0;1"}); }), HasSubstr("d.csv:2"));
  EXPECT_THAT(error_of([] { of({}); }), HasSubstr("d.csv:1: found nothing"));
}

}  // namespace csv_layout_test
}  // namespace rhec::logs
