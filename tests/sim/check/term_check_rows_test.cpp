// What a term says of itself and writes for nodes: one fault each.
#include <gmock/gmock.h>

#include <algorithm>
#include <atomic>
#include <limits>
#include <memory>

#include "sim/support/written_term.hpp"

namespace rhec::sim {
namespace term_check_rows_test {

using testing::AllOf;
using testing::HasSubstr;

const auto& one_limit = [](TermWriter& writer) { writer.limit(writer.position_x() - writer.data("edge"), {}, "edge"); };

/// The only finding of the rows of a term with one limit and one number of data.
Finding of_rows(const WrittenTerm::WriteData& write_data) {
  const TermCheck found = check(written(one_limit, write_data));
  const std::vector<Finding> rows = findings_of(found, "rows");
  EXPECT_EQ(rows.size(), 1U);
  if (rows.front().verdict == Verdict::fail) {
    EXPECT_EQ(findings_of(found, "numbers").front().verdict, Verdict::skip);
  }
  return rows.front();
}

TEST(RowsOfATerm, AreCounted) {
  const Finding found = findings_of(check(right_term()), "rows").front();
  EXPECT_EQ(found.verdict, Verdict::pass);
  EXPECT_THAT(found.found, HasSubstr("limits: 2, costs: 2, data: 2"));
}

TEST(RowsOfATerm, HaveLowerBoundsBelowUpperOnes) {
  const Finding found = of_rows([](const TermPlace& place, double* data, double* lower, double* upper) {
    *data = 0.0;
    *lower = place.arc_length > 50.0 ? 2.0 : 0.0;
    *upper = 1.0;
  });
  EXPECT_EQ(found.verdict, Verdict::fail);
  EXPECT_EQ(found.where, "limit 'edge'");
  EXPECT_THAT(found.found, AllOf(HasSubstr("lower is 2, above upper, which is 1"), HasSubstr("arc_length is")));
}

TEST(RowsOfATerm, MayCrossWhereThePathLeavesNoRoom) {
  const Finding found = of_rows([](const TermPlace& place, double* data, double* lower, double* upper) {
    *data = 0.0;
    *lower = -1.0;
    *upper = std::min(place.left, 3.0) - 2.0;
  });
  EXPECT_EQ(found.verdict, Verdict::warn);
  EXPECT_THAT(found.found, HasSubstr("where the path has room of "));
}

TEST(RowsOfATerm, AreAllWritten) {
  EXPECT_THAT(of_rows([](const TermPlace&, double*, double* lower, double* upper) { *lower = *upper = 0.0; }).where,
              "data 'edge'");
  EXPECT_THAT(of_rows([](const TermPlace&, double* data, double* lower, double*) { *data = *lower = 0.0; }).found,
              HasSubstr("NaN or was not written"));
  EXPECT_THAT(of_rows([](const TermPlace& place, double* data, double* lower, double* upper) {
                *data = place.left;  // infinite where the path does not say it
                *lower = *upper = 0.0;
              }).where,
              "data 'edge'");
}

TEST(RowsOfATerm, AreNoMoreThanAskedFor) {
  const Finding found = of_rows([](const TermPlace&, double* data, double* lower, double* upper) {
    data[0] = data[1] = 0.0;
    *lower = *upper = 0.0;
  });
  EXPECT_EQ(found.where, "write_data");
  EXPECT_THAT(found.found, HasSubstr("behind the end"));
}

TEST(RowsOfATerm, AreTheSameEachTime) {
  const auto calls = std::make_shared<std::atomic<int>>(0);
  const Finding found = of_rows([calls](const TermPlace&, double* data, double* lower, double* upper) {
    *data = ++*calls;
    *lower = *upper = 0.0;
  });
  EXPECT_THAT(found.found, HasSubstr("other numbers for the same place"));
}

TEST(RowsOfATerm, HaveBoundsThatAreSome) {
  constexpr double inf = std::numeric_limits<double>::infinity();
  const Finding turned_off = of_rows([](const TermPlace&, double* data, double* lower, double* upper) {
    *data = 0.0;
    *lower = -inf;
    *upper = inf;
  });
  EXPECT_EQ(turned_off.verdict, Verdict::warn);
  EXPECT_THAT(turned_off.found, HasSubstr("both of its bounds are infinite"));
  const Finding above_all = of_rows([](const TermPlace&, double* data, double* lower, double* upper) {
    *data = 0.0;
    *lower = *upper = inf;
  });
  EXPECT_EQ(above_all.verdict, Verdict::fail);
  EXPECT_THAT(above_all.found, HasSubstr("lower is infinite"));
}

TEST(RowsOfATerm, MayBeNone) {
  const TermCheck found = check(written([](TermWriter&) {}, [](const TermPlace&, double*, double*, double*) {}));
  EXPECT_EQ(findings_of(found, "rows").front().verdict, Verdict::warn);
  EXPECT_EQ(findings_of(found, "derivatives").front().verdict, Verdict::skip);
  EXPECT_TRUE(found.vehicles.empty());
}

TEST(DescriptionOfATerm, HasUnitsAndMeanings) {
  EXPECT_EQ(findings_of(check(right_term()), "description").front().verdict, Verdict::pass);
  TermDescription bare = right_description();
  bare.meaning.clear();
  bare.options.front().meaning = "speed over ground";
  bare.options.push_back({"way", "choice", "left", "", ""});
  const std::vector<Finding> found = findings_of(check(right_term(), bare), "description");
  ASSERT_EQ(found.size(), 3U);
  for (const Finding& finding : found) EXPECT_EQ(finding.verdict, Verdict::warn);
  EXPECT_THAT(found[0].found, HasSubstr("does not say what it does"));
  EXPECT_EQ(found[1].where, "option way");
  EXPECT_EQ(found[2].where, "option most");
  EXPECT_THAT(found[2].found, HasSubstr("no unit"));
}

TEST(DescriptionOfATerm, HasANameForEachRow) {
  const auto write = [](TermWriter& writer) {
    writer.residual(writer.position_x(), {}, "aside");
    writer.residual(writer.position_y(), {}, "aside");
    writer.residual(writer.heading(), {}, "");
  };
  const std::vector<Finding> found =
      findings_of(check(written(write, [](const TermPlace&, double*, double*, double*) {})), "description");
  ASSERT_EQ(found.size(), 2U);
  for (const Finding& finding : found) EXPECT_EQ(finding.verdict, Verdict::fail);
  EXPECT_THAT(found[0].found, HasSubstr("no name"));
  EXPECT_EQ(found[1].where, "'aside'");
}

}  // namespace term_check_rows_test
}  // namespace rhec::sim
