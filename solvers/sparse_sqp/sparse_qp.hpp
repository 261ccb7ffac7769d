#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "kkt_factor.hpp"
#include "rhec/core/ocp/solver.hpp"

namespace rhec::sparse_sqp {

/// Solves the QPs of an SQP method,
///
///     minimise 1/2 d'H d + g'd   subject to   J d + c = 0,   lower <= d <= upper,
///
/// where lower <= 0 <= upper, so that only the equations can make it infeasible:
///
/// 1. The active set that the caller guesses is tried and mended for some rounds (primal-dual active set method): near
///    the solution of the nonlinear program that is one factorisation. Where all that is left is to let go many bounds,
///    one after another, an NLP is better served by what there is, now, than by the best step much later.
/// 2. Otherwise a primal-dual interior-point method (Mehrotra 1992) finds the active set, which is then polished to the
///    exact solution.
/// 3. Where no step satisfies the equations, they are relaxed: minimise also penalty * |J d + c|_1 (Fletcher's
///    Sl1QP), whose slacks only change the lower right diagonal of the same matrix.
///
/// An indefinite Hessian is fine as long as the reduced one is positive definite on the active set that was guessed.
class SparseQp {
 public:
  enum class Outcome {
    solved,
    feasible,    ///< satisfies equations and bounds and is best but for bounds that should be let go: many, one after
                 ///< another
    relaxed,     ///< solved with relaxed equations
    indefinite,  ///< the Hessian is not positive definite where it would have to be: convexify it and ask again
    failed,      ///< nothing came out that could be used
    deadline
  };
  struct Data {
    const double *hessian, *jacobian, *gradient, *constraints, *lower, *upper;
    bool is_convex;  ///< the Hessian is known to be positive semidefinite
  };
  /// Throws std::bad_alloc.
  void take_structure(const SparseNlp& nlp);
  void forget() noexcept;

  /// `step` (n), `multipliers` (m) and `bound_multipliers` (n, signs as Iterate's) are the guess for the active set and
  /// get the solution.
  Outcome solve(const Data& qp, double* step, double* multipliers, double* bound_multipliers,
                Clock::time_point deadline);
  /// The same with equations relaxed from the start.
  Outcome solve_relaxed(const Data& qp, double penalty, double* step, double* multipliers, double* bound_multipliers,
                        Clock::time_point deadline);

  /// A step of least length, in the metric of the last QP's Hessian and on its active set, that takes J d + c to
  /// zero for other constraint values: the second-order correction.
  bool correct(const Data& qp, const double* constraints, double* step);

  int factorisations() const noexcept { return factorisations_; }  ///< so far
  bool used_interior_point() const noexcept { return used_interior_point_; }
  /// Flags of the variables that the last factor had fixed.
  std::span<const std::uint8_t> fixed() const noexcept { return fixed_; }
  KktFactor& factor() noexcept { return factor_; }

 private:
  /// A slack and its multiplier in the interior point, s z -> 0: the distance of a step from a bound, or what a relaxed
  /// equation exceeds or lacks.
  struct Pair {
    enum class Kind : std::uint8_t { lower, upper, excess, lack };
    Kind kind;
    int index;  ///< of the variable, or of the equation
    double s, z;
    double ds = 0.0, dz = 0.0, correction = 0.0;
    bool is_bound() const noexcept { return kind == Kind::lower || kind == Kind::upper; }
  };
  bool factor_with(const Data& qp);
  double solve_system();
  enum class ActiveSet { optimal, feasible, unknown, indefinite };
  bool meet_equations(const Data& qp);
  ActiveSet solve_active(const Data& qp, int rounds);
  Outcome interior_point(const Data& qp, double penalty, Clock::time_point deadline);
  void start_interior(const Data& qp, double penalty, double multiplier);
  void interior_direction(double target);
  double interior_length(double share) const noexcept;
  void finish_interior(const Data& qp, bool relaxed);
  void guess_active(const Data& qp, const double* bound_multipliers);
  void multiply_hessian(const Data& qp, const double* x, double* y) const noexcept;
  void multiply_jacobian(const Data& qp, const double* x, double* y) const noexcept;
  void add_jacobian_transposed(const Data& qp, const double* y, double* x) const noexcept;

  KktFactor factor_;
  const SparseNlp* nlp_ = nullptr;
  int n_ = 0, m_ = 0, factorisations_ = 0;
  static constexpr double first_regularisation = 2e-12, largest_regularisation = 1e-5, least_regularisation = 1e-15;
  double regularisation_ = first_regularisation;  ///< to begin with; smaller where that proved too large for refinement
  KktFactor::Numbers numbers_;                    ///< of the present factor
  bool used_interior_point_ = false;
  bool factor_is_final_ = false;         ///< the factor is that of the solution's active set
  std::vector<std::int8_t> active_;      ///< -1 at the lower bound, +1 at the upper, 2 fixed by both, 0 free
  std::vector<std::uint8_t> fixed_;      ///< flags of the active ones
  std::vector<double> d_, lambda_, mu_;  ///< the solution: step, multipliers, bound multipliers
  std::vector<Pair> pairs_, best_pairs_;
  std::vector<double> best_d_, best_lambda_, best_dual_residual_;  ///< with `best_pairs_`: the interior point's best
  std::vector<double> primal_, dual_, rhs_, solution_, other_solution_, dual_residual_, primal_residual_, work_n_,
      work_m_;
};

}  // namespace rhec::sparse_sqp
