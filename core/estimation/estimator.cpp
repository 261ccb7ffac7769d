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

constexpr std::size_t remembered_nodes = 1024;
constexpr int checked_interval = 16;  // of so many, the integration of one is checked
constexpr int most_parts = 1000;      // largest number of parts of one gap, or of one prediction

/// Number of equal parts of a duration, each at most `longest`.
int parts_of(double duration, double longest) noexcept {
  const double parts = std::ceil(duration / longest - 1e-6);
  return parts < most_parts ? std::max(1, static_cast<int>(parts)) : most_parts;
}

}  // namespace

Estimator::Rows::Rows(std::size_t capacity, int width)
    // Space for twice the rows, so that rows are moved to the front only once in `capacity` drops.
    : capacity_(capacity), width_(width), times_(2 * capacity), values_(2 * capacity * width) {}

bool Estimator::Rows::insert(double time, const double* values) noexcept {
  const bool full = count_ == capacity_;
  if (full) drop_front(1);
  if (first_ + count_ == times_.size()) {
    std::move(times_.begin() + first_, times_.end(), times_.begin());
    std::move(values_.begin() + first_ * width_, values_.end(), values_.begin());
    first_ = 0;
  }
  std::size_t at = first_ + count_;
  for (; at > first_ && times_[at - 1] > time; --at) {
    times_[at] = times_[at - 1];
    std::copy_n(values_.begin() + (at - 1) * width_, width_, values_.begin() + at * width_);
  }
  times_[at] = time;
  std::copy_n(values, width_, values_.begin() + at * width_);
  ++count_;
  return !full;
}

void Estimator::Rows::drop_front(std::size_t rows) noexcept {
  first_ += rows;
  count_ -= rows;
  if (count_ == 0) first_ = 0;
}

Estimator::Estimator(std::unique_ptr<EstimationMethod> method, const Timeline& timeline)
    : method_(std::move(method)),
      timeline_(timeline),
      measurements_(timeline.capacity, method_->model().output_count()),
      inputs_(timeline.capacity, method_->model().input_count()),
      step_error_(method_->model()) {
  if (!(timeline.longest_interval > 0.0))
    throw Error(fmt::format("estimator: longest interval {} s; expected a positive number", timeline.longest_interval));
  if (!(timeline.tolerance >= 0.0 && timeline.tolerance < timeline.longest_interval))
    throw Error(fmt::format("estimator: tolerance {} s; expected a number from 0 to below the longest interval, {} s",
                            timeline.tolerance, timeline.longest_interval));
  if (timeline.capacity < 1) throw Error("estimator: capacity 0; expected room for at least 1 row");
  const Model& m = method_->model();
  clear_estimates();
  node_times_.assign(remembered_nodes, 0.0);
  mean_.assign(m.input_count(), 0.0);
  measured_inputs_ = mean_.size() - m.description().noisy_states.size();
  weight_.assign(m.input_count(), 0.0);
  nothing_.assign(m.output_count(), std::numeric_limits<double>::quiet_NaN());
  next_.assign(m.state_count(), 0.0);
  values_.assign(std::max(m.output_count(), m.input_count()), 0.0);
}

Estimator::Estimator(std::unique_ptr<EstimationMethod> method, const Timeline& timeline,
                     std::unique_ptr<SensorWatch> watch)
    : Estimator(std::move(method), timeline) {
  watch_ = std::move(watch);
  const std::size_t sensors = watch_->sensors().size();
  clocks_ =
      std::make_unique<Clocks>(static_cast<int>(sensors) + 1,
                               Clocks::Setup{.usual_interval = timeline.longest_interval, .behind = timeline.behind});
  silent_.assign(sensors, 0);
  input_sigmas_.assign(mean_.size(), 0.0);
  late_ = nothing_;
  for (Estimate* e : {&estimate_, &predicted_}) assess(*e, 0.0);
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
  measurements_.clear();
  inputs_.clear();
  clear_estimates();
  started_ = stale_ = false;
  newest_ = 0;
  counts_ = {};
  worst_error_ = 0.0;
  watched_ = 0.0;
  if (!watch_) return;
  watch_->reset();
  clocks_->reset();
}

