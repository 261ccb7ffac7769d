// The arrival cost: the information of measurements that have left the window.
#include "rhec/core/estimation/arrival_cost.hpp"

#include <gtest/gtest.h>
#include <Eigen/LU>

#include <cmath>

#include "support/linear_case.hpp"

namespace rhec {
namespace arrival_cost_test {

using namespace rhec::testing;

const std::vector<ArrivalKind> recursive = {ArrivalKind::ekf, ArrivalKind::smoothing};

/// A window of one interval at an arbitrary point, about to slide.
struct OneInterval {
  std::shared_ptr<const Model> model;
  RheProblem problem;
  Iterate solution;

  explicit OneInterval(std::shared_ptr<const Model> of, std::vector<RobustLoss> robust = {})
      : model(of), problem(of, with(robust, linear_setup(*of, 1, ArrivalKind::ekf, {}).problem)) {
    solution = Iterate(problem.capacity());
    problem.set_intervals(1);
    problem.set_duration(0, 0.2);
    const std::vector<std::uint8_t> begins = {0};
    for (int j = 0; j < model->parameter_count(); ++j) problem.set_blocks(j, begins.data(), Transition::step);
    problem.finish();
    for (int j = 0; j < model->output_count(); ++j) problem.output(0)[j] = problem.output(1)[j] = 0.5 + 0.1 * j;
    for (int j = 0; j < model->input_count(); ++j) {
      problem.measured_input(0)[j] = 0.4 - 0.3 * j;
      solution.control(0)[j] = 0.3 - 0.1 * j;
    }
    for (int j = 0; j < problem.capacity().states; ++j) solution.state(0)[j] = 0.2 * j - 0.1;
    std::vector<double> scratch(problem.scratch_size());
    problem.simulate(solution, scratch);
  }

  ArrivalCost arrival(ArrivalKind kind, double process_noise = 0.0, double restart = 1.0) const {
    ArrivalCost cost(kind, problem, std::vector<ParameterWalk>(model->parameter_count(), {process_noise, restart}));
    cost.reset(initial_mean(*model), initial_covariance(*model));
    return cost;
  }
  std::vector<ArrivalCost::Border> borders() const {
    return std::vector<ArrivalCost::Border>(model->parameter_count());
  }

