#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "logs/support/files.hpp"
#include "logs/support/rows.hpp"
#include "logs/support/small_mcap.hpp"
#include "rhec/logs/rosbag2/rosbag2.hpp"
#include "rhec/logs/storage/compression.hpp"
#include "support/error_of.hpp"

namespace rhec::logs {
namespace bag_folder_test {

using testing::HasSubstr;

class BagFolderTest : public FilesTest {
 protected:
  void write_metadata(const std::string& files) {
    write("metadata.yaml", "rosbag2_bagfile_information:\n  version: 8\n  relative_file_paths: " + files + "\n");
  }
  void compress(const std::string& name) {
    const std::string content = content_of(path(name));
    std::vector<std::byte> block;
    compress_zstd(std::as_bytes(std::span(content)), block);
    write(name + ".zstd", {reinterpret_cast<const char*>(block.data()), block.size()});
    std::filesystem::remove(path(name));
  }
};

TEST_F(BagFolderTest, FilesAreReadOneAfterTheOther) {
  write_small_mcap(path("b_0.mcap"), 10);
  write_small_mcap(path("b_1.mcap"), 5);
  write_metadata("[b_0.mcap, b_1.mcap]");
  const auto log = open_bag_folder(path(""));
  EXPECT_EQ(log->topics().size(), 3u);
  EXPECT_EQ(log->topics()[0].count, 15);
  const Rows rows = rows_of(*log, "/b", {{"data"}});
  ASSERT_EQ(rows.values.size(), 15u);
  EXPECT_EQ(rows.values[9][0], -9.0);
  EXPECT_EQ(rows.values[11][0], -1.0);
}

TEST_F(BagFolderTest, CompressedFilesAreDecompressedAside) {
  write_small_mcap(path("b_0.mcap"), 1000);
  compress("b_0.mcap");
  write_metadata("[b_0.mcap.zstd]");
  EXPECT_EQ(rows_of(*open_bag_folder(path("")), "/a", {{"data"}}).values.size(), 1000u);
  write_metadata("[b_0.mcap]");  // of a bag that was compressed by hand
  EXPECT_EQ(rows_of(*open_bag_folder(path("")), "/a", {{"data"}}).values.size(), 1000u);
  EXPECT_EQ(rows_of(*open_compressed(path("b_0.mcap.zstd")), "/a", {{"data"}}).values.size(), 1000u);
}

TEST_F(BagFolderTest, SaysWhatIsMissing) {
  write_metadata("[gone.db3]");
  EXPECT_THAT(error_of([&] { open_bag_folder(path("")); }),
              testing::AllOf(HasSubstr("metadata.yaml:3"), HasSubstr("there is no file"), HasSubstr("gone.db3")));
  write("metadata.yaml", "a: b\n");
  EXPECT_THAT(error_of([&] { open_bag_folder(path("")); }), HasSubstr("relative_file_paths"));
}

}  // namespace bag_folder_test
}  // namespace rhec::logs
