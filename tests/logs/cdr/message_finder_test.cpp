#include "logs/cdr/message_finder.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "logs/support/files.hpp"
#include "support/error_of.hpp"

namespace rhec::logs {
namespace message_finder_test {

using MessageFinderTest = FilesTest;

TEST_F(MessageFinderTest, TheBagsDefinitionCountsThenTheFoldersThenWhatIsBuiltIn) {
  EXPECT_EQ(
      find_message("std_msgs/msg/Float64", "ros2msg", "float32 other\n", {})->structures.front().fields.front().name,
      "other");
  write("share/std_msgs/msg/Float64.msg", "int8 from_folder\n");
  EXPECT_EQ(find_message("std_msgs/msg/Float64", "", "", {path("")})->structures.front().fields.front().name,
            "from_folder");
  EXPECT_EQ(find_message("std_msgs/msg/Float64", "", "", {})->structures.front().fields.front().name, "data");
}

TEST_F(MessageFinderTest, PackagesAreFoundInAllTheirPlaces) {
  write("mine/msg/Wheel.msg", "std_msgs/Header header\nSide left\n");
  write("mine/msg/Side.idl", "module mine { module msg { struct Side { double speed; }; }; };");
  for (const char* folder : {"", "mine"}) {
    const auto type = find_message("mine/msg/Wheel", "", "", {path(folder)});
    EXPECT_EQ(type->structures.size(), 4u) << folder;
  }
}

TEST_F(MessageFinderTest, SaysWhatIsMissing) {
  EXPECT_THAT(error_of([&] { find_message("mine/msg/Wheel", "", "", {path("")}); }),
              testing::AllOf(testing::HasSubstr("mine/msg/Wheel is not defined"), testing::HasSubstr("--msg-path")));
  EXPECT_THAT(error_of([&] { find_message("mine/msg/Wheel", "protobuf", "", {}); }), testing::HasSubstr("'protobuf'"));
}

}  // namespace message_finder_test
}  // namespace rhec::logs