 private:
  static RheProblem::Setup with(const std::vector<RobustLoss>& robust, RheProblem::Setup setup) {
    setup.robust = robust;
    return setup;
  }
};

void expect_near(const Eigen::MatrixXd& a, const Eigen::MatrixXd& b, double tolerance) {
  EXPECT_LE((a - b).cwiseAbs().maxCoeff(), tolerance * (1.0 + b.cwiseAbs().maxCoeff())) << a << "\n\n" << b;
}

TEST(ArrivalCost, WritesTheInverseOfItsCovariance) {
  OneInterval window(linear_model<Hovercraft>());
  ArrivalCost cost = window.arrival(ArrivalKind::ekf);
  cost.write(window.problem);
  expect_near(window.problem.arrival_information * initial_covariance(*window.model), Eigen::MatrixXd::Identity(6, 6),
              1e-12);
  EXPECT_EQ(window.problem.arrival_mean, initial_mean(*window.model));
  EXPECT_EQ(window.problem.arrival_information, window.problem.arrival_information.transpose());
}

TEST(ArrivalCost, UnlikeUnitsDoNotMeetInTheInverse) {
  OneInterval window(linear_model<Hovercraft>());
  Eigen::VectorXd units(6);
  units << 1e5, 1e-4, 1.0, 1e3, 1e-5, 1.0;
  ArrivalCost cost = window.arrival(ArrivalKind::smoothing);
  const Eigen::MatrixXd plain = initial_covariance(*window.model);
  cost.reset(initial_mean(*window.model), units.asDiagonal() * plain * units.asDiagonal());
  cost.write(window.problem);
  expect_near(units.asDiagonal() * window.problem.arrival_information * units.asDiagonal(), plain.inverse(), 1e-12);
}

TEST(ArrivalCost, SingularCovariancesAreWrittenFinite) {
  OneInterval window(linear_model<Boat>());
  for (const ArrivalKind kind : recursive) {
    ArrivalCost cost = window.arrival(kind);
    Eigen::MatrixXd covariance = Eigen::MatrixXd::Ones(4, 4);  // all the same variable
    covariance.row(2).setZero();                               // and one known exactly
    covariance.col(2).setZero();
    cost.reset(initial_mean(*window.model), covariance);
    for (int slide = 0; slide < 5; ++slide) {
      cost.write(window.problem);
      EXPECT_TRUE(window.problem.arrival_information.allFinite());
      EXPECT_GT(window.problem.arrival_information(2, 2), slide == 0 ? 1e12 : 0.0);
      cost.slide(window.problem, window.solution, window.borders());
      EXPECT_TRUE(cost.mean().allFinite());
      EXPECT_TRUE(cost.covariance().allFinite());
    }
  }
}

TEST(ArrivalCost, FilteringAndSmoothingAgreeOnLinearProblems) {
  OneInterval window(linear_model<Hovercraft>());
  window.problem.output(0)[1] = nan;
  ArrivalCost ekf = window.arrival(ArrivalKind::ekf, 0.03), smoothing = window.arrival(ArrivalKind::smoothing, 0.03);
  std::vector<ArrivalCost::Border> borders = window.borders();
  for (int slide = 0; slide < 30; ++slide) {
    borders[0] = {.reached = slide % 3 == 0, .steps = 3.0, .neighbour_sigma = 0.1};
    borders[1] = {.leaves_as_ramp = slide % 2 == 0, .ramp_variance = 0.05};
    window.problem.measured_input(0)[1] = slide % 7 == 0 ? nan : 0.2;
    ekf.slide(window.problem, window.solution, borders);
    smoothing.slide(window.problem, window.solution, borders);
    expect_near(ekf.mean(), smoothing.mean(), 1e-10);
    expect_near(ekf.covariance(), smoothing.covariance(), 1e-10);
  }
}

TEST(ArrivalCost, FilteringAndSmoothingAgreeInTheEstimatorWithForgetting) {
  const auto model = linear_model<Hovercraft>();
  const std::vector<Sample> samples = simulate(*model, 60, true, 3);
  std::vector<std::unique_ptr<RecedingHorizonEstimation>> methods;
  for (const ArrivalKind kind : recursive) {
    RecedingHorizonEstimation::Setup setup =
        linear_setup(*model, 8, kind, {blocking("full_horizon"), blocking("structured", "{size: 3, overlap: 4}")});
    for (ParameterWalk& walk : setup.walks) walk = {.process_noise = 0.1, .restart_sigma = 0.7};
    methods.push_back(std::make_unique<RecedingHorizonEstimation>(model, gn_rti(), setup));
  }
  Estimate estimates[2] = {empty_estimate(*model), empty_estimate(*model)};
  for (std::size_t k = 0; k < samples.size(); ++k) {
    for (int i = 0; i < 2; ++i) {
      if (k == 0) methods[i]->start(samples[0].outputs.data());
      if (k > 0) methods[i]->add_node(samples[k].duration, samples[k].inputs.data(), samples[k].outputs.data());
      methods[i]->estimate(estimates[i], Clock::time_point::max());
    }
    expect_near(estimates[0].state, estimates[1].state, 1e-9);
    expect_near(estimates[0].parameters, estimates[1].parameters, 1e-9);
    expect_near(estimates[0].covariance, estimates[1].covariance, 1e-9);
  }
}

TEST(ArrivalCost, ARobustResidualLeavesWithItsWeight) {
  const double delta = 1.5;
  OneInterval window(linear_model<Trolley>(), {{.outputs = {0, 1}, .delta = delta}});
  window.problem.output(0)[0] = 7.0;  // an outlier
  // By hand: s is the weighted squared residual of the group at the solution, the weight 1 / sqrt(1 + s / delta^2).
  const Noise noise = noise_of(*window.model);
  const double *x = window.solution.state(0), *y = window.problem.output(0);
  const double first = (x[0] - y[0]) / noise.outputs[0], second = (x[0] + 0.5 * x[1] - y[1]) / noise.outputs[1];
  const double weight = 1.0 / std::sqrt(1.0 + (first * first + second * second) / (delta * delta));
  ASSERT_LT(weight, 0.1);
  Noise weighted = noise;
  for (double& sigma : weighted.outputs) sigma /= std::sqrt(weight);
  ReferenceFilter reference(*window.model, weighted, {});
  reference.update({.outputs = {y[0], y[1]}});
  reference.predict(0, {.duration = 0.2, .inputs = {window.problem.measured_input(0)[0]}});
  for (const ArrivalKind kind : recursive) {
    ArrivalCost cost = window.arrival(kind);
    cost.slide(window.problem, window.solution, {});
    expect_near(cost.mean(), reference.mean.cast<double>(), 1e-12);
    expect_near(cost.covariance(), reference.covariance.cast<double>(), 1e-12);
  }
}

/// It is that of a filter, whatever the solution is.
TEST(ArrivalCost, AnUnmeasuredInputIsAnUnknownOne) {
  OneInterval window(linear_model<Trolley>());
  window.problem.measured_input(0)[0] = nan;
  Noise noise = noise_of(*window.model);
  noise.inputs[0] = 3.0 * window.model->description().inputs[0].scale;
  ReferenceFilter reference(*window.model, noise, {});
  reference.update({.outputs = {window.problem.output(0)[0], window.problem.output(0)[1]}});
  reference.predict(0, {.duration = 0.2, .inputs = {0.0}});
  for (const ArrivalKind kind : recursive) {
    ArrivalCost cost = window.arrival(kind);
    cost.slide(window.problem, window.solution, {});
    expect_near(cost.mean(), reference.mean.cast<double>(), 1e-12);
    expect_near(cost.covariance(), reference.covariance.cast<double>(), 1e-12);
  }
}

TEST(ArrivalCost, ABlockWithoutALinkRestartsUncorrelated) {
  OneInterval window(linear_model<Hovercraft>());
  std::vector<ArrivalCost::Border> borders = window.borders();
  for (const ArrivalKind kind : recursive) {
    ArrivalCost goes_on = window.arrival(kind, 0.2, 0.6), restarts = window.arrival(kind, 0.2, 0.6);
    borders[1] = {};
    goes_on.slide(window.problem, window.solution, borders);
    borders[1] = {.reached = true, .steps = 3.0};
    restarts.slide(window.problem, window.solution, borders);
    EXPECT_EQ(restarts.mean(), goes_on.mean());
    Eigen::MatrixXd expected = goes_on.covariance();
    expected.row(5).setZero();
    expected.col(5).setZero();
    expected(5, 5) = 0.6 * 0.6;
    EXPECT_EQ(restarts.covariance(), expected);
    // With a link it keeps them, and only its variance grows.
    ArrivalCost linked = window.arrival(kind, 0.2, 0.6);
    borders[1].neighbour_sigma = 0.3;
    linked.slide(window.problem, window.solution, borders);
    expected = goes_on.covariance();
    expected(5, 5) += 0.3 * 0.3 * 3.0;
    expect_near(linked.covariance(), expected, 1e-15);
  }
}

TEST(ArrivalCost, ForgettingIsAddedAtEachSlide) {
  OneInterval window(linear_model<Boat>());
  for (const ArrivalKind kind : recursive) {
    ArrivalCost without = window.arrival(kind), with = window.arrival(kind, 0.25);
    without.slide(window.problem, window.solution, window.borders());
    with.slide(window.problem, window.solution, window.borders());
    Eigen::MatrixXd expected = without.covariance();
    expected(3, 3) += 0.25 * 0.25;
    expect_near(with.covariance(), expected, 1e-15);
  }
}

TEST(ArrivalCost, OffRemembersNothing) {
  OneInterval window(linear_model<Boat>());
  ArrivalCost cost = window.arrival(ArrivalKind::off, 0.1);
  cost.write(window.problem);
  EXPECT_TRUE(window.problem.arrival_information.isZero(0.0));
  cost.slide(window.problem, window.solution, window.borders());
  cost.write(window.problem);
  EXPECT_TRUE(window.problem.arrival_information.isZero(0.0));
}

TEST(ArrivalCost, ConstantKeepsTheInitialCovarianceAboutTheWindowsNextNode) {
  OneInterval window(linear_model<Boat>());
  ArrivalCost cost = window.arrival(ArrivalKind::constant, 0.1);
  for (int slide = 0; slide < 3; ++slide) {
    cost.slide(window.problem, window.solution, window.borders());
    EXPECT_EQ(cost.covariance(), initial_covariance(*window.model));
    for (int j = 0; j < 4; ++j) EXPECT_EQ(cost.mean()[j], window.solution.state(1)[j]);
  }
}

TEST(ArrivalCost, ASolutionThatIsNoneLeavesItFinite) {
  OneInterval window(linear_model<Boat>());
  std::vector<double> scratch(window.problem.scratch_size());
  for (const double poison : {nan, std::numeric_limits<double>::infinity()}) {
    for (int where = 0; where < 5; ++where) {
      OneInterval poisoned(linear_model<Boat>());
      (where < 4 ? poisoned.solution.state(0)[where] : poisoned.solution.control(0)[0]) = poison;
      poisoned.problem.simulate(poisoned.solution, scratch);
      for (const ArrivalKind kind : recursive) {
        ArrivalCost cost = window.arrival(kind);
        cost.slide(poisoned.problem, poisoned.solution, window.borders());
        cost.write(window.problem);
        EXPECT_TRUE(cost.mean().allFinite());
        EXPECT_TRUE(window.problem.arrival_information.allFinite());
      }
    }
  }
}

}  // namespace arrival_cost_test
}  // namespace rhec
