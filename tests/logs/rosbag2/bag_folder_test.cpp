#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "logs/support/rows.hpp"
#include "logs/support/small_mcap.hpp"
#include "rhec/logs/rosbag2/rosbag2.hpp"
#include "rhec/logs/storage/compression.hpp"
#include "support/error_of.hpp"
#include "support/temporary_folder.hpp"

namespace rhec::logs {
namespace bag_folder_test {

using testing::HasSubstr;

class BagFolderTest : public FolderTest {
 protected:
  void write_metadata(const std::string& files) {
    put("metadata.yaml", "rosbag2_bagfile_information:\n  version: 8\n  relative_file_paths: " + files + "\n");
  }
  void compress(const std::string& name) {
    const std::string content = content_of(file(name));
    std::vector<std::byte> block;
    compress_zstd(std::as_bytes(std::span(content)), block);
    put(name + ".zstd", {reinterpret_cast<const char*>(block.data()), block.size()});
    std::filesystem::remove(file(name));
  }
};

TEST_F(BagFolderTest, FilesAreReadOneAfterTheOther) {
  write_small_mcap(file("b_0.mcap"), 10);
  write_small_mcap(file("b_1.mcap"), 5);
  write_metadata("[b_0.mcap, b_1.mcap]");
  const auto log = open_bag_folder(file(""));
  EXPECT_EQ(log->topics().size(), 3u);
  EXPECT_EQ(log->topics()[0].count, 15);
  const Rows rows = rows_of(*log, "/b", {{"data"}});
  ASSERT_EQ(rows.values.size(), 15u);
  EXPECT_EQ(rows.values[9][0], -9.0);
  EXPECT_EQ(rows.values[11][0], -1.0);
}

TEST_F(BagFolderTest, CompressedFilesAreDecompressedAside) {
  write_small_mcap(file("b_0.mcap"), 1000);
  compress("b_0.mcap");
  write_metadata("[b_0.mcap.zstd]");
  EXPECT_EQ(rows_of(*open_bag_folder(file("")), "/a", {{"data"}}).values.size(), 1000u);
  write_metadata("[b_0.mcap]");  // of a bag that was compressed by hand
  EXPECT_EQ(rows_of(*open_bag_folder(file("")), "/a", {{"data"}}).values.size(), 1000u);
  EXPECT_EQ(rows_of(*open_compressed(file("b_0.mcap.zstd")), "/a", {{"data"}}).values.size(), 1000u);
}

TEST_F(BagFolderTest, ACompressedFileThatIsDamagedGivesWhatIsBefore) {
  write_small_mcap(file("b_0.mcap"), 5000, 1000);
  compress("b_0.mcap");
  const std::string whole = content_of(file("b_0.mcap.zstd"));
  for (const bool is_cut : {true, false}) {
    std::string content = whole;
    if (is_cut) content.resize(whole.size() / 2);
    if (!is_cut) content.replace(whole.size() / 2, 4000, 4000, '\x55');
    put("c.mcap.zstd", content);
    const Rows found = rows_of(*open_compressed(file("c.mcap.zstd")), "/a", {{"data"}});
    EXPECT_GT(found.values.size(), 1000u);
    EXPECT_LT(found.values.size(), 5000u);
    ASSERT_TRUE(found.damage);
    EXPECT_THAT(found.damage->what,
                testing::AllOf(HasSubstr("c.mcap.zstd: byte "), HasSubstr("what is before it is used"),
                               testing::Not(HasSubstr("_c.mcap"))));
  }
}

/// A hundred megabytes of zeros in some kilobytes: no messages are like that.
TEST_F(BagFolderTest, ACompressedFileDoesNotFillTheDisk) {
  write_small_mcap(file("b_0.mcap"), 10);
  std::string content = content_of(file("b_0.mcap"));
  content.resize(std::size_t{100} << 20, '\0');
  put("b_0.mcap", content);
  compress("b_0.mcap");
  ASSERT_LT(std::filesystem::file_size(file("b_0.mcap.zstd")), 20000u);
  EXPECT_THAT(error_of([&] { open_compressed(file("b_0.mcap.zstd")); }),
              testing::AllOf(HasSubstr("b_0.mcap.zstd: it decompresses to more than"), HasSubstr("TMPDIR")));
}

/// A recorder that was killed has not written metadata.yaml.
TEST_F(BagFolderTest, WithoutMetadataFilesAreReadInTheOrderOfTheirNumbers) {
  write_small_mcap(file("bag_10.mcap"), 3);
  write_small_mcap(file("bag_2.mcap"), 4);
  write_small_mcap(file("bag_0.mcap"), 5);
  compress("bag_0.mcap");
  EXPECT_TRUE(has_bag_files(file("")));
  const Rows found = rows_of(*open_bag_folder(file("")), "/a", {{"data"}});
  ASSERT_EQ(found.values.size(), 12u);
  EXPECT_EQ(found.values[4][0], 4.0);
  EXPECT_EQ(found.values[8][0], 3.0);
  EXPECT_EQ(found.values[11][0], 2.0);
  write_small_mcap(file("other.mcap"), 1);
  EXPECT_THAT(
      error_of([&] { open_bag_folder(file("")); }),
      HasSubstr("files of several bags; name one of them: bag_0.mcap.zstd, bag_2.mcap, bag_10.mcap, other.mcap"));
}

TEST_F(BagFolderTest, FilesMayDefineATypeInDifferentWays) {
  const auto write_one = [&](const char* name, const char* definition, int numbers) {
    McapWriter writer(file(name));
    const std::uint16_t channel = writer.add_channel("/a", "my_msgs/msg/A", definition);
    CdrWriter message;
    for (int i = 1; i <= numbers; ++i) message.f64(i);
    writer.write(channel, 1'000'000'000, message.bytes());
    writer.close();
  };
  write_one("b_0.mcap", "float64 x", 1);
  write_one("b_1.mcap", "float64 added\nfloat64 x", 2);
  const Rows found = rows_of(*open_bag_folder(file("")), "/a", {{"x"}});
  ASSERT_EQ(found.values.size(), 2u);
  EXPECT_EQ(found.values[0][0], 1.0);
  EXPECT_EQ(found.values[1][0], 2.0);
}

TEST_F(BagFolderTest, SaysWhatIsMissing) {
  write_metadata("[gone.db3]");
  EXPECT_THAT(error_of([&] { open_bag_folder(file("")); }),
              testing::AllOf(HasSubstr("metadata.yaml:3"), HasSubstr("there is no file"), HasSubstr("gone.db3")));
  put("metadata.yaml", "a: b\n");
  EXPECT_THAT(error_of([&] { open_bag_folder(file("")); }), HasSubstr("relative_file_paths"));
}

}  // namespace bag_folder_test
}  // namespace rhec::logs
