// Files that appear when they are complete, or not at all.
#include "rhec/logs/storage/whole_file.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sys/stat.h>

#include <optional>

#include "support/error_of.hpp"
#include "support/temporary_folder.hpp"

namespace rhec::logs {
namespace whole_file_test {

using testing::HasSubstr;
using WholeFileTest = FolderTest;

TEST_F(WholeFileTest, AppearsWhenItIsComplete) {
  const auto where = file("new/deep/x");
  std::optional<WholeFile> file(where);
  file->write("one ");
  file->write("two");
  EXPECT_FALSE(std::filesystem::exists(where));
  file->close();
  file.reset();
  EXPECT_EQ(content_of(where), "one two");
  EXPECT_EQ(std::distance(std::filesystem::directory_iterator(where.parent_path()), {}), 1);
}

TEST_F(WholeFileTest, WithoutCloseWhatWasThereStays) {
  const auto where = put("x", "before");
  { WholeFile(where).write("half"); }
  EXPECT_EQ(content_of(where), "before");
  EXPECT_EQ(std::distance(std::filesystem::directory_iterator(where.parent_path()), {}), 1);
}

TEST_F(WholeFileTest, SaysWhyItCannotBeWritten) {
  EXPECT_THAT(error_of([&] { WholeFile one(file("")); }), HasSubstr("is a folder; give the name of a file"));
  ASSERT_EQ(mkfifo(file("pipe").c_str(), 0600), 0);
  EXPECT_THAT(error_of([&] { WholeFile one(file("pipe")); }),
              HasSubstr("pipe: is a device or a pipe; give the name of a file"));
  put("file", "");
  EXPECT_THAT(error_of([&] { WholeFile one(file("file/below")); }), HasSubstr("file/below: cannot be written: Not a"));
  EXPECT_THAT(error_of([&] {
                WholeFile one(file("late"));
                std::filesystem::create_directories(file("late/taken"));
                one.close();
              }),
              HasSubstr("late: cannot be put in place"));
}

}  // namespace whole_file_test
}  // namespace rhec::logs
