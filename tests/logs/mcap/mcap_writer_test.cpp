#include "rhec/logs/mcap/mcap_writer.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "logs/support/rows.hpp"
#include "logs/support/small_mcap.hpp"
#include "rhec/logs/mcap/mcap_log.hpp"
#include "support/error_of.hpp"
#include "support/temporary_folder.hpp"

namespace rhec::logs {
namespace mcap_writer_test {

using McapWriterTest = FolderTest;

TEST_F(McapWriterTest, WhatItWritesIsReadInOrderOverManyChunks) {
  write_small_mcap(file("x.mcap"), 5000, 1000);
  EXPECT_GT(std::filesystem::file_size(file("x.mcap")), 4'000'000u);
  const auto log = open_mcap(file("x.mcap"));
  ASSERT_EQ(log->topics().size(), 3u);
  EXPECT_EQ(log->topics()[0].count, 5000);
  const Rows rows = rows_of(*log, "/b", {{"data"}});
  EXPECT_FALSE(rows.damage);
  ASSERT_EQ(rows.values.size(), 5000u);
  for (int i = 0; i < 5000; ++i) {
    EXPECT_EQ(rows.values[static_cast<std::size_t>(i)][0], -i);
    EXPECT_EQ(rows.received[static_cast<std::size_t>(i)], Stamp{1'000'000} * i);
  }
}

TEST_F(McapWriterTest, AFileAppearsWhenItIsCompleteAndNotBefore) {
  {
    McapWriter writer(file("x.mcap"));
    EXPECT_FALSE(std::filesystem::exists(file("x.mcap")));
  }
  EXPECT_TRUE(std::filesystem::is_empty(file("")));
  EXPECT_THAT(error_of([&] { McapWriter writer(put("file", "") / "x.mcap"); }),
              testing::HasSubstr("cannot be written"));
}

}  // namespace mcap_writer_test
}  // namespace rhec::logs
