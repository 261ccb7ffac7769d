#include "limit_rows.hpp"

#include <algorithm>
#include <cmath>

#include "rhec/core/base/infinity.hpp"

namespace rhec::sparse_sqp {

using State = LimitRows::State;

void LimitRows::take_structure(int rows) { states_.assign(rows, State::both); }

void LimitRows::guess(const Data& limits, const double* multipliers) {
  for (const int r : limits.rows) {
    const double multiplier = multipliers[r], price = limits.linear[r];
    State& state = states_[r];
    if (multiplier < 0.0 && -multiplier >= price && limits.lower[r] > -infinity)
      state = State::below;
    else if (multiplier > 0.0 && multiplier >= price && limits.upper[r] < infinity)
      state = State::above;
    else if (limits.lower[r] == limits.upper[r])
      state = State::both;
    else if (multiplier < 0.0 && limits.lower[r] > -infinity)
      state = State::lower;
    else if (multiplier > 0.0 && limits.upper[r] < infinity)
      state = State::upper;
    else
      state = State::off;
  }
}

void LimitRows::describe(const Data& limits, double* multipliers) const {
  for (const int r : limits.rows) {
    const double price = limits.linear[r], within = price < infinity ? 0.5 * price : 1.0;
    switch (states_[r]) {
      case State::off:
      case State::both:
        multipliers[r] = 0.0;
        break;
      case State::lower:
        multipliers[r] = -within;
        break;
      case State::upper:
        multipliers[r] = within;
        break;
      case State::below:
        multipliers[r] = -price - 1.0;
        break;
      case State::above:
        multipliers[r] = price + 1.0;
        break;
    }
  }
}

bool LimitRows::is_known(const Data& limits, int r) const noexcept {
  const State state = states_[r];
  return state == State::off || ((state == State::below || state == State::above) && limits.quadratic[r] == 0.0);
}

double LimitRows::known_multiplier(const Data& limits, int r) const noexcept {
  if (states_[r] == State::off) return 0.0;
  return states_[r] == State::above ? limits.linear[r] : -limits.linear[r];
}

void LimitRows::write_matrix(const Data& limits, std::uint8_t* off, double* dual) const noexcept {
  for (const int r : limits.rows) {
    const bool is_beyond = states_[r] == State::below || states_[r] == State::above;
    off[r] = is_known(limits, r);
    dual[r] = is_beyond && !off[r] ? 1.0 / limits.quadratic[r] : 0.0;
  }
}

double LimitRows::unmet(const Data& limits, int r, double value, double multiplier) const noexcept {
  if (is_known(limits, r)) return 0.0;
  switch (states_[r]) {
    case State::off:
      break;
    case State::lower:
    case State::both:
      return value - limits.lower[r];
    case State::upper:
      return value - limits.upper[r];
    case State::below:
      return value - limits.lower[r] - (multiplier + limits.linear[r]) / limits.quadratic[r];
    case State::above:
      return value - limits.upper[r] - (multiplier - limits.linear[r]) / limits.quadratic[r];
  }
  return 0.0;
}

LimitRows::Change LimitRows::update(const Data& limits, const double* values, const double* multipliers,
                                    double value_tolerance, double multiplier_tolerance) {
  Change change;
  for (const int r : limits.rows) {
    const double lower = limits.lower[r], upper = limits.upper[r], price = limits.linear[r];
    const double value = values[r], multiplier = multipliers[r];
    const bool is_below = value<lower - value_tolerance, is_above = value> upper + value_tolerance;
    // Without a linear weight there is nothing between off and beyond.
    const bool is_smooth = price == 0.0, is_equation = lower == upper;
    const State at_lower = is_smooth ? State::below : is_equation ? State::both : State::lower;
    const State at_upper = is_smooth ? State::above : is_equation ? State::both : State::upper;
    const bool falls_short =
        multiplier<-price - multiplier_tolerance, exceeds = multiplier> price + multiplier_tolerance;
    State next = states_[r];
    switch (states_[r]) {
      case State::off:
        if (is_below) next = at_lower;
        if (is_above) next = at_upper;
        break;
      case State::lower:
        if (multiplier > multiplier_tolerance) next = State::off;
        if (falls_short) next = State::below;
        break;
      case State::upper:
        if (multiplier < -multiplier_tolerance) next = State::off;
        if (exceeds) next = State::above;
        break;
      case State::both:
        if (falls_short) next = State::below;
        if (exceeds) next = State::above;
        break;
      case State::below:
        if (value > lower + value_tolerance) next = is_smooth ? State::off : at_lower;
        break;
      case State::above:
        if (value < upper - value_tolerance) next = is_smooth ? State::off : at_upper;
        break;
    }
    if (next != states_[r]) ++(next == State::off ? change.released : change.added);
    states_[r] = next;
  }
  return change;
}

void LimitRows::clip(const Data& limits, double* multipliers) const noexcept {
  for (const int r : limits.rows) {
    double& multiplier = multipliers[r];
    const double price = limits.linear[r];
    switch (states_[r]) {
      case State::off:
        multiplier = 0.0;
        break;
      case State::lower:
        multiplier = std::clamp(multiplier, -price, 0.0);
        break;
      case State::upper:
        multiplier = std::clamp(multiplier, 0.0, price);
        break;
      case State::both:
        multiplier = std::clamp(multiplier, -price, price);
        break;
      case State::below:
        multiplier = std::min(multiplier, -price);
        break;
      case State::above:
        multiplier = std::max(multiplier, price);
        break;
    }
  }
}

}  // namespace rhec::sparse_sqp
