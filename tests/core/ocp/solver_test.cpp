#include "rhec/core/ocp/solver.hpp"

#include <gtest/gtest.h>

#include <set>
#include <string>
#include <vector>

#include "support/cart.hpp"

namespace rhec {
namespace solver_test {

using testing::cart_control;
using testing::cart_estimation;
using testing::scattered_point;

constexpr Status all[] = {Status::solved,     Status::step_taken, Status::iteration_limit, Status::deadline,
                          Status::infeasible, Status::stalled,    Status::bad_input};

TEST(Status, HasANameAndAdvice) {
  std::set<std::string> names, advice;
  for (const Status status : all) {
    EXPECT_NE(name_of(status), std::string("unknown"));
    EXPECT_GT(std::string(advice_for(status)).size(), 5U) << name_of(status);
    names.insert(name_of(status));
    advice.insert(advice_for(status));
  }
  EXPECT_EQ(names.size(), std::size(all));
  EXPECT_EQ(advice.size(), std::size(all));
}

TEST(Status, IsUsableUnlessThereIsNoPoint) {
  for (const Status status : all)
    EXPECT_EQ(is_usable(status), status != Status::infeasible && status != Status::bad_input) << name_of(status);
  EXPECT_FALSE(is_usable(Report().status)) << "what nobody has filled in is no answer";
}

TEST(Judgement, IsTheSameThroughAWindowOfTheHorizon) {
  const auto control = cart_control(9);
  const auto estimation = cart_estimation(9);
  for (const Ocp* ocp : {static_cast<const Ocp*>(control.get()), static_cast<const Ocp*>(estimation.get())}) {
    Iterate point = scattered_point(*ocp);
    point.control(3)[0] = 1.75;  // beyond its bound, if it has one
    point.state_bound(2)[1] = 0.5;
    std::vector<double> scratch(ocp->scratch_size());
    StageQp whole(ocp->capacity());
    Report expected;
    assess(*ocp, point, whole, scratch, expected);
    EXPECT_DOUBLE_EQ(expected.objective, ocp->evaluate(point, nullptr, scratch));
    EXPECT_GT(expected.kkt.stationarity, 0.01);
    EXPECT_GT(expected.kkt.defect, 0.01);
    EXPECT_GT(expected.kkt.complementarity, 1e-3);
    const KktResidual alone = kkt_residual(*ocp, point, whole, scratch);
    EXPECT_EQ(alone.largest(), expected.kkt.largest());
    for (const int stages : {2, 3, 7}) {
      StageQp window(ocp->capacity(), stages);
      Report report;
      assess(*ocp, point, window, scratch, report);
      EXPECT_NEAR(report.objective, expected.objective, 1e-12 * expected.objective) << stages;
      EXPECT_NEAR(report.kkt.stationarity, expected.kkt.stationarity, 1e-13) << stages;
      EXPECT_NEAR(report.kkt.defect, expected.kkt.defect, 1e-13) << stages;
      EXPECT_NEAR(report.kkt.bound_violation, expected.kkt.bound_violation, 1e-13) << stages;
      EXPECT_NEAR(report.kkt.complementarity, expected.kkt.complementarity, 1e-13) << stages;
    }
  }
}

/// A solver that implements only the required functions.
class Least final : public Solver {
 public:
  std::string why_not(const Ocp&) const override { return {}; }
  void setup(const Ocp&) override {}
  void prepare(const Iterate&) noexcept override {}
  Report solve(Iterate&, Clock::time_point deadline) noexcept override {
    Report report;
    report.status = deadline == Clock::time_point::max() ? Status::solved : Status::deadline;
    return report;
  }
  using Solver::solve;
  void reset() noexcept override {}
};

TEST(Solver, SolvesWithoutADeadlineAndAnswersAllAtOnceUnlessItSaysOtherwise) {
  Least solver;
  Iterate point(Capacity{1, 1, 1});
  EXPECT_EQ(solver.solve(point).status, Status::solved);
  Report report = solver.feedback(point, Clock::time_point::min());
  EXPECT_EQ(report.status, Status::deadline);
  solver.finish(point, report);
  EXPECT_EQ(report.status, Status::deadline);
  std::vector<double> blocks(2, 7.0);
  EXPECT_FALSE(solver.covariances(point, {0, 1}, blocks));
  EXPECT_EQ(blocks[0], 7.0);
}

}  // namespace solver_test
}  // namespace rhec
