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
  step_taken,       ///< the one real-time iteration asked for was done
  iteration_limit,  ///< stopped at max_iterations; the best iterate is returned
  deadline,         ///< stopped at the deadline; the best iterate so far is returned
  infeasible,       ///< no point satisfies the constraints, as far as the method can tell
  stalled,          ///< no further progress is possible above the tolerance
  bad_input         ///< a number in the problem or the guess is not finite; nothing was changed
};
RHEC_EXPORT const char* name_of(Status status) noexcept;
/// One sentence on what to do about it.
RHEC_EXPORT const char* advice_for(Status status) noexcept;
/// True where the returned iterate is the best found and may be used for control: all but infeasible and bad_input.
RHEC_EXPORT bool is_usable(Status status) noexcept;

struct Report {
  Status status = Status::bad_input;
  int iterations = 0;           ///< of the nonlinear method
  int factorisations = 0;       ///< of the linear algebra below it
  bool fallback_used = false;   ///< a robust path had to take over from the fast one
  double objective = 0.0;       ///< at the returned iterate
  KktResidual kkt;              ///< the core's own measure of the returned iterate
  double preparation_us = 0.0;  ///< time spent in prepare, and before it in finish [us]; for TimedSolver to say
  double feedback_us = 0.0;     ///< time spent in solve, or in feedback [us]; for TimedSolver to say
};

/// The KKT residual of an Ocp at an iterate. `qp` is used as workspace: it holds the Gauss-Newton linearisation at the
/// iterate afterwards.
RHEC_EXPORT KktResidual kkt_residual(const Ocp& ocp, const Iterate& iterate, StageQp& qp,
                                     std::span<double> scratch) noexcept;

/// Writes what the core says of an iterate that a solver returns: its objective and its KKT residual. `qp` and
/// `scratch` (of the Ocp's `scratch_size()`) are workspace; of the former a window of two stages will do.
RHEC_EXPORT void assess(const Ocp& ocp, const Iterate& iterate, StageQp& qp, std::span<double> scratch,
                        Report& report) noexcept;

/// Solves an OCP from a guess. One instance serves one caller at a time; two instances never disturb each other.
///
/// `setup` takes on a problem. From then on the solver solves that problem as it is at each call: its data, and its
/// structure within its capacity, may change from sample to sample. The problem must outlive the solver's use of it.
///
/// Per sample: optionally `prepare` (what can be done before the newest data arrive), then `solve` from the same guess.
/// Both are noexcept and never leave a number that is not finite in the iterate. A solver for real time (gn_rti) does
/// not allocate after `setup`; one whose backend does says so in its manifest.
class RHEC_EXPORT Solver {
 public:
  virtual ~Solver() = default;

  /// Why this solver cannot take this problem; empty: it can.
  virtual std::string why_not(const Ocp& ocp) const = 0;

  /// Takes on a problem and sets memory aside for its capacity. Throws Error where `why_not` has a reason. Can be
  /// called again, with another problem.
  virtual void setup(const Ocp& ocp) = 0;

  /// Work that needs the guess and the structure, but not the newest data.
  virtual void prepare(const Iterate& guess) noexcept = 0;

  /// Improves an iterate in place; on failure it is left as it was. Stops at `deadline` with the best iterate so far.
  virtual Report solve(Iterate& iterate, Clock::time_point deadline) noexcept = 0;
  Report solve(Iterate& iterate) noexcept { return solve(iterate, Clock::time_point::max()); }

  /// `solve` in two parts, for a robot that waits: `feedback` returns as soon as the new iterate is known, with a
  /// report that need not have an objective and a KKT residual yet; `finish`, to be called next with the same iterate,
  /// writes them. Should the iterate turn out not to be finite there, it becomes what it was, and the status says so.
  /// As it is, `feedback` does it all.
  virtual Report feedback(Iterate& iterate, Clock::time_point deadline) noexcept { return solve(iterate, deadline); }
  virtual void finish(Iterate& /*iterate*/, Report& /*report*/) noexcept {}

  /// Marginal covariances of the stage states of some nodes at an iterate, from the Hessian there with all bounds
  /// ignored, when the objective is twice a negative log-likelihood (as RheProblem's is): column-major n_s x n_s blocks
  /// of the capacity's n_s, one a node. False, with nothing written, where the solver has no such factor or the Hessian
  /// has no inverse.
  virtual bool covariances(const Iterate& iterate, StageRange nodes, std::span<double> blocks) noexcept;

  /// Forgets all that was learnt; the next solve gives the same bits as one of a new instance.
  virtual void reset() noexcept = 0;
};

}  // namespace rhec
