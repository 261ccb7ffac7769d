#include "rhec/logs/csv/csv_log.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>

#include "logs/support/rows.hpp"
#include "support/error_of.hpp"
#include "support/temporary_folder.hpp"

namespace rhec::logs {
namespace csv_log_test {

using testing::AllOf;
using testing::HasSubstr;

class CsvLogTest : public FolderTest {
 protected:
  Rows rows(const std::string& text, const FieldRequest& request) {
    return rows_of(*open_csv(put("drive.csv", text)), "", request);
  }
};

TEST_F(CsvLogTest, ReadsColumnsByNameWhateverElseThereIs) {
  const Rows found = rows("time,note,speed,gear\n0.5,\"a, b\",1.25,R\n1.5,,nan,D\r\n\n2.5,c,true,\n", {{"speed"}});
  EXPECT_FALSE(found.damage);
  ASSERT_EQ(found.values.size(), 3u);
  EXPECT_EQ(found.stamps, (std::vector<Stamp>{500000000, 1500000000, 2500000000}));
  EXPECT_EQ(found.received, found.stamps);
  EXPECT_EQ(found.values[0][0], 1.25);
  EXPECT_TRUE(std::isnan(found.values[1][0]));
  EXPECT_EQ(found.values[2][0], 1.0);
}

TEST_F(CsvLogTest, KnowsSeveralClocksUnitsAndSeparators) {
  const std::string text = "\xEF\xBB\xBFtime [ms];received [ms];gps_time;x\n1000;1250;0.9;7\n2000;2250;;8\n";
  EXPECT_EQ(rows(text, {{"x"}}).stamps, (std::vector<Stamp>{1000000000, 2000000000}));
  EXPECT_EQ(rows(text, {{"x"}}).received, (std::vector<Stamp>{1250000000, 2250000000}));
  EXPECT_EQ(rows(text, {{"x"}, "gps_time"}).stamps, (std::vector<Stamp>{900000000, no_stamp}));
  EXPECT_EQ(rows(text, {{"x"}, "received"}).stamps, (std::vector<Stamp>{1250000000, 2250000000}));
}

TEST_F(CsvLogTest, ReadsWhatSpreadsheetsInEuropeWrite) {
  const std::string text =
      "\xEF\xBB\xBFsep=;\r\n\"time\";\"speed (km/h)\";steer;\r\n;km/h;\xC2\xB0;\r\n"
      "01.05.2024 12:00:00,5;3,6;-1,5;\r\n01.05.2024 12:00:01,5;\"7,2\";0;\r\n";
  const Rows found = rows(text, {{"speed", "steer"}});
  EXPECT_FALSE(found.damage);
  ASSERT_EQ(found.values.size(), 2u);
  EXPECT_EQ(found.values[0], (std::vector<double>{3.6, -1.5}));
  EXPECT_EQ(found.values[1], (std::vector<double>{7.2, 0.0}));
  EXPECT_EQ(found.stamps, (std::vector<Stamp>{1714564800500000000, 1714564801500000000}));
  const auto log = open_csv(file("drive.csv"));
  EXPECT_EQ(log->unit_of(0, "speed"), "km/h");
  EXPECT_EQ(log->unit_of(0, "steer"), "deg");
  EXPECT_EQ(log->unit_of(0, "time"), "");
}

TEST_F(CsvLogTest, ADecimalPointAmongCommasIsABrokenLine) {
  EXPECT_THAT(rows("time;x\n0;1,5\n1;2.5\n", {{"x"}}).damage->what,
              AllOf(HasSubstr("drive.csv:2: found '1,5'"), HasSubstr("with a decimal point")));
  EXPECT_THAT(rows("time;x\n0;1,5\n" + std::string(2000, '\n') + "1;2.5\n", {{"x"}}).damage->what,
              AllOf(HasSubstr("drive.csv:2003: found '2.5'"), HasSubstr("with a decimal comma")));
}

TEST_F(CsvLogTest, UsesWhatIsBeforeABrokenLine) {
  const Rows found = rows("time,x\n0,1\n1,2\n2,three\n3,4\n", {{"x"}});
  EXPECT_EQ(found.values.size(), 2u);
  ASSERT_TRUE(found.damage);
  EXPECT_THAT(found.damage->what, AllOf(HasSubstr("drive.csv:4"), HasSubstr("'three'"), HasSubstr("mend the line")));
  EXPECT_THAT(rows("time,x\n0,1\nsoon,2\n", {{"x"}}).damage->what, HasSubstr("drive.csv:3: found 'soon'"));
}

TEST_F(CsvLogTest, ALineIsNotLongerThanMemory) {
  const Rows found = rows("time,x\n0,1\n" + std::string(std::size_t{3} << 20, '7') + "\n1,2\n", {{"x"}});
  EXPECT_EQ(found.values.size(), 1u);
  EXPECT_THAT(found.damage->what, HasSubstr("drive.csv:3: found a line of more than"));
}

TEST_F(CsvLogTest, SaysWhatIsWrongWithAFile) {
  const auto message = [&](const std::string& text) { return error_of([&] { open_csv(put("x.csv", text)); }); };
  EXPECT_THAT(message("0,1,2\n1,2,3\n"), AllOf(HasSubstr("x.csv:1"), HasSubstr("expected a header")));
  EXPECT_THAT(message(""), HasSubstr("found nothing, expected a header"));
  EXPECT_THAT(message("time,x,x\n"), HasSubstr("two columns are called 'x'"));
  EXPECT_THAT(error_of([&] { open_csv(file("gone.csv")); }), HasSubstr("No such file"));
  EXPECT_THAT(error_of([&] { rows("time,speed\n0,1\n", {{"sped"}}); }), HasSubstr("did you mean 'speed'"));
  EXPECT_THAT(error_of([&] { rows("when,speed\n0,1\n", {{"speed"}}); }), HasSubstr("signals.clock"));
  EXPECT_THAT(error_of([&] { rows("time [h],speed\n0,1\n", {{"speed"}}); }), HasSubstr("[h]"));
}

}  // namespace csv_log_test
}  // namespace rhec::logs
