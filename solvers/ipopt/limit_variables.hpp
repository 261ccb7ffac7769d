#pragma once

#include <vector>

#include "rhec/core/ocp/ocp.hpp"
#include "rhec/core/ocp/sparse_nlp.hpp"

namespace rhec::ipopt {

/// The variables that limits add to those of SparseNlp, behind them in z, so that a limit becomes an equation:
///
///     g(s, w) + sigma_lower - sigma_upper - t = 0,   lower <= t <= upper,   sigma >= 0
///
/// A soft limit has a slack sigma for each side that it has, which costs  linear sigma + 1/2 quadratic sigma^2. Without
/// a linear weight one slack of either sign serves both sides: bounds at zero would have no multipliers.
class LimitVariables {
 public:
  /// Takes over the limits of a problem as they are.
  void take(const Ocp& ocp, const SparseNlp& nlp);

  int count() const noexcept { return static_cast<int>(variables_.size()); }
  void bounds(double* lower, double* upper) const noexcept;
  /// The values that fit the values of limits in c, and multipliers of their bounds that fit those of c (null: not
  /// asked).
  void start(const double* c, const double* multipliers, double* values, double* bound_multipliers) const noexcept;

  double cost(const double* values) const noexcept;
  void gradient(const double* values, double* derivatives) const noexcept;
  /// Completes the values of limits in c to those of the equations.
  void add_to(const double* values, double* c) const noexcept;
  /// Each variable has one entry in the Jacobian, in the row of its limit.
  void jacobian_pattern(int first_variable, int* rows, int* columns) const noexcept;
  void jacobian(double* entries) const noexcept;
  /// And one in the Hessian, on the diagonal; zero for most.
  void hessian_pattern(int first_variable, int* rows, int* columns) const noexcept;
  void hessian(double* entries) const noexcept;

 private:
  enum class Kind {
    value,   ///< t
    lower,   ///< slack of the lower side
    upper,   ///< slack of the upper side
    either,  ///< slack of both
  };
  struct Variable {
    Kind kind;
    int row;              ///< in c
    double factor;        ///< in that row
    double lower, upper;  ///< of the variable; for slacks, `limit_*` are those of the limit
    double limit_lower, limit_upper, linear, quadratic;
  };
  std::vector<Variable> variables_;
};

}  // namespace rhec::ipopt
