#pragma once

#include "rhec/core/model/pattern.hpp"

namespace rhec::kernels {

/// Which derivatives of the four stages f_k of a Runge-Kutta step with respect to z = [x; p; u] can be non-zero.
template <class Formula>
struct StepPattern {
  static constexpr int nx = Formula::state_count, np = Formula::parameter_count, nu = Formula::input_count;
  static constexpr int nz = nx + np + nu;
  static constexpr DynamicsPattern<Formula> pattern{};

  /// Which entries of z the rates f_k can depend on, as bit masks.
  static constexpr auto find_dependence() {
    std::array<std::array<std::uint64_t, nx>, 4> depends{};
    for (int k = 0; k < 4; ++k)
      for (int r = 0; r < nx; ++r)
        for (int a = 0; a < nz; ++a)
          if (pattern.first[r] >> a & 1)
            depends[k][r] |= std::uint64_t{1} << a | (k > 0 && a < nx ? depends[k - 1][a] : 0);
    return depends;
  }
  static constexpr std::array<std::array<std::uint64_t, nx>, 4> dependence = find_dependence();
  /// The entries of z that component r of any f_k can depend on.
  static constexpr std::uint64_t rates_depend(int r) {
    return dependence[0][r] | dependence[1][r] | dependence[2][r] | dependence[3][r];
  }
  template <int k>
  static constexpr bool rate_depends(int r, int j) {
    return (dependence[k][r] >> j & 1) != 0;
  }
  /// The same for argument a of f_k.
  template <int k>
  static constexpr bool argument_depends(int a, int j) {
    if (a == j) return true;
    if constexpr (k > 0) return a < nx && rate_depends<k - 1>(a, j);
    return false;
  }
  /// Whether any rate depends on argument a, so that its sensitivity is needed.
  static constexpr bool is_argument(int a) {
    for (int r = 0; r < nx; ++r)
      if (pattern.first[r] >> a & 1) return true;
    return false;
  }
  static constexpr bool curves(int a, int b) { return (pattern.second[a] >> b & 1) != 0; }
  /// Whether d2f_r/(da db) can be non-zero.
  static constexpr bool bends(int r, int a, int b) {
    return curves(a, b) && (pattern.first[r] >> a & 1) != 0 && (pattern.first[r] >> b & 1) != 0;
  }
  /// Positions of the entries that can be non-zero, stored contiguously.
  static constexpr int first_place(int r, int a) {
    int place = 0;
    for (int row = 0; row <= r; ++row)
      for (int argument = 0; argument < (row < r ? nz : a); ++argument) place += pattern.first[row] >> argument & 1;
    return place;
  }
  static constexpr int second_place(int r, int a, int b) {
    int place = 0;
    for (int row = 0; row <= r; ++row)
      for (int i = 0; i < nz; ++i)
        for (int j = 0; j <= i; ++j)
          if (row < r || pair(i, j) < pair(a, b)) place += bends(row, i, j);
    return place;
  }
  /// Position of a pair in a lower triangle.
  static constexpr int pair(int a, int b) { return a > b ? a * (a + 1) / 2 + b : b * (b + 1) / 2 + a; }
  static constexpr int pair_of_directions(int a, int b) {
    return pair(pattern.direction_of[a], pattern.direction_of[b]);
  }

  /// Whether row i of the Hessian of a sum of next states can be non-zero.
  static constexpr bool is_bent(int i) {
    for (int b = 0; b < nz; ++b)
      if (pattern.second[b] != 0 && (i == b || (b < nx && (rates_depend(b) >> i & 1) != 0))) return true;
    return false;
  }
};

}  // namespace rhec::kernels
