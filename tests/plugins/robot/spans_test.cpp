#include "rhec/plugins/robot/spans.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "plugins/robot/robots.hpp"
#include "rhec/plugins/robot/blocking_section.hpp"
#include "rhec/plugins/robot/estimator_section.hpp"
#include "support/error_of.hpp"

namespace rhec {
namespace spans_test {

using testing::AllOf;
using testing::HasSubstr;

std::string intervals(const std::string& length, double step = 0.2) {
  return span_in_intervals(*settings("{horizon: " + length + "}").find("horizon"), step).text();
}

TEST(Spans, ATimeIsAsManyIntervalsAsCoverIt) {
  EXPECT_EQ(intervals("15"), "15");
  EXPECT_EQ(intervals("3 s"), "15") << "a multiple of the step, but for rounding";
  EXPECT_EQ(intervals("3s"), "15");
  EXPECT_EQ(intervals("3.01 s"), "16");
  EXPECT_EQ(intervals("0.1 s"), "1");
  EXPECT_EQ(intervals("0 s"), "0");
  EXPECT_EQ(intervals("1e1 s", 0.05), "200");
  EXPECT_EQ(intervals("full_horizon"), "full_horizon");
  EXPECT_EQ(intervals("infinite"), "infinite");
}

TEST(Spans, AnotherUnitIsRefused) {
  for (const char* wrong : {"3 min", "300 ms", "3 m", "3 s s", "15 intervals"})
    EXPECT_THAT(error_of([&] { intervals(wrong); }), AllOf(HasSubstr("horizon"), HasSubstr(wrong), HasSubstr("'3 s'")))
        << wrong;
  for (const char* wrong : {"-1 s", "1e9 s"})
    EXPECT_THAT(error_of([&] { intervals(wrong); }), AllOf(HasSubstr(wrong), HasSubstr("a time from 0 s to 200000 s")))
        << wrong;
}

TEST(Spans, HoldForHorizonsAndBlocks) {
  const auto context = context_with("");
  const EstimatorSection estimator(context, BlockingSection(context, {}), settings("{horizon: 3 s}"));
  EXPECT_EQ(estimator.options().horizon, 15);
  const BlockingSection blocks(context, settings("{kappa: {name: structured, size: 1 s, overlap: 0.4 s}, mu: {name: "
                                                 "pattern, lengths: [0.4 s, 1], anchor: time}}"));
  std::vector<std::uint8_t> begins(12);
  const auto made = blocks.make_for(12, "estimator.horizon");
  made[0]->starts({100, 12}, begins.data());
  EXPECT_THAT(begins, testing::ElementsAre(1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0));
  made[1]->starts({0, 12}, begins.data());
  EXPECT_THAT(begins, testing::ElementsAre(1, 0, 1, 1, 0, 1, 1, 0, 1, 1, 0, 1));
  EXPECT_THAT(error_of([&] { BlockingSection(context, settings("{kappa: {name: structured, size: 1 h}}")); }),
              AllOf(HasSubstr("kappa.size"), HasSubstr("1 h")));
}

}  // namespace spans_test
}  // namespace rhec
