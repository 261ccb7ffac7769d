#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "chain_rule.hpp"
#include "rhec/core/formula/tape.hpp"

namespace rhec {

/// The method of Radau IIA with three stages, of order 5, A- and L-stable, whose last stage is the next state (Hairer
/// and Wanner, Solving Ordinary Differential Equations II, section IV.5, table 5.6).
struct RadauMethod {
  static constexpr int stages = 3;
  std::array<double, 3> nodes;                   ///< c
  std::array<std::array<double, 3>, 3> inverse;  ///< of A
  std::array<double, 3> sums;                    ///< of the rows of the inverse

  RadauMethod();
};

/// Where the numbers of such a step and of its derivatives stand, as registers of eight lanes. Unknown q = 3 k + s
/// belongs to stage s of the state that is eliminated as number k. With a ramp, the parameters of stage s are
/// rest_s p + run_s p_end.
struct RadauPlaces {
  std::uint32_t zero, one;                                     ///< constants
  std::uint32_t inverse, minus_inverse, sums;                  ///< of the method: 9, 9, 3
  std::uint32_t h, minus_h, h_run, h_rest, run, rest;          ///< 1, 1, 3, 3, 3, 3
  std::uint32_t z, x, next, weights, next_weights;             ///< n_z, then n_x each
  std::uint32_t moves, base, tried, residual, pushed, newton;  ///< by unknown: X_s - x, ..., the Newton step
  std::uint32_t pulled, adjoints, sum;                         ///< by unknown, of the transposed system; one number
  std::array<std::uint32_t, 3> arguments, rates, slopes, stage_weights;
  std::uint32_t bends;
  std::uint32_t matrix, matrix_size;   ///< M, and its factors in the same places
  std::uint32_t pivots, minus_pivots;  ///< by unknown: +-1 / pivot
  std::uint32_t upper;                 ///< rows of -U / pivot, in the places of M
  std::uint32_t right, moved;          ///< by unknown: rows of n_z, of the sensitivities
  std::uint32_t moved_start;           ///< dx/dz at a step's start: n_x rows of n_z
  std::uint32_t bent, hessian;         ///< rows of n_z: n_a and n_z of them
  std::uint32_t count;
};

/// Steps of Radau IIA as sparse products, for eight intervals at a time. A step from x solves
///
///     sum_t (A^-1)_st (X_t - x) = h f(a_s),      a_s = [X_s; p_s; u],      s = 1 .. 3,
///
/// by Newton's method, with the matrix M = A^-1 (x) I - h diag(f_x(a_s)), and X_3 is the next state. Where it is
/// solved, the implicit function theorem gives the derivatives of what was computed: along the variables z of an
/// interval, with D_s = da_s/dz,
///
///     M dX/dz = (A^-1 1) (x) dx/dz + h f_{p,u}(a_s) d[p_s; u]/dz,
///
/// and with the adjoints mu of a weighted next state, M' mu = [0; 0; w],
///
///     d2(w'X_3)/dz2 = sum_s D_s' (sum_r h mu_sr d2f_r(a_s)) D_s,      dw'X_3/dx = sum_s (A^-1 1)_s mu_s,
///
/// since all but f is linear. M is factored without a search for pivots, in an order that keeps it sparse: what moves
/// nothing else, such as a position, comes first. The factors have what the matrices that they are made of fill.
class RadauPlan {
 public:
  /// `single`: an interval of one step, which begins with dx/dz = [I 0].
  RadauPlan(const RatesStructure& of, bool ramp, bool single);

  const RadauPlaces& places() const { return at_; }
  const RadauMethod& method() const { return method_; }
  bool has_ramp() const { return ramp_; }
  int nx() const { return of_.nx; }
  int np() const { return of_.np; }
  int nu() const { return of_.nu; }
  int na() const { return of_.na(); }
  int nz() const { return nz_; }
  int unknowns() const { return RadauMethod::stages * of_.nx; }
  /// The state to which unknown q belongs.
  int state_of(int q) const { return order_[static_cast<std::size_t>(q / RadauMethod::stages)]; }

