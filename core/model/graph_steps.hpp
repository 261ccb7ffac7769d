#pragma once

#include <algorithm>
#include <cstddef>

#include "rhec/core/formula/tape.hpp"
#include "rhec/core/model/model.hpp"

namespace rhec {

/// Rows of `columns` doubles become registers of eight lanes; lanes beyond `count` repeat the last row.
void load_columns(const double* rows, int columns, int count, double* registers) noexcept;

/// Several Runge-Kutta steps in each interval, for eight intervals at a time, with the sensitivities of the last state
/// to z = [x; p; u] (or [x; p; u; p_end]) and the Hessian of its weighted sum. With M_k = d x_k / dz, Z_k = [M_k; 0 I],
/// and a step's derivatives A_k by its state, B_k by the rest:
///
///     M_{k+1} = A_k M_k + [0 B_k],      lambda_k = A_k' lambda_{k+1},      H = sum_k Z_k' H_k(lambda_{k+1}) Z_k
///
/// The adjoints run backwards; the states and M_k that they need are computed anew for each k, so that memory does not
/// grow with the number of steps.
class GraphSteps {
 public:
  static constexpr int lanes = 8;
  /// Without parameters there is nothing that could run along an interval.
  static bool is_ramp(const Model::Intervals& request, int np) noexcept { return request.parameters_end && np > 0; }
  struct Parts {
    const Tape *values, *jacobians, *hessians;
    const TapeKernels* kernels;
    int nx, nu, np;
  };
  /// Number of doubles that it needs besides a tape's registers; the registers stand behind them.
  static constexpr std::size_t memory(int nx, int nz) {
    const auto x = static_cast<std::size_t>(nx), z = static_cast<std::size_t>(nz);
    return (3 * x + 2 * z + 2 * x * z + z * z + 1) * lanes;
  }

  GraphSteps(const Parts& parts, const Model::Intervals& request, double* memory) noexcept;
  /// The intervals [first, first + count), at most eight.
  void integrate(int first, int count) noexcept;

 private:
  void load(int first, int count) noexcept;
  void start() noexcept;
  void run(const Tape& tape, int step) noexcept;
  void take(int steps, bool with_jacobian) noexcept;
  void advance(const Tape& tape, bool with_jacobian) noexcept;
  void add_curvature(const Tape& tape) noexcept;
  void pull_multipliers(const Tape& tape) noexcept;
  void store_values(int first, int count) const noexcept;
  void store_hessians(int first, int count) const noexcept;

  /// out += the result `which` of a tape * values, lane by lane.
  void add_product(const Tape& tape, int which, const double* values, double* out) const noexcept;
  double* entry(double* matrix, int row, int column) const noexcept {
    return matrix + (static_cast<std::ptrdiff_t>(row) * nz_ + column) * lanes;
  }
  /// The column of a request for z's: [x; u; p; p_end] there.
  int column(int z) const noexcept {
    if (z < p_.nx || z >= p_.nx + p_.nu + p_.np) return z;
    return z < p_.nx + p_.np ? z + p_.nu : z - p_.np;
  }
  int jacobian_result(int row, int column) const noexcept { return p_.nx + row * nz_ + column; }
  int hessian_result(int row, int column) const noexcept { return p_.nx + p_.nx * nz_ + row * nz_ + column; }

  Parts p_;
  bool at_start_ = true;  ///< M is [I 0]
  const Model::Intervals& q_;
  bool ramp_;
  int nz_, count_ = 0;
  double *z_, *h_, *x_, *lambda_, *next_, *M_, *M_next_, *H_, *product_, *registers_;
};

}  // namespace rhec
