// Problems on which a line search alone does not get anywhere: linearised limits that contradict each other, Hessians
// that are not convex, more active limits than the dual method once had room for. Their verdicts are known from other
// solvers.
#include <gtest/gtest.h>

#include <string>
#include <vector>

#include "conformance/families.hpp"
#include "conformance/found.hpp"
#include "rhec/core/ocp/solver.hpp"
#include "rhec/core/qp/kkt.hpp"

namespace rhec {
namespace priced_steps_test {

struct Case {
  std::string family, model;
  unsigned seed;
};

Report solve(const Case& of, Iterate& point) {
  const conformance::Problem problem = conformance::family(of.family).make(conformance::make_model(of.model), of.seed);
  const auto solver = conformance::make_solver("gn_rti");
  solver->setup(problem.posed());
  point = problem.guess;
  const Report report = solver->solve(point);
  std::vector<double> scratch(problem.posed().scratch_size());
  StageQp qp(problem.posed().capacity());
  if (report.status == Status::solved) {
    EXPECT_LE(kkt_residual(problem.posed(), point, qp, scratch).largest(), 1e-8);
  }
  return report;
}

TEST(PricedSteps, SolveWhatALineSearchDoesNot) {
  const Case cases[] = {
      {"rhc_limits", "bicycle_sideslip", 28},
      {"rhc_limits_redundant", "bicycle_sideslip", 28},
      {"rhc_limits", "tractor_trailer", 4},
      {"rhc_limits_redundant", "tractor_trailer", 4},
      {"rhc_limits_contradiction_soft", "tractor_trailer", 4},
      {"rhe_limits_blocks", "bicycle_slip", 20},
      {"rhe_limits_blocks", "tractor_trailer", 39},
  };
  for (const Case& of : cases) {
    Iterate point;
    EXPECT_EQ(solve(of, point).status, Status::solved) << of.family << " of " << of.model << ", seed " << of.seed;
  }
}

TEST(PricedSteps, SolveWhereTheHessianIsNotConvexAtTheSolution) {
  for (const Case& of : {Case{"rhe_limits_any", "bicycle_slip", 71}, Case{"rhc_limits_any", "unicycle_traction", 111},
                         Case{"rhe_limits_any", "tractor_trailer", 191}}) {
    Iterate point;
    EXPECT_EQ(solve(of, point).status, Status::solved) << of.family << " of " << of.model << ", seed " << of.seed;
  }
}

TEST(PricedSteps, SolveLongEstimationsFarFromTheirSolution) {
  for (const Case& of : {Case{"rhe_200_intervals_unblocked", "unicycle_traction", 6},
                         Case{"rhe_200_intervals_unblocked", "tractor_trailer", 7}}) {
    Iterate point;
    EXPECT_EQ(solve(of, point).status, Status::solved) << of.family << " of " << of.model << ", seed " << of.seed;
  }
}

TEST(PricedSteps, SaySoWhereLimitsContradictEachOther) {
  for (const Case& of :
       {Case{"rhc_limits_infeasible", "tractor_trailer", 28}, Case{"rhc_limits_infeasible", "skid_steer", 122}}) {
    const conformance::Problem problem =
        conformance::family(of.family).make(conformance::make_model(of.model), of.seed);
    Iterate point;
    const Report report = solve(of, point);
    EXPECT_EQ(report.status, Status::infeasible) << of.model;
    EXPECT_TRUE(report.fallback_used);
    EXPECT_LT(report.iterations, 100);
  }
}

TEST(PricedSteps, ManyLimitsAreActive) {
  // Forty and more, of horizons of up to forty intervals.
  for (const Case& of :
       {Case{"rhc_limits_any", "unicycle_traction", 86}, Case{"rhc_limits_any", "bicycle_sideslip", 84}}) {
    Iterate point;
    const Report report = solve(of, point);
    EXPECT_EQ(report.status, Status::solved) << of.model;
    EXPECT_LT(report.iterations, 30);
  }
}

}  // namespace priced_steps_test
}  // namespace rhec
