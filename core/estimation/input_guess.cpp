#include "rhec/core/estimation/input_guess.hpp"

#include <algorithm>
#include <cmath>

#include "rhec/core/estimation/measurement.hpp"

namespace rhec {
namespace {

// How far an input walks, in typical magnitudes; also what one may be that was never measured.
constexpr double most_sigma = 3.0;
// No input is more than so many of these.
constexpr double farthest = 100.0;
// Changes are seen over this time at least, and remembered for so long [s].
constexpr double shortest_change = 0.15, walk_memory = 10.0;
// So much of the inputs' variances is explained by the state where it was too much.
constexpr double most_explained = 0.99;
constexpr double rounding = 1e-9;

}  // namespace

InputWalk::InputWalk(const Variable& input) noexcept
    : lower(std::max(input.lower, -farthest * input.scale)),
      upper(std::min(input.upper, farthest * input.scale)),
      widest(std::min(most_sigma * input.scale, unknown_sigma(input))),
      start(std::min(std::max(0.0, lower), upper)),
      least_rate_(input.scale * input.scale) {
  forget();
}

/// A change is one over some time, so that the noise of two measurements counts for little. What is beyond the bounds
/// counts as these.
void InputWalk::see(double measured, double duration) noexcept {
  measured = std::min(std::max(measured, lower), upper);
  seen_.age += duration;
  if (std::isnan(measured) || std::isnan(seen_.value)) {
    seen_.value = measured;
    seen_.age = 0.0;
    return;
  }
  if (seen_.age < shortest_change) return;
  const double change = measured - seen_.value;
  seen_.rate += std::min(seen_.age / walk_memory, 1.0) * (change * change / seen_.age - seen_.rate);
  seen_.rate = std::max(seen_.rate, least_rate_);
  seen_.value = measured;
  seen_.age = 0.0;
}

double* InputWalk::save(double* state) const noexcept {
  const double all[] = {seen_.rate, seen_.value, seen_.age};
  return std::copy_n(all, state_size, state);
}

const double* InputWalk::restore(const double* state) noexcept {
  seen_ = {state[0], state[1], state[2]};
  return state + state_size;
}

InputGuess::InputGuess(std::span<const Variable> inputs, Eigen::Index states)
    : is_missing_(inputs.size(), 0),
      mean_(Eigen::VectorXd::Zero(std::ssize(inputs))),
      covariance_(Eigen::MatrixXd::Zero(std::ssize(inputs), std::ssize(inputs))),
      with_state_(Eigen::MatrixXd::Zero(states, std::ssize(inputs))),
      state_mean_(Eigen::VectorXd::Zero(states)),
      moved_(state_mean_),
      state_covariance_(Eigen::MatrixXd::Identity(states, states)),
      change_(state_covariance_),
      solved_(with_state_),
      image_(with_state_),
      explained_(covariance_),
      left_(Eigen::MatrixXd::Identity(std::ssize(inputs), std::ssize(inputs))),
      factors_(state_covariance_),
      factors_of_inputs_(left_) {
  for (const Variable& input : inputs) walks_.emplace_back(input);
  forget();
}

void InputGuess::forget() noexcept {
  is_any_missing_ = is_predicted_ = false;
  std::ranges::fill(is_missing_, std::uint8_t{0});
  with_state_.setZero();
  covariance_.setZero();
  for (std::size_t j = 0; j < walks_.size(); ++j) {
    const auto row = static_cast<Eigen::Index>(j);
    walks_[j].forget();
    mean_[row] = walks_[j].start;
    covariance_(row, row) = walks_[j].widest * walks_[j].widest;
  }
}

void InputGuess::drop(Eigen::Index input) noexcept {
  covariance_.row(input).setZero();
  covariance_.col(input).setZero();
  with_state_.col(input).setZero();
}

void InputGuess::begin(const double* measured, double duration,
                       const Eigen::Ref<const Eigen::MatrixXd>& of_state) noexcept {
  is_any_missing_ = is_predicted_ = false;
  for (std::size_t j = 0; j < walks_.size(); ++j) {
    const auto row = static_cast<Eigen::Index>(j);
    InputWalk& walk = walks_[j];
    walk.see(measured[j], duration);
    is_missing_[j] = std::isnan(measured[j]) ? 1 : 0;
    if (is_missing_[j] == 0) {
      mean_[row] = std::min(std::max(measured[j], walk.lower), walk.upper);
      if (covariance_(row, row) > 0.0) drop(row);
      continue;
    }
    is_any_missing_ = true;
    double& variance = covariance_(row, row);
    variance = std::max(variance, std::min(variance + walk.growth(duration), walk.widest * walk.widest));
  }
  if (is_any_missing_) limit(of_state);
}

/// What others have made of the state's covariance must not be less than what the inputs' explain of it: V - C' P^-1 C
/// is a covariance.
void InputGuess::limit(const Eigen::Ref<const Eigen::MatrixXd>& of_state) noexcept {
  state_covariance_ = of_state;
  factors_.compute(state_covariance_);
  solved_ = factors_.solve(with_state_);
  explained_.noalias() = with_state_.transpose() * solved_;
  left_ = covariance_ - explained_;
  for (Eigen::Index j = 0; j < mean_.size(); ++j) left_(j, j) += rounding * covariance_(j, j);
  // A row of 0 is that of a measured input.
  factors_of_inputs_.compute(left_);
  if (left_.allFinite() && factors_of_inputs_.vectorD().minCoeff() >= 0.0) return;
  left_ = covariance_;
  factors_of_inputs_.compute(left_);
  left_ = factors_of_inputs_.solve(explained_);
  const double share = left_.trace();
  with_state_ *= std::isfinite(share) && share > 0.0 ? std::sqrt(std::min(1.0, most_explained / share)) : 0.0;
}

void InputGuess::predicted(const Eigen::Ref<const Eigen::VectorXd>& mean,
                           const Eigen::Ref<const Eigen::MatrixXd>& covariance) noexcept {
  state_mean_ = mean;
  state_covariance_ = covariance;
  is_predicted_ = true;
}

void InputGuess::resume(const Eigen::Ref<const Eigen::VectorXd>& mean,
                        const Eigen::Ref<const Eigen::MatrixXd>& covariance) noexcept {
  if (knows_missing()) predicted(mean, covariance);
}

void InputGuess::updated(const Eigen::Ref<const Eigen::VectorXd>& mean,
                         const Eigen::Ref<const Eigen::MatrixXd>& covariance) noexcept {
  if (!is_predicted_) return;
  factors_.compute(state_covariance_);
  solved_ = factors_.solve(with_state_);
  moved_ = mean - state_mean_;
  change_ = covariance - state_covariance_;
  image_.noalias() = change_ * solved_;
  explained_.noalias() = solved_.transpose() * image_;
  if (!solved_.allFinite() || !explained_.allFinite() || !moved_.allFinite()) return;
  with_state_ += image_;
  covariance_ += explained_;
  for (Eigen::Index j = 0; j < mean_.size(); ++j) {
    mean_[j] += solved_.col(j).dot(moved_);
    const InputWalk& walk = walks_[static_cast<std::size_t>(j)];
    mean_[j] = std::min(std::max(mean_[j], walk.lower), walk.upper);
    if (!(covariance_(j, j) > 0.0)) drop(j);
  }
  // Another update may follow.
  state_mean_ = mean;
  state_covariance_ = covariance;
}

void InputGuess::save(double* state) const noexcept {
  state = std::copy_n(mean_.data(), mean_.size(), state);
  state = std::copy_n(covariance_.data(), covariance_.size(), state);
  state = std::copy_n(with_state_.data(), with_state_.size(), state);
  for (const InputWalk& walk : walks_) state = walk.save(state);
}

void InputGuess::restore(const double* state) noexcept {
  is_any_missing_ = is_predicted_ = false;
  const auto take = [&state](auto& to) {
    std::copy_n(state, to.size(), to.data());
    state += to.size();
  };
  take(mean_);
  take(covariance_);
  take(with_state_);
  for (InputWalk& walk : walks_) state = walk.restore(state);
}

}  // namespace rhec
