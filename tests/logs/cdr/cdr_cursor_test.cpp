#include "rhec/logs/cdr/cdr_cursor.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <array>

#include "rhec/logs/signals/log.hpp"
#include "support/error_of.hpp"

namespace rhec::logs {
namespace cdr_cursor_test {

template <class... Values>
std::vector<std::byte> bytes(Values... values) {
  return {static_cast<std::byte>(values)...};
}

TEST(CdrCursor, ReadsBothByteOrders) {
  // A byte, a short behind one byte of padding, a text, a double behind padding to 8.
  const auto little =
      bytes(0, 1, 0, 0, 7, 0, 0x34, 0x12, 3, 0, 0, 0, 'a', 'b', 0, 0, 0, 0, 0, 0, 0, 0, 0xF8, 0x3F, 0, 0, 0);
  CdrCursor cursor(little);
  EXPECT_EQ(cursor.number(Kind::u8), 7.0);
  EXPECT_EQ(cursor.number(Kind::i16), 0x1234);
  EXPECT_EQ(cursor.text(), "ab");
  const auto big = bytes(0, 0, 0, 0, 7, 0, 0x12, 0x34, 0, 0, 0, 3, 'a', 'b', 0, 0, 0x3F, 0xF8, 0, 0, 0, 0, 0, 0);
  CdrCursor other(big);
  EXPECT_EQ(other.number(Kind::u8), 7.0);
  EXPECT_EQ(other.number(Kind::i16), 0x1234);
  EXPECT_EQ(other.text(), "ab");
  EXPECT_EQ(other.number(Kind::f32), 1.9375f);
}

TEST(CdrCursor, PlainXcdr2AlignsToFourBytesAtMost) {
  const auto message = bytes(0, 7, 0, 0, 1, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0xF8, 0x3F);
  CdrCursor cursor(message);
  cursor.number(Kind::u8);
  EXPECT_EQ(cursor.number(Kind::f64), 1.5);
}

TEST(CdrCursor, LengthsThatCannotBeAreRefused) {
  const auto message = bytes(0, 1, 0, 0, 0xFF, 0xFF, 0xFF, 0x7F, 1, 2, 3, 4);
  EXPECT_THAT(error_of([&] { CdrCursor(message).length(1); }),
              testing::HasSubstr("a length of 2147483647 with 4 bytes"));
  EXPECT_THAT(error_of([&] { CdrCursor(message).skip_numbers(Kind::f64, std::uint64_t{1} << 61); }),
              testing::HasSubstr("found the end"));
  EXPECT_THAT(error_of([&] { CdrCursor cursor(bytes(0, 1)); }), testing::HasSubstr("2 bytes"));
  EXPECT_THAT(error_of([&] { CdrCursor cursor(bytes(0, 3, 0, 0)); }), testing::HasSubstr("0x0003"));
}

}  // namespace cdr_cursor_test
}  // namespace rhec::logs