bool Estimator::reset(const Eigen::VectorXd& mean, const Eigen::MatrixXd& covariance) noexcept {
  const Eigen::Index n = model().state_count() + model().parameter_count();
  const bool fits = mean.size() == n && covariance.rows() == n && covariance.cols() == n;
  if (!started_ || !fits || !mean.allFinite() || !covariance.allFinite()) return false;
  if (!method_->rebase(mean, covariance)) return false;
  if (watch_) watch_->restart(mean, covariance);
  stale_ = true;
  return true;
}

double Estimator::place_on_timeline(double stamp, int source) noexcept {
  if (!clocks_) return stamp;
  const double time = clocks_->take(source, stamp);
  counts_.clocks_set = clocks_->settings();
  return time;
}

/// The clock of a row is that of the first sensor in it.
double Estimator::place_on_timeline(double stamp, const double* outputs) noexcept {
  double time = stamp;
  bool is_placed = false;
  for (std::size_t s = 0; s < watch_->sensors().size(); ++s) {
    const std::vector<int>& all = watch_->sensors()[s].outputs;
    if (std::all_of(all.begin(), all.end(), [&](int j) { return std::isnan(outputs[j]); })) continue;
    const int source = static_cast<int>(s);
    if (!is_placed) {
      time = place_on_timeline(stamp, source);
    } else if (std::isfinite(time)) {
      clocks_->also(source, time);
    }
    is_placed = true;
  }
  return time;
}

void Estimator::push_measurement(double time, const double* outputs) noexcept {
  for (std::size_t j = 0; j < nothing_.size(); ++j) {
    values_[j] = cleaned(outputs[j]);
    counts_.missing += std::isnan(values_[j]);
  }
  outputs = values_.data();
  if (watch_) time = place_on_timeline(time, outputs);
  if (!std::isfinite(time)) {
    ++counts_.dropped;
    return;
  }
  const double newest_time = node_times_[newest_ % remembered_nodes];
  if (!started_ || time > newest_time + timeline_.tolerance) {
    if (!measurements_.insert(time, outputs)) ++counts_.dropped;
    return;
  }
  if (watch_) watch_->judge_late(time, values_.data());
  if (!take_late(time, outputs)) ++counts_.dropped;
}

/// Merges outputs into the node at their time. False if there is none within reach.
bool Estimator::take_late(double time, const double* outputs) noexcept {
  for (std::size_t back = 0; back <= std::min(newest_, remembered_nodes - 1); ++back) {
    if (std::abs(node_times_[(newest_ - back) % remembered_nodes] - time) > timeline_.tolerance) continue;
    if (!method_->amend(static_cast<int>(back), outputs)) return false;
    ++counts_.late;
    stale_ = true;
    return true;
  }
  return false;
}

void Estimator::push_input(double time, const double* inputs) noexcept {
  if (clocks_) time = place_on_timeline(time, static_cast<int>(watch_->sensors().size()));
  if (!std::isfinite(time)) return;
  for (std::size_t j = 0; j < measured_inputs_; ++j) values_[j] = cleaned(inputs[j]);
  if (watch_) watch_->clean_inputs(values_.data());
  inputs_.insert(time, values_.data());
}

/// Mean over an interval of inputs that hold from their stamps on; NaN if none is known.
void Estimator::mean_input(double from, double to) noexcept {
  std::fill(mean_.begin(), mean_.end(), 0.0);
  std::fill(weight_.begin(), weight_.end(), 0.0);
  for (std::size_t i = 0; i < inputs_.size(); ++i) {
    const double start = std::max(inputs_.time(i), from);
    const double end = i + 1 < inputs_.size() ? std::min(inputs_.time(i + 1), to) : to;
    if (inputs_.time(i) >= to - timeline_.tolerance) break;
    const double seconds = end - start;
    if (seconds <= 0.0) continue;
    for (std::size_t j = 0; j < mean_.size(); ++j) {
      const double value = inputs_.values(i)[j];
      if (std::isnan(value)) continue;
      mean_[j] += value * seconds;
      weight_[j] += seconds;
    }
  }
  for (std::size_t j = 0; j < mean_.size(); ++j)
    mean_[j] = weight_[j] > 0.0 ? mean_[j] / weight_[j] : std::numeric_limits<double>::quiet_NaN();
  std::fill(mean_.begin() + static_cast<std::ptrdiff_t>(measured_inputs_), mean_.end(), 0.0);
}

