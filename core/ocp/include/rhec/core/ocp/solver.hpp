#pragma once

#include <memory>
#include <span>
#include <string>

#include "rhec/core/base/clock.hpp"
#include "rhec/core/ocp/ocp.hpp"
#include "rhec/core/qp/kkt.hpp"

namespace rhec {

enum class Status {
  solved,           ///< KKT residual within the tolerance
  step_taken,       ///< the one requested real-time iteration was done
  relaxed,          ///< no point was found that keeps hard limits: this one violates them least (real-time iterations,
                    ///< and controllers)
  iteration_limit,  ///< stopped at max_iterations; the best iterate is returned
  deadline,         ///< stopped at the deadline; the best iterate so far is returned
  infeasible,       ///< no point satisfies the constraints, as far as the method can tell
  stalled,          ///< no further progress is possible, above the tolerance
  bad_input         ///< a number in the problem or the guess is not finite; nothing was changed
};
RHEC_EXPORT const char* name_of(Status status) noexcept;
/// One sentence on what the user can do about a status.
RHEC_EXPORT const char* advice_for(Status status) noexcept;
/// True if the returned iterate is the best found and may be used for control: all but infeasible and bad_input.
RHEC_EXPORT bool is_usable(Status status) noexcept;

struct Report {
  Status status = Status::bad_input;
  int iterations = 0;           ///< of the nonlinear solver
  int factorisations = 0;       ///< of the linear systems below it
  bool fallback_used = false;   ///< a robust method had to replace the fast one
  double objective = 0.0;       ///< at the returned iterate, with the costs of slacks
  KktResidual kkt;              ///< of the returned iterate, measured by the core
  double preparation_us = 0.0;  ///< time in prepare, and in finish before it [us]; set by TimedSolver
  double feedback_us = 0.0;     ///< time in solve, or in feedback [us]; set by TimedSolver
};

/// The KKT residual of an Ocp at an iterate. `qp` is workspace and afterwards holds the Gauss-Newton linearisation at
/// the iterate.
RHEC_EXPORT KktResidual kkt_residual(const Ocp& ocp, const Iterate& iterate, StageQp& qp,
                                     std::span<double> scratch) noexcept;

/// Writes the objective and the KKT residual of an iterate that a solver returns. `qp` and `scratch` (of the Ocp's
/// `scratch_size()`) are workspace; a `qp` with a window of two stages is enough.
RHEC_EXPORT void assess(const Ocp& ocp, const Iterate& iterate, StageQp& qp, std::span<double> scratch,
                        Report& report) noexcept;

/// Solves an OCP from an initial guess. One caller at a time per instance; instances are independent.
///
/// `setup` binds a problem. From then on each call solves the problem as it is then: its data, and its structure within
/// its capacity, may change from sample to sample. The problem must outlive its use by the solver.
///
/// Per sample: optionally `prepare` (before the newest data arrive), then `solve` from the same guess. Both are
/// noexcept and never leave a number that is not finite in the iterate. A real-time solver (gn_rti) does not allocate
/// after `setup`; a solver whose backend does says so in its manifest.
class RHEC_EXPORT Solver {
 public:
  virtual ~Solver() = default;

  /// Why this solver cannot take this problem; empty if it can.
  virtual std::string why_not(const Ocp& ocp) const = 0;

  /// Binds a problem and allocates for its capacity. Throws Error if `why_not` gives a reason. Can be called again with
  /// another problem.
  virtual void setup(const Ocp& ocp) = 0;

  /// Does the work that needs the guess and the structure, but not the newest data.
  virtual void prepare(const Iterate& guess) noexcept = 0;

  /// Improves an iterate in place; leaves it unchanged on failure. Stops at `deadline` with the best iterate so far.
  virtual Report solve(Iterate& iterate, Clock::time_point deadline) noexcept = 0;
  Report solve(Iterate& iterate) noexcept { return solve(iterate, Clock::time_point::max()); }

  /// `solve` in two parts, for robots that wait for the result: `feedback` returns as soon as the new iterate is known,
  /// and its report may lack the objective and the KKT residual; `finish`, called next with the same iterate, adds
  /// them. If the iterate turns out not to be finite there, it is restored, and the status says so. By default
  /// `feedback` does everything.
  virtual Report feedback(Iterate& iterate, Clock::time_point deadline) noexcept { return solve(iterate, deadline); }
  virtual void finish(Iterate& /*iterate*/, Report& /*report*/) noexcept {}

  /// Marginal covariances of the stage states of some nodes, from the Hessian at an iterate with all bounds ignored,
  /// for an objective that is twice a negative log-likelihood (as RheProblem's is): column-major n_s x n_s blocks, with
  /// the capacity's n_s, one per node. Returns false and writes nothing if the solver has no such factorisation or the
  /// Hessian is singular.
  virtual bool covariances(const Iterate& iterate, StageRange nodes, std::span<double> blocks) noexcept;

  /// Clears all memory of earlier solves; the next solve gives the same bits as that of a new instance.
  virtual void reset() noexcept = 0;
};

}  // namespace rhec
