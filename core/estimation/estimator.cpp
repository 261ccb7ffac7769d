#include "rhec/core/estimation/estimator.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>

#include <fmt/format.h>

#include "rhec/core/base/error.hpp"
#include "rhec/core/estimation/measurement.hpp"

namespace rhec {
namespace {

constexpr int checked_interval = 16;  // of so many, the integration of one is checked
constexpr int most_parts = 1000;      // largest number of parts of one prediction

NodeGrid::Setup grid_setup(const EstimationMethod& method, const Estimator::Timeline& timeline) {
  if (!(timeline.longest_interval > 0.0))
    throw Error(fmt::format("estimator: longest interval {} s; expected a positive number", timeline.longest_interval));
  if (!(timeline.tolerance >= 0.0 && timeline.tolerance < timeline.longest_interval))
    throw Error(fmt::format("estimator: tolerance {} s; expected a number from 0 to below the longest interval, {} s",
                            timeline.tolerance, timeline.longest_interval));
  if (!timeline.delays.empty() && std::ssize(timeline.delays) != method.model().output_count())
    throw Error(fmt::format("estimator: {} delays given; expected {}, one an output, or none", timeline.delays.size(),
                            method.model().output_count()));
  for (const double delay : timeline.delays)
    if (!std::isfinite(delay)) throw Error("estimator: a delay that is not finite");
  if (timeline.capacity < 1) throw Error("estimator: capacity 0; expected room for at least 1 row");
  const Model& model = method.model();
  return {.step = timeline.longest_interval,
          .tolerance = timeline.tolerance,
          .capacity = timeline.capacity,
          .outputs = model.output_count(),
          .inputs = model.input_count(),
          .noises = static_cast<int>(model.description().noisy_states.size()),
          .most_between = method.most_between(),
          .reach = method.most_reach()};
}

/// Number of equal parts of a duration, each at most `longest`.
int parts_of(double duration, double longest) noexcept {
  const double parts = std::ceil(duration / longest - 1e-6);
  return parts < most_parts ? std::max(1, static_cast<int>(parts)) : most_parts;
}

}  // namespace

Estimator::Estimator(std::unique_ptr<EstimationMethod> method, const Timeline& timeline)
    : method_(std::move(method)),
      timeline_(timeline),
      grid_(grid_setup(*method_, timeline)),
      step_error_(method_->model()) {
  const Model& m = method_->model();
  clear_estimates();
  input_.assign(m.input_count(), 0.0);
  measured_inputs_ = input_.size() - m.description().noisy_states.size();
  next_.assign(m.state_count(), 0.0);
  values_.assign(std::max(m.output_count(), m.input_count()), 0.0);
  delayed_.assign(m.output_count(), 0.0);
}

void Estimator::clear_estimates() noexcept {
  const Model& m = method_->model();
  const int n = m.state_count() + m.parameter_count();
  for (Estimate* e : {&estimate_, &predicted_}) {
    e->time = 0.0;
    e->state.setZero(m.state_count());
    e->parameters.setZero(m.parameter_count());
    e->covariance.setZero(n, n);
    e->report = {};
    e->fallback = e->predicted = false;
  }
}

void Estimator::reset() noexcept {
  method_->reset();
  grid_.clear();
  clear_estimates();
  stale_ = false;
  counts_ = {};
  worst_error_ = 0.0;
}

void Estimator::push_measurement(double time, const double* outputs) noexcept {
  for (int j = 0; j < model().output_count(); ++j) {
    values_[j] = cleaned(outputs[j]);
    counts_.missing += std::isnan(values_[j]);
  }
  if (!std::isfinite(time)) {
    ++counts_.dropped;
    return;
  }
  // Where delays differ, single outputs go to times of their own.
  const std::vector<double>& delays = timeline_.delays;
  if (delays.empty() || std::ranges::all_of(delays, [&](double each) { return each == delays.front(); }))
    return push(time - (delays.empty() ? 0.0 : delays.front()), values_.data());
  for (std::size_t first = 0; first < delays.size(); ++first) {
    if (std::find(delays.begin(), delays.begin() + first, delays[first]) != delays.begin() + first) continue;
    bool any = false;
    for (std::size_t j = 0; j < delays.size(); ++j) {
      delayed_[j] = delays[j] == delays[first] ? values_[j] : missing_value;
      any = any || !std::isnan(delayed_[j]);
    }
    if (any) push(time - delays[first], delayed_.data());
  }
}

void Estimator::push(double time, const double* outputs) noexcept {
  const std::int64_t dropped = grid_.dropped();
  const NodeGrid::Place place = grid_.push_measurement(time, outputs, method_->reach());
  if (place == NodeGrid::Place::late) ++counts_.late;
  counts_.dropped += grid_.dropped() - dropped;
}

void Estimator::push_input(double time, const double* inputs) noexcept {
  if (!std::isfinite(time)) return;
  for (std::size_t j = 0; j < measured_inputs_; ++j) values_[j] = cleaned(inputs[j]);
  grid_.push_input(time, values_.data());
}

/// Makes the nodes of all that is stamped up to a time, those anew that it has changed.
void Estimator::take_in(double until) noexcept {
  if (const int outdated = grid_.outdated(until, method_->reach()); outdated > 0) {
    method_->rewind(outdated);
    grid_.take_back(outdated);
    counts_.nodes -= outdated;
    stale_ = true;
  }
  bool any = false;
  for (; grid_.make_next(until); any = true) add_node();
  if (any) grid_.settle(method_->reach());
}

void Estimator::add_node() noexcept {
  if (grid_.count() == 1) {
    method_->start(grid_.outputs());
  } else {
    method_->add(grid_.interval(), grid_.outputs());
  }
  ++counts_.nodes;
  stale_ = true;
}

void Estimator::predict_to(double time) noexcept {
  const double last = grid_.time();
  predicted_ = estimate_;
  predicted_.predicted = true;
  std::copy_n(grid_.mean_input(last, time), input_.size(), input_.begin());
  for (double& u : input_)
    if (std::isnan(u)) u = 0.0;
  const double duration = time - last;
  Model::Intervals request;
  request.count = 1;
  request.states = estimate_.state.data();
  request.inputs = input_.data();
  request.parameters = estimate_.parameters.data();
  request.durations = &duration;
  request.substeps = method_->substeps() * parts_of(duration, timeline_.longest_interval);
  request.next_states = next_.data();
  method_->model().integrate(request);
  predicted_.time = time;
  if (std::all_of(next_.begin(), next_.end(), [](double value) { return std::isfinite(value); }))
    std::copy(next_.begin(), next_.end(), predicted_.state.data());
}

/// Holds the newest interval's steps against twice as many, from the newest node on: what the vehicle does there can be
/// faster than what was foreseen at set-up.
void Estimator::check_integration() noexcept {
  if (grid_.count() < 2) return;
  const MeasuredInterval interval = grid_.interval();
  std::copy_n(interval.inputs, input_.size(), input_.begin());
  for (double& u : input_)
    if (std::isnan(u)) u = 0.0;
  int state = -1;
  const double error = step_error_(estimate_.state.data(), input_.data(), estimate_.parameters.data(),
                                   interval.duration, method_->substeps(), &state);
  ++counts_.integrated;
  if (!(error > coarse_error)) return;
  ++counts_.coarse;
  if (error <= worst_error_) return;
  worst_error_ = error;
  counts_.coarse_state = state;
}

void Estimator::prepare() noexcept {
  // A node that gives way to the next measurement is taken back first, and with it what was prepared.
  if (!grid_.ends_open()) method_->prepare();
}

const Estimate& Estimator::estimate(double time, Clock::time_point deadline) noexcept {
  if (has_started() || !std::isnan(time)) take_in(has_started() && !(time > grid_.time()) ? grid_.time() : time);
  if (!has_started()) return estimate_;
  if (stale_) {
    method_->estimate(estimate_, deadline);
    estimate_.time = grid_.time();
    stale_ = false;
    ++counts_.estimates;
    counts_.fallbacks += estimate_.fallback;
    if (counts_.estimates % checked_interval == 0) check_integration();
  }
  if (!std::isfinite(time) || time <= estimate_.time + timeline_.tolerance) return estimate_;
  predict_to(time);
  return predicted_;
}

}  // namespace rhec
