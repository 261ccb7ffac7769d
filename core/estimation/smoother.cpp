#include "rhec/core/estimation/smoother.hpp"

#include <algorithm>
#include <cmath>
#include <cstddef>

namespace rhec {
namespace {

constexpr double unknown_heading = 0.5;  // [rad]

/// The last node that is not later; the first one, if all are.
std::ptrdiff_t node_before(const SmoothedRun& run, double time) {
  const auto after = std::upper_bound(run.times.begin(), run.times.end(), time);
  return std::max<std::ptrdiff_t>(0, after - run.times.begin() - 1);
}

}  // namespace

void NodeRecorder::append_outputs(Measured outputs) {
  const int ny = model().output_count();
  if (outputs.weights) log_->weights.resize(log_->outputs.size(), 1.0);
  log_->outputs.insert(log_->outputs.end(), outputs.values, outputs.values + ny);
  if (outputs.weights) log_->weights.insert(log_->weights.end(), outputs.weights, outputs.weights + ny);
  if (!log_->weights.empty()) log_->weights.resize(log_->outputs.size(), 1.0);
  log_->states.resize(log_->states.size() + static_cast<std::size_t>(model().state_count()), std::nan(""));
  log_->parameters.resize(log_->parameters.size() + static_cast<std::size_t>(model().parameter_count()), std::nan(""));
}

void NodeRecorder::start(Measured outputs) noexcept {
  method_->start(outputs);
  *log_ = {};
  append_outputs(outputs);
  started_ = true;
}

void NodeRecorder::add(const MeasuredInterval& interval, Measured outputs) noexcept {
  if (!started_) {
    start(outputs);
    return;
  }
  method_->add(interval, outputs);
  const int ny = model().output_count();
  if (!(interval.duration > 0.0) || !std::isfinite(interval.duration)) {
    const std::size_t newest = static_cast<std::size_t>(log_->intervals()) * static_cast<std::size_t>(ny);
    if (outputs.weights) log_->weights.resize(log_->outputs.size(), 1.0);
    for (int j = 0; j < ny; ++j) {
      if (std::isnan(outputs[j])) continue;
      log_->outputs[newest + j] = outputs[j];
      if (!log_->weights.empty()) log_->weights[newest + j] = outputs.weight(j);
    }
    return;
  }
  log_->durations.push_back(interval.duration);
  log_->inputs.insert(log_->inputs.end(), interval.inputs, interval.inputs + model().input_count());
  log_->between.emplace_back(ny, interval.between);
  log_->between.back().assign(interval);
  append_outputs(outputs);
}

void NodeRecorder::rewind(int nodes) noexcept {
  method_->rewind(nodes);
  const int left = log_->intervals() - nodes;
  if (left < 0) {
    *log_ = {};
    started_ = false;
    return;
  }
  const auto cut = [](std::vector<double>& rows, int count, int width) {
    rows.resize(static_cast<std::size_t>(count) * static_cast<std::size_t>(width));
  };
  log_->durations.resize(static_cast<std::size_t>(left));
  log_->between.erase(log_->between.begin() + left, log_->between.end());
  cut(log_->inputs, left, model().input_count());
  cut(log_->outputs, left + 1, model().output_count());
  if (!log_->weights.empty()) cut(log_->weights, left + 1, model().output_count());
  cut(log_->states, left + 1, model().state_count());
  cut(log_->parameters, left + 1, model().parameter_count());
}

int NodeLog::most_between() const noexcept {
  int most = 0;
  for (const BetweenNodes& each : between) most = std::max(most, each.count());
  return most;
}

MeasuredInterval NodeLog::interval(int i, int input_count) const noexcept {
  const auto at = static_cast<std::size_t>(i);
  const double* const of_interval = inputs.data() + static_cast<std::ptrdiff_t>(i) * input_count;
  return between.empty() ? MeasuredInterval{durations[at], of_interval} : between[at].over(durations[at], of_interval);
}

void NodeRecorder::estimate(Estimate& result, Clock::time_point deadline) noexcept {
  method_->estimate(result, deadline);
  // What is guessed of a vehicle that may head anywhere is no start.
  const int heading = model().description().roles.heading;
  if (heading >= 0 && heading < result.covariance.rows() &&
      result.covariance(heading, heading) > unknown_heading * unknown_heading)
    return;
  const auto node = static_cast<std::ptrdiff_t>(log_->intervals());
  std::copy_n(result.state.data(), result.state.size(), log_->states.data() + node * result.state.size());
  std::copy_n(result.parameters.data(), result.parameters.size(),
              log_->parameters.data() + node * result.parameters.size());
}

void NodeRecorder::reset() noexcept {
  method_->reset();
  *log_ = {};
  started_ = false;
}

void state_at(const SmoothedRun& run, const Model& model, int substeps, double time, double* state) {
  const int nx = model.state_count();
  const std::ptrdiff_t node = node_before(run, time);
  const double* from = run.states.data() + node * nx;
  const double duration = time - run.times[node];
  if (node == run.intervals() || !(duration > 0.0)) {
    std::copy_n(from, nx, state);
    return;
  }
  Model::Intervals request;
  request.count = 1;
  request.states = from;
  request.inputs = run.inputs.data() + node * model.input_count();
  // On a ramp: the fraction of the interval that has elapsed.
  const int np = model.parameter_count();
  const double share = duration / (run.times[node + 1] - run.times[node]);
  std::vector<double> ends(np);
  for (int j = 0; j < np; ++j) {
    const double start = run.start_parameters[node * np + j];
    ends[j] = start + share * (run.parameters[node * np + j] - start);
  }
  request.parameters = run.start_parameters.data() + node * np;
  request.parameters_end = ends.data();
  request.durations = &duration;
  request.substeps = substeps;
  request.next_states = state;
  model.integrate(request);
}

void parameters_at(const SmoothedRun& run, int parameter_count, double time, double* parameters) {
  const std::ptrdiff_t interval = std::min<std::ptrdiff_t>(node_before(run, time), run.intervals() - 1);
  const double from = run.times[interval], length = run.times[interval + 1] - from;
  const double share = std::clamp((time - from) / length, 0.0, 1.0);
  for (int j = 0; j < parameter_count; ++j) {
    const double start = run.start_parameters[interval * parameter_count + j];
    parameters[j] = start + share * (run.parameters[interval * parameter_count + j] - start);
  }
}

}  // namespace rhec
