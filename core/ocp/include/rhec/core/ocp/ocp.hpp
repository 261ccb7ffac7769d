#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <span>

#include "rhec/core/base/export.hpp"
#include "rhec/core/qp/iterate.hpp"
#include "rhec/core/qp/stage_qp.hpp"

namespace rhec {

class Linearisation;

/// The Hessian of a linearisation.
enum class Hessian {
  none,          ///< H is not needed, and may be left as it is
  gauss_newton,  ///< of the squared residuals only (Gauss-Newton); positive semidefinite
  exact          ///< of the Lagrangian, with the iterate's costates; may be indefinite
};

/// An optimisation problem over a horizon, stage by stage, independent of any solver (docs/method.md, sections 4 and
/// 7):
///
///     minimise    sum_{i=0}^{N} l_i(s_i, w_i)  +  sum over soft limits  linear sigma + 1/2 quadratic sigma^2
///     subject to  s_{i+1} = F_i(s_i, w_i),   bounds on every s_i and w_i,   s_0 given or free
///                 lower_i - sigma_i <= g_i(s_i, w_i) <= upper_i + sigma_i,   sigma_i >= 0
///
/// The rows of g are the limits of a stage. A hard one has no slack sigma; its linear weight is infinite.
///
/// A stage state s_i holds the vehicle's state and the values of the lifted (blocked) variables; a stage control w_i
/// holds the inputs and the values of the blocks that start there. So unblocked, blocked and full-horizon structures
/// all have this form. Evaluation is const, thread-safe and allocation-free; the caller provides `scratch` of
/// `scratch_size()` doubles.
class RHEC_EXPORT Ocp {
 public:
  virtual ~Ocp() = default;

  virtual Capacity capacity() const noexcept = 0;
  virtual int intervals() const noexcept = 0;
  virtual int state_count(int node) const noexcept = 0;
  virtual int control_count(int interval) const noexcept = 0;
  /// The given initial stage state, or null if it is free.
  virtual const double* initial_state() const noexcept = 0;
  virtual const double* state_lower(int node) const noexcept = 0;
  virtual const double* state_upper(int node) const noexcept = 0;
  virtual const double* control_lower(int interval) const noexcept = 0;
  virtual const double* control_upper(int interval) const noexcept = 0;
  /// The number of limits of a stage; none by default. All that follows is asked only of stages that have some, and
  /// rows have capacity().limit_row() entries.
  virtual int limit_count(int /*stage*/) const noexcept { return 0; }
  virtual const double* limit_lower(int /*stage*/) const noexcept { return nullptr; }
  virtual const double* limit_upper(int /*stage*/) const noexcept { return nullptr; }
  /// Weights of the slack: both at least zero, the linear one infinite for a hard limit, one of them above zero.
  virtual const double* limit_linear(int /*stage*/) const noexcept { return nullptr; }
  virtual const double* limit_quadratic(int /*stage*/) const noexcept { return nullptr; }
  /// g_i of all stages at an iterate, one row per stage.
  virtual void evaluate_limits(const Iterate& /*iterate*/, double* /*values*/,
                               std::span<double> /*scratch*/) const noexcept {}
  virtual bool has_second_derivatives() const noexcept = 0;
  /// Whether the cost is a sum of squares with small residuals at the solution, so that full Gauss-Newton steps
  /// converge. True for estimation, false for control, where a reference may be out of reach.
  virtual bool has_small_residuals() const noexcept { return false; }
  /// What a step over the longest horizon takes with either Hessian, in operations on eight numbers at a time; zeros
  /// where that is not known.
  struct StepOperations {
    double gauss_newton = 0.0, exact = 0.0;
  };
  virtual StepOperations step_operations() const noexcept { return {}; }
  /// The Hessian that QPs of this problem should use; HessianChoice looks at both.
  Hessian preferred_hessian() const noexcept {
    return has_second_derivatives() && !has_small_residuals() ? Hessian::exact : Hessian::gauss_newton;
  }
  /// Whether to find the states of an iterate by simulation with its controls from the given initial state. False if
  /// data determine the states of every node, as in estimation.
  virtual bool can_roll_out() const noexcept { return initial_state() != nullptr; }
  virtual std::size_t scratch_size() const noexcept = 0;

