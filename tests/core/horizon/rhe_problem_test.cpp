#include "rhec/core/horizon/rhe_problem.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <vector>

#include "rhec/core/base/error.hpp"
#include "support/cart.hpp"

namespace rhec {
namespace rhe_problem_test {

using testing::cart;
using testing::cart_estimation;
using testing::scattered_point;

constexpr double missing = std::numeric_limits<double>::quiet_NaN();

double pseudo_huber(double s, double delta) {
  return 2.0 * delta * delta * (std::sqrt(1.0 + s / (delta * delta)) - 1.0);
}

/// Weighted squared residuals of the two outputs of a node; 0 where nothing was measured.
std::array<double, 2> residuals(const RheProblem& problem, const Iterate& point, int node) {
  const double x = point.state(node)[0], v = point.state(node)[1], predicted[2] = {x, v * v};
  std::array<double, 2> found{};
  for (int j = 0; j < 2; ++j)
    if (!std::isnan(problem.output(node)[j]))
      found[j] = problem.setup().output_weights[j] * problem.measured(node).weight(j) *
                 std::pow(predicted[j] - problem.output(node)[j], 2);
  return found;
}

/// The sum given in the header, without links and robust losses.
double estimation_cost(const RheProblem& problem, const Iterate& point) {
  const Eigen::Map<const Eigen::VectorXd> start(point.state(0), 4);
  const Eigen::VectorXd error = start - problem.arrival_mean;
  double total = error.dot(problem.arrival_information * error);
  for (int i = 0; i <= problem.intervals(); ++i) {
    for (const double residual : residuals(problem, point, i)) total += residual;
    if (i == problem.intervals() || std::isnan(problem.measured_input(i)[0])) continue;
    double u = 0.0;
    problem.structure().inputs_on(point, i, &u);
    total += problem.setup().input_weights[0] * std::pow(u - problem.measured_input(i)[0], 2);
  }
  return total;
}

double cost_of(const RheProblem& problem, const Iterate& point) {
  std::vector<double> scratch(problem.scratch_size());
  return problem.evaluate(point, nullptr, scratch);
}

TEST(RheProblem, CostsWhatIsWrittenOfIt) {
  const auto problem = cart_estimation(5);
  const Iterate point = scattered_point(*problem);
  EXPECT_NEAR(cost_of(*problem, point), estimation_cost(*problem, point), 1e-12);
  problem->arrival_information(0, 2) = problem->arrival_information(2, 0) = 1.5;
  EXPECT_NEAR(cost_of(*problem, point), estimation_cost(*problem, point), 1e-12);
}

TEST(RheProblem, LeavesOutWhatIsMissing) {
  const auto problem = cart_estimation(5);
  problem->output(2)[0] = missing;
  problem->output(4)[0] = problem->output(4)[1] = missing;
  problem->measured_input(3)[0] = missing;
  const Iterate point = scattered_point(*problem);
  EXPECT_NEAR(cost_of(*problem, point), estimation_cost(*problem, point), 1e-12);
}

TEST(RheProblem, WeighsEachMeasurementByItsOwnAccuracy) {
  for (const bool robust : {false, true}) {
    RheProblem::Setup setup;
    if (robust) setup.robust = {{.outputs = {0, 1}, .delta = 1.5}};
    const auto problem = cart_estimation(5, setup);
    const Iterate point = scattered_point(*problem);
    const auto expected = [&] {
      if (!robust) return estimation_cost(*problem, point);
      double total = estimation_cost(*problem, point);
      for (int i = 0; i <= 5; ++i) {
        const auto each = residuals(*problem, point, i);
        total += pseudo_huber(each[0] + each[1], 1.5) - each[0] - each[1];
      }
      return total;
    };
    const double before = cost_of(*problem, point), values[] = {0.7, 1.9}, weights[] = {3.0, 0.2};
    problem->set_output(2, {values, weights});
    EXPECT_EQ(problem->measured(2).weight(0), 3.0);
    EXPECT_EQ(problem->measured(3).weight(0), 1.0);
    EXPECT_NEAR(cost_of(*problem, point), expected(), 1e-12);
    EXPECT_NE(cost_of(*problem, point), before);
    problem->set_output_weight(0, 7.0);
    EXPECT_NEAR(cost_of(*problem, point), expected(), 1e-12) << "they are relative to the output's weight";
    problem->drop_first_interval();
    EXPECT_EQ(problem->measured(1).weight(0), 3.0);
    EXPECT_NEAR(cost_of(*problem, point), expected(), 1e-12);
    const auto other = cart_estimation(5, setup);
    other->take_data(*problem);
    EXPECT_EQ(cost_of(*other, point), cost_of(*problem, point));
    problem->set_output(1, values);
    EXPECT_EQ(problem->measured(1).weight(0), 1.0) << "one without is as usual again";
    EXPECT_NEAR(cost_of(*problem, point), expected(), 1e-12);
  }
}

TEST(RheProblem, LinksBlocksByTheirVariance) {
  const auto problem = cart_estimation(4);
  const std::uint8_t begins[] = {0, 0, 1, 0};
  problem->set_blocks(0, begins, Transition::step);
  problem->link(2, 0, 0.04);
  problem->finish();
  EXPECT_EQ(problem->link_variance(2, 0), 0.04);
  Iterate point = scattered_point(*problem);
  const double before = point.state(2)[2], after = point.control(2)[problem->structure().control_of_lifted(2, 0)];
  ASSERT_NE(before, after);
  EXPECT_NEAR(cost_of(*problem, point), estimation_cost(*problem, point) + std::pow(after - before, 2) / 0.04, 1e-10);
  problem->link(2, 0, HUGE_VAL);
  EXPECT_NEAR(cost_of(*problem, point), estimation_cost(*problem, point), 1e-12) << "it is not linked";
}

TEST(RheProblem, WeighsTheSquareOfABlocksValue) {
  const auto problem = cart_estimation(4);
  const std::uint8_t begins[] = {1, 0, 1, 0};
  problem->set_blocks(0, begins, Transition::step);
  problem->set_block_weight(0, 0, 3.0);
  problem->set_block_weight(2, 0, 2.0);
  problem->finish();
  const Iterate point = scattered_point(*problem);
  const double first = point.state(0)[2], second = point.control(2)[problem->structure().control_of_lifted(2, 0)];
  ASSERT_NE(first, second);
  EXPECT_NEAR(cost_of(*problem, point), estimation_cost(*problem, point) + 3.0 * first * first + 2.0 * second * second,
              1e-10);
  StageQp qp(problem->capacity());
  std::vector<double> scratch(problem->scratch_size());
  const auto linearise = [&] {
    return problem->linearise(all_stages(*problem), point, Hessian::gauss_newton, qp, scratch);
  };
  linearise();
  const int at = qp.stride() + 1, control = problem->capacity().states + problem->structure().control_of_lifted(2, 0);
  const double H0 = qp.H(0)[2 * at], H2 = qp.H(2)[control * at], h0 = qp.h(0)[2], h2 = qp.h(2)[control];
  problem->set_blocks(0, begins, Transition::step);
  problem->finish();
  EXPECT_EQ(problem->block_weight(2, 0), 0.0) << "blocks that are set anew cost nothing";
  linearise();
  EXPECT_NEAR(H0 - qp.H(0)[2 * at], 6.0, 1e-12);
  EXPECT_NEAR(H2 - qp.H(2)[control * at], 4.0, 1e-12);
  EXPECT_NEAR(h0 - qp.h(0)[2], 6.0 * first, 1e-12);
  EXPECT_NEAR(h2 - qp.h(2)[control], 4.0 * second, 1e-12);
}

TEST(RheProblem, WeighsAGroupOfOutputsByItsRobustLoss) {
  RheProblem::Setup setup;
  setup.robust = {{.outputs = {0, 1}, .delta = 1.5}};
  const auto problem = cart_estimation(3, setup);
  problem->output(1)[0] += 20.0;
  const Iterate point = scattered_point(*problem);
  double expected = estimation_cost(*problem, point);
  std::vector<double> scratch(problem->scratch_size());
  for (int i = 0; i <= 3; ++i) {
    const auto each = residuals(*problem, point, i);
    const double s = each[0] + each[1];
    expected += pseudo_huber(s, 1.5) - s;
    double weights[2];
    problem->robust_weights(point, i, weights, scratch);
    const double slope = (pseudo_huber(s + 1e-6, 1.5) - pseudo_huber(s - 1e-6, 1.5)) / 2e-6;
    EXPECT_NEAR(weights[0], slope, 1e-6) << i;
    EXPECT_EQ(weights[1], weights[0]) << "they share one loss";
    EXPECT_GT(weights[0], 0.0);
    EXPECT_LE(weights[0], 1.0);
  }
  EXPECT_NEAR(cost_of(*problem, point), expected, 1e-10 * expected);
}

TEST(RheProblem, WeighsOutputsWithoutALossFully) {
  const auto problem = cart_estimation(3);
  const Iterate point = scattered_point(*problem);
  std::vector<double> scratch(problem->scratch_size());
  double weights[2] = {7.0, 7.0};
  problem->robust_weights(point, 1, weights, scratch);
  EXPECT_EQ(weights[0], 1.0);
  EXPECT_EQ(weights[1], 1.0);
}

TEST(RheProblem, BoundsStatesAndParametersWhereTheyAreDecided) {
  const auto problem = cart_estimation(4);
  const std::uint8_t begins[] = {0, 0, 1, 0};
  problem->set_blocks(0, begins, Transition::step);
  problem->finish();
  const int control = problem->structure().control_of_lifted(2, 0);
  EXPECT_EQ(problem->state_upper(0)[2], 0.5) << "drag, at node 0";
  EXPECT_EQ(problem->control_upper(2)[control], 0.5);
  EXPECT_EQ(problem->control_lower(2)[control], 0.0);
  EXPECT_EQ(problem->state_upper(3)[1], 5.0);
  EXPECT_EQ(problem->control_upper(1)[0], HUGE_VAL) << "an input that was measured has no bounds";
}

TEST(RheProblem, DropsItsFirstInterval) {
  const auto problem = cart_estimation(4);
  problem->set_duration(1, 0.7);
  const double output = problem->output(2)[1], input = problem->measured_input(3)[0], last = problem->output(4)[0];
  problem->drop_first_interval();
  EXPECT_EQ(problem->duration(0), 0.7);
  EXPECT_EQ(problem->output(1)[1], output);
  EXPECT_EQ(problem->measured_input(2)[0], input);
  EXPECT_EQ(problem->output(3)[0], last);
  EXPECT_EQ(problem->output(4)[0], last) << "until it is overwritten";
}

TEST(RheProblem, TakesOnTheDataOfAnother) {
  const auto from = cart_estimation(5), to = cart_estimation(5);
  from->set_intervals(3);
  const std::uint8_t begins[] = {0, 1, 0};
  from->set_blocks(0, begins, Transition::step);
  from->link(1, 0, 0.1);
  from->output(2)[0] = 4.0;
  from->measured_input(1)[0] = missing;
  from->arrival_mean[1] = -1.0;
  from->finish();
  to->take_data(*from);
  EXPECT_EQ(to->intervals(), 3);
  EXPECT_EQ(to->control_count(1), 2);
  const Iterate point = scattered_point(*from);
  EXPECT_EQ(cost_of(*to, point), cost_of(*from, point));
}

TEST(RheProblem, RefusesASetUpThatDoesNotFit) {
  RheProblem::Setup setup = cart_estimation(3)->setup();
  EXPECT_NO_THROW(RheProblem(cart(), setup));
  setup.output_weights = {1.0};
  EXPECT_THROW(RheProblem(cart(), setup), Error);
  setup.output_weights = {1.0, -1.0};
  EXPECT_THROW(RheProblem(cart(), setup), Error);
  setup.output_weights = {1.0, 1.0};
  setup.robust = {{.outputs = {2}, .delta = 1.0}};
  EXPECT_THROW(RheProblem(cart(), setup), Error) << "there is no such output";
  setup.robust = {{.outputs = {0}, .delta = 0.0}};
  EXPECT_THROW(RheProblem(cart(), setup), Error);
}

}  // namespace rhe_problem_test
}  // namespace rhec
