#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "rhec/logs/cdr/message_definitions.hpp"
#include "support/error_of.hpp"

namespace rhec::logs {
namespace msg_definitions_test {

TEST(MsgDefinitions, ReadsFieldsAndPassesOverConstantsCommentsAndDefaults) {
  Definitions found;
  parse_ros2msg(
      "pkg/msg/A",
      "# a comment\nint32 RED=1\nstring NAME = \"x # y\"\nfloat64 x 1.5 # with a default\nB[] items\n"
      "other_pkg/C c\nstring<=10 text\nuint8[<=5] few\nfloat32[3] three\nHeader header\r\n"
      "================================================================================\nMSG: pkg/B\nbool on\n",
      found);
  const StructureDefinition& a = found.at("pkg/msg/A");
  ASSERT_EQ(a.fields.size(), 7u);
  EXPECT_EQ(a.fields[0].kind, Kind::f64);
  EXPECT_EQ(a.fields[1].type, "pkg/msg/B");
  EXPECT_EQ(a.fields[1].shape, Shape::sequence);
  EXPECT_EQ(a.fields[2].type, "other_pkg/msg/C");
  EXPECT_EQ(a.fields[3].kind, Kind::text);
  EXPECT_EQ(a.fields[4].shape, Shape::sequence);
  EXPECT_EQ(a.fields[5].length, 3u);
  EXPECT_EQ(a.fields[6].type, "std_msgs/msg/Header");
  EXPECT_EQ(found.at("pkg/msg/B").fields.front().kind, Kind::boolean);
}

TEST(MsgDefinitions, NamesTheLineOfWhatIsNoField) {
  Definitions found;
  EXPECT_THAT(error_of([&] { parse_ros2msg("pkg/msg/A", "float64 x\nfloat64\n", found); }),
              testing::HasSubstr("pkg/msg/A, line 2: found 'float64'"));
  EXPECT_THAT(error_of([&] { parse_ros2msg("pkg/msg/A", "float64[three] x\n", found); }), testing::HasSubstr("line 1"));
}

}  // namespace msg_definitions_test
}  // namespace rhec::logs
