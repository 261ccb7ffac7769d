// conformance_test                    forgets the verdicts of earlier runs, runs all tests and prints the table
// conformance_test --one-of-many ...  runs tests and keeps their verdicts, beside those of other processes
// conformance_test --forget           forgets the verdicts of earlier runs
// conformance_test --table            compares and prints the verdicts that are kept
//
// RHEC_CONFORMANCE_PROBLEMS=50 makes at least fifty problems of every family. RHEC_CONFORMANCE_FOLDER says where
// verdicts are kept, for runs that must not meet.

#include <gtest/gtest.h>

#include <string>

#include "verdicts.hpp"

int main(int count, char** words) {
  using namespace rhec::conformance;
  testing::InitGoogleTest(&count, words);
  const std::string mode = count > 1 ? words[1] : "";
  if (mode == "--table") return report_verdicts() > 0 ? 1 : 0;
  if (mode == "--forget" || mode.empty()) {
    if (!testing::GTEST_FLAG(list_tests)) forget_verdicts();
    if (!mode.empty()) return 0;
  }
  const int failed = RUN_ALL_TESTS();
  if (!mode.empty() || testing::GTEST_FLAG(list_tests)) return failed;
  return report_verdicts() > 0 ? 1 : failed;
}