  using Products = std::span<const SparseProduct>;
  /// a_s of the moves.
  Products arguments(int s) const { return arguments_[static_cast<std::size_t>(s)]; }
  /// h f - A^-1 (X - x), once the rates are there.
  Products residual() const { return residual_; }
  /// M, once the slopes are there.
  Products matrix() const { return matrix_; }
  /// What is eliminated with the pivot of unknown q, once its reciprocal is there.
  Products eliminate(int q) const { return eliminate_[static_cast<std::size_t>(q)]; }
  std::uint32_t diagonal(int q) const { return diagonal_[static_cast<std::size_t>(q)]; }
  /// M newton = residual.
  Products solve() const { return solve_; }
  /// x + X_3.
  Products next() const { return next_; }
  /// dX/dz, of the factored matrix, the slopes and dx/dz.
  Products sensitivities() const { return sensitivities_; }
  /// The adjoints of the weights, and the weights at the step's start.
  Products adjoints() const { return adjoints_; }
  /// What stage s adds to the Hessian, once its bends are there.
  Products curvature(int s) const { return curvature_[static_cast<std::size_t>(s)]; }

  /// Registers of d x_next / dz (n_x rows) and of the Hessian (n_z rows), row by row: `zero` where these are zero.
  const std::vector<std::uint32_t>& moved() const { return moved_; }
  const std::vector<std::uint32_t>& hessian() const { return hessian_; }
  /// Multiplications of a Newton iteration, of the sensitivities and of the Hessian.
  long iteration_operations() const;
  long sensitivity_operations() const { return count(sensitivities_); }
  long hessian_operations() const;

 private:
  using List = std::vector<SparseProduct>;
  using Pattern = std::vector<char>;
  /// A part of a row of a matrix.
  struct Part {
    std::uint32_t from;
    int column, count;
  };
  static long count(const List& list);
  void plan_order();
  void plan_fill();
  void plan_places();
  void plan_newton();
  void plan_factors();
  std::vector<Pattern> closed() const;
  void plan_sensitivities();
  void plan_adjoints();
  void plan_curvature();
  int unknown(int state, int s) const { return RadauMethod::stages * position_[static_cast<std::size_t>(state)] + s; }
  /// The place of an entry of M that is there.
  std::uint32_t entry(int q, int r) const { return at_.matrix + offset(q, r); }
  std::uint32_t offset(int q, int r) const;
  bool has(int q, int r) const { return fill_[static_cast<std::size_t>(q)][static_cast<std::size_t>(r)] != 0; }
  std::uint32_t row(std::uint32_t matrix, int r) const { return matrix + static_cast<std::uint32_t>(r * nz_); }
  std::size_t cell(int r, int c) const {
    return static_cast<std::size_t>(r) * static_cast<std::size_t>(nz_) + static_cast<std::size_t>(c);
  }
  static std::vector<Part> parts(const Pattern& pattern, std::uint32_t first);
  static void add(List& to, std::uint32_t factor, const std::vector<Part>& row, std::uint32_t sum, int limit);
  std::vector<Part> argument_row(int a, int s) const;

  RatesStructure of_;
  bool ramp_, single_;
  int nz_;
  RadauMethod method_;
  std::vector<int> order_, position_;  ///< of elimination: the states, and where each one comes
  std::vector<Pattern> fill_;
  std::vector<std::vector<std::uint32_t>> offsets_;
  RadauPlaces at_{};
  std::array<List, 3> arguments_, curvature_;
  List residual_, matrix_, solve_, next_, sensitivities_, adjoints_;
  std::vector<List> eliminate_;
  std::vector<std::uint32_t> diagonal_;
  std::vector<Pattern> reached_;  ///< of dX/dz, by unknown
  std::vector<std::uint32_t> moved_, hessian_;
};

}  // namespace rhec
