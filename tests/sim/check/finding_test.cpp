#include "rhec/sim/check/finding.hpp"

#include <gtest/gtest.h>

namespace rhec::sim {
namespace finding_test {

std::vector<Finding> with(std::vector<Verdict> verdicts) {
  std::vector<Finding> findings;
  for (const Verdict verdict : verdicts) findings.emplace_back().verdict = verdict;
  return findings;
}

TEST(Findings, AreAsBadAsTheWorst) {
  EXPECT_EQ(verdict_of({}), Verdict::pass);
  EXPECT_EQ(verdict_of(with({Verdict::pass, Verdict::skip})), Verdict::pass);
  EXPECT_EQ(verdict_of(with({Verdict::warn, Verdict::pass})), Verdict::warn);
  EXPECT_EQ(verdict_of(with({Verdict::warn, Verdict::fail, Verdict::pass})), Verdict::fail);
  EXPECT_EQ(count_of(with({Verdict::warn, Verdict::fail, Verdict::warn}), Verdict::warn), 2);
}

TEST(Verdicts, HaveWords) {
  EXPECT_EQ(word_of(Verdict::pass), "pass");
  EXPECT_EQ(word_of(Verdict::skip), "skip");
  EXPECT_EQ(word_of(Verdict::warn), "warn");
  EXPECT_EQ(word_of(Verdict::fail), "fail");
}

}  // namespace finding_test
}  // namespace rhec::sim
