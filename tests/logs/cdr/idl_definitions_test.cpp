#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "rhec/logs/cdr/message_definitions.hpp"
#include "support/error_of.hpp"

namespace rhec::logs {
namespace idl_definitions_test {

constexpr const char* text = R"(================================================================================
IDL: pkg/msg/A
// generated
#include "std_msgs/msg/Header.idl"
module pkg {
  module msg {
    module A_Constants {
      const int8 RED = 1;
      @verbatim (language="comment", text="a (b" "c")
      const string NAME = 'x;y';
    };
    typedef double double__36[36];
    typedef pkg::msg::B B__2[2];
    enum Colour { RED, GREEN };
    @verbatim (language="comment", text=
      "what it is")
    struct A {
      std_msgs::msg::Header header;
      @unit (value="m")
      double x;
      unsigned long long count;
      sequence<float> few;
      sequence<string, 3> names;
      string<10> text;
      double__36 covariance;
      B__2 pair;
      Colour colour;
      uint8 raw[4];
      @default (value=TRUE)
      boolean on;
    };
    struct Empty { uint8 structure_needs_at_least_one_member; };
  };
};
================================================================================
IDL: pkg/msg/B
module pkg { module msg { struct B { long i; }; }; };
)";

TEST(IdlDefinitions, ReadsWhatRosidlWrites) {
  Definitions found;
  parse_ros2idl("pkg/msg/A", text, found);
  const std::vector<FieldDefinition>& fields = found.at("pkg/msg/A").fields;
  ASSERT_EQ(fields.size(), 11u);
  EXPECT_EQ(fields[0].type, "std_msgs/msg/Header");
  EXPECT_EQ(fields[2].kind, Kind::u64);
  EXPECT_EQ(fields[3].kind, Kind::f32);
  EXPECT_EQ(fields[3].shape, Shape::sequence);
  EXPECT_EQ(fields[4].kind, Kind::text);
  EXPECT_EQ(fields[4].shape, Shape::sequence);
  EXPECT_EQ(fields[5].kind, Kind::text);
  EXPECT_EQ(fields[6].shape, Shape::array);
  EXPECT_EQ(fields[6].length, 36u);
  EXPECT_EQ(fields[7].type, "pkg/msg/B");
  EXPECT_EQ(fields[7].length, 2u);
  EXPECT_EQ(fields[8].kind, Kind::u32);
  EXPECT_EQ(fields[9].length, 4u);
  EXPECT_EQ(fields[10].kind, Kind::boolean);
  EXPECT_TRUE(found.at("pkg/msg/Empty").fields.empty());
  EXPECT_EQ(found.at("pkg/msg/B").fields.front().kind, Kind::i32);
}

TEST(IdlDefinitions, NamesTheLineOfAMistake) {
  Definitions found;
  EXPECT_THAT(error_of([&] { parse_ros2idl("p/msg/A", "module p {\n  struct A {\n    double x\n  };\n};", found); }),
              testing::HasSubstr("line 4: found '}', expected ';'"));
  EXPECT_THAT(error_of([&] { parse_ros2idl("p/msg/A", "module p {", found); }), testing::HasSubstr("found the end"));
  EXPECT_THAT(error_of([&] { parse_ros2idl("p/msg/A", "module p {};", found); }),
              testing::HasSubstr("does not define p/msg/A"));
}

}  // namespace idl_definitions_test
}  // namespace rhec::logs
