#pragma once

#include <array>
#include <cstdint>

#include "rhec/core/model/dual.hpp"

namespace rhec {

/// Which derivatives of a number can be non-zero, found by computing with patterns instead of values: bit j of `first`
/// for d/da_j, bit j of `second[i]` for d2/(da_i da_j). If a formula's functions are constexpr, its pattern is found at
/// compile time.
struct DerivativePattern {
  static constexpr int most_arguments = 64;
  std::uint64_t first = 0;
  std::array<std::uint64_t, most_arguments> second{};

  constexpr DerivativePattern() = default;
  constexpr DerivativePattern(double /*constant*/) {}  // NOLINT(google-explicit-constructor)
  static constexpr DerivativePattern argument(int j) {
    DerivativePattern pattern;
    pattern.first = std::uint64_t{1} << j;
    return pattern;
  }
  constexpr void bend(std::uint64_t a, std::uint64_t b) {
    for (int i = 0; i < most_arguments; ++i) {
      if (a >> i & 1) second[i] |= b;
      if (b >> i & 1) second[i] |= a;
    }
  }
  friend constexpr DerivativePattern operator+(const DerivativePattern& a, const DerivativePattern& b) {
    DerivativePattern sum = a;
    sum.first |= b.first;
    for (int i = 0; i < most_arguments; ++i) sum.second[i] |= b.second[i];
    return sum;
  }
  friend constexpr DerivativePattern operator-(const DerivativePattern& a, const DerivativePattern& b) { return a + b; }
  friend constexpr DerivativePattern operator-(const DerivativePattern& a) { return a; }
  friend constexpr DerivativePattern operator*(const DerivativePattern& a, const DerivativePattern& b) {
    DerivativePattern product = a + b;
    product.bend(a.first, b.first);
    return product;
  }
  friend constexpr DerivativePattern operator/(const DerivativePattern& a, const DerivativePattern& b) {
    return a * curved(b);
  }
  template <class Other>
  constexpr DerivativePattern& operator+=(const Other& b) {
    return *this = *this + b;
  }
  template <class Other>
  constexpr DerivativePattern& operator-=(const Other& b) {
    return *this = *this - b;
  }
  template <class Other>
  constexpr DerivativePattern& operator*=(const Other& b) {
    return *this = *this * b;
  }
  template <class Other>
  constexpr DerivativePattern& operator/=(const Other& b) {
    return *this = *this / b;
  }
  static constexpr DerivativePattern curved(const DerivativePattern& a) {
    DerivativePattern result = a;
    result.bend(a.first, a.first);
    return result;
  }
  friend constexpr DerivativePattern sqrt(const DerivativePattern& a) { return curved(a); }
  friend constexpr DerivativePattern exp(const DerivativePattern& a) { return curved(a); }
  friend constexpr DerivativePattern log(const DerivativePattern& a) { return curved(a); }
  friend constexpr DerivativePattern sin(const DerivativePattern& a) { return curved(a); }
  friend constexpr DerivativePattern cos(const DerivativePattern& a) { return curved(a); }
  friend constexpr DerivativePattern tan(const DerivativePattern& a) { return curved(a); }
  friend constexpr DerivativePattern tanh(const DerivativePattern& a) { return curved(a); }
  friend constexpr DerivativePattern asin(const DerivativePattern& a) { return curved(a); }
  friend constexpr DerivativePattern acos(const DerivativePattern& a) { return curved(a); }
  friend constexpr DerivativePattern atan(const DerivativePattern& a) { return curved(a); }
  friend constexpr DerivativePattern atan2(const DerivativePattern& y, const DerivativePattern& x) {
    return curved(y + x);
  }
};

/// The patterns of dx/dt = f(x, p, u) with respect to [x; p; u].
template <class Formula>
constexpr auto pattern_of_dynamics() {
  constexpr int nx = Formula::state_count, np = Formula::parameter_count, nu = Formula::input_count;
  std::array<DerivativePattern, nx> rates{};
  std::array<DerivativePattern, nx> x{};
  std::array<DerivativePattern, np + 1> p{};
  std::array<DerivativePattern, nu + 1> u{};
  for (int j = 0; j < nx; ++j) x[j] = DerivativePattern::argument(j);
  for (int j = 0; j < np; ++j) p[j] = DerivativePattern::argument(nx + j);
  for (int j = 0; j < nu; ++j) u[j] = DerivativePattern::argument(nx + np + j);
  Formula().dynamics(static_cast<const DerivativePattern*>(x.data()), static_cast<const DerivativePattern*>(u.data()),
                     static_cast<const DerivativePattern*>(p.data()), rates.data());
  return rates;
}

/// The patterns of y = h(x) with respect to x.
template <class Formula>
constexpr auto pattern_of_outputs() {
  std::array<DerivativePattern, Formula::output_count> y{};
  std::array<DerivativePattern, Formula::state_count> x{};
  for (int j = 0; j < Formula::state_count; ++j) x[j] = DerivativePattern::argument(j);
  Formula().outputs(static_cast<const DerivativePattern*>(x.data()), y.data());
  return y;
}

/// Formulas whose pattern is available at compile time.
template <class Formula>
concept HasPattern = requires {
  typename std::bool_constant<(pattern_of_dynamics<Formula>(), true)>;
};
template <class Formula>
concept HasOutputPattern = requires {
  typename std::bool_constant<(pattern_of_outputs<Formula>(), true)>;
};

/// Curvature pattern of the outputs: which second derivatives of any output can be non-zero. All of them if the pattern
/// is not available at compile time.
template <class Formula>
struct OutputPattern {
  static constexpr int nx = Formula::state_count;
  static_assert(nx <= DerivativePattern::most_arguments);

