#include "plugins/host/examiner_words.hpp"

#include <gmock/gmock.h>

#include <csignal>

#include "plugins/host/verdict.hpp"
#include "rhec/plugins/host/examination.hpp"

namespace rhec {
namespace examiner_words_test {

using testing::HasSubstr;

Verdict verdict_of_end(const ExaminerEnd& end) {
  return verdict_of("/folder/plugin.so", end, std::chrono::milliseconds(2500), std::size_t{64} << 20);
}
std::string refusal_of_end(const ExaminerEnd& end) { return verdict_of_end(end).record.refusal; }
int exited(int code) { return code << 8; }  // as waitpid tells it

const std::string complete = "name toy\ncomplete yes\nstage end\n";

TEST(ExaminerWords, AGoodExaminationIsTakenAsItIs) {
  const Verdict verdict = verdict_of_end({.report = complete});
  EXPECT_TRUE(verdict.record.accepted());
  EXPECT_EQ(verdict.record.name, "toy");
  EXPECT_EQ(verdict.record.path, "/folder/plugin.so");
  EXPECT_FALSE(verdict.harmful);
}

TEST(ExaminerWords, WhatEndedItIsToldWithTheStage) {
  EXPECT_EQ(refusal_of_end({.report = "stage make\n", .timed_out = true}),
            "it had not returned after 2.5 s while it made an object with its default options");
  EXPECT_THAT(refusal_of_end({.report = "stage options\n", .status = SIGFPE}),
              HasSubstr("SIGFPE) while it was asked for its options"));
  EXPECT_THAT(refusal_of_end({.report = "stage load\n", .status = SIGXCPU}), HasSubstr("after 2.5 s of computing"));
  EXPECT_THAT(refusal_of_end({.report = "stage load\n", .status = exited(0)}), HasSubstr("with exit code 0"));
  EXPECT_THAT(refusal_of_end({.report = complete, .status = exited(3)}),
              HasSubstr("with exit code 3 at the end of the program"));
  EXPECT_THAT(refusal_of_end({.report = "stage load\nmemory exceeded\n"}), HasSubstr("more than the 64 MiB"));
  EXPECT_THAT(refusal_of_end({.report = "", .status = exited(1)}), HasSubstr("before it was loaded"));
  EXPECT_THAT(refusal_of_end({.report = "stage load\n", .status = exited(kExaminationNotTold)}),
              HasSubstr("it closed what its examination reports through"));
  EXPECT_TRUE(verdict_of_end({.report = "stage load\n"}).harmful);
}

TEST(ExaminerWords, TheFirstLineThatIsNotTheLoadersIsTold) {
  EXPECT_THAT(refusal_of_end({.report = "stage load\n",
                              .output = "ERROR: ld.so: x\n\n out of \x1b"
                                        "tea\nmore\n"}),
              HasSubstr("; it wrote ' out of tea'"));
  EXPECT_THAT(refusal_of_end({.report = "stage load\n", .output = std::string(5000, 'y')}).size(), testing::Lt(400u));
}

TEST(ExaminerWords, AReportThatIsNoneIsRefused) {
  EXPECT_THAT(refusal_of_end({.report = "name toy\nnonsense here\ncomplete yes\n"}),
              HasSubstr("it wrote into the report of its examination"));
}

TEST(ExaminerWords, AProcessThatCouldNotBeStartedIsNotThePluginsFault) {
  const Verdict verdict = verdict_of_end({.problem = "no more processes"});
  EXPECT_EQ(verdict.record.refusal, "it could not be examined: no more processes");
  EXPECT_FALSE(verdict.harmful);
}

}  // namespace examiner_words_test
}  // namespace rhec
