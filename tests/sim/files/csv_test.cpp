#include "rhec/sim/files/csv.hpp"

#include <gtest/gtest.h>

#include <chrono>
#include <cmath>
#include <string>

#include "support/error_of.hpp"

namespace rhec::sim {
namespace csv_test {

std::string message_for(const std::string& text, const CsvOptions& options = {}) {
  return error_of([&] { parse_csv(text, "log.csv", options); });
}

TEST(Csv, ReadsNumbersAndCountsWhatIsMissing) {
  const CsvTable table = parse_csv("1, -2.5e-1,+3\r\n4,nan,\r\n7,8,NaN", "log.csv");
  ASSERT_EQ(table.rows(), 3);
  ASSERT_EQ(table.columns(), 3);
  EXPECT_EQ(table.at(0, 1), -0.25);
  EXPECT_EQ(table.at(0, 2), 3.0);
  EXPECT_TRUE(std::isnan(table.at(1, 1)));
  EXPECT_TRUE(std::isnan(table.at(2, 2)));
  EXPECT_EQ(table.missing, (std::vector<std::int64_t>{0, 1, 2}));
}

TEST(Csv, ReadsAHeader) {
  const CsvTable required = parse_csv("\xEF\xBB\xBFtime, x\n1,2\n", "log.csv", {.header = CsvHeader::required});
  EXPECT_EQ(required.header, (std::vector<std::string>{"time", "x"}));
  EXPECT_EQ(required.rows(), 1);
  EXPECT_EQ(required.line_of(0), 2);
  EXPECT_EQ(parse_csv("1,2\n", "log.csv", {.header = CsvHeader::optional}).rows(), 1);
  EXPECT_EQ(parse_csv("a,b\n1,2\n", "log.csv", {.header = CsvHeader::optional}).rows(), 1);
  EXPECT_CONTAINS(message_for("a,1\n1,2\n", {.header = CsvHeader::optional}), "log.csv:1: field 1 is 'a'");
}

TEST(Csv, NamesFileLineAndWhatWasFound) {
  EXPECT_CONTAINS(message_for("1,2\n1,2\n1\n"), "log.csv:3: 1 field(s) where 2");
  EXPECT_CONTAINS(message_for("1,2\n1,2,3\n"), "log.csv:2: 3 field(s) where 2");
  EXPECT_CONTAINS(message_for("1,2\n", {.columns = 3}), "log.csv:1: 2 field(s) where 3");
  EXPECT_CONTAINS(message_for("a,b\n1,2\n1,?\n", {.header = CsvHeader::required}), "log.csv:3: field 2 is '?'");
  EXPECT_CONTAINS(message_for("1,2\n\n1,2\n"), "log.csv:2: a blank line");
  for (const char* wrong : {"1.5x", "0x10", "inf", "-INF", "1e999", "1 2", "--1", "+-1", "\"1\"", "1;2", "-nan"}) {
    EXPECT_CONTAINS(message_for(std::string("0,0\n0,") + wrong), "log.csv:2: field 2 is");
  }
  EXPECT_CONTAINS(message_for("x;y\n0;1\n", {.header = CsvHeader::optional}),
                  "log.csv:2: semicolons in '0;1'; expected numbers separated by commas");
  EXPECT_CONTAINS(message_for("0\t1\n"), "log.csv:1: tabs in ");
  EXPECT_CONTAINS(message_for("0 1\n"), "log.csv:1: blanks in ");
  EXPECT_CONTAINS(message_for(""), "empty");
  EXPECT_CONTAINS(error_of([] { read_csv("no/such.csv"); }), "no/such.csv: cannot be read");
  EXPECT_CONTAINS(error_of([] { read_csv(testing::TempDir()); }), "is a folder");
}

TEST(Csv, FindsTimeThatRunsBackwards) {
  EXPECT_NO_THROW(check_time_order(parse_csv("1,0\n1,0\n2,0\n", "log.csv")));
  EXPECT_CONTAINS(error_of([] {
                    check_time_order(parse_csv("t,x\n1,0\n3,0\n2.5,0\n", "log.csv", {.header = CsvHeader::required}));
                  }),
                  "log.csv:4: time runs backwards, from 3 s to 2.5 s");
  EXPECT_CONTAINS(error_of([] { check_time_order(parse_csv("0,1\n0,\n", "log.csv"), 1); }),
                  "log.csv:2: the time is missing");
  EXPECT_CONTAINS(error_of([] { check_time_order(parse_csv("0,1\n", "log.csv"), 2); }), "no column 3");
}

TEST(Csv, ReadsALongLogQuickly) {
  std::string text;
  for (int i = 0; i < 62000; ++i) text += std::to_string(20.0 + 0.025 * i) + ",3.14159,-0.0034717\n";
  const auto start = std::chrono::steady_clock::now();
  const CsvTable table = parse_csv(text, "log.csv");
  const std::chrono::duration<double> elapsed = std::chrono::steady_clock::now() - start;
  EXPECT_EQ(table.rows(), 62000);
  EXPECT_LT(elapsed.count(), 1.0) << "ten times what it may take, for slow and instrumented machines";
}

}  // namespace csv_test
}  // namespace rhec::sim
