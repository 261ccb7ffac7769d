#include "rhec/logs/mcap/mcap_log.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <cstdint>
#include <cstring>

#include "logs/support/rows.hpp"
#include "logs/support/small_mcap.hpp"
#include "rhec/logs/storage/compression.hpp"
#include "support/error_of.hpp"
#include "support/temporary_folder.hpp"

namespace rhec::logs {
namespace mcap_log_test {

using testing::HasSubstr;

class McapLogTest : public FolderTest {
 protected:
  Rows rows(const std::string& content) { return rows_of(*open_mcap(put("y.mcap", content)), "/a", {{"data"}}); }
  std::string small(int count, std::size_t filling = 0) {
    write_small_mcap(file("x.mcap"), count, filling);
    return content_of(file("x.mcap"));
  }
};

/// As rosbag2 writes with `compression_mode: message`.
TEST_F(McapLogTest, MessagesMayBeCompressedOneByOne) {
  McapWriter writer(file("x.mcap"));
  const std::uint16_t a = writer.add_channel("/a", "std_msgs/msg/Float64", "float64 data");
  for (int i = 0; i < 3; ++i) {
    CdrWriter message;
    message.f64(i);
    std::vector<std::byte> block;
    compress_zstd(message.bytes(), block);
    if (i == 1) block.resize(block.size() - 1);
    writer.write(a, Stamp{1'000'000} * (i + 1), block);
  }
  writer.close();
  const Rows found = rows_of(*open_mcap(file("x.mcap")), "/a", {{"data"}});
  ASSERT_EQ(found.values.size(), 2u);
  EXPECT_EQ(found.values[1][0], 2.0);
  ASSERT_TRUE(found.damage);
  EXPECT_THAT(found.damage->what, HasSubstr("a message is damaged"));
}

TEST_F(McapLogTest, ATypeMayBeDefinedAnewOnTheWay) {
  McapWriter writer(file("x.mcap"));
  for (const char* definition : {"float64 x", "float64 added\nfloat64 x"}) {
    const bool is_second = definition[8] == 'a';
    const std::uint16_t channel = writer.add_channel("/a", "my_msgs/msg/A", definition);
    CdrWriter message;
    if (is_second) message.f64(7.0);
    message.f64(is_second ? 2.0 : 1.0);
    writer.write(channel, 1'000'000, message.bytes());
  }
  writer.close();
  const auto log = open_mcap(file("x.mcap"));
  ASSERT_EQ(log->topics().size(), 1u);
  EXPECT_EQ(log->topics()[0].count, 2);
  const Rows found = rows_of(*log, "/a", {{"x", "added"}});
  ASSERT_EQ(found.values.size(), 2u);
  EXPECT_EQ(found.values[0][0], 1.0);
  EXPECT_TRUE(std::isnan(found.values[0][1]));
  EXPECT_EQ(found.values[1], (std::vector<double>{2.0, 7.0}));
  EXPECT_THAT(error_of([&] { log->reader(0, {{"y"}}); }), HasSubstr("has no field 'y'"));
}

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
    const auto log = open_mcap(put("y.mcap", whole.substr(0, size)));
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
  const auto log = open_mcap(put("y.mcap", content));
  EXPECT_EQ(log->topics().size(), 3u);
  EXPECT_EQ(log->topics()[0].count, 100);
  EXPECT_EQ(rows_of(*log, "/a", {{"data"}}).values.size(), 100u);
}

TEST_F(McapLogTest, ALengthThatIsALieTakesNoMemory) {
  std::string content = small(10);
  const std::string huge(8, '\x7F');
  content.replace(8 + 1, 8, huge);  // of the first record
  EXPECT_THAT(open_mcap(put("y.mcap", content))->read({true, true, true}, [](const Record&) { return true; })->what,
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
  const auto log = open_mcap(put("y.mcap", content));
  const auto damage = log->read(std::vector<bool>(log->topics().size(), false), [](const Record&) { return true; });
  ASSERT_TRUE(damage);
  EXPECT_THAT(damage->what, HasSubstr("found the end"));
}

TEST_F(McapLogTest, RefusesWhatIsNoMcap) {
  EXPECT_THAT(error_of([&] { open_mcap(put("y.mcap", "time,x\n")); }), HasSubstr("found no MCAP"));
}

}  // namespace mcap_log_test
}  // namespace rhec::logs