void Estimator::add_node(double time, const double* outputs) noexcept {
  if (!started_) {
    method_->start(outputs);
    started_ = true;
    newest_ = 0;
  } else {
    const double last = node_times_[newest_ % remembered_nodes];
    mean_input(last, time);
    method_->add_node(time - last, mean_.data(), outputs);
    ++newest_;
  }
  node_times_[newest_ % remembered_nodes] = time;
  ++counts_.nodes;
  stale_ = true;
  // Of the input rows before this node, only the last one still holds.
  std::size_t used = 0;
  while (used + 1 < inputs_.size() && inputs_.time(used + 1) <= time) ++used;
  inputs_.drop_front(used);
}

void Estimator::add_nodes_until(double time, const double* outputs) noexcept {
  if (started_) {
    const double last = node_times_[newest_ % remembered_nodes];
    const int parts = parts_of(time - last, timeline_.longest_interval);
    for (int i = 1; i < parts; ++i) add_node(last + (time - last) * i / parts, nothing_.data());
  }
  add_node(time, outputs);
}

/// Judges a row before it is used; what fails becomes NaN.
SensorWatch::Finding Estimator::judge(double time, double* outputs) noexcept {
  if (!watch_ || !started_) return {};
  const double newest_input = clocks_->newest(static_cast<int>(watch_->sensors().size()));
  if (time - newest_input > longest_silence(static_cast<int>(watch_->sensors().size()))) {
    through_unknown_motion(watched_, time,
                           [&](double duration) { watch_->advance(duration, mean_.data(), input_sigmas_.data()); });
  } else {
    mean_input(watched_, time);
    watch_->advance(time - watched_, mean_.data());
  }
  watched_ = time;
  const SensorWatch::Finding finding = watch_->judge(time, outputs);
  counts_.rejected = 0;
  for (const SensorHealth& sensor : watch_->sensor_states()) counts_.rejected += sensor.rejected;
  return finding;
}

/// After so long without a word a source is silent [s].
double Estimator::longest_silence(int source) const noexcept {
  constexpr double least_silence = 1.0, usual_intervals = 5.0;
  return std::max(least_silence, usual_intervals * clocks_->usual_interval(source));
}

/// Goes through a time in parts, each with its mean input and how much that may be off besides its noise. An input
/// holds; the longer nobody has said so again, the less it is known: within a second it may change by its typical
/// magnitude, and stay there.
template <class Function>
void Estimator::through_unknown_motion(double from, double to, const Function& advance) noexcept {
  const int parts = parts_of(to - from, timeline_.longest_interval);
  const int source = static_cast<int>(watch_->sensors().size());
  const double newest_input = clocks_->newest(source), usual = clocks_->usual_interval(source);
  const std::vector<Variable>& inputs = model().description().inputs;
  double known = 0.0;  // squared age of the last part, in parts
  for (int i = 0; i < parts; ++i) {
    const double begin = from + (to - from) * i / parts, end = from + (to - from) * (i + 1) / parts;
    mean_input(begin, end);
    for (std::size_t j = 0; j < measured_inputs_; ++j)
      if (std::isnan(mean_[j])) mean_[j] = 0.0;
    const double age = std::isnan(newest_input) ? end - from : std::max(0.0, end - newest_input - usual);
    const double aged = age / (end - begin);  // in parts
    for (std::size_t j = 0; j < measured_inputs_; ++j) {
      const double sigma = inputs[j].scale * std::min(1.0, age);
      // An offset that stays adds up to t^2, not t: each part has what the square grows by.
      input_sigmas_[j] = sigma * std::sqrt(std::max(0.0, aged * aged - known));
    }
    known = aged * aged;
    advance(end - begin);
  }
}

