#include "rhec/core/estimation/filter_estimation.hpp"
#include "rhec/core/base/angle.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>
#include <span>
#include <utility>

#include <fmt/format.h>

#include "filter_memo.hpp"
#include "rhec/core/base/error.hpp"
#include "rhec/core/horizon/rhe_problem.hpp"

namespace rhec {
namespace {

// Once the best hypothesis explains the data e^25 times better than every different one, the others are dropped.
constexpr double decisive = 25.0;

}  // namespace

FilterEstimation::FilterEstimation(const std::shared_ptr<const Model>& model, Setup setup) : setup_(std::move(setup)) {
  if (setup_.walk.size() != static_cast<std::size_t>(model->parameter_count()))
    throw Error("filter: expected one random walk a parameter");
  const Eigen::Index n = Eigen::Index{model->state_count()} + model->parameter_count();
  if (setup_.initial_mean.size() != n || setup_.initial_covariance.rows() != n || setup_.initial_covariance.cols() != n)
    throw Error(fmt::format("filter: the initial mean and covariance must have the size {} of [x; p]", n));
  const int count = model->description().roles.heading >= 0 ? std::max(1, setup_.heading_starts) : 1;
  for (int i = 0; i < count; ++i)
    bank_.push_back({KalmanFilter(model, setup_.noise, setup_.substeps, setup_.most_between), 0.0});
  if (setup_.remembered_nodes < 0) throw Error("filter: expected 0 remembered nodes or more");
  const Moments moments{Eigen::VectorXd::Zero(n), Eigen::MatrixXd::Zero(n, n),
                        std::vector<double>(bank_[0].filter.inputs().state_size(), 0.0), 0.0};
  nodes_.assign(setup_.remembered_nodes + std::size_t{1}, Node{std::vector<Moments>(bank_.size(), moments), 1, 0});
  for (const double sigma : setup_.walk) ramp_variances_.push_back(sigma * sigma);
  predicted_.assign(model->output_count(), 0.0);
  jacobian_.assign(static_cast<std::size_t>(model->output_count()) * model->state_count(), 0.0);
  reset();
}

void FilterEstimation::listen(std::shared_ptr<const FilterMemo> memo) {
  const FilterMemo::Setup same{.noise = setup_.noise, .walk = setup_.walk, .substeps = setup_.substeps};
  if (memo && !setup_.has_ramps && memo->setup() == same) memo_ = std::move(memo);
}

void FilterEstimation::reset() noexcept {
  is_rebased_ = false;
  alive_ = bank_.size();
  best_ = 0;
  newest_ = -1;
  remembered_ = 0;
  for (std::size_t i = 0; i < bank_.size(); ++i) {
    KalmanFilter& filter = bank_[i].filter;
    bank_[i].log_likelihood = 0.0;
    filter.mean = setup_.initial_mean;
    filter.covariance = setup_.initial_covariance;
    filter.inputs().forget();
    if (bank_.size() == 1) continue;
    // Each start covers its part of the circle.
    const Roles& roles = model().description().roles;
    const int h = roles.heading;
    const double part = 2.0 * std::numbers::pi / static_cast<double>(bank_.size());
    roles.turn(part * static_cast<double>(i), filter.mean.data());
    filter.covariance.row(h).setZero();
    filter.covariance.col(h).setZero();
    filter.covariance(h, h) = std::min(setup_.initial_covariance(h, h), 0.25 * part * part);
  }
}

bool FilterEstimation::rebase(const Eigen::VectorXd& mean, const Eigen::MatrixXd& covariance) noexcept {
  alive_ = 1;
  best_ = 0;
  bank_[0].filter.mean = mean;
  bank_[0].filter.covariance = covariance;
  is_rebased_ = true;
  remembered_ = 0;
  remember();
  return true;
}

/// Log-likelihood of the measured outputs given the past, each on its own.
double FilterEstimation::log_likelihood(const KalmanFilter& filter, Measured outputs) noexcept {
  const Model& m = filter.model();
  const int ny = m.output_count(), nx = m.state_count();
  Model::Nodes request;
  request.count = 1;
  request.states = filter.mean.data();
  request.outputs = predicted_.data();
  request.jacobians = jacobian_.data();
  m.observe(request);
  double sum = 0.0;
  for (int j = 0; j < ny; ++j) {
    if (std::isnan(outputs[j])) continue;
    const double error =
        m.description().outputs[j].is_angle ? angle_difference(outputs[j], predicted_[j]) : outputs[j] - predicted_[j];
    double variance = filter.noise().output_variances[j] / outputs.weight(j);
    for (int c = 0; c < nx; ++c)
      for (int r = 0; r < nx; ++r) variance += jacobian_[c * ny + j] * filter.covariance(r, c) * jacobian_[r * ny + j];
    // A single outlier must not decide.
    sum -= 0.5 * std::min(error * error / variance, 16.0) + 0.5 * std::log(variance);
  }
  return sum;
}

void FilterEstimation::take(Measured outputs) noexcept {
  for (std::size_t i = 0; i < alive_; ++i) {
    if (alive_ > 1) bank_[i].log_likelihood += log_likelihood(bank_[i].filter, outputs);
    const std::span given(outputs.values, setup_.noise.output_variances.size());
    const bool is_known = memo_ && !outputs.weights && !bank_[i].filter.inputs().is_any_missing() &&
                          memo_->update.take(given, 0.0, bank_[i].filter);
    if (!is_known) bank_[i].filter.update(outputs);
  }
  if (alive_ == 1) return;
  best_ = 0;
  for (std::size_t i = 1; i < alive_; ++i)
    if (bank_[i].log_likelihood > bank_[best_].log_likelihood) best_ = i;
  const int h = model().description().roles.heading;
  for (std::size_t i = 0; i < alive_; ++i) {
    const bool agrees = std::abs(angle_difference(bank_[i].filter.mean[h], bank_[best_].filter.mean[h])) < 0.2;
    if (!agrees && bank_[i].log_likelihood > bank_[best_].log_likelihood - decisive) return;
  }
  std::swap(bank_[0], bank_[best_]);
  best_ = 0;
  alive_ = 1;
}

void FilterEstimation::start(Measured outputs) noexcept {
  reset();
  take(outputs);
  newest_ = 0;
  remember();
}

void FilterEstimation::add(const MeasuredInterval& interval, Measured outputs) noexcept {
  if (!(interval.duration > 0.0) || !std::isfinite(interval.duration)) {
    take(outputs);
    --remembered_;  // the same node
    return remember();
  }
  const Eigen::Index nx = model().state_count();
  for (std::size_t i = 0; i < alive_; ++i) {
    KalmanFilter& filter = bank_[i].filter;
    const std::span given(interval.inputs, setup_.noise.input_variances.size());
    const bool is_plain = interval.between == 0 && !interval.ends_with_jump;
    if (memo_ && is_plain && memo_->prediction.take(given, interval.duration, filter)) {
      filter.inputs().begin(interval.inputs, interval.duration, filter.covariance);
      continue;
    }
    filter.predict(interval, nullptr, setup_.has_ramps ? ramp_variances_.data() : nullptr, nullptr, outputs);
    bank_[i].log_likelihood += filter.between_log_likelihood();
    for (std::size_t j = 0; !setup_.has_ramps && j < setup_.walk.size(); ++j)
      filter.add_parameter_variance(static_cast<int>(j), setup_.walk[j] * setup_.walk[j]);
    for (Eigen::Index j = 0; interval.ends_with_jump && j < std::ssize(setup_.walk); ++j)
      filter.restart_parameter(static_cast<int>(j), setup_.initial_covariance(nx + j, nx + j));
  }
  take(outputs);
  ++newest_;
  remember();
}

/// Keeps what is known at the newest node.
void FilterEstimation::remember() noexcept {
  Node& kept = node(newest_);
  kept.alive = alive_;
  kept.best = best_;
  for (std::size_t i = 0; i < alive_; ++i) {
    kept.moments[i].mean = bank_[i].filter.mean;
    kept.moments[i].covariance = bank_[i].filter.covariance;
    bank_[i].filter.inputs().save(kept.moments[i].inputs.data());
    kept.moments[i].log_likelihood = bank_[i].log_likelihood;
  }
  remembered_ = std::min(remembered_ + 1, static_cast<std::int64_t>(nodes_.size()));
}

int FilterEstimation::reach() const noexcept {
  return static_cast<int>(remembered_ == newest_ + 1 && !is_rebased_ ? remembered_ : remembered_ - 1);
}

void FilterEstimation::rewind(int nodes) noexcept {
  if (nodes > newest_) return reset();
  newest_ -= nodes;
  remembered_ -= nodes;
  const Node& kept = node(newest_);
  alive_ = kept.alive;
  best_ = kept.best;
  for (std::size_t i = 0; i < alive_; ++i) {
    bank_[i].filter.mean = kept.moments[i].mean;
    bank_[i].filter.covariance = kept.moments[i].covariance;
    bank_[i].filter.inputs().restore(kept.moments[i].inputs.data());
    bank_[i].log_likelihood = kept.moments[i].log_likelihood;
  }
}

void FilterEstimation::estimate(Estimate& result, Clock::time_point) noexcept {
  const KalmanFilter& filter = bank_[best_].filter;
  const int nx = filter.model().state_count();
  result.state = filter.mean.head(nx);
  result.parameters = filter.mean.tail(filter.mean.size() - nx);
  result.covariance = filter.covariance;
  result.report = {};
  result.report.status = Status::solved;
  result.fallback = !filter.mean.allFinite();
  result.predicted = false;
}

}  // namespace rhec
