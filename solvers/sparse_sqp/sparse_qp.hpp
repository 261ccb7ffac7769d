#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "kkt_factor.hpp"
#include "limit_rows.hpp"
#include "rhec/core/ocp/solver.hpp"

namespace rhec::sparse_sqp {

/// Solves the QPs of an SQP method (docs/method.md, section 7),
///
///     minimise 1/2 d'H d + g'd   subject to   J d + c = 0,   lower <= d <= upper,
///
/// where lower <= 0 <= upper, so the bounds alone are always feasible, and some rows of J d + c may have limits instead
/// of an equation (LimitRows):
///
/// 1. A primal-dual active-set method corrects the caller's guess of the active set for some rounds; near the solution
///    of the nonlinear program that takes one factorisation. If all that remains is to release many bounds one after
///    another, the feasible step found so far is returned: the NLP converges faster with it than by solving this QP.
/// 2. Otherwise a primal-dual interior-point method [8] finds the active set, which is then polished to the exact
///    solution.
/// 3. If no step satisfies the equations and limits, they are relaxed by an l1 penalty, penalty * |J d + c|_1 (Sl1QP
///    [15]). Its slacks, as those of soft limits, change only the lower right diagonal of the same matrix.
///
/// The Hessian may be indefinite as long as the reduced Hessian is positive definite on the active sets tried.
class SparseQp {
 public:
  enum class Outcome {
    solved,
    feasible,    ///< satisfies equations and bounds; not optimal, since many active bounds still have to be released
    relaxed,     ///< solved with relaxed equations
    indefinite,  ///< the reduced Hessian is not positive definite: convexify and solve again
    failed,      ///< no usable step was found
    deadline
  };
  struct Data {
    const double *hessian, *jacobian, *gradient, *constraints, *lower, *upper;
    bool is_convex;  ///< the Hessian is known to be positive semidefinite
    LimitRows::Data limits = {};
  };
  /// Throws std::bad_alloc.
  void take_structure(const SparseNlp& nlp);
  void forget() noexcept;

  /// On entry `bound_multipliers`, and `multipliers` of limits, are the guess of the active set; on exit `step` (n),
  /// `multipliers` (m) and `bound_multipliers` (n, both with the signs of Iterate's) are the solution.
  Outcome solve(const Data& qp, double* step, double* multipliers, double* bound_multipliers,
                Clock::time_point deadline);
  /// As `solve`, with the equations and hard limits relaxed from the start.
  Outcome solve_relaxed(const Data& qp, double penalty, double* step, double* multipliers, double* bound_multipliers,
                        Clock::time_point deadline);

  /// Second-order correction: the shortest step, in the metric of the last QP's Hessian and on its active set, that
  /// satisfies J d + c = 0, and active limits, for other constraint values c. False if the linear system cannot be
  /// solved accurately.
  bool correct(const Data& qp, const double* constraints, double* step);

  int factorisations() const noexcept { return factorisations_; }  ///< since construction
  bool used_interior_point() const noexcept { return used_interior_point_; }
  /// Flags of the variables fixed in the last factorisation.
  std::span<const std::uint8_t> fixed() const noexcept { return fixed_; }
  KktFactor& factor() noexcept { return factor_; }

 private:
  /// A slack s and its multiplier z in the interior-point method, s z -> 0. The slack is the distance of the step from
  /// a bound, that of a limit's value t from a side, or the positive or negative part of what a relaxed equation's or a
  /// soft limit's residual J d + c - t is.
  struct Pair {
    enum class Kind : std::uint8_t { lower, upper, least, most, excess, lack };
    Kind kind;
    int index;  ///< of the variable, or of the row
    double s, z;
    double quadratic = 0.0;  ///< weight of an excess or a lack
    double ds = 0.0, dz = 0.0, correction = 0.0;
    bool is_bound() const noexcept { return kind == Kind::lower || kind == Kind::upper; }
    bool is_side() const noexcept { return kind == Kind::least || kind == Kind::most; }
    double stiffness() const noexcept { return z + quadratic * s; }  ///< of an excess or a lack: per s
  };
  bool factor_with(const Data& qp);
  double solve_system();
  enum class ActiveSet { optimal, feasible, unknown, indefinite };
  void find_unmet(const Data& qp);
  double size_of_constraints(const Data& qp);
  bool meet_equations(const Data& qp);
  ActiveSet solve_active(const Data& qp, int rounds);
  Outcome interior_point(const Data& qp, double penalty, Clock::time_point deadline);
  void start_interior(const Data& qp, double penalty, double multiplier);
  void interior_direction(const Data& qp, double target);
  double interior_length(double share) const noexcept;
  void finish_interior(const Data& qp, bool relaxed);
  double add_pairs_to_residuals(const Data& qp) noexcept;
  void write_interior_matrix(const Data& qp);
  void guess_active(const Data& qp, const double* bound_multipliers, const double* multipliers);
  void multiply_hessian(const Data& qp, const double* x, double* y) const noexcept;
  void multiply_jacobian(const Data& qp, const double* x, double* y) const noexcept;
  void add_jacobian_transposed(const Data& qp, const double* y, double* x) const noexcept;

  KktFactor factor_;
  const SparseNlp* nlp_ = nullptr;
  int n_ = 0, m_ = 0, factorisations_ = 0;
  static constexpr double first_regularisation = 2e-12, largest_regularisation = 1e-5, least_regularisation = 1e-15;
  double regularisation_ = first_regularisation;  ///< initial value; reduced if refinement fails
  KktFactor::Numbers numbers_;                    ///< of the current factor
  bool used_interior_point_ = false;
  bool factor_is_final_ = false;     ///< the factor belongs to the solution's active set
  std::vector<std::int8_t> active_;  ///< -1 at the lower bound, +1 at the upper, 2 fixed by both, 0 free
  std::vector<std::uint8_t> fixed_;  ///< flags of the active ones
  LimitRows limit_rows_;
  std::vector<std::uint8_t> off_;        ///< flags of the rows that are no equations now
  std::vector<double> d_, lambda_, mu_;  ///< the solution: step, multipliers, bound multipliers
  std::vector<Pair> pairs_, best_pairs_;
  std::vector<double> best_d_, best_lambda_, best_dual_residual_;  ///< with `best_pairs_`: the best interior iterate
  // Of limits in the interior-point method: their value t, its step, and the sum of z / s of their sides.
  std::vector<double> values_, value_steps_, side_stiffness_;
  std::vector<double> best_values_;
  std::vector<double> primal_, dual_, rhs_, solution_, other_solution_, dual_residual_, primal_residual_, work_n_,
      work_m_;
};

}  // namespace rhec::sparse_sqp
