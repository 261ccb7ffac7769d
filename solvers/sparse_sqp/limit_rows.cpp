#include "limit_rows.hpp"

#include <algorithm>
#include <cmath>

#include "rhec/core/base/infinity.hpp"

namespace rhec::sparse_sqp {

using RowState = LimitRows::State;

void LimitRows::take_structure(int rows) { states_.assign(rows, RowState::both); }

void LimitRows::guess(const Data& limits, const double* multipliers) {
  for (const int r : limits.rows) {
    const double multiplier = multipliers[r], price = limits.linear[r];
    RowState& state = states_[r];
    if (multiplier < 0.0 && -multiplier >= price && limits.lower[r] > -infinity)
      state = RowState::below;
    else if (multiplier > 0.0 && multiplier >= price && limits.upper[r] < infinity)
      state = RowState::above;
    else if (limits.lower[r] == limits.upper[r])
      state = RowState::both;
    else if (multiplier < 0.0 && limits.lower[r] > -infinity)
      state = RowState::lower;
    else if (multiplier > 0.0 && limits.upper[r] < infinity)
      state = RowState::upper;
    else
      state = RowState::off;
  }
}

void LimitRows::describe(const Data& limits, double* multipliers) const {
  for (const int r : limits.rows) {
    const double price = limits.linear[r], within = price < infinity ? 0.5 * price : 1.0;
    switch (states_[r]) {
      case RowState::off:
      case RowState::both:
        multipliers[r] = 0.0;
        break;
      case RowState::lower:
        multipliers[r] = -within;
        break;
      case RowState::upper:
        multipliers[r] = within;
        break;
      case RowState::below:
        multipliers[r] = -price - 1.0;
        break;
      case RowState::above:
        multipliers[r] = price + 1.0;
        break;
    }
  }
}

bool LimitRows::is_known(const Data& limits, int r) const noexcept {
  const RowState state = states_[r];
  return state == RowState::off ||
         ((state == RowState::below || state == RowState::above) && limits.quadratic[r] == 0.0);
}

double LimitRows::known_multiplier(const Data& limits, int r) const noexcept {
  if (states_[r] == RowState::off) return 0.0;
  return states_[r] == RowState::above ? limits.linear[r] : -limits.linear[r];
}

void LimitRows::write_matrix(const Data& limits, std::uint8_t* off, double* dual) const noexcept {
  for (const int r : limits.rows) {
    const bool is_beyond = states_[r] == RowState::below || states_[r] == RowState::above;
    off[r] = is_known(limits, r);
    dual[r] = is_beyond && !off[r] ? 1.0 / limits.quadratic[r] : 0.0;
  }
}

double LimitRows::unmet(const Data& limits, int r, double value, double multiplier) const noexcept {
  if (is_known(limits, r)) return 0.0;
  switch (states_[r]) {
    case RowState::off:
      break;
    case RowState::lower:
    case RowState::both:
      return value - limits.lower[r];
    case RowState::upper:
      return value - limits.upper[r];
    case RowState::below:
      return value - limits.lower[r] - (multiplier + limits.linear[r]) / limits.quadratic[r];
    case RowState::above:
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
    const RowState at_lower = is_smooth ? RowState::below : is_equation ? RowState::both : RowState::lower;
    const RowState at_upper = is_smooth ? RowState::above : is_equation ? RowState::both : RowState::upper;
    const bool falls_short =
        multiplier<-price - multiplier_tolerance, exceeds = multiplier> price + multiplier_tolerance;
    RowState next = states_[r];
    switch (states_[r]) {
      case RowState::off:
        if (is_below) next = at_lower;
        if (is_above) next = at_upper;
        break;
      case RowState::lower:
        if (multiplier > multiplier_tolerance) next = RowState::off;
        if (falls_short) next = RowState::below;
        break;
      case RowState::upper:
        if (multiplier < -multiplier_tolerance) next = RowState::off;
        if (exceeds) next = RowState::above;
        break;
      case RowState::both:
        if (falls_short) next = RowState::below;
        if (exceeds) next = RowState::above;
        break;
      case RowState::below:
        if (value > lower + value_tolerance) next = is_smooth ? RowState::off : at_lower;
        break;
      case RowState::above:
        if (value < upper - value_tolerance) next = is_smooth ? RowState::off : at_upper;
        break;
    }
    if (next != states_[r]) ++(next == RowState::off ? change.released : change.added);
    states_[r] = next;
  }
  return change;
}

void LimitRows::clip(const Data& limits, double* multipliers) const noexcept {
  for (const int r : limits.rows) {
    double& multiplier = multipliers[r];
    const double price = limits.linear[r];
    switch (states_[r]) {
      case RowState::off:
        multiplier = 0.0;
        break;
      case RowState::lower:
        multiplier = std::clamp(multiplier, -price, 0.0);
        break;
      case RowState::upper:
        multiplier = std::clamp(multiplier, 0.0, price);
        break;
      case RowState::both:
        multiplier = std::clamp(multiplier, -price, price);
        break;
      case RowState::below:
        multiplier = std::min(multiplier, -price);
        break;
      case RowState::above:
        multiplier = std::max(multiplier, price);
        break;
    }
  }
}

}  // namespace rhec::sparse_sqp
