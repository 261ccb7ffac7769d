#pragma once

#include <numbers>
#include <span>

#include <Eigen/Core>

#include "rhec/core/estimation/input_guess.hpp"

namespace rhec {

/// Inputs that nobody knows turn a vehicle until it may head anywhere. An angle whose standard deviation is more than
/// half a turn has nothing to do with what else is estimated any more: what is linear about it would lead that far
/// astray once the angle is measured. In the covariance of [x; ...] and in what `guess` has of it, it becomes
/// independent, with a standard deviation of half a turn. False if there is no such angle.
inline bool release_angles(std::span<const Variable> states, Eigen::MatrixXd& covariance, InputGuess& guess) noexcept {
  constexpr double most = std::numbers::pi * std::numbers::pi;
  bool is_any = false;
  for (Eigen::Index j = 0; j < std::ssize(states); ++j) {
    if (!states[static_cast<std::size_t>(j)].is_angle || !(covariance(j, j) > most)) continue;
    covariance.row(j).setZero();
    covariance.col(j).setZero();
    covariance(j, j) = most;
    for (int input = 0; input < guess.with_state().cols(); ++input) guess.set_with_state(j, input, 0.0);
    is_any = true;
  }
  return is_any;
}

}  // namespace rhec
