#include <gtest/gtest.h>

#include <chrono>
#include <cmath>
#include <filesystem>
#include <fstream>
#include <functional>
#include <string>

#include "rhec/core/base/error.hpp"
#include "rhec/sim/files/csv.hpp"
#include "rhec/sim/files/output_folder.hpp"

namespace rhec::sim {
namespace {

namespace fs = std::filesystem;

#define EXPECT_CONTAINS(text, part) EXPECT_NE((text).find(part), std::string::npos) << (text)

std::string message_of(const std::function<void()>& call) {
  try {
    call();
  } catch (const Error& error) {
    return error.what();
  }
  return "no error";
}

std::string message_for(const std::string& text, const CsvOptions& options = {}) {
  return message_of([&] { parse_csv(text, "log.csv", options); });
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
  EXPECT_CONTAINS(message_for(""), "empty");
  EXPECT_CONTAINS(message_of([] { read_csv("no/such.csv"); }), "no/such.csv: cannot be read");
  EXPECT_CONTAINS(message_of([] { read_csv(testing::TempDir()); }), "is a folder");
}

TEST(Csv, FindsTimeThatRunsBackwards) {
  EXPECT_NO_THROW(check_time_order(parse_csv("1,0\n1,0\n2,0\n", "log.csv")));
  EXPECT_CONTAINS(message_of([] {
                    check_time_order(parse_csv("t,x\n1,0\n3,0\n2.5,0\n", "log.csv", {.header = CsvHeader::required}));
                  }),
                  "log.csv:4: time runs backwards, from 3 s to 2.5 s");
  EXPECT_CONTAINS(message_of([] { check_time_order(parse_csv("0,1\n0,\n", "log.csv"), 1); }),
                  "log.csv:2: the time is missing");
  EXPECT_CONTAINS(message_of([] { check_time_order(parse_csv("0,1\n", "log.csv"), 2); }), "no column 3");
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

class OutputFolderTest : public testing::Test {
 protected:
  void SetUp() override {
    root_ = fs::path(testing::TempDir()) /
            ("rhec_output_" + std::string(testing::UnitTest::GetInstance()->current_test_info()->name()));
    fs::remove_all(root_);
    fs::create_directories(root_);
  }
  void TearDown() override { fs::remove_all(root_); }
  static void put(const fs::path& file, const std::string& content) { std::ofstream(file) << content; }
  int entries(const fs::path& folder) const {
    return static_cast<int>(std::distance(fs::directory_iterator(folder), fs::directory_iterator()));
  }
  fs::path root_;
};

TEST_F(OutputFolderTest, NothingAppearsBeforeCommit) {
  OutputFolder folder(root_ / "deep" / "run");
  folder.write("a.csv", "1,2\n");
  EXPECT_FALSE(fs::exists(root_ / "deep" / "run"));
  folder.commit();
  EXPECT_EQ(read_text(root_ / "deep" / "run" / "a.csv"), "1,2\n");
  EXPECT_EQ(entries(root_ / "deep"), 1) << "nothing is left aside";
  EXPECT_EQ(entries(root_ / "deep" / "run"), 1);
}

TEST_F(OutputFolderTest, WithoutCommitEverythingStays) {
  fs::create_directories(root_ / "run");
  put(root_ / "run" / "a.csv", "old");
  {
    OutputFolder folder(root_ / "run");
    folder.write("a.csv", "new");
    EXPECT_EQ(read_text(root_ / "run" / "a.csv"), "old");
  }
  EXPECT_EQ(read_text(root_ / "run" / "a.csv"), "old");
  EXPECT_EQ(entries(root_ / "run"), 1);
  EXPECT_EQ(entries(root_), 1);
  { OutputFolder folder(root_ / "never"); }
  EXPECT_EQ(entries(root_), 1);
}

TEST_F(OutputFolderTest, ReplacesItsFilesAndKeepsOthers) {
  fs::create_directories(root_ / "run");
  put(root_ / "run" / "a.csv", "old");
  put(root_ / "run" / "notes.txt", "mine");
  OutputFolder folder((root_ / "run" / "").string());
  folder.write("a.csv", "new");
  put(folder.file("b.csv"), "by another writer");
  folder.commit();
  EXPECT_EQ(read_text(root_ / "run" / "a.csv"), "new");
  EXPECT_EQ(read_text(root_ / "run" / "b.csv"), "by another writer");
  EXPECT_EQ(read_text(root_ / "run" / "notes.txt"), "mine");
  EXPECT_THROW(folder.write("late.csv", ""), Error);
}

TEST_F(OutputFolderTest, TwoRunsAtOnceDoNotMix) {
  OutputFolder first(root_ / "run"), second(root_ / "run");
  first.write("a.csv", "first");
  second.write("a.csv", "second");
  first.commit();
  EXPECT_EQ(read_text(root_ / "run" / "a.csv"), "first");
  second.commit();
  EXPECT_EQ(read_text(root_ / "run" / "a.csv"), "second");
  EXPECT_EQ(entries(root_), 1 + 1) << "the empty place aside goes with its owner";
}

TEST_F(OutputFolderTest, RefusesBeforeAnythingIsReplaced) {
  put(root_ / "file", "");
  EXPECT_CONTAINS(message_of([&] { OutputFolder folder(root_ / "file"); }), "is a file");
  EXPECT_CONTAINS(message_of([&] { OutputFolder folder(root_ / "file" / "below"); }), "cannot be created");
  EXPECT_CONTAINS(message_of([&] { OutputFolder folder(""); }), "empty");
  fs::create_directories(root_ / "run" / "b.csv");
  put(root_ / "run" / "a.csv", "old");
  OutputFolder folder(root_ / "run");
  for (const char* name : {"", ".", "..", "../a", "a/b", "/a"}) EXPECT_THROW(folder.file(name), Error) << name;
  folder.write("a.csv", "new");
  folder.write("b.csv", "new");
  EXPECT_CONTAINS(message_of([&] { folder.commit(); }), "in the way");
  EXPECT_EQ(read_text(root_ / "run" / "a.csv"), "old");
  OutputFolder forgetful(root_ / "other");
  forgetful.file("a.csv");
  EXPECT_CONTAINS(message_of([&] { forgetful.commit(); }), "never written");
}

}  // namespace
}  // namespace rhec::sim
