#pragma once

#include <cstdint>
#include <vector>

#include <Eigen/Core>

namespace rhec::nlopt {

/// A condensed problem at one iterate, in steps d from there:
///
///     minimise g'd + 1/2 d'Hd  subject to  lower <= d <= upper,  row_lower <= J d <= row_upper
///
/// Multipliers and active sets are counted through: first the bounds of d, then the rows. They are positive at upper
/// bounds, negative at lower ones.
struct CondensedQp {
  const Eigen::VectorXd& gradient;
  const Eigen::MatrixXd& jacobian;
  Eigen::VectorXd lower, upper;  ///< of d, then of J d
  Eigen::Index variables() const noexcept { return gradient.size(); }
  Eigen::Index bounds() const noexcept { return lower.size(); }
};

/// Multipliers that NLopt does not tell: those of bounds no further away than `distance` that leave the least gradient
/// of the Lagrangian, each with the sign that its bound demands (Lawson and Hanson's nonnegative least squares).
/// Gradients are compared divided by `scale`.
Eigen::VectorXd recover_multipliers(const CondensedQp& qp, const Eigen::VectorXd& scale, double distance);

/// The step to the minimiser by a primal-dual active-set method that begins with the bounds that have a multiplier.
/// False, with nothing written, where the set does not settle or the curvature on it is not positive.
bool solve_active_set(const CondensedQp& qp, const Eigen::MatrixXd& hessian, Eigen::VectorXd& step,
                      Eigen::VectorXd& multipliers);

}  // namespace rhec::nlopt
