// States at measurements between nodes: integrated to each, or interpolated between few points of the interval.
#include <gtest/gtest.h>

#include <cmath>
#include <vector>

#include "rhec/core/horizon/rhe_problem.hpp"
#include "support/cart.hpp"
#include "support/random_problem.hpp"

namespace rhec {
namespace rhe_between_states_test {

using namespace testing;

/// The largest difference of an interval's measurements between what the problem says of them and the integration up to
/// each of them, with many steps.
double error_of_states(int measurements, int substeps) {
  RandomProblem::RheSpec spec;
  spec.intervals = 1;
  spec.adjust = [&](RheProblem::Setup& setup, const RandomProblem::Drive&) {
    setup.most_between = measurements;
    setup.substeps = substeps;
  };
  RandomProblem random(cart(), 7);
  const auto problem = random.rhe(spec);
  problem->set_duration(0, 0.5);
  const Iterate point = scattered_point(*problem);
  for (int k = 0; k < measurements; ++k) {
    double* const y = problem->between(0).add(0.5 * (k + 0.5) / measurements);
    y[0] = y[1] = 0.0;
  }
  std::vector<double> scratch(problem->scratch_size()), weights(2 * static_cast<std::size_t>(measurements));
  const int entries = 1 + 2 + 2 + 1;  // a residual, and its derivatives by x, p and u
  std::vector<double> rows(weights.size() * entries);
  problem->linearise_between(0, point, weights.data(), rows.data(), scratch);
  const double* const p = point.state(0) + 2;
  double started[2];
  for (int j = 0; j < 2; ++j) {
    const int start = problem->structure().control_of_lifted(0, j);
    started[j] = start >= 0 ? point.control(0)[start] : p[j];
  }
  double largest = 0.0;
  for (int k = 0; k < measurements; ++k) {
    double x[2], y[2];
    const double time = problem->between(0).time(k), u = point.control(0)[0];
    problem->model().integrate({.count = 1,
                                .states = point.state(0),
                                .inputs = &u,
                                .parameters = started,
                                .durations = &time,
                                .substeps = 50,
                                .next_states = x});
    problem->model().observe({.count = 1, .states = x, .outputs = y});
    for (int j = 0; j < 2; ++j)
      largest =
          std::max(largest, std::abs(std::abs(rows[static_cast<std::size_t>(2 * k + j) * entries]) - std::abs(y[j])));
  }
  return largest;
}

TEST(RheBetweenStates, InterpolationIsAsGoodAsTheStepsAre) {
  for (const int substeps : {1, 2, 3}) {
    const double integrated = error_of_states(3, substeps), interpolated = error_of_states(30, substeps);
    EXPECT_LT(interpolated, 3.0 * integrated + 1e-9) << substeps;
  }
  EXPECT_LT(error_of_states(30, 3), 0.2 * error_of_states(30, 1));
}

}  // namespace rhe_between_states_test
}  // namespace rhec
