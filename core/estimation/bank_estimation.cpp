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
                    setup_.parameter_upper};
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
  history_.bank().replace_vehicle(mean.head(nx), covariance.topLeftCorner(nx, nx));
  history_.start(nothing_.data(), newest);
  if (place_) place_->add_node(history_);
  return true;
}

void BankEstimation::start(const double* outputs) noexcept {
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

void BankEstimation::add_node(double duration, const double* inputs, const double* outputs) noexcept {
  if (searching_) {
    search_->add_node(duration, inputs, outputs);
    if (duration > 0.0 && std::isfinite(duration)) ++searched_;
    return start_bank_if_found();
  }
  if (!(duration > 0.0 && std::isfinite(duration))) {
    amend(0, outputs);
    return;
  }
  history_.add(duration, inputs, outputs);
  if (place_) place_->add_node(history_);
}

bool BankEstimation::amend(int back, const double* outputs) noexcept {
  if (!searching_) {
    if (!history_.amend(back, outputs)) return false;
    if (place_) place_->amend(history_, history_.newest() - back);
    return true;
  }
  if (!search_->amend(back, outputs)) return false;
  start_bank_if_found();
  return true;
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
