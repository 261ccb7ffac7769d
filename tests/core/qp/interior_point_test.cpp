#include <gtest/gtest.h>

#include "rhec/core/qp/stage_qp_solver.hpp"
#include "support/active_set_attempt.hpp"

namespace rhec {
namespace interior_point_test {

using namespace rhec::testing;

TEST(InteriorPoint, AgreesWithTheDualMethodOnLimits) {
  RandomQp random(34);
  int compared = 0;
  for (int trial = 0; trial < 100; ++trial) {
    const StageQp qp = limited_qp(random, trial % 2 == 0, {.room = 0.6, .soft = 0.5});
    const Attempt attempt(qp, nullptr);
    if (attempt.outcome != DualActiveSet::Outcome::solved) continue;
    StageQpSolver solver(qp.capacity());
    Iterate step(qp.capacity());
    if (solver.solve_by_interior_point(qp, step) == StageQpSolver::Outcome::infeasible) {
      ADD_FAILURE() << "trial " << trial << ": the interior-point method failed on a feasible program";
      continue;
    }
    ++compared;
    EXPECT_LT(kkt_violation(qp, step), 1e-6) << "trial " << trial;
    EXPECT_LT(distance(qp, step, attempt.step), 1e-6) << "trial " << trial;
  }
  EXPECT_GT(compared, 85);
}

}  // namespace interior_point_test
}  // namespace rhec
