#pragma once

#include <cstdint>
#include <vector>

#include <Eigen/Core>

namespace rhec::nlopt {

/// The QP of a condensed problem at one iterate, in the step d from there:
///
///     minimise g'd + 1/2 d'Hd  subject to  lower <= d <= upper,  row_lower <= J d <= row_upper
///
/// Multipliers and active sets are indexed by bound: first the bounds of d, then the rows. Multipliers are positive at
/// upper bounds and negative at lower bounds.
struct CondensedQp {
  const Eigen::VectorXd& gradient;
  const Eigen::MatrixXd& jacobian;
  Eigen::VectorXd lower, upper;  ///< of d, then of J d
  Eigen::Index variables() const noexcept { return gradient.size(); }
  Eigen::Index bounds() const noexcept { return lower.size(); }
};

/// Recovers the multipliers, which NLopt does not return: those of the bounds within `distance` that minimise the norm
/// of the Lagrangian's gradient, each with the sign that its bound requires (Lawson and Hanson's nonnegative least
/// squares). The gradient is divided by `scale`.
Eigen::VectorXd recover_multipliers(const CondensedQp& qp, const Eigen::VectorXd& scale, double distance);

/// Computes the minimising step by a primal-dual active-set method [6], which starts with the bounds that have a
/// nonzero multiplier. Returns false and writes nothing if the active set does not settle or the reduced Hessian is not
/// positive definite.
bool solve_active_set(const CondensedQp& qp, const Eigen::MatrixXd& hessian, Eigen::VectorXd& step,
                      Eigen::VectorXd& multipliers);

}  // namespace rhec::nlopt
