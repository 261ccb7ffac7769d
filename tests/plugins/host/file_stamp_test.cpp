#include "plugins/host/file_stamp.hpp"

#include <gtest/gtest.h>

#include <fstream>

#include "plugins/host/fixtures.hpp"

namespace rhec {
namespace file_stamp_test {

TEST(FileStamp, TellsChangedFilesApart) {
  TemporaryFolder folder;
  const fs::path file = folder.path() / "file";
  EXPECT_FALSE(stamp_of(file));
  std::ofstream(file) << "one";
  const auto before = stamp_of(file);
  ASSERT_TRUE(before);
  EXPECT_EQ(stamp_of(file), before);
  std::ofstream(file) << "other";
  EXPECT_NE(stamp_of(file), before);
}

TEST(FileStamp, IsReadAsItIsWritten) {
  const FileStamp stamp{.device = 1, .inode = 2, .size = 3, .modified = -4, .changed = 5'000'000'000};
  EXPECT_EQ(stamp_from(text_of(stamp)), stamp);
  for (const char* wrong : {"", "1 2 3 4", "1 2 3 4 5 6", "1 2 3 4 x", "-1 2 3 4 5"})
    EXPECT_FALSE(stamp_from(wrong)) << wrong;
}

TEST(FileStamp, TheHashIsTheOneOfFowlerNollAndVo) {
  TemporaryFolder folder;
  const fs::path file = folder.path() / "file";
  EXPECT_EQ(content_hash(file), "");
  std::ofstream(file) << "a";
  EXPECT_EQ(content_hash(file), "af63dc4c8601ec8c");  // of their page of test values
  EXPECT_EQ(text_hash(""), "cbf29ce484222325");
  const std::string large(200'000, 'b');  // more than is read at once
  std::ofstream(file) << large;
  EXPECT_EQ(content_hash(file), text_hash(large));
}

}  // namespace file_stamp_test
}  // namespace rhec