  std::array<std::uint64_t, nx> second{};
  /// States in which some output is nonlinear: the directions of differentiation.
  std::array<int, nx> direction_of{};  ///< -1: none
  int curved = 0;

  constexpr OutputPattern() {
    if constexpr (HasOutputPattern<Formula>) {
      for (const DerivativePattern& output : pattern_of_outputs<Formula>())
        for (int i = 0; i < nx; ++i) second[i] |= output.second[i];
    } else {
      second.fill(~std::uint64_t{0});
    }
    for (int i = 0; i < nx; ++i) direction_of[i] = second[i] != 0 ? curved++ : -1;
  }
  constexpr bool bends(int i, int j) const { return (second[i] >> j & 1) != 0; }
};

/// What a Runge-Kutta step needs to know about the derivatives of f with respect to a = [x; p; u]. Without a
/// compile-time pattern, nothing is omitted.
template <class Formula>
struct DynamicsPattern {
  static constexpr int nx = Formula::state_count;
  static constexpr int arguments = nx + Formula::parameter_count + Formula::input_count;
  static_assert(arguments <= DerivativePattern::most_arguments);

  std::array<std::uint64_t, nx> first{};          ///< of each state's rate
  std::array<std::uint64_t, arguments> second{};  ///< of any of them
  /// Arguments that f depends on, nonlinear ones first: the directions of differentiation.
  std::array<int, arguments> direction_of{};  ///< -1: none
  int directions = 0, curved = 0;

  constexpr DynamicsPattern() {
    const std::uint64_t all = arguments == 64 ? ~std::uint64_t{0} : (std::uint64_t{1} << arguments) - 1;
    if constexpr (HasPattern<Formula>) {
      constexpr auto rates = pattern_of_dynamics<Formula>();
      for (int r = 0; r < nx; ++r) {
        first[r] = rates[r].first;
        for (int i = 0; i < arguments; ++i) second[i] |= rates[r].second[i];
      }
    } else {
      first.fill(all);
      second.fill(all);
    }
    std::uint64_t active = 0;
    for (int r = 0; r < nx; ++r) active |= first[r];
    direction_of.fill(-1);
    for (int a = 0; a < arguments; ++a)
      if (second[a] != 0) direction_of[a] = directions++;
    curved = directions;
    for (int a = 0; a < arguments; ++a)
      if (second[a] == 0 && (active >> a & 1)) direction_of[a] = directions++;
  }
};

}  // namespace rhec
