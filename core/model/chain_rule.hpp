#pragma once

#include <array>
#include <cstdint>
#include <span>
#include <utility>
#include <vector>

#include "rhec/core/formula/tape.hpp"

namespace rhec {

/// The classical method of Runge and Kutta, of order 4: where its stages lie, and their weights.
struct ClassicalMethod {
  static constexpr std::array<double, 4> reach{0.0, 0.5, 0.5, 1.0}, share{1.0 / 6.0, 1.0 / 3.0, 1.0 / 3.0, 1.0 / 6.0};
};

/// Where derivatives of dx/dt = f(a) are not always zero, with a = [x; p; u].
struct RatesStructure {
  struct Entry {
    int row, column;
  };
  int nx = 0, np = 0, nu = 0;
  std::vector<Entry> slopes;  ///< df_row/da_column, row by row
  std::vector<Entry> bends;   ///< sum_r mu_r d2f_r/da2, its lower half

  int na() const { return nx + np + nu; }
};

/// Where the numbers of a Runge-Kutta step and of its derivatives stand, as registers of eight lanes. With a ramp, the
/// parameters of stage k are rest_k p + run_k p_end.
struct ChainRulePlaces {
  ChainRulePlaces(const RatesStructure& of, bool ramp);

  bool ramp;
  int nx, np, nu, na, nz;
  std::uint32_t zero, one;                                   ///< constants
  std::uint32_t share, reach, run, rest;                     ///< of each stage; the first two times h
  std::uint32_t z, x, next, weights, next_weights, product;  ///< n_z, then n_x each
  std::array<std::uint32_t, 4> arguments, rates, slopes, adjoints;
  std::uint32_t bends;
  std::array<std::uint32_t, 4> moved;  ///< d x_k / dz: n_x rows; those of the first stage in a later step only
  std::uint32_t sum, moved_next;       ///< a row; d x_next / dz
  std::uint32_t hessian;               ///< n_z rows
  std::array<std::uint32_t, 2> bent;   ///< d adjoint / dz, of one stage and of the one before it: n_x rows
  std::uint32_t pull, pull_next;       ///< d weights / dz at a step's end and at its start: n_x rows
  std::uint32_t count;

  std::uint32_t entry(std::uint32_t matrix, int row, int column) const {
    return matrix + static_cast<std::uint32_t>(row * nz + column);
  }
};

/// The chain rule of classical Runge-Kutta steps as sparse products, for a formula whose steps are too long to be
/// written out. A step from x with the weights w of its result has the stages
///
///     a_k = [x_k; p_k; u],  x_1 = x,  x_k = x + h c_k f(a_{k-1}),  x_next = x + h sum_k b_k f(a_k)
///
/// with c = (0, 1/2, 1/2, 1), b = (1/6, 1/3, 1/3, 1/6). Along the variables z of an interval, with A_k = da_k/dz, their
/// derivatives are those of each line (forward); the adjoints of the f(a_k) and the gradient of w'x_next follow
/// backwards,
///
///     mu_k = h b_k w + h c_{k+1} f_x(a_{k+1})' mu_{k+1},      g = w + sum_k f_x(a_k)' mu_k,
///
/// and the Hessian is the derivative of that along z, forward over reverse:
///
///     G_k = C_k A_k + f_a(a_k)' dmu_k/dz,     C_k = sum_r mu_k,r d2f_r(a_k)
///
/// (Griewank and Walther, Evaluating Derivatives, 2008, chapter 5; for Runge-Kutta steps Hager, Runge-Kutta methods in
/// optimal control and the transformed adjoint system, 2000). What is zero by structure has no product: the time is
/// that of the nonzeros of f_a and C_k times the columns that they meet.
class ChainRule {
 public:
  /// `single`: an interval of one step, which begins with dx/dz = [I 0]. Else any of several, which begins with what
  /// the one before it has left.
  ChainRule(const RatesStructure& of, const ChainRulePlaces& places, bool single);

  using Products = std::span<const SparseProduct>;
  /// x_k and p_k of stage k, from the rates of the one before it.
  Products arguments(int k) const { return arguments_[k]; }
  Products next() const { return next_; }
  /// d x_{k+1} / dz, once the slopes of stage k are there; after the last stage d x_next / dz is.
  Products forward(int k) const { return forward_[k]; }
  /// The adjoints of stage k, from those of the one after it.
  Products adjoints(int k) const { return adjoints_[k]; }
  /// The weights at the start of the step, from those at its end.
  Products weights() const { return weights_; }
  /// What stage k adds to the Hessian, once its bends are there; from the last stage to the first.
  Products backward(int k) const { return backward_[k]; }

  /// Registers of d x_next / dz (n_x rows) and of the Hessian (n_z rows), row by row: `zero` where these are zero.
  const std::vector<std::uint32_t>& moved() const { return moved_; }
  const std::vector<std::uint32_t>& hessian() const { return hessian_; }
  /// Multiplications that one step takes, with and without a Hessian.
  long operations(bool with_hessian) const;

 private:
  /// A part of a row of a matrix.
  struct Part {
    std::uint32_t from;
    int column, count;
  };
  using Rows = std::vector<std::vector<Part>>;
  using Pattern = std::vector<std::vector<char>>;
  using List = std::vector<SparseProduct>;

  std::vector<Part> parts(const std::vector<char>& pattern, std::uint32_t first) const;
  Pattern pattern_of(const Rows& rows) const;
  Rows stage(int k, const Pattern& states) const;
  void add(List& to, std::uint32_t factor, const std::vector<Part>& row, std::uint32_t sum, int limit) const;
  void clear(List& to, const std::vector<char>& pattern, std::uint32_t sum, int limit) const;
  void plan_values();
  void plan_adjoints();
  void plan_forward();
  void plan_backward();
  Pattern closed() const;

  RatesStructure of_;
  ChainRulePlaces at_;
  bool single_;
  std::array<List, 4> arguments_, forward_, adjoints_, backward_;
  List next_, weights_;
  std::array<Pattern, 4> reached_;  ///< of d x_k / dz
  std::vector<std::uint32_t> moved_, hessian_;
};

}  // namespace rhec
