#pragma once

#include "rhec/core/qp/stage_qp.hpp"

namespace rhec {

/// How far a primal-dual iterate is from a first-order optimum: the same measure for every solver (docs/method.md,
/// section 7).
///
/// A soft limit's slack sigma is its violation. Stationarity in sigma: its multiplier is at most linear + quadratic
/// sigma, and equal to that where sigma is above zero.
///
/// Stationarity and complementarity are relative to 1 + the largest term of the Lagrangian's gradient (objective,
/// costates and bound multipliers), so that scaling the objective changes little. Defect and bound violation are
/// absolute, in the units of their variables.
struct RHEC_EXPORT KktResidual {
  double stationarity = 0.0;
  double defect = 0.0;           ///< max |F_i(s_i, w_i) - s_{i+1}|, the given initial state included
  double bound_violation = 0.0;  ///< of bounds and hard limits
  double complementarity = 0.0;  ///< max |multiplier| x distance from its bound or limit; of slacks too

  double largest() const noexcept;
};

/// The residual at the iterate that the QP was linearised at.
RHEC_EXPORT KktResidual kkt_residual(const StageQp& linearisation, const Iterate& iterate) noexcept;

/// The terms of a residual as largest absolute values, to process a long horizon piece by piece.
struct RHEC_EXPORT KktTerms {
  double stationarity = 0.0, defect = 0.0, bound_violation = 0.0, complementarity = 0.0;
  double largest_term = 0.0;  ///< of the Lagrangian's gradient

  /// Adds the stages of a range, for which the QP holds the linearisation at the iterate. If the range does not reach
  /// the end, the sizes of the stage behind it must be set.
  void add(const StageQp& linearisation, const Iterate& iterate, StageRange range) noexcept;
  void add(const KktTerms& others) noexcept;
  KktResidual residual() const noexcept;
};

/// Sets the costates that make the iterate stationary in all states, by one backward sweep; bound multipliers stay as
/// they are.
RHEC_EXPORT void set_costates(const StageQp& linearisation, Iterate& iterate) noexcept;

}  // namespace rhec
