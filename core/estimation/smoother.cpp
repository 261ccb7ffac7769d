#include "rhec/core/estimation/smoother.hpp"

#include <algorithm>
#include <cmath>
#include <cstddef>

namespace rhec {
namespace {

/// The last node that is not later; the first one, if all are.
std::ptrdiff_t node_before(const SmoothedRun& run, double time) {
  const auto after = std::upper_bound(run.times.begin(), run.times.end(), time);
  return std::max<std::ptrdiff_t>(0, after - run.times.begin() - 1);
}

}  // namespace

void NodeRecorder::append_outputs(const double* outputs) {
  const int ny = model().output_count();
  log_->outputs.insert(log_->outputs.end(), outputs, outputs + ny);
  log_->states.resize(log_->states.size() + static_cast<std::size_t>(model().state_count()), std::nan(""));
  log_->parameters.resize(log_->parameters.size() + static_cast<std::size_t>(model().parameter_count()), std::nan(""));
}

void NodeRecorder::start(const double* outputs) noexcept {
  method_->start(outputs);
  *log_ = {};
  append_outputs(outputs);
  started_ = true;
}

void NodeRecorder::add_node(double duration, const double* inputs, const double* outputs) noexcept {
  if (!started_) {
    start(outputs);
    return;
  }
  method_->add_node(duration, inputs, outputs);
  if (!(duration > 0.0) || !std::isfinite(duration)) return;
  log_->durations.push_back(duration);
  log_->inputs.insert(log_->inputs.end(), inputs, inputs + model().input_count());
  append_outputs(outputs);
}

bool NodeRecorder::amend(int back, const double* outputs) noexcept {
  if (!method_->amend(back, outputs)) return false;
  const int ny = model().output_count();
  double* row = log_->outputs.data() + static_cast<std::ptrdiff_t>(log_->intervals() - back) * ny;
  for (int j = 0; j < ny; ++j)
    if (!std::isnan(outputs[j])) row[j] = outputs[j];
  return true;
}

void NodeRecorder::estimate(Estimate& result, Clock::time_point deadline) noexcept {
  method_->estimate(result, deadline);
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
