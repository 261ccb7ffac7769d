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
/// a linear weight it has none: there t is free, and its distance from the sides costs as much. That has a continuous
/// gradient, and an interior point would keep away from bounds whose multipliers are zero.
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
  void hessian(const double* values, double* entries) const noexcept;

 private:
  enum class Kind {
    value,  ///< t
    lower,  ///< slack of the lower side
    upper,  ///< slack of the upper side
    free,   ///< t that may be anywhere
  };
  struct Variable {
    Kind kind;
    int row;                   ///< in c
    double factor;             ///< in that row
    double lower, upper;       ///< bounds of the variable
    double beyond[2];          ///< sides of the limit, beyond which it is soft; none if it is hard
    double linear, quadratic;  ///< weights of the slack
    double slack(double value) const noexcept;
  };
  std::vector<Variable> variables_;
};

}  // namespace rhec::ipopt
