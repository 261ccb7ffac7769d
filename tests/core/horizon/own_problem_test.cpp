// A user-defined problem class, written against rhec's public headers: examples/problem.
#include <gtest/gtest.h>

#include <cmath>
#include <random>

#include "examples/problem/parking_problem.hpp"
#include "rhec/core/horizon/shift.hpp"
#include "rhec/core/ocp/linearisation.hpp"
#include "rhec/core/ocp/solver.hpp"
#include "rhec/plugins/host/host.hpp"
#include "rhec/plugins/yaml/yaml.hpp"

namespace rhec {
namespace own_problem_test {

const Host& host() {
  static const Host one;
  return one;
}

struct Parking {
  ParkingProblem problem{
      host().make_model("bicycle_slip"),
      {.intervals = 12, .step = 0.3, .input_weights = {0.02, 0.05}, .goal_weights = {10.0, 20.0, 30.0, 1.0}}};
  Iterate iterate{problem.capacity()};
  std::vector<double> scratch = std::vector<double>(problem.scratch_size());

  Parking() {
    problem.goal = {3.0, 0.5, 0.2, 0.0};
    std::copy_n(std::vector<double>{0.8, 0.9}.data(), 2, problem.given_parameters());
    std::vector<double> inputs, parameters;
    for (int i = 0; i < problem.intervals(); ++i) {
      inputs.insert(inputs.end(), {0.8, 0.05});
      parameters.insert(parameters.end(), {0.8, 0.9});
    }
    problem.structure().set_decisions(iterate, inputs.data(), parameters.data());
    roll_out(problem, iterate, scratch);
  }
};

TEST(OwnProblem, IsTheDerivativeOfWhatItEvaluates) {
  Parking parking;
  const ParkingProblem& problem = parking.problem;
  StageQp qp(problem.capacity());
  const double objective =
      problem.linearise(all_stages(problem), parking.iterate, Hessian::gauss_newton, qp, parking.scratch);
  EXPECT_NEAR(objective, problem.evaluate(parking.iterate, nullptr, parking.scratch), 1e-12 * objective);
  for (int i = 0; i <= problem.intervals(); ++i) {
    const int used = problem.state_count(i) + (i < problem.intervals() ? problem.control_count(i) : 0);
    for (int k = 0; k < used; ++k) {
      double ends[2];
      for (const int side : {0, 1}) {
        Iterate moved = parking.iterate;
        moved.row(i)[k] += side == 0 ? -1e-4 : 1e-4;
        ends[side] = problem.evaluate(moved, nullptr, parking.scratch);
      }
      EXPECT_NEAR(qp.h(i)[k], (ends[1] - ends[0]) / 2e-4, 1e-6 * (1.0 + std::abs(qp.h(i)[k]))) << i << ' ' << k;
    }
  }
}

TEST(OwnProblem, ItsLinearisationIsTheOneThatIsMadeAnew) {
  Parking parking;
  ParkingProblem& problem = parking.problem;
  const auto remembering = problem.make_linearisation();
  Linearisation plain(problem);
  GuessShifter shifter(problem);
  std::mt19937 random(4);
  std::normal_distribution<double> normal;
  for (int sample = 0; sample < 6; ++sample) {
    for (int i = 0; i <= problem.intervals(); ++i)
      for (int j = 0; j < 4; ++j) parking.iterate.costate(i)[j] = normal(random);
    remembering->linearise_for_residual(parking.iterate, Hessian::exact);
    shifter.take(problem, parking.iterate);
    problem.goal[0] += 0.1;
    problem.given_state()[0] += 0.1;
    ASSERT_TRUE(shifter.apply(1, problem, parking.iterate));
    for (Linearisation* each : {remembering.get(), &plain}) {
      each->prepare(parking.iterate, Hessian::exact);
      each->refresh(parking.iterate);
    }
    const StageQp &found = remembering->qp(), &expected = plain.qp();
    const int ns = problem.capacity().states, stride = found.stride();
    const auto compare = [&](const double* a, const double* b, int count, int stage) {
      for (int k = 0; k < count; ++k) ASSERT_NEAR(a[k], b[k], 1e-12 * (1.0 + std::abs(b[k]))) << stage << ' ' << k;
    };
    for (int i = 0; i <= problem.intervals(); ++i) {
      compare(found.h(i), expected.h(i), stride, i);
      compare(found.H(i), expected.H(i), (ns + found.controls(i)) * stride, i);
      if (i == problem.intervals()) break;
      compare(found.AB(i), expected.AB(i), ns * stride, i);
      compare(found.b(i), expected.b(i), stride, i);
    }
  }
}

TEST(OwnProblem, EverySolverTakesIt) {
  for (const std::string& name : host().names(PluginKind::solver)) {
    Parking parking;
    const auto solver = host().make_solver(name, parse_yaml(name == "gn_rti" ? "{mode: converge}" : "{}", "test"));
    ASSERT_EQ(solver->why_not(parking.problem), "") << name;
    solver->setup(parking.problem);
    Iterate iterate = parking.iterate;
    const Report report = solver->solve(iterate);
    EXPECT_EQ(report.status, Status::solved) << name << ": " << name_of(report.status);
    StageQp qp(parking.problem.capacity());
    EXPECT_LE(kkt_residual(parking.problem, iterate, qp, parking.scratch).largest(), 1e-6) << name;
    EXPECT_NEAR(iterate.state(parking.problem.intervals())[0], 3.0, 0.1) << name;
  }
}

}  // namespace own_problem_test
}  // namespace rhec
