// A user-defined kind of problem, solved by any of rhec's solvers: a robot drives into a parking place.
#include <cstdio>

#include "parking_problem.hpp"
#include "rhec/core/ocp/solver.hpp"
#include "rhec/plugins/host/host.hpp"

int main(int count, char** words) try {
  const rhec::Host host;
  const auto solver = host.make_solver(count > 1 ? words[1] : "sparse_sqp");
  // x, y, heading and steering angle of a bicycle; its inputs are speed and steering rate.
  ParkingProblem problem(
      host.make_model("bicycle_slip"),
      {.intervals = 30, .step = 0.2, .input_weights = {0.01, 0.01}, .goal_weights = {100.0, 100.0, 100.0, 1.0}});
  problem.goal = {4.0, 1.0, 0.0, 0.0};
  const double slip[] = {0.9, 1.0};
  std::copy_n(slip, 2, problem.given_parameters());

  // The initial guess: slowly straight ahead.
  rhec::Iterate iterate(problem.capacity());
  std::vector<double> inputs, parameters, scratch(problem.scratch_size());
  for (int i = 0; i < problem.intervals(); ++i) {
    inputs.insert(inputs.end(), {0.5, 0.0});
    parameters.insert(parameters.end(), slip, slip + 2);
  }
  problem.structure().set_decisions(iterate, inputs.data(), parameters.data());
  roll_out(problem, iterate, scratch);

  solver->setup(problem);
  const rhec::Report report = solver->solve(iterate);
  const double* end = iterate.state(problem.intervals());
  std::printf("%s after %d iterations, KKT residual %.1e: x %.3f m, y %.3f m, heading %.3f rad\n",
              rhec::name_of(report.status), report.iterations, report.kkt.largest(), end[0], end[1], end[2]);
  return report.status == rhec::Status::solved ? 0 : 1;
} catch (const std::exception& error) {
  std::fprintf(stderr, "%s\n", error.what());
  return 1;
}
