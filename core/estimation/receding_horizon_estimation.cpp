#include "rhec/core/estimation/receding_horizon_estimation.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>
#include <utility>

#include <fmt/format.h>

#include "block_structure.hpp"
#include "missing_inputs.hpp"
#include "node_covariance.hpp"
#include "noise_blocks.hpp"
#include "prior_restart.hpp"
#include "rhec/core/base/assertion.hpp"
#include "rhec/core/base/error.hpp"
#include "rhec/core/estimation/measurement.hpp"

namespace rhec {
namespace {

// Above this standard deviation an angle is searched around the circle instead of refined [rad].
constexpr double uncertain_angle = 0.35;
// Iterations for each start of that search.
constexpr int search_iterations = 12;
// Durations that differ by less than this fraction are equal.
constexpr double same_time = 1e-9;

RheProblem make_problem(std::shared_ptr<const Model> model, const RecedingHorizonEstimation::Setup& setup) {
  const auto np = static_cast<std::size_t>(model->parameter_count());
  if (setup.blockings.size() != np || setup.walks.size() != np)
    throw Error(
        fmt::format("estimator: {} blockings and {} parameter walks given; expected {} of each, one a parameter",
                    setup.blockings.size(), setup.walks.size(), np));
  const auto n = static_cast<Eigen::Index>(model->state_count() + np);
  if (setup.initial_mean.size() != n || setup.initial_covariance.rows() != n || setup.initial_covariance.cols() != n)
    throw Error(fmt::format("estimator: the initial mean and covariance must have the size {} of [x; p]", n));
  for (std::size_t j = 0; j < np; ++j)
    if (const std::string reason = setup.blockings[j]->why_not(setup.problem.max_intervals); !reason.empty())
      throw Error(fmt::format("blocking of '{}': {}", model->description().parameters[j].name, reason));
  RheProblem::Setup problem = setup.problem;
  problem.one_block = one_block_parameters(setup.blockings);
  return {std::move(model), std::move(problem)};
}

}  // namespace

RecedingHorizonEstimation::RecedingHorizonEstimation(std::shared_ptr<const Model> model, std::shared_ptr<Solver> solver,
                                                     Setup setup)
    : model_(std::move(model)),
      setup_(with_noise_blocks(*model_, std::move(setup))),
      problem_(make_problem(with_noise_blocks(model_, setup_), setup_)),
      arrival_(setup_.arrival, problem_, setup_.walks),
      solver_(std::move(solver)),
      shifter_(problem_),
      point_(problem_.capacity()),
      trial_(problem_.capacity()),
      best_(problem_.capacity()),
      kept_(problem_.capacity()),
      covariance_(std::make_unique<NodeCovariance>(problem_)),
      restart_(std::make_unique<PriorRestart>(problem_)) {
  if (const std::string reason = solver_->why_not(problem_); !reason.empty())
    throw Error("estimator: the solver cannot take this problem: " + reason);
  solver_->setup(problem_);
  const int np = problem_.model().parameter_count();
  const auto intervals = static_cast<std::size_t>(setup_.problem.max_intervals);
  begins_.assign(intervals, 0);
  next_begins_.assign(intervals, 0);
  first_starts_.assign(np, 0);
  borders_.resize(np);
  scratch_.assign(problem_.scratch_size(), 0.0);
  inputs_.assign(model_->input_count(), 0.0);  // those that are given; blocked noise is expected to be 0
  outputs_.assign(problem_.model().output_count(), 0.0);
  const std::vector<int>& noisy = model_->description().noisy_states;
  const int first_noise = model_->input_count() - static_cast<int>(noisy.size());
  for (int j = 0; j < model_->input_count(); ++j) {
    const int state = j < first_noise ? -1 : noisy[j - first_noise];
    const auto blocks = [&](const Setup::BlockedNoise& noise) { return noise.state == state; };
    if (std::ranges::none_of(setup_.noises, blocks)) given_inputs_.push_back(j);
  }
  last_state_ = setup_.initial_mean;
  base_covariance_ = setup_.initial_covariance;
  // Those of the window and the one before it, one that was prepared, and one to spare.
  nodes_.assign(intervals + 4,
                Node{0.0, std::vector<double>(model_->input_count()), MeasuredOutputs(model_->output_count()),
                     BetweenNodes(model_->output_count(), setup_.problem.most_between)});
  arrivals_.assign(3, Arrival{-1, arrival_.mean(), arrival_.covariance(),
                              std::vector<double>(arrival_.inputs().state_size()), first_starts_});
  reset();
}

RecedingHorizonEstimation::~RecedingHorizonEstimation() = default;

void RecedingHorizonEstimation::reset() noexcept {
  arrival_.reset(setup_.initial_mean, setup_.initial_covariance);
  solver_->reset();
  shifter_.forget();
  window_ = {};
  std::fill(first_starts_.begin(), first_starts_.end(), 0);
  last_state_ = setup_.initial_mean;
  started_ = solved_ = prepared_ = slid_ = has_kept_ = false;
  base_ = -1;
  for (Arrival& each : arrivals_) each.first = -1;
  searching_ = roles().heading >= 0 && setup_.heading_starts > 1;
}

/// The window begins anew at the newest node.
bool RecedingHorizonEstimation::rebase(const Eigen::VectorXd& mean, const Eigen::MatrixXd& covariance) noexcept {
  const std::int64_t number = newest();
  reset();
  // Blocked noises, behind the parameters, are as at the start.
  const Eigen::Index n = mean.size();
  last_state_.head(n) = mean;
  base_covariance_ = setup_.initial_covariance;
  base_covariance_.topLeftCorner(n, n) = covariance;
  arrival_.reset(last_state_, base_covariance_);
  window_.first = base_ = number;
  std::fill(first_starts_.begin(), first_starts_.end(), number);
  searching_ = false;
  std::fill(outputs_.begin(), outputs_.end(), missing_value);
  begin_window(outputs_.data());
  return true;
}

void RecedingHorizonEstimation::start(Measured outputs) noexcept {
  reset();
  begin_window(outputs);
}

/// A window of one node.
void RecedingHorizonEstimation::begin_window(Measured outputs) noexcept {
  started_ = true;
  remember_arrival();
  remember({}, outputs, window_.first);
  problem_.set_output(0, outputs);
  set_structure();
  start_cold(point_);
}

void RecedingHorizonEstimation::remember(const MeasuredInterval& interval, Measured outputs,
                                         std::int64_t number) noexcept {
  Node& kept = node(number);
  kept.duration = interval.duration;
  if (interval.inputs) std::copy_n(interval.inputs, kept.inputs.size(), kept.inputs.data());
  kept.outputs.assign(outputs);
  kept.between.assign(interval);
}

/// What is known before the window's present first node.
void RecedingHorizonEstimation::remember_arrival() noexcept {
  Arrival& kept = arrival_at(window_.first);
  kept.first = window_.first;
  kept.mean = arrival_.mean();
  kept.covariance = arrival_.covariance();
  arrival_.inputs().save(kept.inputs.data());
  kept.starts = first_starts_;
}

void RecedingHorizonEstimation::restore_arrival() noexcept {
  const Arrival& kept = arrival_at(window_.first);
  arrival_.restore(kept.mean, kept.covariance, kept.inputs.data());
}

/// Whether outputs give other weights to squared residuals than those of a node do.
bool RecedingHorizonEstimation::weigh_otherwise(int node, Measured outputs) const noexcept {
  const Measured before = problem_.measured(node);
  for (std::ptrdiff_t j = 0; j < std::ssize(outputs_); ++j)
    if (std::isnan(before[j]) != std::isnan(outputs[j]) ||
        (!std::isnan(outputs[j]) && before.weight(j) != outputs.weight(j)))
      return true;
  return false;
}

void RecedingHorizonEstimation::take_interval(int place, const MeasuredInterval& interval) noexcept {
  double* const measured = problem_.measured_input(place);
  for (std::size_t j = 0; j < given_inputs_.size(); ++j) measured[j] = interval.inputs[given_inputs_[j]];
  problem_.between(place).assign(interval);
}

/// Cold start: the prior, rolled out with the measured inputs.
void RecedingHorizonEstimation::start_cold(Iterate& point) noexcept {
  const int nx = problem_.model().state_count(), np = problem_.model().parameter_count();
  const auto& lower = problem_.setup().parameter_lower;
  const auto& upper = problem_.setup().parameter_upper;
  for (int j = 0; j < nx; ++j) point.state(0)[j] = problem_.arrival_mean[j];
  for (int j = 0; j < np; ++j)
    point.state(0)[nx + j] = std::min(std::max(problem_.arrival_mean[nx + j], lower[j]), upper[j]);
  for (int i = 0; i < window_.intervals; ++i) {
    double* w = point.control(i);
    for (std::size_t j = 0; j < given_inputs_.size(); ++j) {
      const double measured = problem_.measured_input(i)[j];
      w[j] = std::isnan(measured) ? 0.0 : measured;
    }
    for (int j = static_cast<int>(given_inputs_.size()), c = 0; c < np; ++c)
      if (problem_.structure().starts_block(i, c)) w[j++] = point.state(0)[nx + c];
  }
  point.clear_multipliers();
  problem_.simulate(point, scratch_);
}

/// After a failed solve: leaves a finite guess from which the next solve starts anew.
void RecedingHorizonEstimation::recover() noexcept {
  const int N = window_.intervals;
  const auto is_finite = [&] {
    bool finite = true;
    for (int i = 0; i <= N; ++i) {
      for (int j = 0; j < problem_.capacity().states; ++j) finite = finite && std::isfinite(point_.state(i)[j]);
      for (int j = 0; i < N && j < problem_.control_count(i); ++j)
        finite = finite && std::isfinite(point_.control(i)[j]);
    }
    return finite;
  };
  if (!is_finite()) start_cold(point_);
  if (!is_finite()) {
    // The simulation from the prior is not finite either: keep the vehicle where it was last.
    for (int i = 0; i <= N; ++i) std::copy_n(last_state_.data(), last_state_.size(), point_.state(i));
    for (int i = 0; i < N; ++i) std::fill_n(point_.control(i), problem_.control_count(i), 0.0);
  }
  point_.clear_multipliers();
  solver_->reset();
}

void RecedingHorizonEstimation::slide_arrival() noexcept {
  const Window next{window_.first + 1, window_.intervals};
  for (std::size_t j = 0; j < borders_.size(); ++j) {
    const Blocking& blocking = *setup_.blockings[j];
    const bool ramp = blocking.transition() == Transition::ramp;
    const std::int64_t start = blocking.starts(next, next_begins_.data());
    ArrivalCost::Border& border = borders_[j];
    border.reached = !ramp && start == next.first;
    border.steps = static_cast<double>(next.first - first_starts_[j]);
    border.neighbour_sigma = blocking.neighbour_sigma();
    border.leaves_as_ramp = ramp && problem_.structure().starts_block(0, static_cast<int>(j));
    border.ramp_variance = border.leaves_as_ramp ? problem_.link_variance(0, static_cast<int>(j)) : 0.0;
    // What leaves needs a finite covariance, so an unlinked block has that of a restarted one here.
    if (!std::isfinite(border.ramp_variance))
      border.ramp_variance = setup_.walks[j].restart_sigma * setup_.walks[j].restart_sigma;
  }
  const int heading = roles().heading;
  const bool lost = heading >= 0 && arrival_.covariance()(heading, heading) > uncertain_angle * uncertain_angle;
  arrival_.slide(problem_, point_, borders_, lost);
}

void RecedingHorizonEstimation::set_structure() noexcept {
  // The same window may be set up again, behind nodes that were taken back.
  first_starts_ = arrival_at(window_.first).starts;
  if (window_.intervals == 0) {
    problem_.set_intervals(0);
    for (int j = 0; j < problem_.model().parameter_count(); ++j) problem_.set_block_weight(0, j, 0.0);
    problem_.finish();
    return arrival_.write(problem_);
  }
  set_block_structure(window_, setup_.blockings, setup_.walks, first_starts_, begins_, problem_);
  arrival_.write(problem_);
}

void RecedingHorizonEstimation::advance_window(const MeasuredInterval& interval, Measured outputs) noexcept {
  const bool full = window_.intervals == setup_.problem.max_intervals;
  const bool was_empty = window_.intervals == 0;
  if (full) slide_arrival();
  if (!was_empty) shifter_.take(problem_, std::move(point_));
  if (full) {
    problem_.drop_first_interval();
    ++window_.first;
    remember_arrival();
  } else {
    ++window_.intervals;
  }
  const int last = window_.intervals;
  problem_.set_intervals(last);
  problem_.set_duration(last - 1, interval.duration);
  take_interval(last - 1, interval);
  problem_.set_output(last, outputs);
  set_structure();
  if (was_empty) {
    for (std::size_t j = 0; j < given_inputs_.size(); ++j) {
      const double measured = problem_.measured_input(0)[j];
      point_.control(0)[j] = std::isnan(measured) ? 0.0 : measured;
    }
    point_.clear_multipliers();
    problem_.simulate(point_, scratch_);
  } else if (!shifter_.apply(full ? 1 : 0, problem_, point_)) {
    start_cold(point_);
  }
}

void RecedingHorizonEstimation::add(const MeasuredInterval& interval, Measured outputs) noexcept {
  if (!started_) {
    start(outputs);
    return;
  }
  if (!(interval.duration > 0.0) || !std::isfinite(interval.duration)) return add_outputs(outputs);
  solved_ = false;
  remember(interval, outputs, newest() + 1);
  if (!prepared_) {
    advance_window(interval, outputs);
    return;
  }
  // The horizon has already moved, with placeholders for the data that are now known. If these fit, the linearisation
  // remains valid.
  prepared_ = false;
  const int last = window_.intervals;
  // Stamps computed as sums or multiples of one step differ in their last digits, which does not matter here.
  const bool same_duration = std::abs(problem_.duration(last - 1) - interval.duration) <= same_time * interval.duration;
  // The weights of robust losses were those of the predicted outputs, so with them the matrices change too.
  bool fits = same_duration && setup_.problem.robust.empty() && interval.between == 0;
  fits = fits && !weigh_otherwise(last, outputs);
  for (std::size_t j = 0; j < given_inputs_.size(); ++j)
    fits = fits && std::isnan(problem_.measured_input(last - 1)[j]) == std::isnan(interval.inputs[given_inputs_[j]]);
  take_interval(last - 1, interval);
  problem_.set_output(last, outputs);
  if (fits) return;
  problem_.set_duration(last - 1, interval.duration);
  if (!same_duration) problem_.simulate_interval(last - 1, point_, scratch_);
  solver_->prepare(point_);
}

/// More outputs of the newest node; they replace those that it has.
void RecedingHorizonEstimation::add_outputs(Measured outputs) noexcept {
  const int at = window_.intervals - (prepared_ ? 1 : 0);
  MeasuredOutputs& kept = node(newest()).outputs;
  kept.add(outputs);
  const bool weights_change = weigh_otherwise(at, kept.measured());
  problem_.set_output(at, kept.measured());
  solved_ = solved_ && prepared_;
  if (weights_change && prepared_) solver_->prepare(point_);
}

int RecedingHorizonEstimation::reach() const noexcept {
  if (!started_) return 0;
  const std::int64_t first = first_before_preparing();
  if (first <= base_) return static_cast<int>(newest() - base_);
  return static_cast<int>(newest() - first) + 1;  // either the node before the window's first, or the start of the run
}

void RecedingHorizonEstimation::rewind(int nodes) noexcept {
  const std::int64_t target = newest() - nodes;
  if (target < 0) return reset();
  if (nodes <= 0) return;
  const Window before{first_before_preparing(), static_cast<int>(newest() - first_before_preparing())};
  // Preparing has left the solution in the shifter.
  if (!prepared_) shifter_.take(problem_, point_);
  if (!has_kept_) {
    kept_ = shifter_.kept();
    kept_window_ = before;
    has_kept_ = true;
  }
  window_.first = std::min(before.first, target);
  window_.intervals = static_cast<int>(target - window_.first);
  prepared_ = slid_ = solved_ = false;
  restore_arrival();
  problem_.set_intervals(window_.intervals);
  for (int i = 0; i <= window_.intervals; ++i) {
    const Node& kept = node(window_.first + i);
    problem_.set_output(i, kept.outputs.measured());
    if (i == 0) continue;
    problem_.set_duration(i - 1, kept.duration);
    take_interval(i - 1, kept.between.over(kept.duration, kept.inputs.data()));
  }
  set_structure();
  if (window_.intervals == 0 || window_.first != before.first || !shifter_.apply(0, problem_, point_))
    start_cold(point_);
}

/// The nodes that were taken back have come again, with more that was measured: the guess is what was known of them.
void RecedingHorizonEstimation::take_up_solution() noexcept {
  if (!std::exchange(has_kept_, false) || prepared_ || window_.first != kept_window_.first ||
      window_.intervals != kept_window_.intervals || window_.intervals == 0)
    return;
  point_ = kept_;
  problem_.simulate_interval(window_.intervals - 1, point_, scratch_);
}

void RecedingHorizonEstimation::prepare() noexcept {
  if (!started_ || prepared_ || window_.intervals == 0 || !solved_) return;
  const int last = window_.intervals;
  for (std::size_t j = 0; j < given_inputs_.size(); ++j)
    inputs_[given_inputs_[j]] = problem_.measured_input(last - 1)[j];
  slid_ = last == setup_.problem.max_intervals;
  // Placeholders with zero residuals and the previous mask.
  Model::Nodes request;
  request.count = 1;
  request.states = point_.state(last);
  request.outputs = outputs_.data();
  problem_.model().observe(request);
  for (std::size_t j = 0; j < outputs_.size(); ++j)
    if (std::isnan(problem_.output(last)[j])) outputs_[j] = missing_value;
  const double duration = problem_.duration(last - 1);
  advance_window({duration, inputs_.data()}, {outputs_.data(), problem_.measured(last).weights});
  solver_->prepare(point_);
  prepared_ = true;
}

bool RecedingHorizonEstimation::arrival(double* mean, double* sigma) const noexcept {
  const bool is_known = arrival_.kind() != ArrivalKind::off;
  for (Eigen::Index j = 0; j < model_->state_count() + model_->parameter_count(); ++j) {
    mean[j] = arrival_.mean()[j];
    sigma[j] =
        is_known ? std::sqrt(std::max(0.0, arrival_.covariance()(j, j))) : std::numeric_limits<double>::infinity();
  }
  return is_known;
}

/// Solves from headings around the circle, each rolled out; keeps the best objective.
void RecedingHorizonEstimation::search_heading(Clock::time_point deadline) noexcept {
  double best_objective = std::numeric_limits<double>::infinity();
  best_ = point_;
  for (int start = 0; start <= setup_.heading_starts && !is_past(deadline); ++start) {
    trial_ = point_;  // the last start is the present guess
    if (start < setup_.heading_starts) {
      trial_.clear_multipliers();
      for (int j = 0; j < problem_.model().state_count(); ++j) trial_.state(0)[j] = problem_.arrival_mean[j];
      roles().turn(2.0 * std::numbers::pi * start / setup_.heading_starts, trial_.state(0));
      problem_.simulate(trial_, scratch_);
    }
    Report report;
    for (int i = 0; i < search_iterations && (i == 0 || !is_past(deadline)); ++i) {
      report = solver_->solve(trial_, deadline);
      if (!is_usable(report.status) || report.status == Status::solved) break;
    }
    if (!is_usable(report.status) || !(report.kkt.defect < 1e-2) || !(report.objective < best_objective)) continue;
    best_objective = report.objective;
    best_ = trial_;
  }
  point_ = best_;
}

void RecedingHorizonEstimation::estimate(Estimate& result, Clock::time_point deadline) noexcept {
  const int nx = model_->state_count(), np = model_->parameter_count(), N = window_.intervals;
  const int heading = roles().heading;
  result.state.resize(nx);
  result.parameters.resize(np);
  result.covariance.resize(nx + np, nx + np);
  take_up_solution();
  // A horizon that was moved in advance ends in a node that does not exist yet. Without its outputs, this node does not
  // affect the others.
  const int newest = prepared_ ? N - 1 : N;
  if (prepared_) {
    std::fill_n(problem_.output(N), outputs_.size(), missing_value);
    solver_->prepare(point_);
  }
  // Once found, a heading is tracked, even if it becomes uncertain again in a gap: the vehicle cannot have turned
  // around unseen.
  const bool remembers = setup_.arrival == ArrivalKind::ekf || setup_.arrival == ArrivalKind::smoothing;
  const auto is_known = [&](const Eigen::MatrixXd& covariance) {
    return covariance(heading, heading) <= uncertain_angle * uncertain_angle;
  };
  if (searching_ && remembers && is_known(arrival_.covariance())) searching_ = false;
  if (lacks_inputs(problem_)) return filter_window(newest, result);
  if (searching_) search_heading(deadline);
  result.report = solver_->solve(point_, deadline);
  if (result.report.status == Status::iteration_limit || result.report.status == Status::stalled) {
    start_cold(trial_);
    restart_->reconsider(problem_, *solver_, trial_, covariance_->qp(), point_, result.report, deadline);
  }
  result.fallback = !is_usable(result.report.status);
  result.predicted = false;
  if (result.fallback) recover();
  solved_ = true;
  std::copy_n(point_.state(newest), last_state_.size(), last_state_.data());
  result.state = last_state_.head(nx);
  result.parameters = last_state_.segment(nx, np);
  write_covariance(newest, result);
  RHEC_ASSERT(result.state.allFinite() && result.parameters.allFinite(), "an estimate is finite");
  // An arrival cost without memory never determines the heading; use the covariance of the estimate instead.
  if (searching_ && !remembers && is_known(result.covariance)) searching_ = false;
}

/// The estimate where some inputs were not measured, and a guess for when they are again.
void RecedingHorizonEstimation::filter_window(int newest, Estimate& result) noexcept {
  const int nx = model_->state_count(), np = model_->parameter_count();
  const KalmanFilter* filter = &arrival_.begin_filtering(problem_);
  for (int i = 0; i < newest; ++i) filter = &arrival_.filter_interval(problem_, i);
  result.fallback = result.predicted = false;
  result.report = {};
  result.report.status = Status::solved;
  solved_ = true;
  if (filter->mean.allFinite()) last_state_ = filter->mean;
  result.state = last_state_.head(nx);
  result.parameters = last_state_.segment(nx, np);
  result.covariance = filter->covariance.topLeftCorner(nx + np, nx + np);
  start_cold(point_);
  if (!point_.is_finite()) recover();
  solver_->reset();
}

/// Covariance of the state of a node and the parameters before it. If it is not finite, the last one is kept.
void RecedingHorizonEstimation::write_covariance(int node, Estimate& result) noexcept {
  const auto n = static_cast<int>(result.covariance.rows());
  const int ns = problem_.capacity().states;
  if (const double* found = covariance_->find(problem_, *solver_, point_, node))
    result.covariance =
        Eigen::Map<const Eigen::MatrixXd, 0, Eigen::OuterStride<>>(found, n, n, Eigen::OuterStride<>(ns));
}

}  // namespace rhec
