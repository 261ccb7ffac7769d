#include "rhec/core/estimation/bank_estimation.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>

#include <fmt/format.h>

#include "rhec/core/base/error.hpp"

namespace rhec {

BankEstimation::BankEstimation(const std::shared_ptr<const Model>& model, Setup setup)
    : setup_(std::move(setup)),
      history_(PriorBank(model, setup_.bank), setup_.remembered_nodes,
               setup_.place.map ? PlaceMemory::remembered_nodes(setup_.place, setup_.remembered_nodes) : 0) {
  const Eigen::Index nx = model->state_count(), np = model->parameter_count();
  if (setup_.initial_state.size() != nx || setup_.initial_covariance.rows() != nx ||
      setup_.initial_covariance.cols() != nx)
    throw Error(fmt::format("bank: the initial mean and covariance must have the size {} of x", nx));
  mean_ = Eigen::VectorXd::Zero(nx + np);
  covariance_ = Eigen::MatrixXd::Zero(nx + np, nx + np);
  if (setup_.heading_starts > 1 && model->description().roles.heading >= 0) {
    FilterEstimation::Setup search;
    search.noise = {setup_.bank.output_variances, setup_.bank.input_variances, setup_.parameter_lower,
                    setup_.parameter_upper,       setup_.bank.motion_outputs,  {},
                    setup_.bank.scaled_outputs};
    search.walk.assign(np, 0.0);
    search.initial_mean = mean_;
    search.initial_mean.head(nx) = setup_.initial_state;
    search.initial_covariance = covariance_;
    search.initial_covariance.topLeftCorner(nx, nx) = setup_.initial_covariance;
    std::vector<double> start(Prior::max_states), spread(std::size_t{Prior::max_states} * Prior::max_states);
    for (Eigen::Index j = 0; j < np; ++j) {
      setup_.bank.members.front()[j]->start(start.data(), spread.data());
      search.initial_mean[nx + j] = start[0];
      search.initial_covariance(nx + j, nx + j) = spread[0];
    }
    search.substeps = setup_.bank.substeps;
    search.heading_starts = setup_.heading_starts;
    search.most_between = setup_.bank.most_between;
    search.remembered_nodes = setup_.remembered_nodes;
    search_ = std::make_unique<FilterEstimation>(model, std::move(search));
    found_.state = setup_.initial_state;
    found_.parameters = mean_.tail(np);
    found_.covariance = covariance_;
  }
  if (setup_.place.map)
    place_ = std::make_shared<PlaceMemory>(model, history_.bank(), setup_.bank, setup_.remembered_nodes, setup_.place);
  nothing_.assign(model->output_count(), std::numeric_limits<double>::quiet_NaN());
  reset();
}

void BankEstimation::reset() noexcept {
  is_rebased_ = false;
  history_.bank().reset(setup_.initial_state, setup_.initial_covariance);
  if (place_) place_->reset();
  if (search_) search_->reset();
  searching_ = search_ != nullptr;
  searched_ = 0;
}

bool BankEstimation::rebase(const Eigen::VectorXd& mean, const Eigen::MatrixXd& covariance) noexcept {
  const Eigen::Index nx = setup_.initial_state.size();
  const std::int64_t newest = searching_ ? searched_ : history_.newest();
  if (place_ && !searching_) {
    place_->finish(history_);
    place_->reset();
  }
  searching_ = false;
  is_rebased_ = true;
  history_.bank().replace_vehicle(mean.head(nx), covariance.topLeftCorner(nx, nx));
  history_.start(nothing_.data(), newest);
  if (place_) place_->add_node(history_);
  return true;
}

void BankEstimation::start(Measured outputs) noexcept {
  reset();
  if (!searching_) {
    history_.start(outputs);
    if (place_) place_->add_node(history_);
    return;
  }
  search_->start(outputs);
  start_bank_if_found();
}

/// Once one heading is left, the bank goes on from that filter's vehicle; its measurements are in it already.
void BankEstimation::start_bank_if_found() noexcept {
  if (search_->is_searching()) return;
  search_->estimate(found_, Clock::time_point::max());
  const Eigen::Index nx = setup_.initial_state.size();
  history_.bank().reset(found_.state, found_.covariance.topLeftCorner(nx, nx));
  history_.start(nothing_.data(), searched_);
  if (place_) place_->add_node(history_);
  searching_ = false;
}

void BankEstimation::add(const MeasuredInterval& interval, Measured outputs) noexcept {
  const bool is_new = interval.duration > 0.0 && std::isfinite(interval.duration);
  if (searching_) {
    search_->add(interval, outputs);
    if (is_new) ++searched_;
    return start_bank_if_found();
  }
  if (!is_new) {
    history_.amend(0, outputs);
    return follow_place(history_.newest());
  }
  history_.add(interval, outputs);
  if (place_) place_->add_node(history_);
}

/// How many nodes before the bank's first one can be taken back, together with that one; 0 if it is forgotten.
int BankEstimation::before_bank() const noexcept {
  if (is_rebased_ || history_.newest() - history_.count() + 1 > searched_ || history_.count() > setup_.remembered_nodes)
    return 0;
  return search_ ? search_->reach() : 1;
}

int BankEstimation::reach() const noexcept {
  if (searching_) return search_->reach();
  return std::min(history_.count(), std::max(setup_.remembered_nodes, 1)) - 1 + before_bank();
}

int BankEstimation::most_reach() const noexcept {
  return std::max(setup_.remembered_nodes, 1) + (search_ ? search_->most_reach() : 0);
}

void BankEstimation::rewind(int nodes) noexcept {
  if (!searching_ && history_.rewind(nodes)) {
    if (place_) place_->rewind(history_);
    return;
  }
  if (!search_) return reset();
  // The bank's first node was the search's newest.
  if (!searching_) nodes -= history_.count() - 1;
  if (place_) place_->reset();
  searching_ = true;
  searched_ = std::max<std::int64_t>(0, searched_ - nodes);
  search_->rewind(nodes);
}

void BankEstimation::end_drive() noexcept {
  if (place_ && !searching_) place_->finish(history_);
}

std::optional<EstimationMethod::OutputNoise> BankEstimation::output_noise(int output) const noexcept {
  if (!setup_.bank.adapts_noise) return {};
  const PriorBank::Noise noise = bank().noise(output);
  return OutputNoise{std::sqrt(noise.variance), noise.is_identified};
}

void BankEstimation::estimate(Estimate& result, Clock::time_point deadline) noexcept {
  if (searching_) return search_->estimate(result, deadline);
  history_.bank().moments(mean_, covariance_);
  fuse_place(mean_, covariance_);
  const Eigen::Index nx = setup_.initial_state.size(), np = mean_.size() - nx;
  result.state = mean_.head(nx);
  result.parameters = mean_.tail(np);
  for (Eigen::Index j = 0; j < np; ++j)
    result.parameters[j] =
        std::min(std::max(result.parameters[j], setup_.parameter_lower[j]), setup_.parameter_upper[j]);
  result.covariance = covariance_;
  result.report = {};
  result.report.status = Status::solved;
  result.fallback = !mean_.allFinite();
  result.predicted = false;
}

}  // namespace rhec
