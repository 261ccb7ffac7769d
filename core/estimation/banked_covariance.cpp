#include "rhec/core/estimation/banked_covariance.hpp"

#include <utility>

#include "rhec/core/base/angle.hpp"

namespace rhec {

BankedCovariance::BankedCovariance(std::unique_ptr<WindowedEstimation> blocks, const BankEstimation::Setup& bank,
                                   std::shared_ptr<const Model> bank_model)
    : blocks_(std::move(blocks)), bank_(bank_model ? std::move(bank_model) : blocks_->problem().shared_model(), bank) {
  const Eigen::Index n = model().state_count() + model().parameter_count();
  mean_ = difference_ = Eigen::VectorXd::Zero(n);
  covariance_ = own_ = Eigen::MatrixXd::Zero(n, n);
}

void BankedCovariance::start(Measured outputs) noexcept {
  blocks_->start(outputs);
  bank_.start(outputs);
}

void BankedCovariance::add(const MeasuredInterval& interval, Measured outputs) noexcept {
  blocks_->add(interval, outputs);
  bank_.add(interval, outputs);
}

void BankedCovariance::rewind(int nodes) noexcept {
  blocks_->rewind(nodes);
  bank_.rewind(nodes);
}

void BankedCovariance::reset() noexcept {
  blocks_->reset();
  bank_.reset();
}

bool BankedCovariance::rebase(const Eigen::VectorXd& mean, const Eigen::MatrixXd& covariance) noexcept {
  bank_.rebase(mean, covariance);
  return blocks_->rebase(mean, covariance);
}

void BankedCovariance::estimate(Estimate& result, Clock::time_point deadline) noexcept {
  blocks_->estimate(result, deadline);
  own_ = result.covariance;
  if (bank_.is_searching()) return;
  bank_.history().bank().moments(mean_, covariance_);
  const Eigen::Index nx = result.state.size();
  difference_.head(nx) = result.state - mean_.head(nx);
  difference_.tail(result.parameters.size()) = result.parameters - mean_.tail(result.parameters.size());
  const std::vector<Variable>& states = model().description().states;
  for (Eigen::Index j = 0; j < nx; ++j)
    if (states[j].is_angle) difference_[j] = angle_difference(result.state[j], mean_[j]);
  if (!difference_.allFinite() || !covariance_.allFinite()) return;
  for (Eigen::Index c = 0; c < difference_.size(); ++c)
    for (Eigen::Index r = 0; r < difference_.size(); ++r)
      result.covariance(r, c) = covariance_(r, c) + difference_[r] * difference_[c];
}

}  // namespace rhec
