#include "rhec/sim/files/output_folder.hpp"

#include <gtest/gtest.h>
#include <sys/stat.h>

#include <filesystem>
#include <fstream>
#include <iterator>
#include <string>

#include "rhec/sim/files/csv.hpp"
#include "support/error_of.hpp"
#include "support/temporary_folder.hpp"

namespace rhec::sim {
namespace output_folder_test {

namespace fs = std::filesystem;

class OutputFolderTest : public FolderTest {
 protected:
  static void put(const fs::path& file, const std::string& content) { std::ofstream(file) << content; }
  int entries(const fs::path& folder) const {
    return static_cast<int>(std::distance(fs::directory_iterator(folder), fs::directory_iterator()));
  }
  const fs::path root_ = folder_.path();
};

TEST_F(OutputFolderTest, NothingAppearsBeforeCommit) {
  OutputFolder folder(root_ / "deep" / "run");
  folder.write("a.csv", "1,2\n");
  EXPECT_FALSE(fs::exists(root_ / "deep" / "run"));
  folder.commit();
  EXPECT_EQ(read_text(root_ / "deep" / "run" / "a.csv"), "1,2\n");
  EXPECT_EQ(entries(root_ / "deep"), 1) << "nothing is left aside";
  EXPECT_EQ(entries(root_ / "deep" / "run"), 1);
}

TEST_F(OutputFolderTest, WithoutCommitEverythingStays) {
  fs::create_directories(root_ / "run");
  put(root_ / "run" / "a.csv", "old");
  {
    OutputFolder folder(root_ / "run");
    folder.write("a.csv", "new");
    EXPECT_EQ(read_text(root_ / "run" / "a.csv"), "old");
  }
  EXPECT_EQ(read_text(root_ / "run" / "a.csv"), "old");
  EXPECT_EQ(entries(root_ / "run"), 1);
  EXPECT_EQ(entries(root_), 1);
  { OutputFolder folder(root_ / "never"); }
  EXPECT_EQ(entries(root_), 1);
}

TEST_F(OutputFolderTest, ReplacesItsFilesAndKeepsOthers) {
  fs::create_directories(root_ / "run");
  put(root_ / "run" / "a.csv", "old");
  put(root_ / "run" / "notes.txt", "mine");
  OutputFolder folder((root_ / "run" / "").string());
  folder.write("a.csv", "new");
  put(folder.file("b.csv"), "by another writer");
  folder.commit();
  EXPECT_EQ(read_text(root_ / "run" / "a.csv"), "new");
  EXPECT_EQ(read_text(root_ / "run" / "b.csv"), "by another writer");
  EXPECT_EQ(read_text(root_ / "run" / "notes.txt"), "mine");
  EXPECT_THROW(folder.write("late.csv", ""), Error);
}

TEST_F(OutputFolderTest, LeavesDevicesAndPipesWhatTheyAre) {
  const fs::path pipe = root_ / "pipe";
  ASSERT_EQ(mkfifo(pipe.c_str(), 0600), 0);
  put(root_ / "first", "before");
  OutputFolder folder(root_);
  folder.write("first", "after");
  folder.write("pipe", "a page");
  EXPECT_NE(error_of([&] { folder.commit(); }).find("pipe: is a device or a pipe; give the name of a file"),
            std::string::npos);
  EXPECT_TRUE(fs::is_fifo(pipe));
  std::string content;
  std::ifstream(root_ / "first") >> content;
  EXPECT_EQ(content, "before");
}

TEST_F(OutputFolderTest, TwoRunsAtOnceDoNotMix) {
  OutputFolder first(root_ / "run"), second(root_ / "run");
  first.write("a.csv", "first");
  second.write("a.csv", "second");
  first.commit();
  EXPECT_EQ(read_text(root_ / "run" / "a.csv"), "first");
  second.commit();
  EXPECT_EQ(read_text(root_ / "run" / "a.csv"), "second");
  EXPECT_EQ(entries(root_), 1 + 1) << "the empty place aside goes with its owner";
}

TEST_F(OutputFolderTest, RefusesBeforeAnythingIsReplaced) {
  put(root_ / "file", "");
  EXPECT_CONTAINS(error_of([&] { OutputFolder folder(root_ / "file"); }), "is a file");
  EXPECT_CONTAINS(error_of([&] { OutputFolder folder(root_ / "file" / "below"); }), "cannot be created");
  EXPECT_CONTAINS(error_of([&] { OutputFolder folder(""); }), "empty");
  fs::create_directories(root_ / "run" / "b.csv");
  put(root_ / "run" / "a.csv", "old");
  OutputFolder folder(root_ / "run");
  for (const char* name : {"", ".", "..", "../a", "a/b", "/a"}) EXPECT_THROW(folder.file(name), Error) << name;
  folder.write("a.csv", "new");
  folder.write("b.csv", "new");
  EXPECT_CONTAINS(error_of([&] { folder.commit(); }), "in the way");
  EXPECT_EQ(read_text(root_ / "run" / "a.csv"), "old");
  OutputFolder forgetful(root_ / "other");
  forgetful.file("a.csv");
  EXPECT_CONTAINS(error_of([&] { forgetful.commit(); }), "never written");
}

}  // namespace output_folder_test
}  // namespace rhec::sim