void Estimator::assess(Estimate& estimate, double time) noexcept {
  if (!watch_) return;
  const bool is_estimated = estimate.covariance.size() > 0 && estimate.covariance.diagonal().maxCoeff() > 0.0;
  std::uint32_t reasons = !started_ || (is_estimated && !watch_->is_active()) ? reason::starting : 0;
  for (std::size_t s = 0; s < silent_.size(); ++s) {
    const int source = static_cast<int>(s);
    silent_[s] = started_ && time - clocks_->newest(source) > longest_silence(source);
    if (clocks_->is_suspected(source)) reasons |= reason::clock;
  }
  if (clocks_->is_suspected(static_cast<int>(silent_.size()))) reasons |= reason::clock;
  watch_->assess(estimate, silent_, reasons, estimate.health);
}

void Estimator::predict_to(double time) noexcept {
  const double last = node_times_[newest_ % remembered_nodes];
  predicted_ = estimate_;
  predicted_.predicted = true;
  if (watch_ && watch_->is_active())
    return through_unknown_motion(last, time, [&](double duration) {
      watch_->predict(duration, mean_.data(), input_sigmas_.data(), predicted_);
    });
  mean_input(last, time);
  for (double& u : mean_)
    if (std::isnan(u)) u = 0.0;
  const double duration = time - last;
  Model::Intervals request;
  request.count = 1;
  request.states = estimate_.state.data();
  request.inputs = mean_.data();
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
  if (newest_ == 0) return;
  const double duration = node_times_[newest_ % remembered_nodes] - node_times_[(newest_ - 1) % remembered_nodes];
  for (double& u : mean_)
    if (std::isnan(u)) u = 0.0;
  int state = -1;
  const double error = step_error_(estimate_.state.data(), mean_.data(), estimate_.parameters.data(), duration,
                                   method_->substeps(), &state);
  ++counts_.integrated;
  if (!(error > coarse_error)) return;
  ++counts_.coarse;
  if (error <= worst_error_) return;
  worst_error_ = error;
  counts_.coarse_state = state;
}

const Estimate& Estimator::estimate(double time, Clock::time_point deadline) noexcept {
  double clock_offset = 0.0;
  if (watch_) {
    watch_->begin_innovations();
    clock_offset = clocks_->offset_of(time);
    time -= clock_offset;
  }
  while (measurements_.size() > 0 && measurements_.time(0) <= time + timeline_.tolerance) {
    const double stamp = measurements_.time(0);
    // Measurements with the same stamp, e.g. of two sensors, make one node.
    std::size_t same = 1;
    double* merged = measurements_.values(0);
    while (same < measurements_.size() && measurements_.time(same) <= stamp + timeline_.tolerance) {
      for (std::size_t j = 0; j < nothing_.size(); ++j)
        if (const double value = measurements_.values(same)[j]; !std::isnan(value)) merged[j] = value;
      ++same;
    }
    const SensorWatch::Finding finding = judge(stamp, merged);
    add_nodes_until(stamp, merged);
    if (!watch_ || !watch_->is_active()) watched_ = stamp;
    if (finding.rebase) counts_.rebased += method_->rebase(watch_->mean(), watch_->covariance());
    for (int i = 0; finding.release && i < watch_->held_count(); ++i)
      take_late(watch_->held()[i].time, watch_->held()[i].outputs.data());
    measurements_.drop_front(same);
  }
  if (!started_) {
    assess(estimate_, time);
    return estimate_;
  }
  if (stale_) {
    method_->estimate(estimate_, deadline);
    stale_ = false;
    if (watch_) watch_->follow(estimate_);
    ++counts_.estimates;
    counts_.fallbacks += estimate_.fallback;
    if (counts_.estimates % checked_interval == 0) check_integration();
  }
  const double newest = node_times_[newest_ % remembered_nodes];
  estimate_.time = newest + clock_offset;
  if (watch_) estimate_.innovations = watch_->innovations();
  if (!std::isfinite(time) || time <= newest + timeline_.tolerance) {
    assess(estimate_, std::isfinite(time) ? time : newest);
    return estimate_;
  }
  predict_to(time);
  predicted_.time = time + clock_offset;
  assess(predicted_, time);
  return predicted_;
}

}  // namespace rhec
