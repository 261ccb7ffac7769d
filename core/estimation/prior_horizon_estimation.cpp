#include "rhec/core/estimation/prior_horizon_estimation.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>

#include "missing_inputs.hpp"
#include "node_covariance.hpp"
#include "prior_restart.hpp"
#include "process_problem.hpp"
#include "rhec/core/base/assertion.hpp"
#include "rhec/core/base/error.hpp"

namespace rhec {
namespace {

/// A law must be so much more probable than the present one to take its place: the window then needs another
/// linearisation, and its solution jumps a little.
constexpr double advantage = 2.0;

BankEstimation::Setup with_memory(BankEstimation::Setup filters, int horizon) {
  // Those of the window, the one that leaves it, and one from where a late measurement at the first of them is used.
  filters.remembered_nodes = std::max(filters.remembered_nodes, horizon + 3);
  return filters;
}

}  // namespace

PriorHorizonEstimation::PriorHorizonEstimation(const std::shared_ptr<const Model>& model,
                                               std::shared_ptr<Solver> solver, Setup setup)
    : filters_(model, with_memory(setup.filters, setup.problem.max_intervals)),
      process_model_(make_process_model(model, filters_.bank())),
      problem_(make_process_problem(process_model_, setup.problem)),
      solver_(std::move(solver)),
      covariance_(std::make_unique<NodeCovariance>(problem_)),
      restart_(std::make_unique<PriorRestart>(problem_)),
      shifter_(problem_),
      point_(problem_.capacity()),
      prior_(problem_.capacity()),
      parameter_lower_(setup.filters.parameter_lower),
      parameter_upper_(setup.filters.parameter_upper) {
  if (const std::string reason = solver_->why_not(problem_); !reason.empty())
    throw Error("estimator: the solver cannot take this problem: " + reason);
  solver_->setup(problem_);
  const int nx = model->state_count(), np = model->parameter_count(), n = process_model_->state_count();
  scratch_.assign(problem_.scratch_size(), 0.0);
  robust_weights_.assign(model->output_count(), 0.0);
  advances_.resize(setup.problem.max_intervals);
  laws_.assign(filters_.history().capacity() + std::size_t{1}, 0);
  known_data_.assign(advances_.size() * process_model_->data_count(), 0.0);
  for (int j = 0; j < nx; ++j) entries_.push_back(j);
  for (int j = 0; j < np; ++j) entries_.push_back(process_model_->first_state(j));
  mean_ = member_mean_ = shift_ = Eigen::VectorXd::Zero(nx + np);
  mixture_ = member_covariance_ = Eigen::MatrixXd::Zero(nx + np, nx + np);
  predicted_ = Eigen::MatrixXd::Zero(n, n);
  information_ = std::make_unique<InformationOf>(n);
  reset();
}

PriorHorizonEstimation::~PriorHorizonEstimation() = default;

void PriorHorizonEstimation::reset() noexcept {
  filters_.reset();
  solver_->reset();
  shifter_.forget();
  window_ = {};
  has_window_ = has_solution_ = has_rehearsed_ = false;
  law_ = 0;
  std::fill(advances_.begin(), advances_.end(), Advance{});
}

bool PriorHorizonEstimation::rebase(const Eigen::VectorXd& mean, const Eigen::MatrixXd& covariance) noexcept {
  solver_->reset();
  shifter_.forget();
  window_ = {};
  has_window_ = has_solution_ = has_rehearsed_ = false;
  return filters_.rebase(mean, covariance);
}

void PriorHorizonEstimation::start(Measured outputs) noexcept {
  reset();
  filters_.start(outputs);
  choose_law();
}

void PriorHorizonEstimation::add(const MeasuredInterval& interval, Measured outputs) noexcept {
  filters_.add(interval, outputs);
  choose_law();
}

void PriorHorizonEstimation::rewind(int nodes) noexcept {
  filters_.rewind(nodes);
  if (!filters_.is_searching()) law_ = law_at(filters_.history().newest());
}

/// What the window has found of the outliers in the nodes that leave it now, which is more than their innovations said,
/// goes to the bank: the arrival cost shall not bring back what the window had down-weighted.
void PriorHorizonEstimation::hand_weights_on() noexcept {
  if (!has_solution_ || problem_.setup().robust.empty()) return;
  const std::int64_t first = filters_.history().newest() - problem_.capacity().intervals;
  std::int64_t changed = -1;
  for (int node = 0; node < window_.intervals && window_.first + node < first; ++node) {
    problem_.robust_weights(point_, node, robust_weights_.data(), scratch_);
    for (std::size_t j = 0; j < robust_weights_.size(); ++j)
      if (std::isnan(problem_.output(node)[j])) robust_weights_[j] = std::numeric_limits<double>::quiet_NaN();
    if (filters_.history().reweigh(window_.first + node, robust_weights_.data()) && changed < 0)
      changed = window_.first + node;
  }
  if (changed >= 0) filters_.follow_place(changed);
}

/// At each node, so that it does not depend on when the estimate is asked for.
void PriorHorizonEstimation::choose_law() noexcept {
  if (filters_.is_searching()) return;
  const BankHistory& history = filters_.history();
  law_ = history.count() > 1 ? law_at(history.newest() - 1) : 0;
  const auto weights = bank().weights();
  const auto best = std::max_element(weights.begin(), weights.end());
  if (*best > advantage * weights[law_]) law_ = static_cast<int>(best - weights.begin());
  law_at(history.newest()) = law_;
}

void PriorHorizonEstimation::fill_interval(int interval, std::int64_t number) noexcept {
  const BankHistory::Node node = filters_.history().node(number);
  const int nu = model().input_count();
  problem_.set_duration(interval, node.way.duration);
  double* const inputs = problem_.measured_input(interval);
  std::copy_n(node.inputs, nu, inputs);
  std::fill(inputs + nu, inputs + process_model_->input_count(), 0.0);
  problem_.set_output(interval + 1, node.outputs);
  problem_.between(interval).assign(*node.between);
  const auto place = static_cast<std::size_t>(number % static_cast<std::int64_t>(advances_.size()));
  double* const data = known_data_.data() + place * process_model_->data_count();
  const Advance advance{number, law_, node.way};
  if (advances_[place] != advance) {
    for (int j = 0; j < model().parameter_count(); ++j)
      filters_.history().bank().write_process(law_, j, node.way, processes().process_data(j, data));
    advances_[place] = advance;
  }
  std::copy_n(data, process_model_->data_count(), problem_.interval_data(interval));
}

/// Mean and information of [x; z] before the first node's outputs, from what the bank has saved there.
void PriorHorizonEstimation::write_arrival(const double* saved) noexcept {
  filters_.history().bank().saved_moments(saved, law_, problem_.arrival_mean, predicted_);
  information_->find(predicted_, problem_.arrival_information);
}

void PriorHorizonEstimation::fill_window() noexcept {
  BankHistory& history = filters_.history();
  const int N = std::min(problem_.capacity().intervals, history.count() - 1);
  const Window next{history.newest() - N, N};
  const std::int64_t steps = next.first - window_.first;
  const bool has_guess = has_window_ && window_.intervals > 0 && steps < window_.intervals;
  if (has_guess) shifter_.take(problem_, std::move(point_));
  window_ = next;
  has_window_ = true;
  problem_.set_intervals(N);
  const BankHistory::Node first = history.node(next.first);
  problem_.set_output(0, first.outputs);
  for (int i = 0; i < N; ++i) fill_interval(i, next.first + i + 1);
  for (int j = 0; j < model().output_count(); ++j) problem_.set_output_weight(j, 1.0 / bank().noise(j).counted);
  write_arrival(first.predicted);
  problem_.finish();
  if (!has_guess || !shifter_.apply(static_cast<int>(steps), problem_, point_)) start_cold(point_);
}

/// Cold start: the arrival's mean, rolled out with the measured inputs and without process noise.
void PriorHorizonEstimation::start_cold(Iterate& point) noexcept {
  const int inputs = process_model_->input_count();
  for (int j = 0; j < process_model_->state_count(); ++j)
    point.state(0)[j] =
        std::min(std::max(problem_.arrival_mean[j], problem_.state_lower(0)[j]), problem_.state_upper(0)[j]);
  for (int i = 0; i < window_.intervals; ++i) {
    for (int j = 0; j < inputs; ++j) {
      const double measured = problem_.measured_input(i)[j];
      point.control(i)[j] = std::isnan(measured) ? 0.0 : measured;
    }
  }
  point.clear_multipliers();
  problem_.simulate(point, scratch_);
}

bool PriorHorizonEstimation::arrival(double* mean, double* sigma) const noexcept {
  for (std::size_t j = 0; j < entries_.size(); ++j) {
    mean[j] = problem_.arrival_mean[entries_[j]];
    sigma[j] = information_->sigmas()[entries_[j]];
  }
  return true;
}

/// The mixture of the bank, with the window in place of the filter of its law.
void PriorHorizonEstimation::combine(Estimate& result) noexcept {
  const int N = window_.intervals, n = static_cast<int>(entries_.size()), ns = problem_.capacity().states;
  const double weight = bank().weights()[law_];
  bank().moments_of(law_, member_mean_, member_covariance_);
  const double* const state = point_.state(N);
  for (int j = 0; j < n; ++j) shift_[j] = state[entries_[j]] - member_mean_[j];
  if (!shift_.allFinite()) {
    result.fallback = true;
    return;
  }
  shift_ *= weight;
  mean_ += shift_;
  if (bank().looks_ahead()) {
    // The window's covariance is that of its linearisation, for which a product that is known tells its factors apart.
    // That of the bank holds about its own mean.
    for (int c = 0; c < n; ++c)
      for (int r = 0; r < n; ++r) mixture_(r, c) += shift_[r] * shift_[c];
    return;
  }
  const double* const found = covariance_->find(problem_, *solver_, point_, N);
  if (!found) return;
  for (int c = 0; c < n; ++c)
    for (int r = 0; r < n; ++r)
      mixture_(r, c) +=
          weight * (found[static_cast<std::ptrdiff_t>(entries_[c]) * ns + entries_[r]] - member_covariance_(r, c));
}

void PriorHorizonEstimation::rehearse() noexcept {
  filters_.rehearse();
  if (!has_solution_ || filters_.is_searching()) return;
  if (!bank().looks_ahead()) covariance_->find(problem_, *solver_, point_, window_.intervals);
  solver_->prepare(point_);
  has_rehearsed_ = true;
}

void PriorHorizonEstimation::estimate(Estimate& result, Clock::time_point deadline) noexcept {
  if (filters_.is_searching()) return filters_.estimate(result, deadline);
  hand_weights_on();
  filters_.history().bank().moments(mean_, mixture_);
  choose_law();
  fill_window();
  if (lacks_inputs(problem_)) {
    // Without a prior of them a window makes of them what it likes.
    has_solution_ = result.fallback = result.predicted = false;
    start_cold(point_);
    solver_->reset();
    result.report = {};
    result.report.status = Status::solved;
    return give_out(result);
  }
  // What the solver has prepared in a rehearsal was for other data.
  if (std::exchange(has_rehearsed_, false)) solver_->prepare(point_);
  result.report = solver_->solve(point_, deadline);
  has_solution_ = result.report.status == Status::solved;
  if (!has_solution_) has_solution_ = PriorRestart::is_convincing(problem_, result.report);
  // Without time to doubt it, a solution is the next one's guess, and the filters speak.
  const bool is_doubtful = !has_solution_ && is_usable(result.report.status) && is_past(deadline);
  if (is_doubtful) {
    has_solution_ = true;
    result.report.status = Status::deadline;
  }
  if (!has_solution_) {
    start_cold(prior_);
    has_solution_ =
        restart_->reconsider(problem_, *solver_, prior_, covariance_->qp(), point_, result.report, deadline);
  }
  // Where the window knows no better than its prior, the filters do.
  result.fallback = !has_solution_;
  result.predicted = false;
  if (result.fallback) {
    start_cold(point_);
    solver_->reset();
  } else if (!is_doubtful) {
    combine(result);
  }
  give_out(result);
}

/// The moments of all.
void PriorHorizonEstimation::give_out(Estimate& result) noexcept {
  const int nx = model().state_count(), np = model().parameter_count();
  filters_.fuse_place(mean_, mixture_);
  result.state = mean_.head(nx);
  result.parameters = mean_.tail(np);
  for (int j = 0; j < np; ++j)
    result.parameters[j] = std::min(std::max(result.parameters[j], parameter_lower_[j]), parameter_upper_[j]);
  result.covariance = mixture_;
  RHEC_ASSERT(result.state.allFinite() && result.parameters.allFinite(), "an estimate is finite");
}

}  // namespace rhec
