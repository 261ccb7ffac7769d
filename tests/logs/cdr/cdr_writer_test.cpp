#include "rhec/logs/cdr/cdr_writer.hpp"

#include <gtest/gtest.h>

#include "rhec/logs/cdr/cdr_cursor.hpp"

namespace rhec::logs {
namespace cdr_writer_test {

TEST(CdrWriter, ItsNumbersAndTextsAreRead) {
  CdrWriter writer;
  writer.flag(true);
  writer.f64(2.5);
  writer.text("frame");
  writer.u16(7);
  writer.f32(0.5f);
  writer.i8(-3);
  CdrCursor cursor(writer.bytes());
  EXPECT_EQ(cursor.number(Kind::boolean), 1.0);
  EXPECT_EQ(cursor.number(Kind::f64), 2.5);
  EXPECT_EQ(cursor.text(), "frame");
  EXPECT_EQ(cursor.number(Kind::u16), 7.0);
  EXPECT_EQ(cursor.number(Kind::f32), 0.5);
  EXPECT_EQ(cursor.number(Kind::i8), -3.0);
  EXPECT_EQ(cursor.left(), 0u);
}

TEST(CdrWriter, StampsBefore1970HaveNanosecondsThatArePositive) {
  CdrWriter writer;
  writer.stamp(-1);
  CdrCursor cursor(writer.bytes());
  EXPECT_EQ(cursor.number(Kind::i32), -1.0);
  EXPECT_EQ(cursor.number(Kind::u32), 999999999.0);
}

}  // namespace cdr_writer_test
}  // namespace rhec::logs
