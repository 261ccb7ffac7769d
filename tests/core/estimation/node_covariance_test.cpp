#include "core/estimation/node_covariance.hpp"

#include <gtest/gtest.h>

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>
#include <limits>
#include <vector>

#include "rhec/core/ocp/solver_decorator.hpp"
#include "support/linear_case.hpp"

namespace rhec {
namespace node_covariance_test {

using namespace testing;

/// A solver that keeps its covariances to itself.
class Secretive final : public SolverDecorator {
 public:
  using SolverDecorator::SolverDecorator;
  bool covariances(const Iterate&, StageRange, std::span<double>) noexcept override { return false; }
};

/// Over a window of six intervals: with and without the solver's help the same.
TEST(NodeCovariance, DoesNotDependOnWhereItComesFrom) {
  const auto model = linear_model<Hovercraft>();
  const auto samples = simulate(*model, 6, true, 4);
  auto setup = linear_setup(*model, 6, ArrivalKind::ekf, {blocking("full_horizon"), blocking("full_horizon")});
  RheProblem problem(model, setup.problem);
  problem.set_intervals(6);
  problem.arrival_mean = initial_mean(*model);
  problem.arrival_information = initial_covariance(*model).inverse();
  for (int i = 0; i <= 6; ++i) {
    std::copy(samples[i].outputs.begin(), samples[i].outputs.end(), problem.output(i));
    if (i == 6) continue;
    problem.set_duration(i, samples[i + 1].duration);
    std::copy(samples[i + 1].inputs.begin(), samples[i + 1].inputs.end(), problem.measured_input(i));
  }
  problem.finish();
  const auto solver = gn_rti();
  solver->setup(problem);
  Iterate point(problem.capacity());
  std::vector<double> scratch(problem.scratch_size());
  problem.simulate(point, scratch);
  solver->solve(point, Clock::time_point::max());
  Secretive secretive(solver);
  NodeCovariance covariance(problem);
  const int ns = problem.capacity().states;
  for (int node = 0; node <= 6; ++node) {
    const double* found = covariance.find(problem, *solver, point, node);
    ASSERT_NE(found, nullptr);
    const std::vector<double> own(found, found + ns * ns);
    found = covariance.find(problem, secretive, point, node);
    ASSERT_NE(found, nullptr);
    for (int e = 0; e < ns * ns; ++e) EXPECT_NEAR(found[e], own[e], 1e-9 * (1.0 + std::abs(own[e]))) << node;
    EXPECT_GT(own[0], 0.0);
  }
  problem.arrival_information.setConstant(std::numeric_limits<double>::quiet_NaN());
  EXPECT_EQ(covariance.find(problem, secretive, point, 6), nullptr) << "not finite";
}

}  // namespace node_covariance_test
}  // namespace rhec
