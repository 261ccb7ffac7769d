#include "rhec/logs/files/open_log.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "logs/support/small_mcap.hpp"
#include "support/error_of.hpp"
#include "support/temporary_folder.hpp"

namespace rhec::logs {
namespace open_log_test {

using testing::HasSubstr;
using OpenLogTest = FolderTest;

TEST_F(OpenLogTest, ContentCountsNotTheName) {
  write_small_mcap(file("drive.csv"), 3);
  EXPECT_EQ(open_log(file("drive.csv"))->topics().size(), 3u);
  EXPECT_EQ(open_log(put("drive.mcap", "time,x\n0,1\n"))->topics().front().type, "table");
}

TEST_F(OpenLogTest, SaysWhatAFileIsAndWhatToDo) {
  const auto message = [&](const std::string& content) { return error_of([&] { open_log(put("old.bag", content)); }); };
  EXPECT_THAT(message("#ROSBAG V2.0\n"), testing::AllOf(HasSubstr("ROS 1"), HasSubstr("rosbags-convert --src")));
  EXPECT_THAT(message(""), HasSubstr("empty"));
  EXPECT_THAT(message(std::string("\x7F"
                                  "ELF\0\0",
                                  6)),
              HasSubstr("no text"));
  EXPECT_THAT(error_of([&] { open_log(file("gone")); }), HasSubstr("no such file"));
  EXPECT_THAT(error_of([&] { open_log(file("")); }), HasSubstr("without metadata.yaml"));
}

}  // namespace open_log_test
}  // namespace rhec::logs
