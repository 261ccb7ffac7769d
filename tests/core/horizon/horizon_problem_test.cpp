#include "rhec/core/base/angle.hpp"
#include "rhec/core/ocp/ocp.hpp"

#include <gtest/gtest.h>

#include "rhec/core/qp/stage_qp_views.hpp"
#include "rhec/plugins/host/host.hpp"
#include "support/random_problem.hpp"

namespace rhec {
namespace horizon_problem_test {

using testing::RandomProblem;

/// A random point near another, with random multipliers.
Iterate perturbed(const Ocp& ocp, const Iterate& from, RandomProblem& random, double size) {
  Iterate point = from;
  for (int i = 0; i <= ocp.intervals(); ++i) {
    for (int j = 0; j < ocp.state_count(i); ++j) {
      point.state(i)[j] += size * random.normal();
      point.costate(i)[j] = random.normal();
    }
    if (i == ocp.intervals()) break;
    for (int j = 0; j < ocp.control_count(i); ++j) point.control(i)[j] += size * random.normal();
  }
  return point;
}

/// Compares a linearisation with finite differences of `evaluate`.
void check_linearisation(const Ocp& ocp, const Iterate& point, double tolerance) {
  std::vector<double> scratch(ocp.scratch_size()), defects(ocp.capacity().intervals * ocp.capacity().states);
  std::vector<double> plus(defects), minus(defects);
  StageQp qp(ocp.capacity()), exact(ocp.capacity()), moved(ocp.capacity());
  ocp.linearise(all_stages(ocp), point, Hessian::gauss_newton, qp, scratch);
  ocp.linearise(all_stages(ocp), point, Hessian::exact, exact, scratch);
  ocp.evaluate(point, defects.data(), scratch);
  const int ns = ocp.capacity().states, N = ocp.intervals();
  for (int i = 0; i < N; ++i)
    for (int j = 0; j < ns; ++j) ASSERT_NEAR(qp.b(i)[j], defects[i * ns + j], 1e-12);
  // The objective is the sum of the stage costs, each of which depends only on its own state and control.
  std::vector<double> costs(N + 1), moved_costs(N + 1);
  const double objective = ocp.evaluate_stages(point, nullptr, costs.data(), scratch);
  ASSERT_EQ(objective, ocp.evaluate(point, nullptr, scratch));
  ASSERT_NEAR(objective, std::accumulate(costs.begin(), costs.end(), 0.0), 1e-12 * (1.0 + std::abs(objective)));

  const auto gradient = [&](const StageQp& of, int i, Eigen::VectorXd& by_state, Eigen::VectorXd& by_control) {
    by_state = q_of(of, i);
    by_control = r_of(of, i);
    if (i < N) {
      const Eigen::Map<const Eigen::VectorXd> costate(point.costate(i + 1), ns);
      by_state += A_of(of, i).transpose() * costate;
      by_control += B_of(of, i).transpose() * costate;
    }
    if (i > 0) by_state -= Eigen::Map<const Eigen::VectorXd>(point.costate(i), ns);
  };
  const double h = 1e-6;
  for (int i = 0; i <= N; ++i) {
    const int controls = i < N ? ocp.control_count(i) : 0;
    for (int v = 0; v < ocp.state_count(i) + controls; ++v) {
      const bool is_state = v < ocp.state_count(i);
      const int j = is_state ? v : v - ocp.state_count(i);
      Iterate up = point, down = point;
      (is_state ? up.state(i) : up.control(i))[j] += h;
      (is_state ? down.state(i) : down.control(i))[j] -= h;
      const double f_up = ocp.evaluate(up, plus.data(), scratch), f_down = ocp.evaluate(down, minus.data(), scratch);
      const double slope = is_state ? qp.q(i)[j] : qp.r(i)[j];
      ocp.evaluate_stages(up, nullptr, moved_costs.data(), scratch);
      for (int k = 0; k <= N; ++k)
        ASSERT_TRUE(k == i || moved_costs[k] == costs[k]) << "stage " << k << " moved by " << i;
      ASSERT_NEAR((f_up - f_down) / (2.0 * h), slope, tolerance * (1.0 + std::abs(slope))) << "gradient at stage " << i;
      if (i < N) {
        for (int r = 0; r < ns; ++r) {
          const double entry = is_state ? A_of(qp, i)(r, j) : B_of(qp, i)(r, j);
          ASSERT_NEAR((plus[i * ns + r] - minus[i * ns + r]) / (2.0 * h), entry, 1e-6 * (1.0 + std::abs(entry)))
              << "dynamics at stage " << i << ", " << (is_state ? "state " : "control ") << j;
        }
      }
      // A column of the exact Hessian is the change of the Lagrangian's gradient.
      Eigen::VectorXd s_up, w_up, s_down, w_down;
      ocp.linearise(all_stages(ocp), up, Hessian::gauss_newton, moved, scratch);
      gradient(moved, i, s_up, w_up);
      ocp.linearise(all_stages(ocp), down, Hessian::gauss_newton, moved, scratch);
      gradient(moved, i, s_down, w_down);
      for (int r = 0; r < ocp.state_count(i); ++r) {
        const double entry = is_state ? Q_of(exact, i)(r, j) : S_of(exact, i)(j, r);
        ASSERT_NEAR((s_up[r] - s_down[r]) / (2.0 * h), entry, tolerance * (1.0 + std::abs(entry)))
            << "Q, S at stage " << i;
      }
      for (int r = 0; r < controls; ++r) {
        const double entry = is_state ? S_of(exact, i)(r, j) : R_of(exact, i)(r, j);
        ASSERT_NEAR((w_up[r] - w_down[r]) / (2.0 * h), entry, tolerance * (1.0 + std::abs(entry)))
            << "S, R at stage " << i;
      }
    }
  }
}

class OcpTest : public ::testing::TestWithParam<std::string> {
 protected:
  std::shared_ptr<const Model> model_ = host().make_model(GetParam());
  static const Host& host() {
    static const Host one;
    return one;
  }
};

TEST_P(OcpTest, TheEstimationProblemIsTheDerivativeOfWhatItEvaluates) {
  unsigned seed = 1;
  for (const bool robust : {false, true}) {
    for (const int block : {0, 2}) {
      for (const Transition transition : {Transition::step, Transition::ramp}) {
        RandomProblem random(model_, seed++);
        RandomProblem::RheSpec spec;
        spec.intervals = 5;
        spec.missing = 0.2;
        spec.robust = robust;
        spec.block = block;
        spec.transition = transition;
        spec.noise = 0.3;  // weights near one, so that rounding does not dominate the differences
        const auto problem = random.rhe(spec);
        check_linearisation(*problem, perturbed(*problem, RandomProblem::cold_start(*problem), random, 0.05), 2e-5);
        if (HasFatalFailure()) return;
      }
    }
  }
}

TEST_P(OcpTest, TheControlProblemIsTheDerivativeOfWhatItEvaluates) {
  unsigned seed = 20;
  for (const bool blocked : {false, true}) {
    RandomProblem random(model_, seed++);
    RandomProblem::RhcSpec spec;
    spec.intervals = 5;
    if (blocked) spec.blocked_inputs = {model_->input_count() - 1};
    spec.block = 2;
    const auto problem = random.rhc(spec);
    check_linearisation(*problem, perturbed(*problem, RandomProblem::cold_start(*problem), random, 0.05), 2e-5);
    if (HasFatalFailure()) return;
  }
}

TEST_P(OcpTest, ARangeOfStagesIsWhatTheWholeHorizonGives) {
  RandomProblem random(model_, 31);
  RandomProblem::RheSpec spec;
  spec.intervals = 9;
  spec.block = 3;
  const auto problem = random.rhe(spec);
  const Iterate point = perturbed(*problem, RandomProblem::cold_start(*problem), random, 0.02);
  std::vector<double> scratch(problem->scratch_size());
  StageQp whole(problem->capacity()), parts(problem->capacity());
  problem->linearise(all_stages(*problem), point, Hessian::exact, whole, scratch);
  problem->linearise({0, 3}, point, Hessian::exact, parts, scratch);
  problem->linearise({4, 9}, point, Hessian::exact, parts, scratch);
  for (int i = 0; i <= 9; ++i) {
    // All lanes of a pack are evaluated alike.
    EXPECT_TRUE(Q_of(whole, i).isApprox(Q_of(parts, i), 1e-13)) << i;
    EXPECT_TRUE(q_of(whole, i).isApprox(q_of(parts, i), 1e-13)) << i;
    if (i < 9) {
      EXPECT_TRUE(A_of(whole, i).isApprox(A_of(parts, i), 1e-13)) << i;
    }
  }
}

TEST_P(OcpTest, NewDataChangeTheVectorsAndNotTheMatrices) {
  RandomProblem random(model_, 41);
  const auto problem = random.rhe({});
  const Iterate point = perturbed(*problem, RandomProblem::cold_start(*problem), random, 0.02);
  std::vector<double> scratch(problem->scratch_size());
  StageQp early(problem->capacity()), late(problem->capacity());
  problem->linearise(all_stages(*problem), point, Hessian::gauss_newton, early, scratch);
  for (int j = 0; j < model_->output_count(); ++j) problem->output(problem->intervals())[j] += 0.1;
  problem->refresh(point, early, scratch);
  problem->linearise(all_stages(*problem), point, Hessian::gauss_newton, late, scratch);
  for (int i = 0; i <= problem->intervals(); ++i) {
    EXPECT_TRUE(q_of(early, i).isApprox(q_of(late, i), 1e-13));
    EXPECT_TRUE(Q_of(early, i).isApprox(Q_of(late, i), 1e-13));
  }
}

TEST_P(OcpTest, WhatIsMissingIsLeftOut) {
  RandomProblem random(model_, 51);
  const auto problem = random.rhe({});
  const Iterate point = perturbed(*problem, RandomProblem::cold_start(*problem), random, 0.02);
  std::vector<double> scratch(problem->scratch_size());
  const double with_all = problem->evaluate(point, nullptr, scratch);
  std::vector<double> predicted(model_->output_count());
  Model::Nodes request;
  request.count = 1;
  request.states = point.state(3);
  request.outputs = predicted.data();
  model_->observe(request);
  const double error = model_->description().outputs[0].is_angle ? angle_difference(predicted[0], problem->output(3)[0])
                                                                 : predicted[0] - problem->output(3)[0];
  problem->output(3)[0] = std::numeric_limits<double>::quiet_NaN();
  EXPECT_NEAR(with_all - problem->evaluate(point, nullptr, scratch), problem->setup().output_weights[0] * error * error,
              1e-9 * with_all);
}

std::vector<std::string> all_models() { return Host().names(PluginKind::model); }
INSTANTIATE_TEST_SUITE_P(Models, OcpTest, ::testing::ValuesIn(all_models()));

}  // namespace horizon_problem_test
}  // namespace rhec
