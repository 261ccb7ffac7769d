#include "../../solvers/gn_rti/stage_qp_solver.hpp"

#include <gtest/gtest.h>

#include "random_qp.hpp"

namespace rhec::gn_rti {
namespace {

using rhec::testing::RandomQp;

/// Largest violation of the KKT conditions of the program by a step with its multipliers.
double kkt_violation(const StageQp& qp, const Iterate& step) {
  double worst = 0.0;
  const int N = qp.intervals();
  for (int i = 0; i <= N; ++i) {
    const Eigen::Map<const Eigen::VectorXd> s(step.state(i), qp.states(i)),
        w(step.control(i < N ? i : 0), qp.controls(i));
    Eigen::VectorXd by_state = qp.Q_of(i) * s + qp.q_of(i);
    Eigen::VectorXd by_control = Eigen::VectorXd::Zero(qp.controls(i));
    if (i < N) {
      const Eigen::Map<const Eigen::VectorXd> costate(step.costate(i + 1), qp.states(i + 1));
      by_state += qp.S_of(i).transpose() * w + qp.A_of(i).transpose() * costate;
      by_control = qp.R_of(i) * w + qp.S_of(i) * s + qp.r_of(i) + qp.B_of(i).transpose() * costate;
      const Eigen::Map<const Eigen::VectorXd> next(step.state(i + 1), qp.states(i + 1));
      worst = std::max(worst, (qp.A_of(i) * s + qp.B_of(i) * w + qp.b_of(i) - next).lpNorm<Eigen::Infinity>());
    }
    const auto check = [&](double gradient, double multiplier, double value, double lower, double upper) {
      worst = std::max({worst, std::abs(gradient + multiplier), lower - value, value - upper});
      if (multiplier > 0.0) worst = std::max(worst, multiplier * std::min(1.0, std::abs(upper - value)));
      if (multiplier < 0.0) worst = std::max(worst, -multiplier * std::min(1.0, std::abs(lower - value)));
    };
    for (int j = 0; j < qp.states(i); ++j)
      check(by_state[j] - step.costate(i)[j], step.state_bound(i)[j], s[j],
            i == 0 && qp.initial_state_is_given ? -1e9 : qp.state_lower(i)[j],
            i == 0 && qp.initial_state_is_given ? 1e9 : qp.state_upper(i)[j]);
    for (int j = 0; j < qp.controls(i); ++j)
      check(by_control[j], step.control_bound(i)[j], w[j], qp.control_lower(i)[j], qp.control_upper(i)[j]);
  }
  return worst;
}

StageQp bounded_qp(RandomQp& random, bool given, double tightness) {
  StageQp qp = random.make(random.integer(2, 15), random.integer(1, 5), random.integer(1, 4), given);
  for (int i = 0; i <= qp.intervals(); ++i) {
    for (int j = 0; j < qp.controls(i); ++j) {
      qp.control_lower(i)[j] = -random.uniform(0.1, 1.0) * tightness;
      qp.control_upper(i)[j] = random.uniform(0.1, 1.0) * tightness;
    }
    // Roomy enough that some trajectory keeps them.
    for (int j = 0; j < qp.states(i); ++j) {
      qp.state_lower(i)[j] = -4.0;
      qp.state_upper(i)[j] = 4.0;
    }
    for (int j = 0; i < qp.intervals() && j < qp.states(i + 1); ++j) qp.b(i)[j] *= 0.3;
  }
  return qp;
}

TEST(StageQpSolver, SolvesRandomProgramsToTheirKktConditions) {
  RandomQp random(11);
  int exact = 0, interior = 0;
  for (int trial = 0; trial < 500; ++trial) {
    StageQp qp = bounded_qp(random, trial % 2 == 0, trial % 3 == 0 ? 0.3 : 2.0);
    StageQpSolver solver(qp.capacity());
    Iterate step(qp.capacity());
    solver.guess_from(qp, step);
    const auto outcome = solver.solve(qp, step);
    if (outcome == StageQpSolver::Outcome::infeasible) continue;
    (outcome == StageQpSolver::Outcome::active_set ? exact : interior)++;
    ASSERT_LT(kkt_violation(qp, step), 1e-7) << "trial " << trial;
  }
  EXPECT_GT(exact, 400);
  RecordProperty("interior_point", interior);
}

TEST(StageQpSolver, TheInteriorPointMethodAgreesWithActiveSets) {
  RandomQp random(12);
  int compared = 0;
  for (int trial = 0; trial < 100; ++trial) {
    StageQp qp = bounded_qp(random, true, 0.5);
    StageQpSolver solver(qp.capacity());
    Iterate by_sets(qp.capacity()), by_interior(qp.capacity());
    solver.guess_from(qp, by_sets);
    if (solver.solve(qp, by_sets) != StageQpSolver::Outcome::active_set) continue;
    if (solver.solve_by_interior_point(qp, by_interior) == StageQpSolver::Outcome::infeasible) {
      ADD_FAILURE() << "trial " << trial << ": the interior-point method failed on a feasible program";
      continue;
    }
    ++compared;
    for (int i = 0; i <= qp.intervals(); ++i)
      for (int j = 0; j < qp.states(i); ++j) ASSERT_NEAR(by_sets.state(i)[j], by_interior.state(i)[j], 1e-7);
  }
  EXPECT_GT(compared, 80);
}

TEST(StageQpSolver, SaysSoWhenTheBoundsCannotBeSatisfied) {
  RandomQp random(13);
  for (int trial = 0; trial < 20; ++trial) {
    StageQp qp = bounded_qp(random, true, 0.5);
    const int N = qp.intervals();
    qp.state_lower(N)[0] = 50.0;
    qp.state_upper(N)[0] = 60.0;
    StageQpSolver solver(qp.capacity());
    Iterate step(qp.capacity());
    solver.guess_from(qp, step);
    EXPECT_EQ(solver.solve(qp, step), StageQpSolver::Outcome::infeasible) << "trial " << trial;
    // And the next program is solved as if nothing had happened.
    StageQp good = bounded_qp(random, true, 1.0);
    StageQpSolver fresh(good.capacity());
    Iterate answer(good.capacity());
    fresh.guess_from(good, answer);
    EXPECT_NE(fresh.solve(good, answer), StageQpSolver::Outcome::infeasible);
  }
}

}  // namespace
}  // namespace rhec::gn_rti