  /// Marks which derivatives of F_i can be non-zero at any iterate: entry [c * state_count(i + 1) + r] of `state_flags`
  /// for dF_r/ds_c, of `control_flags` for dF_r/dw_c. By default all can.
  virtual void mark_dynamics(int interval, std::uint8_t* state_flags, std::uint8_t* control_flags) const noexcept;
  /// The same for g: entry [c * limit_count(stage) + r] of `state_flags` for dg_r/ds_c, of `control_flags` for
  /// dg_r/dw_c.
  virtual void mark_limits(int stage, std::uint8_t* state_flags, std::uint8_t* control_flags) const noexcept;

  /// The sum of the l_i at an iterate, without slacks; `defects` (N rows of capacity().states, or null) gets F_i(s_i,
  /// w_i) - s_{i+1}, `stage_costs` (N + 1, or null) gets the l_i.
  virtual double evaluate_stages(const Iterate& iterate, double* defects, double* stage_costs,
                                 std::span<double> scratch) const noexcept = 0;
  double evaluate(const Iterate& iterate, double* defects, std::span<double> scratch) const noexcept {
    return evaluate_stages(iterate, defects, nullptr, scratch);
  }

  /// Overwrites the state of node `interval` + 1 by simulating one interval.
  virtual void simulate_interval(int interval, Iterate& iterate, std::span<double> scratch) const noexcept = 0;
  /// Overwrites the states of nodes 1 .. N by simulation from node 0 with the iterate's controls.
  void simulate(Iterate& iterate, std::span<double> scratch) const noexcept {
    for (int i = 0; i < intervals(); ++i) simulate_interval(i, iterate, scratch);
  }

  /// Writes the stages of a range of the QP at an iterate: sizes, dynamics, costs, bounds and limits. Returns the
  /// objective of these stages without slacks. The exact Hessian contains the limits' second derivatives, weighted with
  /// the iterate's multipliers; the Gauss-Newton one does not.
  virtual double linearise(StageRange range, const Iterate& iterate, Hessian hessian, StageQp& qp,
                           std::span<double> scratch) const noexcept = 0;

  /// Writes again what depends on data that may be new since `linearise` at the same iterate (measurements, references,
  /// the initial state, bounds, limits): h, the bounds, the limits and the initial step. AB, b and H stay. By default b
  /// and AB are evaluated anew.
  virtual void refresh(const Iterate& iterate, StageQp& qp, std::span<double> scratch) const noexcept {
    linearise({0, intervals()}, iterate, Hessian::none, qp, scratch);
  }

  /// Makes the linearisation cache with which a solver linearises this problem. Throws std::bad_alloc.
  virtual std::unique_ptr<Linearisation> make_linearisation() const;
};

/// The whole horizon of an Ocp.
inline StageRange all_stages(const Ocp& ocp) { return {0, ocp.intervals()}; }

/// Computes the states from the controls by simulation, from the iterate's first stage state. Controls are clipped to
/// their bounds first. The result has no defects.
RHEC_EXPORT void roll_out(const Ocp& ocp, Iterate& iterate, std::span<double> scratch) noexcept;

/// How the values g of a stage's limits, a row, meet them: what their slacks cost, and the sum by which hard ones are
/// violated.
struct LimitCosts {
  double slack = 0.0, violation = 0.0;
};
RHEC_EXPORT LimitCosts limit_costs(const Ocp& ocp, int stage, const double* values) noexcept;
/// The same of the stages of a linearisation, where it was made.
RHEC_EXPORT LimitCosts limit_costs(const StageQp& linearisation, StageRange range) noexcept;
/// Their slack costs alone.
RHEC_EXPORT double slack_costs(const StageQp& linearisation, StageRange range) noexcept;

}  // namespace rhec
