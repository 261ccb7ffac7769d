#include "core/estimation/node_log.hpp"

#include <gmock/gmock.h>

#include <cmath>

#include "support/linear_case.hpp"

namespace rhec {
namespace node_log_test {

using ::testing::ElementsAre;
using testing::linear_model;
using testing::linear_setup;
using testing::nan;

TEST(FillGaps, CopiesTheRowBeforeOrElseTheRowBehind) {
  std::vector<double> rows{nan, 1.0, 2.0, 3.0, nan, nan, 4.0, INFINITY, 5.0, 6.0};
  fill_gaps(rows, 2);
  EXPECT_THAT(rows, ElementsAre(2.0, 3.0, 2.0, 3.0, 2.0, 3.0, 2.0, 3.0, 5.0, 6.0));
  std::vector<double> nothing;
  fill_gaps(nothing, 0);
  EXPECT_TRUE(nothing.empty());
}

TEST(FillColumns, FillsEachOfThem) {
  std::vector<double> rows{nan, 1.0, nan, 2.0, nan, nan, nan, nan, nan, 3.0, 4.0, nan};
  fill_columns(rows, 3);
  EXPECT_THAT(rows, ElementsAre(2.0, 1.0, 0.0, 2.0, 1.0, 0.0, 2.0, 1.0, 0.0, 3.0, 4.0, 0.0));
}

TEST(FillData, MeasuresFurtherInputsAsZero) {
  const auto model = linear_model<testing::Hovercraft>();  // two inputs, of which the log has one
  RheProblem problem(model, linear_setup(*model, 2, ArrivalKind::ekf, {}).problem);
  problem.set_intervals(2);
  NodeLog log;
  log.durations = {0.2, 0.3};
  log.inputs = {5.0, nan};
  log.outputs = {1.0, 2.0, 3.0, 4.0, nan, 6.0, 7.0, 8.0, 9.0};
  fill_data(log, 1, problem);
  EXPECT_EQ(problem.duration(1), 0.3);
  EXPECT_EQ(problem.measured_input(0)[0], 5.0);
  EXPECT_TRUE(std::isnan(problem.measured_input(1)[0]));
  EXPECT_EQ(problem.measured_input(0)[1], 0.0);
  EXPECT_EQ(problem.measured_input(1)[1], 0.0);
  EXPECT_EQ(problem.output(2)[2], 9.0);
  EXPECT_TRUE(std::isnan(problem.output(1)[1]));
}

}  // namespace node_log_test
}  // namespace rhec
