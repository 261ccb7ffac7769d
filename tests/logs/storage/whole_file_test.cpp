// Files that appear when they are complete, or not at all.
#include "rhec/logs/storage/whole_file.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sys/stat.h>

#include <optional>

#include "logs/support/files.hpp"
#include "support/error_of.hpp"

namespace rhec::logs {
namespace whole_file_test {

using testing::HasSubstr;
using WholeFileTest = FilesTest;

TEST_F(WholeFileTest, AppearsWhenItIsComplete) {
  const auto where = path("new/deep/x");
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
  const auto where = write("x", "before");
  { WholeFile(where).write("half"); }
  EXPECT_EQ(content_of(where), "before");
  EXPECT_EQ(std::distance(std::filesystem::directory_iterator(where.parent_path()), {}), 1);
}

TEST_F(WholeFileTest, SaysWhyItCannotBeWritten) {
  EXPECT_THAT(error_of([&] { WholeFile file(path("")); }), HasSubstr("is a folder; give the name of a file"));
  ASSERT_EQ(mkfifo(path("pipe").c_str(), 0600), 0);
  EXPECT_THAT(error_of([&] { WholeFile file(path("pipe")); }),
              HasSubstr("pipe: is a device or a pipe; give the name of a file"));
  write("file", "");
  EXPECT_THAT(error_of([&] { WholeFile file(path("file/below")); }), HasSubstr("file/below: cannot be written: Not a"));
  EXPECT_THAT(error_of([&] {
                WholeFile file(path("late"));
                std::filesystem::create_directories(path("late/taken"));
                file.close();
              }),
              HasSubstr("late: cannot be put in place"));
}

}  // namespace whole_file_test
}  // namespace rhec::logs
