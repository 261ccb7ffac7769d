#include "rhec/core/ocp/iterate_checks.hpp"

#include <algorithm>
#include <cmath>

namespace rhec {

bool is_finite(const Ocp& ocp, const Iterate& iterate) noexcept {
  double rest = 0.0;  // stays 0 as long as everything is finite
  const auto check = [&](const double* row, int n) {
    double of_row = 0.0;  // a separate sum per row, so that rows are independent
    for (int j = 0; j < n; ++j) of_row += 0.0 * row[j];
    rest += of_row;
  };
  const bool is_limited = ocp.capacity().limits > 0;
  for (int i = 0; i <= ocp.intervals(); ++i) {
    const int n = ocp.state_count(i), m = i < ocp.intervals() ? ocp.control_count(i) : 0;
    for (const double* row : {iterate.state(i), iterate.costate(i), iterate.state_bound(i)}) check(row, n);
    if (is_limited) check(iterate.limit_bound(i), ocp.limit_count(i));
    if (m == 0) continue;
    for (const double* row : {iterate.control(i), iterate.control_bound(i)}) check(row, m);
  }
  return rest == 0.0;
}

namespace {

bool bounds_are_numbers(const Ocp& ocp) noexcept {
  bool numbers = true;
  const bool is_limited = ocp.capacity().limits > 0;
  const auto check = [&](const double* row, int n) {
    for (int j = 0; j < n; ++j) numbers = numbers && !std::isnan(row[j]);
  };
  for (int i = 0; i <= ocp.intervals(); ++i) {
    for (const double* row : {ocp.state_lower(i), ocp.state_upper(i)}) check(row, ocp.state_count(i));
    if (i < ocp.intervals())
      for (const double* row : {ocp.control_lower(i), ocp.control_upper(i)}) check(row, ocp.control_count(i));
    if (const int limits = is_limited ? ocp.limit_count(i) : 0; limits > 0)
      for (const double* row : {ocp.limit_lower(i), ocp.limit_upper(i), ocp.limit_linear(i), ocp.limit_quadratic(i)})
        check(row, limits);
  }
  return numbers;
}

/// A guess can be finite where what is given of its first node is not.
bool given_state_is_finite(const Ocp& ocp) noexcept {
  const double* const given = ocp.initial_state();
  return !given || std::all_of(given, given + ocp.state_count(0), [](double value) { return std::isfinite(value); });
}

}  // namespace

bool has_sound_numbers(const Ocp& ocp, const Iterate& iterate) noexcept {
  return iterate.capacity() == ocp.capacity() && is_finite(ocp, iterate) && given_state_is_finite(ocp) &&
         bounds_are_numbers(ocp);
}

bool is_sound_start(const Ocp& ocp, const Iterate& iterate, std::span<double> scratch) noexcept {
  return has_sound_numbers(ocp, iterate) && std::isfinite(ocp.evaluate(iterate, nullptr, scratch));
}

double largest_costate(const Ocp& ocp, const Iterate& iterate) noexcept {
  double largest = 0.0;
  for (int i = 1; i <= ocp.intervals(); ++i)
    for (int j = 0, n = ocp.state_count(i); j < n; ++j) largest = std::max(largest, std::abs(iterate.costate(i)[j]));
  return largest;
}

double largest_bound_multiplier(const Ocp& ocp, const Iterate& iterate) noexcept {
  double largest = 0.0;
  for (int i = 0; i <= ocp.intervals(); ++i) {
    const int n = ocp.state_count(i), m = i < ocp.intervals() ? ocp.control_count(i) : 0;
    for (int j = 0; j < n; ++j) largest = std::max(largest, std::abs(iterate.state_bound(i)[j]));
    for (int j = 0; j < m; ++j) largest = std::max(largest, std::abs(iterate.control_bound(i)[j]));
    for (int j = 0, limits = ocp.limit_count(i); j < limits; ++j)
      largest = std::max(largest, std::abs(iterate.limit_bound(i)[j]));
  }
  return largest;
}

double total_violation(const Ocp& ocp, const Iterate& iterate) noexcept {
  double total = 0.0;
  const auto add = [&](const double* value, const double* lower, const double* upper, int n) {
    for (int j = 0; j < n; ++j) total += std::max({0.0, lower[j] - value[j], value[j] - upper[j]});
  };
  for (int i = 0; i <= ocp.intervals(); ++i) {
    add(iterate.state(i), ocp.state_lower(i), ocp.state_upper(i), ocp.state_count(i));
    if (i < ocp.intervals()) add(iterate.control(i), ocp.control_lower(i), ocp.control_upper(i), ocp.control_count(i));
  }
  return total;
}

}  // namespace rhec
