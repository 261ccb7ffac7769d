#include "long_problems.hpp"

#include <algorithm>
#include <cmath>
#include <random>

#include "rhec/core/horizon/rhc_problem.hpp"
#include "rhec/core/horizon/rhe_problem.hpp"
#include "rhec/plugins/yaml/yaml.hpp"

namespace rhec::bench {
namespace {

constexpr double step = 0.2;         // [s]
constexpr double steering = 0.61;    // largest steering angle [rad]
constexpr double kappa_walk = 0.05;  // standard deviation from block to block

/// The true states, inputs and parameters, by node and interval.
struct DriveOfTruth {
  std::vector<std::array<double, 4>> states;
  std::vector<std::array<double, 2>> inputs, parameters;
};

DriveOfTruth drive_truth(const Model& model, int intervals, int block) {
  std::mt19937 random(1);  // NOLINT(cert-msc32-c,cert-msc51-cpp): the same drive each time
  std::normal_distribution<double> normal;
  DriveOfTruth drive;
  drive.states.push_back({0.0, 0.0, 0.3, 0.05});
  double kappa = 0.7;
  for (int i = 0; i < intervals; ++i) {
    if (i % block == 0) kappa = std::clamp(kappa + kappa_walk * normal(random), 0.6, 0.8);
    drive.inputs.push_back({2.0 + 0.3 * std::sin(0.05 * i), 0.06 * std::cos(0.1 * i)});
    drive.parameters.push_back({kappa, 0.9});
    std::array<double, 4> next{};
    model.integrate({.count = 1,
                     .states = drive.states.back().data(),
                     .inputs = drive.inputs.back().data(),
                     .parameters = drive.parameters.back().data(),
                     .durations = &step,
                     .next_states = next.data()});
    drive.states.push_back(next);
  }
  return drive;
}

std::shared_ptr<const Model> bicycle(const Host& host) {
  return host.make_model("bicycle_slip", parse_yaml("{outputs: [x_gps, y_gps, delta]}", "benchmark"));
}

/// Writes the true drive from node `first` on as an iterate of a problem.
void write_truth(const DriveOfTruth& drive, int first, const HorizonProblem& problem, Iterate& point) {
  const int N = problem.intervals();
  point.clear_multipliers();
  std::copy_n(drive.states[first].data(), 4, point.state(0));
  std::copy_n(drive.parameters[first].data(), 2, point.state(0) + 4);
  problem.structure().set_decisions(point, drive.inputs[first].data(), drive.parameters[first].data());
  for (int i = 1; i <= N; ++i) std::copy_n(drive.states[first + i].data(), 4, point.state(i));
}

void finish(Sequence& sequence, const DriveOfTruth& drive) {
  sequence.start = Iterate(sequence.workspace->capacity());
  write_truth(drive, 0, *sequence.workspace, sequence.start);
}

}  // namespace

Sequence long_estimation(const Host& host, int intervals, int samples, int block, Blocks blocks) {
  Sequence made{.name = "long/rhe/" + std::to_string(intervals), .kind = "rhe", .model = bicycle(host)};
  const DriveOfTruth drive = drive_truth(*made.model, intervals + samples, block);
  const std::array<double, 3> output_sigma = {0.03, 0.03, 0.01745};
  const double input_sigma = 0.1;
  RheProblem::Setup setup;
  setup.max_intervals = intervals;
  for (const double sigma : output_sigma) setup.output_weights.push_back(1.0 / (sigma * sigma));
  setup.input_weights.assign(2, 1.0 / (input_sigma * input_sigma));
  setup.state_lower = {-INFINITY, -INFINITY, -INFINITY, -steering};
  setup.state_upper = {INFINITY, INFINITY, INFINITY, steering};

  std::mt19937 random(2);  // NOLINT(cert-msc32-c,cert-msc51-cpp): the same noise each time
  std::normal_distribution<double> normal;
  std::vector<std::array<double, 3>> outputs;
  std::vector<std::array<double, 2>> inputs;
  for (const auto& state : drive.states) {
    outputs.emplace_back();
    made.model->observe({.count = 1, .states = state.data(), .outputs = outputs.back().data()});
    for (int j = 0; j < 3; ++j) outputs.back()[j] += output_sigma[j] * normal(random);
  }
  for (const auto& input : drive.inputs)
    inputs.push_back({input[0] + input_sigma * normal(random), input[1] + input_sigma * normal(random)});

  for (int first = 0; first < samples; ++first) {
    auto problem = std::make_unique<RheProblem>(made.model, setup);
    problem->set_intervals(intervals);
    for (int j = 0; j < 4; ++j) problem->arrival_mean[j] = drive.states[first][j];
    problem->arrival_mean[4] = problem->arrival_mean[5] = 0.75;
    problem->arrival_information.setIdentity();
    problem->arrival_information *= 10.0;
    for (int i = 0; i <= intervals; ++i) std::copy_n(outputs[first + i].data(), 3, problem->output(i));
    for (int i = 0; i < intervals; ++i) std::copy_n(inputs[first + i].data(), 2, problem->measured_input(i));
    std::vector<std::uint8_t> begins(intervals, 0), never(intervals, 0);
    for (int i = 0; i < intervals; ++i) {
      problem->set_duration(i, step);
      begins[i] = ((blocks == Blocks::moving ? first : 0) + i) % block == 0;
    }
    problem->set_blocks(0, begins.data(), Transition::step);
    problem->set_blocks(1, never.data(), Transition::step);
    for (int i = 1; i < intervals; ++i)
      if (begins[i]) problem->link(i, 0, kappa_walk * kappa_walk);
    problem->finish();
    if (first == 0) made.workspace = std::make_unique<RheProblem>(*problem);
    made.samples.push_back({std::move(problem), first > 0});
  }
  finish(made, drive);
  return made;
}

Sequence long_control(const Host& host, int intervals, int samples) {
  Sequence made{.name = "long/rhc/" + std::to_string(intervals), .kind = "rhc", .model = bicycle(host)};
  const DriveOfTruth drive = drive_truth(*made.model, intervals + samples, intervals + samples);
  RhcProblem::Setup setup;
  setup.max_intervals = intervals;
  setup.state_weights = {1.0, 1.0, 0.0, 0.0};
  setup.terminal_weights = {10.0, 10.0, 0.0, 0.0};
  setup.input_weights = {5.0, 5.0};
  setup.state_lower = {-INFINITY, -INFINITY, -INFINITY, -steering};
  setup.state_upper = {INFINITY, INFINITY, INFINITY, steering};
  setup.input_lower = {0.0, -steering};
  setup.input_upper = {6.0, steering};
  for (int first = 0; first < samples; ++first) {
    auto problem = std::make_unique<RhcProblem>(made.model, setup);
    problem->set_intervals(intervals);
    for (int j = 0; j < 4; ++j) problem->given_state()[j] = drive.states[first][j] + 0.01 * std::sin(1.0 + first + j);
    std::copy_n(drive.parameters[first].data(), 2, problem->given_parameters());
    for (int i = 0; i <= intervals; ++i) std::copy_n(drive.states[first + i].data(), 4, problem->state_reference(i));
    for (int i = 0; i < intervals; ++i) std::copy_n(drive.inputs[first + i].data(), 2, problem->input_reference(i));
    for (int i = 0; i < intervals; ++i) problem->set_duration(i, step);
    std::vector<double> scratch(problem->scratch_size());
    problem->finish(scratch);
    if (first == 0) made.workspace = std::make_unique<RhcProblem>(*problem);
    made.samples.push_back({std::move(problem), first > 0});
  }
  finish(made, drive);
  return made;
}

}  // namespace rhec::bench
