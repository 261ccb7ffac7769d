#include "rhec/core/ocp/solver.hpp"

#include <algorithm>

#include "rhec/core/base/assertion.hpp"

namespace rhec {

const char* name_of(Status status) noexcept {
  switch (status) {
    case Status::solved:
      return "solved";
    case Status::step_taken:
      return "step_taken";
    case Status::relaxed:
      return "relaxed";
    case Status::iteration_limit:
      return "iteration_limit";
    case Status::deadline:
      return "deadline";
    case Status::infeasible:
      return "infeasible";
    case Status::stalled:
      return "stalled";
    case Status::bad_input:
      return "bad_input";
  }
  return "unknown";
}

const char* advice_for(Status status) noexcept {
  switch (status) {
    case Status::solved:
      return "Nothing to do.";
    case Status::step_taken:
      return "One real-time iteration was taken; use mode: converge where full accuracy is needed.";
    case Status::relaxed:
      return "Hard limits could not be kept around the last plan, and were violated least; soft ones or more room "
             "leave a choice.";
    case Status::iteration_limit:
      return "Raise max_iterations, give a better initial guess, or loosen the tolerance.";
    case Status::deadline:
      return "Shorten the horizon, block more, or allow more time; the best point so far was returned.";
    case Status::infeasible:
      return "Check the bounds against the initial state: no trajectory satisfies them all.";
    case Status::stalled:
      return "Check the scaling of weights and bounds; the tolerance may be below what rounding allows.";
    case Status::bad_input:
      return "Look for a NaN or an infinity in measurements, references, weights or the guess.";
  }
  return "";
}

bool is_usable(Status status) noexcept { return status != Status::infeasible && status != Status::bad_input; }

KktResidual kkt_residual(const Ocp& ocp, const Iterate& iterate, StageQp& qp, std::span<double> scratch) noexcept {
  RHEC_ASSERT(iterate.capacity() == ocp.capacity() && qp.capacity() == ocp.capacity(), "the OCP's capacity");
  RHEC_ASSERT(scratch.size() >= ocp.scratch_size(), "scratch of the OCP's `scratch_size()`");
  ocp.linearise(all_stages(ocp), iterate, Hessian::none, qp, scratch);
  return kkt_residual(qp, iterate);
}

void assess(const Ocp& ocp, const Iterate& iterate, StageQp& qp, std::span<double> scratch, Report& report) noexcept {
  RHEC_ASSERT(iterate.capacity() == ocp.capacity() && qp.capacity() == ocp.capacity(), "the OCP's capacity");
  RHEC_ASSERT(scratch.size() >= ocp.scratch_size(), "scratch of the OCP's `scratch_size()`");
  RHEC_ASSERT(qp.window() == 0 || qp.window() >= 2, "a window of at least two stages");
  const int N = ocp.intervals();
  if (qp.window() == 0) {
    report.objective = ocp.linearise(all_stages(ocp), iterate, Hessian::none, qp, scratch);
    report.objective += slack_costs(qp, all_stages(ocp));
    report.kkt = kkt_residual(qp, iterate);
    return;
  }
  report.objective = 0.0;
  KktTerms terms;
  for (StageRange piece{0, 0}; piece.first <= N; piece.first = piece.last + 1) {
    // The next stage is needed too, for its sizes.
    piece.last = piece.first + qp.window() > N ? N : piece.first + qp.window() - 2;
    qp.look_at(piece.first);
    report.objective += ocp.linearise(piece, iterate, Hessian::none, qp, scratch);
    report.objective += slack_costs(qp, piece);
    if (piece.last < N) qp.set_sizes(piece.last + 1, ocp.state_count(piece.last + 1), 0);
    terms.add(qp, iterate, piece);
  }
  report.kkt = terms.residual();
}

bool Solver::covariances(const Iterate&, StageRange, std::span<double>) noexcept { return false; }

}  // namespace rhec
