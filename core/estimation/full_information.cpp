#include "rhec/core/estimation/full_information.hpp"

#include <algorithm>
#include <cmath>
#include <utility>

#include <fmt/format.h>

#include "block_structure.hpp"
#include "input_walks.hpp"
#include "node_log.hpp"
#include "rhec/core/base/error.hpp"
#include "rhec/core/estimation/measurement.hpp"
#include "track_alignment.hpp"

namespace rhec {

FullInformationEstimation::FullInformationEstimation(std::shared_ptr<const Model> model, std::shared_ptr<Solver> solver,
                                                     Setup setup)
    : model_(std::move(model)), solver_(std::move(solver)), setup_(std::move(setup)) {
  const auto np = static_cast<std::size_t>(model_->parameter_count());
  const auto n = Eigen::Index{model_->state_count()} + model_->parameter_count();
  if (setup_.blockings.size() != np || setup_.walks.size() != np)
    throw Error(fmt::format("smoother: {} blockings and {} parameter walks given; expected {} of each, one a parameter",
                            setup_.blockings.size(), setup_.walks.size(), np));
  if (setup_.initial_mean.size() != n || setup_.initial_covariance.rows() != n || setup_.initial_covariance.cols() != n)
    throw Error(fmt::format("smoother: the initial mean and covariance must have the size {} of [x; p]", n));
}

namespace {

/// The estimates in the log as an iterate; a block gets the value of its last interval, which is based on most of its
/// data.
Iterate guess_from(const NodeLog& log, const Model& vehicle, const InputWalks& walks, const RheProblem& problem) {
  const int nx = vehicle.state_count(), nu = vehicle.input_count(), np = vehicle.parameter_count(), N = log.intervals();
  Iterate guess(problem.capacity());
  std::vector<double> states = log.states, at_nodes = log.parameters, inputs = log.inputs;
  fill_gaps(states, nx);
  fill_gaps(at_nodes, np);
  for (double& value : states) value = std::isfinite(value) ? value : 0.0;
  fill_columns(inputs, nu);
  std::vector<double> parameters(static_cast<std::size_t>(N) * np);
  for (int j = 0; j < np; ++j) {
    const double lower = problem.setup().parameter_lower[j], upper = problem.setup().parameter_upper[j];
    double value = 0.0;
    for (int i = N - 1; i >= 0; --i) {
      const bool ends = i == N - 1 || problem.structure().starts_block(i + 1, j);
      if (ends) value = at_nodes[static_cast<std::ptrdiff_t>(i + 1) * np + j];
      if (!std::isfinite(value)) value = problem.arrival_mean[nx + walks.count() + j];
      parameters[static_cast<std::ptrdiff_t>(i) * np + j] = std::clamp(value, lower, upper);
    }
  }
  align_track(problem, vehicle, states, inputs, parameters);
  std::vector<double> own = inputs;
  for (std::ptrdiff_t i = 0; i <= N; ++i) {
    const int node = static_cast<int>(i);
    double* const state = guess.state(node);
    std::copy_n(states.data() + i * nx, nx, state);
    walks.write_kept(inputs, node, state + nx);
    if (i == N) break;
    walks.to_own(node, state + nx, own.data() + i * nu);
  }
  problem.structure().set_decisions(guess, own.data(), parameters.data());
  return guess;
}

}  // namespace

SmoothedRun FullInformationEstimation::estimate(NodeLog log, Clock::time_point deadline) const {
  clean(log);
  const int N = log.intervals(), nx = model_->state_count(), nu = model_->input_count(), np = model_->parameter_count();
  if (N < 1) throw Error("smoother: the log has fewer than two nodes; there is nothing between them to estimate");
  RheProblem::Setup problem_setup = setup_.problem;
  problem_setup.max_intervals = N;
  problem_setup.most_between = log.most_between();
  problem_setup.one_block = one_block_parameters(setup_.blockings);
  for (int j = 0; j < np; ++j)
    if (const std::string reason = setup_.blockings[j]->why_not(N); !reason.empty())
      throw Error(fmt::format("blocking of '{}': {}", model_->description().parameters[j].name, reason));
  InputWalks walks(model_, problem_setup, log);
  RheProblem problem(walks.model(), walks.setup(problem_setup));
  std::vector<std::int64_t> first_starts(np, 0);
  std::vector<std::uint8_t> begins(N, 0);
  set_block_structure({0, N}, setup_.blockings, setup_.walks, first_starts, begins, problem);
  fill_data(log, nu, problem);
  // An arrival cost filters with the vehicle itself.
  RheProblem::Setup of_start = problem_setup;
  of_start.max_intervals = 1;
  RheProblem start_problem(model_, of_start);
  ArrivalCost prior(ArrivalKind::constant, start_problem, setup_.walks);
  prior.reset(setup_.initial_mean, setup_.initial_covariance);
  prior.write(start_problem);
  walks.add_start(start_problem.arrival_mean, start_problem.arrival_information);
  problem.arrival_mean = start_problem.arrival_mean;
  problem.arrival_information = start_problem.arrival_information;
  if (const std::string reason = solver_->why_not(problem); !reason.empty())
    throw Error("smoother: the solver cannot take this problem: " + reason);
  solver_->setup(problem);

  Iterate iterate = guess_from(log, *model_, walks, problem);
  std::vector<double> held(static_cast<std::size_t>(np));
  for (int i = 0; i < N; ++i) {
    problem.structure().parameters_on(iterate, i, held.data());
    walks.write(i, held.data(), problem.interval_data(i), problem.measured_input(i));
  }
  SmoothedRun run;
  const auto start = Clock::now();
  run.report = solver_->solve(iterate, deadline);
  run.solve_seconds = 1e-6 * microseconds_since(start);
  run.times.assign(1, 0.0);
  run.inputs.resize(static_cast<std::size_t>(N) * nu);
  run.parameters.resize(static_cast<std::size_t>(N) * np);
  for (std::ptrdiff_t i = 0; i <= N; ++i) {
    const int node = static_cast<int>(i);
    run.states.insert(run.states.end(), iterate.state(node), iterate.state(node) + nx);
    if (i == N) break;
    run.times.push_back(run.times.back() + log.durations[i]);
    problem.structure().inputs_on(iterate, node, run.inputs.data() + i * nu);
    walks.to_acting(iterate.state(node + 1) + nx, run.inputs.data() + i * nu);
    problem.structure().parameters_on(iterate, node, run.parameters.data() + i * np);
    for (int j = 0; j < np; ++j) {
      const bool ramp = setup_.blockings[j]->transition() == Transition::ramp;
      run.start_parameters.push_back(ramp ? iterate.state(node)[nx + walks.count() + j] : run.parameters[i * np + j]);
    }
  }
  for (std::ptrdiff_t i = 0; i <= N; ++i) {
    const auto row = run.parameters.begin() + std::max<std::ptrdiff_t>(i - 1, 0) * np;
    run.node_parameters.insert(run.node_parameters.end(), row, row + np);
  }
  const std::ptrdiff_t n = nx + np, K = walks.count(), wide = n + K;
  std::vector<double> covariances(static_cast<std::size_t>((N + 1) * wide * wide));
  if (!solver_->covariances(iterate, all_stages(problem), covariances)) return run;
  const auto place = [&](std::ptrdiff_t k) { return k < nx ? k : k + K; };
  for (std::ptrdiff_t i = 0; i <= N; ++i)
    for (std::ptrdiff_t c = 0; c < n; ++c)
      for (std::ptrdiff_t r = 0; r < n; ++r)
        run.covariances.push_back(covariances[static_cast<std::size_t>((i * wide + place(c)) * wide + place(r))]);
  return run;
}

}  // namespace rhec
