#include "rhec/logs/mcap/mcap_log.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cstdint>
#include <cstring>

#include "logs/support/files.hpp"
#include "logs/support/rows.hpp"
#include "logs/support/small_mcap.hpp"
#include "support/error_of.hpp"

namespace rhec::logs {
namespace mcap_log_test {

using testing::HasSubstr;

class McapLogTest : public FilesTest {
 protected:
  Rows rows(const std::string& content) { return rows_of(*open_mcap(write("y.mcap", content)), "/a", {{"data"}}); }
  std::string small(int count, std::size_t filling = 0) {
    write_small_mcap(path("x.mcap"), count, filling);
    return content_of(path("x.mcap"));
  }
};

TEST_F(McapLogTest, ACutFileGivesWhatIsBeforeTheCut) {
  const std::string whole = small(5000, 1000);
  std::size_t before = 0;
  for (const std::size_t size : {whole.size() / 4, whole.size() / 2}) {
    const Rows found = rows(whole.substr(0, size));
    ASSERT_TRUE(found.damage) << size;
    EXPECT_THAT(found.damage->what, testing::AllOf(HasSubstr("y.mcap: byte "), HasSubstr("mcap recover")));
    EXPECT_GT(found.values.size(), before);
    before = found.values.size();
    for (std::size_t i = 0; i < before; ++i) ASSERT_EQ(found.values[i][0], static_cast<double>(i));
  }
  // A summary that is cut is done without.
  EXPECT_FALSE(rows(whole.substr(0, whole.size() - 100)).damage);
}

TEST_F(McapLogTest, EveryCutIsAnswered) {
  const std::string whole = small(20);
  for (std::size_t size = 8; size < whole.size(); size += 7) {
    const auto log = open_mcap(write("y.mcap", whole.substr(0, size)));
    std::int64_t count = 0;
    static_cast<void>(
        log->read(std::vector<bool>(log->topics().size(), true), [&](const Record&) { return ++count < 100; }));
    EXPECT_LE(count, 40);
  }
}

TEST_F(McapLogTest, AChunkWithAWrongChecksumIsPassedOver) {
  std::string content = small(5000, 1000);
  content[content.size() / 2] ^= 1;
  const Rows found = rows(content);
  ASSERT_TRUE(found.damage);
  EXPECT_THAT(found.damage->what, HasSubstr("a chunk is damaged"));
  EXPECT_GT(found.values.size(), 3000u);
  EXPECT_LT(found.values.size(), 5000u);
  EXPECT_EQ(found.values.back()[0], 4999.0);
}

TEST_F(McapLogTest, WithoutASummaryItIsGoneThroughOnce) {
  std::string content = small(100);
  // The footer's place of the summary, 8 bytes before its own second half, becomes 0: there is none.
  const std::size_t footer = content.size() - 8 - 20;
  for (std::size_t i = 0; i < 20; ++i) content[footer + i] = 0;
  const auto log = open_mcap(write("y.mcap", content));
  EXPECT_EQ(log->topics().size(), 3u);
  EXPECT_EQ(log->topics()[0].count, 100);
  EXPECT_EQ(rows_of(*log, "/a", {{"data"}}).values.size(), 100u);
}

TEST_F(McapLogTest, ALengthThatIsALieTakesNoMemory) {
  std::string content = small(10);
  const std::string huge(8, '\x7F');
  content.replace(8 + 1, 8, huge);  // of the first record
  EXPECT_THAT(open_mcap(write("y.mcap", content))->read({true, true, true}, [](const Record&) { return true; })->what,
              HasSubstr("byte 8: found a record of"));
}

// A length that leads back to the chunk itself, in which nothing is asked for.
TEST_F(McapLogTest, ALengthThatLeadsBackIsGoneThroughOnce) {
  std::string content = small(100);
  std::size_t chunk = 8;
  const auto length_at = [&](std::size_t place) {
    std::uint64_t length = 0;
    std::memcpy(&length, content.data() + place + 1, sizeof(length));
    return length;
  };
  while (content.at(chunk) != '\x06') chunk += 9 + length_at(chunk);
  const std::uint64_t back = std::uint64_t{0} - 9;
  std::memcpy(content.data() + chunk + 1, &back, sizeof(back));
  const auto log = open_mcap(write("y.mcap", content));
  const auto damage = log->read(std::vector<bool>(log->topics().size(), false), [](const Record&) { return true; });
  ASSERT_TRUE(damage);
  EXPECT_THAT(damage->what, HasSubstr("found the end"));
}

TEST_F(McapLogTest, RefusesWhatIsNoMcap) {
  EXPECT_THAT(error_of([&] { open_mcap(write("y.mcap", "time,x\n")); }), HasSubstr("found no MCAP"));
}

}  // namespace mcap_log_test
}  // namespace rhec::logs
