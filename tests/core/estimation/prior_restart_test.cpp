#include "core/estimation/prior_restart.hpp"

#include <gtest/gtest.h>

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>
#include <limits>
#include <vector>

#include "rhec/core/ocp/solver_decorator.hpp"
#include "support/linear_case.hpp"

namespace rhec {
namespace prior_restart_test {

using namespace testing;

/// A solver whose result is what a test says, or its own.
class Scripted final : public SolverDecorator {
 public:
  using SolverDecorator::solve;
  using SolverDecorator::SolverDecorator;
  Report solve(Iterate& iterate, Clock::time_point deadline) noexcept override {
    ++solves;
    start = iterate.state(0)[0];
    Report report = SolverDecorator::solve(iterate, deadline);
    iterate.state(0)[0] += error;
    if (says != Status::solved) report.status = says;
    return report;
  }
  void reset() noexcept override {
    ++resets;
    SolverDecorator::reset();
  }

  Status says = Status::solved;
  double error = 0.0, start = 0.0;
  int solves = 0, resets = 0;
};

/// A window of six intervals whose guess is far off.
class PriorRestartTest : public ::testing::Test {
 protected:
  PriorRestartTest()
      : model_(linear_model<Hovercraft>()),
        problem_(
            model_,
            linear_setup(*model_, 6, ArrivalKind::ekf, {blocking("full_horizon"), blocking("full_horizon")}).problem),
        solver_(gn_rti()),
        restart_(problem_),
        qp_(problem_.capacity()),
        prior_(problem_.capacity()),
        solution_(problem_.capacity()) {
    const auto samples = simulate(*model_, 6, true, 4);
    problem_.set_intervals(6);
    problem_.arrival_mean = initial_mean(*model_);
    problem_.arrival_information = initial_covariance(*model_).inverse();
    for (int i = 0; i <= 6; ++i) {
      std::copy(samples[i].outputs.begin(), samples[i].outputs.end(), problem_.output(i));
      if (i == 6) continue;
      problem_.set_duration(i, samples[i + 1].duration);
      std::copy(samples[i + 1].inputs.begin(), samples[i + 1].inputs.end(), problem_.measured_input(i));
    }
    problem_.finish();
    solver_.setup(problem_);
    std::vector<double> scratch(problem_.scratch_size());
    std::copy_n(problem_.arrival_mean.data(), problem_.arrival_mean.size(), prior_.state(0));
    problem_.simulate(prior_, scratch);
    solution_ = prior_;
    solver_.SolverDecorator::solve(solution_, Clock::time_point::max());
    poor_ = solution_.state(0)[0] + 50.0;
  }

  /// What becomes of a result that is `poor`, with this status.
  bool reconsider(bool poor, Status status) {
    Iterate point = solution_;
    if (poor) point.state(0)[0] = poor_;
    report_ = {};
    report_.status = status;
    report_.iterations = 7;
    const bool solved = restart_.reconsider(problem_, solver_, prior_, qp_, point, report_, Clock::time_point::max());
    found_ = point.state(0)[0];
    return solved;
  }

  std::shared_ptr<const Model> model_;
  RheProblem problem_;
  Scripted solver_;
  PriorRestart restart_;
  StageQp qp_;
  Iterate prior_, solution_;
  Report report_;
  double poor_ = 0.0, found_ = 0.0;
};

TEST_F(PriorRestartTest, KeepsWhatIsBetterThanThePrior) {
  EXPECT_TRUE(reconsider(false, Status::iteration_limit));
  EXPECT_EQ(found_, solution_.state(0)[0]);
  EXPECT_EQ(solver_.solves, 0);
  EXPECT_EQ(report_.iterations, 7);
}

TEST_F(PriorRestartTest, SolvesAgainFromThePrior) {
  for (const Status status : {Status::iteration_limit, Status::stalled, Status::bad_input}) {
    solver_.resets = 0;
    EXPECT_TRUE(reconsider(true, status));
    EXPECT_EQ(solver_.start, prior_.state(0)[0]);
    EXPECT_NEAR(found_, solution_.state(0)[0], 1e-9);
    EXPECT_EQ(report_.status, Status::solved);
    EXPECT_GT(report_.iterations, 7);
    EXPECT_EQ(solver_.resets, status == Status::bad_input ? 1 : 0);
  }
}

TEST_F(PriorRestartTest, TakesThePriorWhereNothingIsBetter) {
  solver_.error = 40.0;
  EXPECT_FALSE(reconsider(true, Status::iteration_limit));
  EXPECT_EQ(found_, prior_.state(0)[0]);
  EXPECT_EQ(report_.status, Status::iteration_limit);
  std::vector<double> scratch(problem_.scratch_size());
  EXPECT_EQ(report_.objective, problem_.evaluate(prior_, nullptr, scratch));
  EXPECT_GT(report_.kkt.largest(), 0.0);
  // A failure stays one.
  solver_.says = Status::bad_input;
  EXPECT_FALSE(reconsider(true, Status::bad_input));
  EXPECT_EQ(report_.status, Status::bad_input);
  EXPECT_EQ(found_, prior_.state(0)[0]);
}

/// Seven nodes of three outputs, some of which are missing: chi-square with as many degrees of freedom.
TEST_F(PriorRestartTest, IsConvincedByWhatExplainsTheMeasurements) {
  Report report;
  report.status = Status::step_taken;
  int measured = 0;
  for (int i = 0; i <= 6; ++i)
    for (int j = 0; j < 3; ++j) measured += !std::isnan(problem_.output(i)[j]);
  ASSERT_GT(measured, 10);
  report.objective = measured;
  EXPECT_TRUE(PriorRestart::is_convincing(problem_, report));
  report.objective = measured + 3.1 * std::sqrt(2.0 * measured);
  EXPECT_FALSE(PriorRestart::is_convincing(problem_, report));
  std::fill_n(problem_.output(2), 3, std::numeric_limits<double>::quiet_NaN());
  report.objective = measured + 2.9 * std::sqrt(2.0 * measured);
  EXPECT_FALSE(PriorRestart::is_convincing(problem_, report)) << "fewer measurements";
  report.objective = 1.0;
  EXPECT_TRUE(PriorRestart::is_convincing(problem_, report));
  report.kkt.defect = 0.1;
  EXPECT_FALSE(PriorRestart::is_convincing(problem_, report)) << "an objective that defects have made";
  report.kkt.defect = 0.0;
  report.status = Status::bad_input;
  EXPECT_FALSE(PriorRestart::is_convincing(problem_, report));
}

}  // namespace prior_restart_test
}  // namespace rhec
