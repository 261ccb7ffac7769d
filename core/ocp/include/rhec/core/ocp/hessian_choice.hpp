#pragma once

#include <span>
#include <vector>

#include "rhec/core/base/export.hpp"
#include "rhec/core/ocp/ocp.hpp"

namespace rhec {

/// Which Hessian the steps of a real-time iteration use where none is asked for: the one that Ocp prefers, unless
/// Gauss-Newton's does the same for less. What the exact one adds to a step d is measured where the step ended,
///
///     kappa = sum_i |d_i' (H_i - G_i) d_i| / sum_i d_i' G_i d_i
///
/// with H_i and G_i the exact Hessian of stage i and Gauss-Newton's: along d, the rate at which Gauss-Newton's method
/// converges (Diehl, Ferreau and Haverbeke, Efficient numerical methods for nonlinear MPC and moving horizon
/// estimation, 2009, section 4), so that a Gauss-Newton step leaves about kappa^2 of what the exact one gains. What
/// either costs is known from the counts of operations (Ocp::step_operations).
///
/// - Where the exact one adds fewer than `few_operations` to a step, or less than `modest_share` of it, it is taken: of
///   a vehicle of a few states that is some microseconds.
/// - Where it takes more than `high_cost` times as many as Gauss-Newton's, the latter is taken at once.
/// - In between the exact one is taken, until kappa was below `small_kappa` at `trial_steps` steps in a row.
///
/// While Gauss-Newton's is taken, one step of every `trial_steps` is looked at, and each whose KKT residual is larger
/// than it was before. Where kappa is not small there, the exact one is taken from then on, until `reset`.
class RHEC_EXPORT HessianChoice {
 public:
  static constexpr double few_operations = 20000.0, modest_share = 0.1, high_cost = 4.0, small_kappa = 0.1;
  static constexpr int trial_steps = 20;

  /// Allocates; the problem must outlive this object.
  void setup(const Ocp& ocp);
  void reset() noexcept;
  Hessian now() const noexcept { return now_; }
  /// Tells it of a step, from one iterate to another, which has costates and a KKT residual. Looks at it if that is
  /// due, for which both Hessians are evaluated.
  void step(const Iterate& before, const Iterate& after, double residual, std::span<double> scratch) noexcept;
  /// kappa of the last step that was looked at; negative: none was.
  double kappa() const noexcept { return kappa_; }

 private:
  double measure(const Iterate& before, const Iterate& after, std::span<double> scratch) noexcept;
  /// d_i' H_i d_i of the QP that was linearised last.
  double curvature(int stage, const Iterate& before, const Iterate& after) const noexcept;

  const Ocp* ocp_ = nullptr;
  StageQp qp_;
  std::vector<double> exact_;  ///< by stage
  Hessian first_ = Hessian::exact, now_ = Hessian::exact;
  bool is_open_ = false;
  int steps_ = 0;  ///< of the trial, or since one was looked at
  double kappa_ = -1.0;
  double largest_residual_ = 0.0;  ///< of the steps that were looked at
};

}  // namespace rhec
