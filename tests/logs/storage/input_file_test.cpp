#include "rhec/logs/storage/input_file.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sys/stat.h>

#include "support/error_of.hpp"
#include "support/temporary_folder.hpp"

namespace rhec::logs {
namespace input_file_test {

using InputFileTest = FolderTest;

TEST_F(InputFileTest, ReadsFromAnyPlaceAndNotBeyondTheEnd) {
  InputFile file(put("x", "0123456789"));
  std::vector<std::byte> bytes(4);
  ASSERT_TRUE(file.read(bytes));
  EXPECT_TRUE(begins_with(bytes, "0123"));
  file.seek(8);
  EXPECT_FALSE(file.read(bytes));
  EXPECT_EQ(file.place(), 8);
  EXPECT_EQ(file.left(), 2);
  file.seek(5);
  ASSERT_TRUE(file.read(bytes));
  EXPECT_TRUE(begins_with(bytes, "5678"));
}

TEST_F(InputFileTest, SaysWhyAFileCannotBeRead) {
  EXPECT_THAT(error_of([&] { InputFile one(file("gone")); }), testing::HasSubstr("No such file"));
  EXPECT_THAT(error_of([&] { InputFile one(file("")); }), testing::HasSubstr("folder"));
}

// The metadata of a bag may name anything.
TEST_F(InputFileTest, WaitsForNoPipeAndReadsNoDevice) {
  const std::filesystem::path pipe = file("pipe");
  ASSERT_EQ(mkfifo(pipe.c_str(), S_IRUSR | S_IWUSR), 0);
  for (const std::filesystem::path& file : {pipe, std::filesystem::path("/dev/zero")})
    EXPECT_THAT(error_of([&] { InputFile input(file); }),
                testing::HasSubstr(file.string() + ": is a device or a pipe"));
}

TEST_F(InputFileTest, NumbersAndTextsComeBack) {
  ByteWriter writer;
  writer.u8(1);
  writer.u16(0x2345);
  writer.u32(0x6789ABCD);
  writer.u64(0x123456789ABCDEF0);
  writer.text("text");
  ByteReader reader(writer.bytes());
  EXPECT_EQ(reader.u8(), 1);
  EXPECT_EQ(reader.u16(), 0x2345);
  EXPECT_EQ(reader.u32(), 0x6789ABCDu);
  EXPECT_EQ(reader.u64(), 0x123456789ABCDEF0u);
  EXPECT_EQ(reader.text(), "text");
  EXPECT_TRUE(reader.ok());
  EXPECT_EQ(reader.u8(), 0);
  EXPECT_FALSE(reader.ok());
}

TEST_F(InputFileTest, ALengthBeyondTheEndIsNoText) {
  ByteWriter writer;
  writer.u32(1000);
  ByteReader reader(writer.bytes());
  EXPECT_EQ(reader.text(), "");
  EXPECT_FALSE(reader.ok());
}

}  // namespace input_file_test
}  // namespace rhec::logs
