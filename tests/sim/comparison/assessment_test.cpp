#include "sim/comparison/assessment.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <memory>
#include <numbers>
#include <vector>

#include "rhec/core/horizon/rhc_problem.hpp"
#include "rhec/core/horizon/rhe_problem.hpp"
#include "rhec/core/qp/kkt.hpp"
#include "rhec/plugins/host/host.hpp"
#include "sim/support/same_point.hpp"
#include "support/random_problem.hpp"

namespace rhec::sim {
namespace assessment_test {

using rhec::testing::RandomProblem;

class AssessorTest : public ::testing::Test {
 protected:
  AssessorTest() : random_(Host().make_model("bicycle_slip"), 5) {}

  /// A problem, and the point that a solver finds for it.
  void solve(std::unique_ptr<HorizonProblem> problem) {
    problem_ = std::move(problem);
    Settings converging;
    converging.set("mode", Settings::scalar("converge"));
    const auto solver = Host().make_solver("gn_rti", converging);
    solver->setup(*problem_);
    point_ = RandomProblem::cold_start(*problem_);
    solver->prepare(point_);
    ASSERT_EQ(solver->solve(point_).status, Status::solved);
    assessor_.begin(*problem_);
  }
  const ModelDescription& about() const { return problem_->model().description(); }

  RandomProblem random_;
  std::unique_ptr<HorizonProblem> problem_;
  Iterate point_;
  Assessor assessor_;
};

TEST_F(AssessorTest, TheResidualIsThatOfTheCore) {
  solve(random_.rhe({}));
  Answer answer;
  EXPECT_LT(assessor_.kkt_of(point_, answer), 1e-7);
  EXPECT_LT(answer.defect, 1e-8);
  point_.state(3)[0] += 0.5;
  StageQp qp(problem_->capacity());
  std::vector<double> scratch(problem_->scratch_size());
  EXPECT_EQ(assessor_.kkt_of(point_, answer), kkt_residual(*problem_, point_, qp, scratch).largest());
  EXPECT_NEAR(answer.defect, 0.5, 1e-6);
}

TEST_F(AssessorTest, APlanIsAssessedByWhatItsInputsDo) {
  solve(random_.rhc({}));
  Iterate moved = point_;
  for (int i = 1; i <= problem_->intervals(); ++i) moved.state(i)[0] += 1.0;
  assessor_.make_assessed(moved);
  Iterate straight = point_;
  assessor_.make_assessed(straight);
  expect_same_point(*problem_, straight, moved);
  EXPECT_LT(assessor_.verdict_on(moved, point_).defect, 1e-12);
}

TEST_F(AssessorTest, AnEstimateIsAssessedAsItIs) {
  solve(random_.rhe({}));
  point_.state(3)[0] += 0.5;
  Iterate assessed = point_;
  assessor_.make_assessed(assessed);
  expect_same_point(*problem_, point_, assessed);
}

TEST_F(AssessorTest, DefectsAreChargedAtTheirMultipliers) {
  solve(random_.rhe({}));
  std::vector<double> scratch(problem_->scratch_size());
  const Assessor::Verdict honest = assessor_.verdict_on(point_, point_);
  EXPECT_TRUE(honest.is_feasible());
  EXPECT_EQ(honest.objective, problem_->evaluate(point_, nullptr, scratch));
  EXPECT_NEAR(honest.charged, honest.objective, 1e-6 * honest.objective);

  Iterate prices = point_, last = point_;
  const int N = problem_->intervals();
  for (int i = 0; i <= N; ++i)
    for (int j = 0; j < problem_->state_count(i); ++j) prices.costate(i)[j] = prices.state_bound(i)[j] = 0.0;
  prices.costate(N)[0] = -30.0;
  last.state(N)[0] += 0.25;
  const Assessor::Verdict verdict = assessor_.verdict_on(last, prices);
  EXPECT_NEAR(verdict.defect, 0.25, 1e-8);
  EXPECT_FALSE(verdict.is_feasible());
  EXPECT_NEAR(verdict.charged - verdict.objective, 30.0 * 0.25, 1e-6);
}

TEST_F(AssessorTest, ViolatedBoundsAreChargedAtTheirMultipliers) {
  solve(random_.rhc({}));
  const int N = problem_->intervals();
  int bounded = -1;
  for (int j = 0; j < problem_->control_count(0); ++j)
    if (std::isfinite(problem_->control_upper(0)[j])) bounded = j;
  ASSERT_GE(bounded, 0);
  Iterate prices = point_, beyond = point_;
  for (int i = 0; i <= N; ++i) {
    for (int j = 0; j < problem_->state_count(i); ++j) prices.costate(i)[j] = prices.state_bound(i)[j] = 0.0;
    for (int j = 0; i < N && j < problem_->control_count(i); ++j) prices.control_bound(i)[j] = 0.0;
  }
  prices.control_bound(0)[bounded] = 20.0;
  beyond.control(0)[bounded] = problem_->control_upper(0)[bounded] + 0.125;
  const Assessor::Verdict verdict = assessor_.verdict_on(beyond, prices);
  EXPECT_NEAR(verdict.violation, 0.125, 1e-12);
  EXPECT_NEAR(verdict.charged - verdict.objective, 20.0 * 0.125, 1e-9);
}

TEST_F(AssessorTest, DistanceIsInScalesAndAcrossWholeTurns) {
  solve(random_.rhe({}));
  EXPECT_EQ(assessor_.distance(point_, point_), 0.0);
  Iterate other = point_;
  other.state(2)[0] += 0.5 * about().states[0].scale;
  EXPECT_NEAR(assessor_.distance(point_, other), 0.5, 1e-12);
  Iterate turned = point_;
  ASSERT_TRUE(about().states[2].is_angle);
  turned.state(2)[2] += 2.0 * std::numbers::pi;
  EXPECT_NEAR(assessor_.distance(point_, turned), 0.0, 1e-12);
}

TEST_F(AssessorTest, OfAWindowWithoutIntervalsParametersCount) {
  RandomProblem::RheSpec spec;
  spec.intervals = 0;
  const auto problem = random_.rhe(spec);
  assessor_.begin(*problem);
  const Iterate one(problem->capacity());
  Iterate other = one;
  const auto& description = problem->model().description();
  other.state(0)[description.states.size() + 1] += 0.5 * description.parameters[1].scale;
  EXPECT_NEAR(assessor_.distance(one, other), 0.5, 1e-12);
}

}  // namespace assessment_test
}  // namespace rhec::sim
