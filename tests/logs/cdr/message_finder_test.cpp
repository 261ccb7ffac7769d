#include "logs/cdr/message_finder.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "support/error_of.hpp"
#include "support/temporary_folder.hpp"

namespace rhec::logs {
namespace message_finder_test {

using MessageFinderTest = FolderTest;

TEST_F(MessageFinderTest, TheBagsDefinitionCountsThenTheFoldersThenWhatIsBuiltIn) {
  EXPECT_EQ(
      find_message("std_msgs/msg/Float64", "ros2msg", "float32 other\n", {})->structures.front().fields.front().name,
      "other");
  put("share/std_msgs/msg/Float64.msg", "int8 from_folder\n");
  EXPECT_EQ(find_message("std_msgs/msg/Float64", "", "", {file("")})->structures.front().fields.front().name,
            "from_folder");
  EXPECT_EQ(find_message("std_msgs/msg/Float64", "", "", {})->structures.front().fields.front().name, "data");
}

TEST_F(MessageFinderTest, PackagesAreFoundInAllTheirPlaces) {
  put("mine/msg/Wheel.msg", "std_msgs/Header header\nSide left\n");
  put("mine/msg/Side.idl", "module mine { module msg { struct Side { double speed; }; }; };");
  for (const char* folder : {"", "mine"}) {
    const auto type = find_message("mine/msg/Wheel", "", "", {file(folder)});
    EXPECT_EQ(type->structures.size(), 4u) << folder;
  }
}

TEST_F(MessageFinderTest, SaysWhatIsMissing) {
  EXPECT_THAT(error_of([&] { find_message("mine/msg/Wheel", "", "", {file("")}); }),
              testing::AllOf(testing::HasSubstr("mine/msg/Wheel is not defined"), testing::HasSubstr("--msg-path")));
  EXPECT_THAT(error_of([&] { find_message("mine/msg/Wheel", "protobuf", "", {}); }), testing::HasSubstr("'protobuf'"));
}

}  // namespace message_finder_test
}  // namespace rhec::logs
