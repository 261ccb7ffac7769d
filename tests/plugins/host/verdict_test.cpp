#include "plugins/host/verdict.hpp"

#include <gtest/gtest.h>

namespace rhec {
namespace verdict_test {

Verdict read_back(const std::string& text) {
  Verdict verdict;
  for (const auto& [key, value] : report_lines(text)) EXPECT_TRUE(take_line(key, value, verdict)) << key;
  return verdict;
}

TEST(Verdict, IsReadAsItIsWritten) {
  Verdict verdict;
  verdict.record.kind = PluginKind::solver;
  verdict.record.name = "a name";
  verdict.record.refusal = "two\nlines, and a \\ back\\nslash";
  verdict.record.capabilities = "much";
  verdict.trial = {PluginTrial::Outcome::needs_options, "lengths: missing"};
  verdict.harmful = true;
  verdict.libraries = {{"/lib/a b, c.so", {1, 2, 3, 4, 5}}, {"/lib/d.so", {6, 7, 8, 9, 10}}};
  const Verdict read = read_back(lines_of(verdict));
  EXPECT_EQ(lines_of(read), lines_of(verdict));
  EXPECT_EQ(read.record.kind, PluginKind::solver);
  EXPECT_EQ(read.record.refusal, verdict.record.refusal);
  EXPECT_EQ(read.trial.outcome, PluginTrial::Outcome::needs_options);
  ASSERT_EQ(read.libraries.size(), 2u);
  EXPECT_EQ(read.libraries[0].path, "/lib/a b, c.so");
  EXPECT_EQ(read.libraries[1].stamp, verdict.libraries[1].stamp);
  EXPECT_TRUE(read.harmful);
}

TEST(Verdict, AnUnknownKindIsNotWritten) {
  Verdict verdict;
  verdict.record.kind = static_cast<PluginKind>(9);
  EXPECT_EQ(read_back(lines_of(verdict)).record.kind, PluginKind{});
}

TEST(Verdict, WrongLinesAreNotTaken) {
  Verdict verdict;
  for (const auto& [key, value] : std::initializer_list<std::pair<const char*, const char*>>{{"colour", "red"},
                                                                                             {"kind", "wheel"},
                                                                                             {"outcome", "fine"},
                                                                                             {"library", "/lib/a.so"},
                                                                                             {"library", "1 2, /a"},
                                                                                             {"harmful", "maybe"}})
    EXPECT_FALSE(take_line(key, value, verdict)) << key;
  EXPECT_EQ(report_lines("one 1\nno_value\ntwo 2\nthree 3 without end").size(), 2u);
}

}  // namespace verdict_test
}  // namespace rhec
