#include "plugins/host/examine.hpp"

#include <gtest/gtest.h>

#include <fstream>

#include "plugins/host/examiner_process.hpp"
#include "plugins/host/fixtures.hpp"
#include "plugins/host/verdict_cache.hpp"

namespace rhec {
namespace examine_test {

class Examine : public testing::Test {
 protected:
  std::vector<Verdict> examined(bool anew = false) const {
    return examine_apart({plugin_}, {.apart = true, .anew = anew, .verdicts = verdicts_.path()}, EXAMINER);
  }

  TemporaryFolder folder_, verdicts_;
  fs::path plugin_ = folder_.path() / "plugin.so";
};

TEST_F(Examine, AVerdictThatWasKeptIsTakenUnlessItIsAskedForAnew) {
  fs::copy_file(fixture("good") / "toy.so", plugin_);
  EXPECT_EQ(examined()[0].record.name, "toy");
  Verdict other = examined()[0];
  other.record.name = "as it was kept";
  VerdictCache(verdicts_.path()).keep(other, *stamp_of(plugin_));
  EXPECT_EQ(examined()[0].record.name, "as it was kept");
  EXPECT_EQ(examined(true)[0].record.name, "toy");
  EXPECT_EQ(examined()[0].record.name, "toy") << "the new one was kept";
}

TEST_F(Examine, WhatTheLoaderRefusesIsNotKept) {
  fs::copy_file(fixture("missing_dependency") / "bad.so", plugin_);
  EXPECT_FALSE(examined()[0].record.accepted());
  EXPECT_TRUE(fs::is_empty(verdicts_.path()));
}

TEST_F(Examine, WhatDoesHarmIsKept) {
  plugin_ = folder_.path() / "constructor_crashes.so";
  fs::copy_file(fixture("harmful") / "harmful.so", plugin_);
  const Verdict verdict = examined()[0];
  EXPECT_TRUE(verdict.harmful);
  const auto kept = VerdictCache(verdicts_.path()).find(plugin_);
  ASSERT_TRUE(kept);
  EXPECT_EQ(lines_of(*kept), lines_of(verdict));
}

TEST_F(Examine, AFileThatIsNoLibraryStartsNoProcess) {
  std::ofstream(plugin_) << "GROUP ( libm.so.6 )\n";
  EXPECT_NE(examined()[0].record.refusal, "");
  EXPECT_TRUE(fs::is_empty(verdicts_.path()));
}

TEST_F(Examine, AnExaminerThatIsNotThereIsTold) {
  const ExaminerEnd end = run_examiner(folder_.path() / "gone", plugin_, std::chrono::seconds(1), 1 << 20);
  EXPECT_NE(end.problem.find("cannot be started: No such file or directory"), std::string::npos) << end.problem;
}

}  // namespace examine_test
}  // namespace rhec
